"""The generated rooms of the experiments: seeds for tuning and for reporting, made once and kept as artifacts.

A room's name, `<recipe>-<seed>`, is the seed of its trials.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from benchmarks.steps import made

TUNING = (
    *(f"kitchen-{seed}" for seed in (40, 41, 42)),
    *(f"office-{seed}" for seed in (40, 41, 42)),
    *(f"bedroom-{seed}" for seed in (40, 41)),
    *(f"room-{seed}" for seed in (40, 41)),
)
"""Looked at while methods and constants were chosen (seeds of the recipes' tuning range)."""
RECIPES = ("kitchen", "office", "bedroom", "room")
TUNING_UNTRAINED = tuple(f"{recipe}-{seed}" for seed in (2000, 2001) for recipe in RECIPES)
"""Looked at as well, where the masks of our own network matter: it was trained on rooms of the seeds of TUNING."""
REPORTING = tuple(f"{recipe}-{seed}" for seed in range(1000, 1005) for recipe in RECIPES)
"""For figures alone (seeds of the recipes' reporting range)."""
CLUTTER = "high"
LIBRARY_SEED = 1
STEPS = ("library build", "synthesize", "ingest")
"""What makes a room."""


@dataclass(frozen=True)
class RoomFolder:
    """Artifacts of one room: `ground_truth` and the `sequence` made of its log."""

    name: str
    folder: Path

    @property
    def ground_truth(self) -> Path:
        """Artifact of kind ground_truth."""
        return self.folder / "ground_truth"

    @property
    def sequence(self) -> Path:
        """Artifact of kind sequence."""
        return self.folder / "sequence"


def make_library(root: Path) -> Path:
    """Make the library that the rooms are furnished from, unless it is up to date."""
    return made("library build", root / "cad_library", "--seed", LIBRARY_SEED)


def room_at(root: Path, name: str, frames: int) -> RoomFolder:
    """Return where a room stands, made or not."""
    return RoomFolder(name, root / f"{name}-{frames}")


def make_room(
    root: Path, name: str, frames: int, *, size: tuple[int, int] = (640, 480), clutter: str = CLUTTER, opened: int = 0
) -> RoomFolder:
    """Make a room of this name under `root` unless it is up to date; size (width, height) [px]; up to so many doors and
    drawers are `opened` or shut half-way. Raises StepFailed."""
    library, room = make_library(root), room_at(root, name, frames)
    recipe, seed = name.rsplit("-", 1)
    options = ("--recipe", recipe, "--seed", seed, "--clutter", clutter, "--frames", frames, "--opened", opened)
    made("synthesize", room.ground_truth, "--library", library, *options, "--width", size[0], "--height", size[1])
    made("ingest", room.sequence, "--log", room.ground_truth / "log.mcap")
    return room
