"""The samples that `scenewright train words` reads: libraries, rooms and two files; what is there is not made again.

python -m benchmarks.words.making --out FOLDER [--quick]
"""

from __future__ import annotations

from pathlib import Path

from pydantic import Field
from scenewright.stages.splat import lexicon
from scenewright.stages.splat.training.words.samples import TRAINING_FILE, VALIDATION_FILE, write_samples

from benchmarks.options import Recipe, asked
from benchmarks.words.gathering import gather
from benchmarks.words.rooms import LIBRARIES, ROOMS, VALIDATION, VALIDATION_LIBRARY, library, room

VIEWS = 3
VALIDATION_SEED = 7


class Options(Recipe):
    """Options."""

    seed: int = Field(0, description="Of the colours and sides of training models")


def make(path: Path, rooms: tuple[str, ...], libraries: tuple[int, ...], seed: int) -> None:
    """Write the file of samples unless it is there."""
    if not path.is_file():
        given = [room(path.parent, each) for each in rooms], [library(path.parent, each) for each in libraries]
        write_samples(path, gather(*given, lexicon(), VIEWS, seed))


def main() -> None:
    """Make both files."""
    options = asked(Options)
    rooms, libraries = ROOMS[: 2 if options.quick else None], LIBRARIES[: 1 if options.quick else None]
    make(options.out / TRAINING_FILE, rooms, libraries, options.seed)
    held_back = VALIDATION[: 1 if options.quick else None]
    make(options.out / VALIDATION_FILE, held_back, (VALIDATION_LIBRARY,), VALIDATION_SEED)


if __name__ == "__main__":
    main()
