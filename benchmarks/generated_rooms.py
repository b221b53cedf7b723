"""The generated rooms of the experiments: seeds for tuning and for reporting, made once and kept as artifacts.

A room's name, `<recipe>-<seed>`, is the seed of its trials.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks.reporting_seeds import newest, read_sets
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
INDEPENDENT_RECIPES = ("household", "lodging")
"""Outside of the recipes that maps and CAD were tuned on; `plan` was tuned on households, and one lodging was looked at
when models came to be stretched."""
TUNING_INDEPENDENT = ("household-2000", "lodging-2000")
ROOMS = "rooms"
"""Group of the reporting seeds (reporting_seeds.toml)."""


def recipe_of(name: str) -> str:
    """Return the recipe of a room's name."""
    return name.rsplit("-", 1)[0]


REPORTING = tuple(name for name in newest(ROOMS).seeds if recipe_of(name) in RECIPES)
"""For figures alone (seeds of the recipes' reporting range): the newest set."""
INDEPENDENT = tuple(name for name in newest(ROOMS).seeds if recipe_of(name) in INDEPENDENT_RECIPES)
"""Its rooms by other recipes than those of tuning."""
FIRST_REPORTING = read_sets()[0].seeds
"""The rooms of the first figures, which have been seen: the network's are of them."""
DRAWS = 2
"""Draws of the errors of masks and poses in every room."""
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


def with_draws(rooms: Sequence[str], draws: int = DRAWS) -> tuple[str, ...]:
    """Return the seeds of trials that draw errors: `<room>+<draw>`, all rooms of the first draw before the second."""
    return tuple(f"{room}+{draw}" for draw in range(draws) for room in rooms)


def room_of(seed: str) -> str:
    """Return the room of a trial's seed."""
    return seed.split("+")[0]


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
