"""The generated rooms of the experiments, made once and kept as artifacts.

A room's name, `<recipe>-<seed>`, is the seed of its trials.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path

from benchmarks.steps import made

RECIPES = ("kitchen", "office", "bedroom", "room")


def recipe_of(name: str) -> str:
    """Return the recipe of a room's name."""
    return name.rsplit("-", 1)[0]


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


def error_seed(seed: str) -> int:
    """Return the number that the errors of a trial are drawn with: another one for every recipe, seed and draw."""
    return int.from_bytes(hashlib.blake2b(seed.encode(), digest_size=4).digest(), "big")


def make_library(root: Path) -> Path:
    """Make the library that the rooms are furnished from, unless it is up to date."""
    return made("library build", root / "cad_library", "--seed", LIBRARY_SEED)


def room_at(root: Path, name: str, frames: int) -> RoomFolder:
    """Return where a room stands, made or not."""
    return RoomFolder(name, root / f"{name}-{frames}")


def make_room(
    root: Path,
    name: str,
    frames: int,
    *,
    size: tuple[int, int] = (640, 480),
    clutter: str = CLUTTER,
    opened: int = 0,
    cameras: int = 1,
    path: str = "tour",
    rounds: int = 1,
    rearranged: int = 0,
    rescaled: float = 0.0,
) -> RoomFolder:
    """Make a room of this name under `root` unless it is up to date; size (width, height) [px]; up to so many doors and
    drawers are `opened` or shut half-way; frames are of so many `cameras` in turn, along so many rounds of a `path`;
    which other draw of what lies about (`rearranged`); by what share things are larger or smaller than their models
    (`rescaled`). Raises StepFailed."""
    library, room = make_library(root), room_at(root, name, frames)
    recipe, seed = recipe_of(name), name.rsplit("-", 1)[1]
    options = ("--recipe", recipe, "--seed", seed, "--clutter", clutter, "--frames", frames, "--opened", opened)
    drawn = ("--rearranged", rearranged, "--rescaled", rescaled)
    camera = ("--width", size[0], "--height", size[1], "--cameras", cameras, "--path", path, "--rounds", rounds)
    made("synthesize", room.ground_truth, "--library", library, *options, *drawn, *camera)
    made(
        "ingest", room.sequence, "--log", room.ground_truth / "log.mcap", *(("--camera", "all") if cameras > 1 else ())
    )
    return room
