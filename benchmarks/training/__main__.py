"""The frames that `scenewright train network` reads: generated and real ones; a part that is there is kept.

    python -m benchmarks.training --out FOLDER [--workers N] [--quick]

Writes FOLDER/data and, where the recordings are there, FOLDER/real.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from pydantic import Field

from benchmarks.options import Recipe, asked
from benchmarks.steps import made
from benchmarks.training.real_frames import PLACES

LIBRARY_SEED, LIBRARY_SHAPES = 41, 12
"""Seed and shapes of every class of the training's own library; other experiments use seeds 0 and 1."""
QUICK_SHAPES = 3


class Options(Recipe):
    """Options."""

    data: Path = Field(Path("../shared/data"), description="Folder with the recordings; without them no real frames")
    workers: int = Field(1, description="Processes that make frames")


def main() -> None:
    """Make what is missing."""
    arguments = asked(Options)
    out: Path = arguments.out
    shapes = QUICK_SHAPES if arguments.quick else LIBRARY_SHAPES
    numbers = ("--shapes-per-class", shapes, "--small-shapes-per-class", shapes)
    library = made("library build", out / "library", "--seed", LIBRARY_SEED, *numbers)
    if not (out / "data" / "done.json").is_file():
        quick = ["--quick"] if arguments.quick else []
        workers = str(arguments.workers)
        _module("data", "--out", str(out / "data"), "--library", str(library), "--workers", workers, *quick)
    if all((arguments.data / place).is_dir() for place in PLACES):
        _module("real_frames", "--out", str(out / "real"), "--data", str(arguments.data))


def _module(name: str, *arguments: str) -> None:
    subprocess.run([sys.executable, "-m", f"benchmarks.training.{name}", *arguments], check=True)


if __name__ == "__main__":
    main()
