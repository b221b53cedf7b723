"""The rooms and libraries that the embedded encoder is trained on: none of them is ever reported on.

Libraries of other seeds than the experiments' (other sizes and colours of the same families), rooms of the recipes'
tuning range. Validation rooms are furnished from the experiments' library, so that no model in them was trained on.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from scenewright.schemas.cad_library import CadLibrary
from scenewright.schemas.ground_truth import GroundTruth

from benchmarks.steps import made

RECIPES = ("kitchen", "office", "bedroom", "room", "household", "studio")
LIBRARIES = tuple(range(11, 17))
VALIDATION_LIBRARY = 1
SIZE = (320, 240)
FRAMES = 24
WITHOUT = ("studio-55", "studio-61", "studio-73", "studio-85")
"""For these seeds no room is found."""
SEEDS = 39
NAMES = tuple(f"{RECIPES[(k % SEEDS + 3 * (k // SEEDS)) % 6]}-{50 + k % SEEDS}" for k in range(2 * SEEDS))
"""Every seed with two recipes."""
ROOMS = tuple(name for name in NAMES if name not in WITHOUT)
VALIDATION = ("kitchen-90", "office-91", "room-92")
LIBRARY_OF_ROOM = {name: LIBRARIES[(k + k // 6) % len(LIBRARIES)] for k, name in enumerate(NAMES, SEEDS)}


@dataclass(frozen=True)
class Furnished:
    """A room with the library that it is furnished from."""

    truth: GroundTruth
    library: CadLibrary


def library(root: Path, seed: int) -> CadLibrary:
    """Make a library unless it is there."""
    return CadLibrary(made("library build", root / f"library-{seed}", "--seed", seed))


def room(root: Path, name: str) -> Furnished:
    """Make a room unless it is there."""
    models = library(root, LIBRARY_OF_ROOM.get(name, VALIDATION_LIBRARY))
    recipe, seed = name.rsplit("-", 1)
    options = ("--recipe", recipe, "--seed", seed, "--clutter", "high", "--frames", FRAMES)
    size = ("--width", SIZE[0], "--height", SIZE[1])
    return Furnished(GroundTruth(made("synthesize", root / name, "--library", models.root, *options, *size)), models)
