"""Train the embedded encoder of pictures and words; stop and start again at will.

    python -m benchmarks.words.train --out FOLDER [--quick] [--steps N] [--batch N] [--seed N]

Libraries and rooms that are not in FOLDER/rooms yet are made first. A step's samples depend on the seed and on the
number of the step alone. The result is `two_towers.safetensors`, the moving average of the weights, and what it does
on rooms of another library, on held-out combinations, styles and words: `figures.json`.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import torch
from pydantic import Field
from torch.nn import functional

from benchmarks.options import Recipe, asked
from benchmarks.training.run import TrainingRun, rate_at, train
from benchmarks.words.figures import figures_of
from benchmarks.words.lexicon import FALSE, TRUE, UNKNOWN, Lexicon, Phrase, lexicon, truth_of
from benchmarks.words.rooms import LIBRARIES, ROOMS, VALIDATION, VALIDATION_LIBRARY, library, room
from benchmarks.words.samples import Crop, RoomCrops, changed, composed, labels_of, rendered_models
from stages.kit.open_words.embedded import EmbeddedEncoder, save_towers
from stages.kit.open_words.relevancy import CANONICAL
from stages.kit.open_words.two_towers import TwoTowers, tokens, words_of

FILE = "two_towers.safetensors"
WEIGHT_DECAY, WARM_UP, PEAK = 0.02, 0.05, 2e-3
FURTHER_PHRASES = 96
"""Beside one phrase for each crop: of things that need not be in the batch."""
MODELS_SHARE = 0.35
VIEWS = 4


@dataclass(frozen=True)
class Plan:
    """What a run is."""

    steps: int
    batch: int
    seed: int
    rooms: int


class Data:
    """All that is trained on."""

    def __init__(self, folder: Path, plan: Plan, words: Lexicon) -> None:
        self.words = words
        self.rooms = RoomCrops([room(folder, name) for name in ROOMS[: plan.rooms]], words)
        libraries = [library(folder, seed) for seed in LIBRARIES[: 1 if plan.rooms < len(ROOMS) else None]]
        models = rendered_models(libraries, VIEWS, plan.seed)
        self.models = [(each, words.row(each.thing)) for each in models if not words.is_held_out(each.thing)]

    def batch(self, plan: Plan, step: int) -> tuple[list[Crop], list[Phrase], np.ndarray]:
        """Return crops, phrases, and what is true of which (N, M)."""
        random = np.random.default_rng([plan.seed, 1, step])
        crops = []
        for _ in range(plan.batch):
            if random.random() < MODELS_SHARE:
                model, row = self.models[int(random.integers(len(self.models)))]
                crop = composed(model, self.rooms.frames, row, random)
            else:
                crop = self.rooms.sample(random)
            crops.append(Crop(changed(crop.picture, random), crop.main, crop.others))
        rows = [crop.main for crop in crops]
        rows += [self.models[int(random.integers(len(self.models)))][1] for _ in range(FURTHER_PHRASES)]
        found = {phrase.text: phrase for phrase in (self.words.training_phrase(row, random) for row in rows)}
        phrases = list(found.values())
        others = [(k, row) for k, crop in enumerate(crops) for row in crop.others]
        truth = truth_of(np.stack(rows[: plan.batch]), phrases)
        if others:
            of_others = truth_of(np.stack([row for _, row in others]), phrases)
            truth = labels_of(crops, truth, of_others, np.array([k for k, _ in others]))
        return crops, phrases, truth


def loss_of(logits: torch.Tensor, truth: np.ndarray, count: int) -> torch.Tensor:
    """Return the cross entropy of what is known: of texts that are true or false of a crop and, on the last `count`
    columns, of canonical phrases, which fit anything half."""
    wanted = torch.full(logits.shape, 0.5)
    weights = torch.ones(logits.shape)
    known = torch.from_numpy(truth)
    wanted[:, :-count] = (known == TRUE).float()
    weights[:, :-count] = (known != UNKNOWN).float()
    # true pairs are rare: they count as much as the false ones
    rarity = ((known == FALSE).sum() / (known == TRUE).sum().clamp(min=1)).sqrt().clamp(1.0, 8.0)
    weights[:, :-count] *= torch.where(known == TRUE, rarity, torch.tensor(1.0))
    return 20.0 * (functional.binary_cross_entropy_with_logits(logits, wanted, reduction="none") * weights).mean()


class Run(TrainingRun):
    """A training run and its state on disk."""

    average_decay, gradient_norm = 0.995, 5.0

    def __init__(self, plan: Plan, out: Path) -> None:
        self.plan = plan
        torch.manual_seed(plan.seed)
        self.read: set[str] = {word for phrase in CANONICAL for word in words_of(phrase)}
        super().__init__(TwoTowers(), asdict(plan), out, PEAK, WEIGHT_DECAY)

    def train_step(self, data: Data) -> float:
        """Take one step and return its loss."""
        self.network.train()
        crops, phrases, truth = data.batch(self.plan, self.step)
        inputs = torch.from_numpy(np.stack([crop.picture for crop in crops])).permute(0, 3, 1, 2).float() / 255.0
        inputs = inputs.contiguous(memory_format=torch.channels_last)
        logits = self.network.logits(inputs, tokens([*(phrase.text for phrase in phrases), *CANONICAL]))
        loss = loss_of(logits, truth, len(CANONICAL))
        self.descend(loss, rate_at(self.step, self.plan.steps, PEAK, WARM_UP))
        return float(loss.detach())

    def save(self) -> None:
        """Write the state, and the encoder as it would be used now."""
        super().save()
        network = TwoTowers()
        network.load_state_dict(self.average)
        description = (
            f"two towers, step {self.step} of {self.plan.steps}, batch {self.plan.batch}, seed {self.plan.seed}"
        )
        save_towers(self.out / FILE, network, vocabulary(lexicon()), description)


def vocabulary(words: Lexicon) -> list[str]:
    """Return the words that may stand in a training text."""
    texts = [
        text
        for k, (kind, _) in enumerate(words.attributes)
        for text in (words.nouns(k) if kind in ("class", "style", "group") else words.adjectives(k))
    ]
    free = [text for text in texts if not words.is_held_phrase(Phrase(text, ()))]
    return sorted({word for text in (*free, *CANONICAL, "thing", "a", "the") for word in words_of(text)})


class Options(Recipe):
    """Options."""

    rooms: Path | None = Field(None, description="Where rooms are kept; OUT/rooms if not given")
    steps: int = Field(1500, description="Steps")
    batch: int = Field(160, description="Crops a step")
    seed: int = Field(0, description="Seed")
    save_every: float = Field(120.0, description="Seconds between states")


def main() -> None:
    """Make what is missing, train or go on with a training, and measure."""
    options = asked(Options)
    torch.set_num_threads(1)
    folder, words = options.rooms or options.out / "rooms", lexicon()
    plan = Plan(30 if options.quick else options.steps, options.batch, options.seed, 2 if options.quick else len(ROOMS))
    data, run = Data(folder, plan, words), Run(plan, options.out)
    train(run, plan.steps, lambda: {"loss": run.train_step(data)}, options.save_every)
    validation = [room(folder, name) for name in VALIDATION[: 1 if options.quick else None]]
    figures = figures_of(EmbeddedEncoder(options.out / FILE), validation, library(folder, VALIDATION_LIBRARY), words)
    (options.out / "figures.json").write_text(json.dumps(figures, indent=1) + "\n")
    print(json.dumps(figures, indent=1))


if __name__ == "__main__":
    main()
