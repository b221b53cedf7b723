"""Train the network of `--backend network`; stop and start again at will.

    python -m benchmarks.training.train --data FOLDER --out FOLDER [--steps N] [--batch N] [--seed N]

The state (network, moving average, optimiser) is written every few minutes as safetensors with a small JSON beside it;
the same command goes on from there. A step's samples and their changes depend on the seed and the number of the step
alone, so that a run that was stopped ends with the bytes of one that was not, on the same machine with one thread.
The result is `panoptic.safetensors`: the moving average of the weights.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import torch
from pydantic import Field
from torch.nn import functional

from benchmarks.options import Recipe, asked
from benchmarks.training.run import TrainingRun, rate_at, train
from benchmarks.training.samples import FrameSet, varied
from benchmarks.training.targets import IGNORED, Targets
from stages.segment.backends.network.features import CHANNELS
from stages.segment.backends.network.model import PanopticNetwork, Widths
from stages.segment.backends.network.weights import save_checkpoint

PEAK_RATE, WEIGHT_DECAY = 4e-3, 0.02
WARM_UP, WHOLE_FRAMES = 0.04, 0.12
"""Shares of the steps: the rate rises during the first; the last of them see whole frames instead of crops."""
CENTRE_WEIGHT, OFFSET_WEIGHT = 200.0, 0.05
SMOOTHING = 0.05


@dataclass(frozen=True)
class Plan:
    """What a run is."""

    steps: int
    batch: int
    seed: int
    classes: tuple[str, ...]
    frames: int


def batch_of(frames: FrameSet, plan: Plan, step: int) -> tuple[torch.Tensor, list[Targets]]:
    """Return the inputs (batch, 16, H, W) and targets of a step."""
    per_epoch = max(1, len(frames) // plan.batch)
    epoch, place = divmod(step, per_epoch)
    order = np.random.default_rng([plan.seed, 1, epoch]).permutation(len(frames))
    chosen = order[place * plan.batch : (place + 1) * plan.batch]
    whole = step >= (1 - WHOLE_FRAMES) * plan.steps
    made = [
        varied(frames[int(index)], plan.classes, np.random.default_rng([plan.seed, 2, step, k]), whole=whole)
        for k, index in enumerate(chosen)
    ]
    inputs = torch.from_numpy(np.stack([inputs for inputs, _ in made])).to(memory_format=torch.channels_last)
    return inputs, [targets for _, targets in made]


def loss_of(
    outputs: tuple[torch.Tensor, torch.Tensor, torch.Tensor], targets: list[Targets], class_weight: torch.Tensor
) -> tuple[torch.Tensor, dict[str, float]]:
    """Return the loss and its parts: weighted cross entropy of the classes, squared error of the heat map, absolute
    error of the offsets on things."""
    logits, centres, offsets = (output.float() for output in outputs)
    classes = torch.from_numpy(np.stack([t.classes for t in targets]).astype(np.int64))
    weight = torch.from_numpy(np.stack([t.weight for t in targets])) * (classes != IGNORED)
    heat = torch.from_numpy(np.stack([t.centres for t in targets]))[:, None]
    wanted = torch.from_numpy(np.stack([t.offsets for t in targets]))
    things = torch.from_numpy(np.stack([t.things for t in targets]))[:, None].float()
    each = functional.cross_entropy(
        logits, classes, weight=class_weight, ignore_index=IGNORED, reduction="none", label_smoothing=SMOOTHING
    )
    semantic = (each * weight).sum() / weight.sum().clamp(min=1)
    centre = functional.mse_loss(centres, heat)
    offset = ((offsets - wanted).abs() * things).sum() / (things.sum() * 2).clamp(min=1)
    loss = semantic + CENTRE_WEIGHT * centre + OFFSET_WEIGHT * offset
    return loss, {"class": float(semantic.detach()), "centre": float(centre.detach()), "offset": float(offset.detach())}


def class_weights(frames: FrameSet, classes: tuple[str, ...]) -> torch.Tensor:
    """Return weights (classes,) with mean 1 over pixels' classes: the inverse of the share of pixels, to the power
    0.3, of at most 240 frames spread over the set."""
    counts = np.ones(len(classes))
    for index in np.linspace(0, len(frames) - 1, min(240, len(frames))).astype(int):
        frame = frames[int(index)]
        pixels = np.bincount(frame.labels.ravel(), minlength=len(frame.classes) + 1)
        for name, number in zip(frame.classes, pixels[1:], strict=False):
            counts[classes.index(name)] += number
    weights = (counts / counts.sum()) ** -0.3
    return torch.tensor(weights / np.average(weights, weights=counts), dtype=torch.float32)


class Run(TrainingRun):
    """A training run and its state on disk."""

    average_decay, gradient_norm = 0.998, 10.0

    def __init__(self, plan: Plan, out: Path, widths: Widths) -> None:
        self.plan, self.widths = plan, widths
        torch.manual_seed(plan.seed)
        network = PanopticNetwork(len(CHANNELS), len(plan.classes), widths)
        super().__init__(network, _plan_record(plan), out, PEAK_RATE, WEIGHT_DECAY)

    def train_step(self, frames: FrameSet, class_weight: torch.Tensor) -> dict[str, float]:
        """Take one step and return the parts of its loss."""
        self.network.train()
        inputs, targets = batch_of(frames, self.plan, self.step)
        with torch.autocast("cpu", torch.bfloat16):
            outputs = self.network(inputs)
        loss, parts = loss_of(outputs, targets, class_weight)
        self.descend(loss, rate_at(self.step, self.plan.steps, PEAK_RATE, WARM_UP))
        return parts

    def averaged(self) -> PanopticNetwork:
        """Return a network with the moving average of the weights, for use."""
        network = PanopticNetwork(len(CHANNELS), len(self.plan.classes), self.widths)
        network.load_state_dict(self.average)
        return network.eval()

    def save(self) -> None:
        """Write the state, and the checkpoint as it would be used now."""
        super().save()
        save_checkpoint(
            self.out / "panoptic.safetensors",
            self.averaged(),
            self.plan.classes,
            self.widths,
            f"trained on {self.plan.frames} frames of generated rooms and tabletops, "
            f"step {self.step} of {self.plan.steps}, batch {self.plan.batch}, seed {self.plan.seed}",
        )


def _plan_record(plan: Plan) -> dict[str, int | list[str]]:
    return asdict(plan) | {"classes": list(plan.classes)}


class Options(Recipe):
    """Options."""

    data: Path = Field(description="Folder of benchmarks.training.data")
    steps: int = Field(4600, description="Steps")
    batch: int = Field(8, description="Frames a step")
    seed: int = Field(0, description="Seed")
    threads: int = Field(1, description="Of the processor")
    save_every: float = Field(240.0, description="Seconds between states")


def main() -> None:
    """Train, or go on with a training."""
    arguments = asked(Options)
    torch.set_num_threads(arguments.threads)
    frames = FrameSet(arguments.data / "training")
    plan = Plan(arguments.steps, arguments.batch, arguments.seed, frames.class_names(), len(frames))
    run = Run(plan, arguments.out, Widths())
    class_weight = class_weights(frames, plan.classes)
    train(run, plan.steps, lambda: run.train_step(frames, class_weight), arguments.save_every)


if __name__ == "__main__":
    main()
