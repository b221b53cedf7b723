"""Train the embedded encoder of pictures and words; stop and start again at will.

    python -m benchmarks.words.train --out FOLDER [--quick] [--steps N] [--batch N] [--seed N] [--device cuda]

Libraries, rooms and the files of samples that are not in FOLDER/rooms yet are made first; with the files alone, nothing
else is needed. A step's samples depend on the seed and on the number of the step alone. The result is
`two_towers.safetensors`, the moving average of the weights, and what it does on rooms of another library, on held-out
combinations, styles and words: `figures.json`.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Literal

import torch
from pydantic import Field
from scenewright.stages.kit.open_words.embedded import EmbeddedEncoder

from benchmarks.options import Recipe, asked
from benchmarks.training.run import train
from benchmarks.words.figures import figures_of
from benchmarks.words.gathering import gather
from benchmarks.words.learning import FILE, Data, Plan, Run
from benchmarks.words.lexicon import lexicon
from benchmarks.words.rooms import LIBRARIES, ROOMS, VALIDATION, VALIDATION_LIBRARY, library, room
from benchmarks.words.samples import Samples, read_samples, write_samples

VIEWS = 3


def samples_of(folder: Path, name: str, rooms: tuple[str, ...], libraries: tuple[int, ...], seed: int) -> Samples:
    """Read the file of this name, which is made where it is missing."""
    path = folder / f"{name}.npz"
    if not path.is_file():
        given = [room(folder, each) for each in rooms], [library(folder, each) for each in libraries]
        write_samples(path, gather(*given, lexicon(), VIEWS, seed))
    return read_samples(path)


class Options(Recipe):
    """Options."""

    rooms: Path | None = Field(None, description="Where rooms and samples are kept; OUT/rooms if not given")
    steps: int = Field(10_000, description="Steps")
    batch: int = Field(1024, description="Crops a step")
    seed: int = Field(0, description="Seed")
    device: Literal["cpu", "cuda"] = Field("cpu", description="Where it is trained")
    save_every: float = Field(120.0, description="Seconds between states")


def main() -> None:
    """Make what is missing, train or go on with a training, and measure."""
    options = asked(Options)
    torch.set_num_threads(1)
    folder, words, quick = options.rooms or options.out / "rooms", lexicon(), options.quick
    rooms, libraries = ROOMS[: 2 if quick else None], LIBRARIES[: 1 if quick else None]
    samples = samples_of(folder, "training", rooms, libraries, options.seed)
    count = len(samples.frames) + len(samples.sprites)
    plan = Plan(4 if quick else options.steps, 32 if quick else options.batch, options.seed, count)
    data, run = Data(samples, words, options.seed, options.device), Run(plan, options.out, options.device)
    train(run, plan.steps, lambda: {"loss": run.train_step(data)}, options.save_every)
    validation = samples_of(folder, "validation", VALIDATION[: 1 if quick else None], (VALIDATION_LIBRARY,), 7)
    figures = figures_of(EmbeddedEncoder(options.out / FILE), validation, words)
    (options.out / "figures.json").write_text(json.dumps(figures, indent=1) + "\n")
    print(json.dumps(figures, indent=1))


if __name__ == "__main__":
    main()
