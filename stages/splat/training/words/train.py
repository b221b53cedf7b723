"""Train the embedded encoder of pictures and words; stop and start again at will.

    scenewright train words --samples FOLDER --out FOLDER [--quick] [--steps N] [--batch N] [--seed N] [--device cuda]

A step's samples depend on the seed and on the number of the step alone. The result is
`two_towers.safetensors`, the moving average of the weights, and what it does on rooms of another library, on held-out
combinations, styles and words: `figures.json`.
"""

from __future__ import annotations

import json
import logging
from pathlib import Path

import torch
from scenewright.stages.kit.open_words.embedded import EmbeddedEncoder
from scenewright.stages.kit.training.run import take_steps
from scenewright.stages.splat.training.words import WordsTraining
from scenewright.stages.splat.training.words.figures import figures_of
from scenewright.stages.splat.training.words.learning import FILE, Data, Plan, Run
from scenewright.stages.splat.training.words.lexicon import lexicon
from scenewright.stages.splat.training.words.samples import TRAINING_FILE, VALIDATION_FILE, read_samples

_LOGGER = logging.getLogger("scenewright")


def train(options: WordsTraining, out: Path) -> None:
    """Train or go on with a training, and measure. Raises BadInput where samples are missing."""
    torch.set_num_threads(1)
    words, quick = lexicon(), options.quick
    samples = read_samples(options.samples / TRAINING_FILE)
    plan = Plan(
        4 if quick else options.steps,
        32 if quick else options.batch,
        options.seed,
        len(samples.frames) + len(samples.sprites),
    )
    data, run = Data(samples, words, options.seed, options.device), Run(plan, out, options.device)
    take_steps(run, plan.steps, lambda: {"loss": run.train_step(data)}, options.save_every)
    figures = figures_of(EmbeddedEncoder(out / FILE), read_samples(options.samples / VALIDATION_FILE), words)
    (out / "figures.json").write_text(json.dumps(figures, indent=1) + "\n")
    for name, entry in figures.items():
        _LOGGER.info("%s: %s", name, entry)
