"""Train the network of `--backend network`; stop and start again at will.

    python -m benchmarks.training.train --data FOLDER --out FOLDER [--real FOLDER] [--steps N] [--batch N] [--seed N]
                                        [--device cuda] [--seconds N]

The state (network, moving average, optimiser) is written every few minutes as safetensors with a small JSON beside it;
the same command goes on from there. A step's samples and their changes depend on the seed, the number of the step and
the frames that are there by then (a folder that is still written is read as it grows), so that a run that was stopped
ends with the bytes of one that was not, on the same processor with one thread (not with `--seconds`, under which the
rate falls by the clock). `--real` adds frames of `real_frames` to every batch. The result is `panoptic.safetensors`:
the moving average of the weights.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import torch
from pydantic import Field
from scenewright.stages.segment.backends.network.features import CHANNELS
from scenewright.stages.segment.backends.network.model import PanopticNetwork, Widths
from scenewright.stages.segment.backends.network.weights import save_checkpoint
from torch.nn import functional

from benchmarks.options import Recipe, asked
from benchmarks.training.drawing import drawn
from benchmarks.training.drawn_targets import TargetBatch
from benchmarks.training.run import TrainingRun, rate_at, train
from benchmarks.training.samples import FrameSet, Store
from benchmarks.training.targets import IGNORED

PEAK_RATE, WEIGHT_DECAY = 4e-3, 0.02
WARM_UP, WHOLE_FRAMES = 0.04, 0.12
"""Shares of the steps: the rate rises during the first; the last of them see whole frames instead of crops."""
CENTRE_WEIGHT, OFFSET_WEIGHT = 200.0, 0.05
SMOOTHING = 0.05
REAL_SHARE = 0.08
"""Of the samples of a batch, where there are real frames."""
LOOKED_FOR_EVERY = 200
"""After so many steps frames that were written meanwhile are taken."""
WIDTHS = Widths(encoder=(32, 64, 96, 160, 224), decoder=(32, 64, 96, 144), blocks=2)


@dataclass(frozen=True)
class Plan:
    """What a run is."""

    steps: int
    batch: int
    seed: int
    classes: tuple[str, ...]
    real_frames: int = 0


class Feed:
    """The batches of a run, on its device."""

    def __init__(self, frames: FrameSet, real: FrameSet | None, plan: Plan, device: str = "cpu") -> None:
        self.plan = plan
        self.store = Store([frames] if real is None else [frames, real], plan.classes, device)

    def __call__(self, step: int, whole: bool) -> tuple[torch.Tensor, TargetBatch]:
        """Return inputs and targets of a step; `whole`: frames, not crops of them."""
        if step % LOOKED_FOR_EVERY == 0:
            self.store.grow()
        random = np.random.default_rng([self.plan.seed, 1, step])
        sets = self.store.sets
        which = (random.random(self.plan.batch) < REAL_SHARE) & (len(sets) > 1)
        chosen = [(int(k), int(random.integers(len(sets[int(k)])))) for k in which]
        return drawn(self.store.frames(chosen), random, whole=whole)


def loss_of(
    outputs: tuple[torch.Tensor, torch.Tensor, torch.Tensor], targets: TargetBatch, class_weight: torch.Tensor
) -> tuple[torch.Tensor, dict[str, torch.Tensor]]:
    """Return the loss and its parts: weighted cross entropy of the classes, squared error of the heat map where it is
    known what is there, absolute error of the offsets on things."""
    logits, centres, offsets = (output.float() for output in outputs)
    weight = targets.weight * (targets.classes != IGNORED)
    each = functional.cross_entropy(
        logits, targets.classes, weight=class_weight, ignore_index=IGNORED, reduction="none", label_smoothing=SMOOTHING
    )
    semantic = (each * weight).sum() / weight.sum().clamp(min=1)
    centre = ((centres - targets.centres[:, None]) ** 2 * targets.told[:, None]).mean()
    things = targets.things[:, None]
    offset = ((offsets - targets.offsets).abs() * things).sum() / (things.sum() * 2).clamp(min=1)
    loss = semantic + CENTRE_WEIGHT * centre + OFFSET_WEIGHT * offset
    return loss, {"class": semantic.detach(), "centre": centre.detach(), "offset": offset.detach()}


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

    def __init__(self, plan: Plan, out: Path, widths: Widths, device: str = "cpu") -> None:
        self.frames = 0
        """So many are there by now."""
        self.plan, self.widths, self.device = plan, widths, device
        torch.manual_seed(plan.seed)
        network = PanopticNetwork(len(CHANNELS), len(plan.classes), widths).to(device)
        super().__init__(network, _plan_record(plan), out, PEAK_RATE, WEIGHT_DECAY)

    def train_step(
        self, batch: tuple[torch.Tensor, TargetBatch], class_weight: torch.Tensor, progress: float
    ) -> Mapping[str, torch.Tensor]:
        """Take one step, `progress` (0..1) into the run, and return the parts of its loss."""
        self.network.train()
        inputs, targets = batch
        with torch.autocast(self.device, torch.bfloat16):
            outputs = self.network(inputs.contiguous(memory_format=torch.channels_last))
        loss, parts = loss_of(outputs, targets, class_weight)
        self.descend(loss, rate_at(round(progress * self.plan.steps), self.plan.steps, PEAK_RATE, WARM_UP))
        return parts

    def averaged(self) -> PanopticNetwork:
        """Return a network with the moving average of the weights, for use."""
        network = PanopticNetwork(len(CHANNELS), len(self.plan.classes), self.widths)
        network.load_state_dict(self.average)
        return network.eval()

    def save(self) -> None:
        """Write the state, and the checkpoint as it would be used now."""
        super().save()
        real = f" and {self.plan.real_frames} real ones" if self.plan.real_frames else ""
        save_checkpoint(
            self.out / "panoptic.safetensors",
            self.averaged(),
            self.plan.classes,
            self.widths,
            f"trained on {self.frames} frames of generated rooms and tabletops{real}, "
            f"step {self.step} of at most {self.plan.steps}, batch {self.plan.batch}, seed {self.plan.seed}",
        )


def _plan_record(plan: Plan) -> dict[str, int | list[str]]:
    return asdict(plan) | {"classes": list(plan.classes)}


class Clock:
    """How far a run is: by its steps, or by the clock where that is further."""

    def __init__(self, steps: int, seconds: float) -> None:
        self.steps, self.seconds, self.started = steps, seconds, time.monotonic()

    def progress(self, step: int) -> float:
        """Return the share of the run (0..1) that is over before `step`."""
        return min(1.0, max(step / self.steps, (time.monotonic() - self.started) / self.seconds))


class Options(Recipe):
    """Options."""

    data: Path = Field(description="Folder of benchmarks.training.data")
    real: Path | None = Field(None, description="Folder of benchmarks.training.real_frames")
    steps: int = Field(2500, description="Steps")
    batch: int = Field(32, description="Frames a step")
    seed: int = Field(0, description="Seed")
    device: str = Field("cpu", description="cpu, or cuda")
    threads: int = Field(1, description="Of the processor")
    seconds: float = Field(float("inf"), description="Ends after so many, however many steps were taken")
    save_every: float = Field(240.0, description="Seconds between states")


def main() -> None:
    """Train, or go on with a training."""
    arguments = asked(Options)
    torch.set_num_threads(arguments.threads)
    torch.backends.cudnn.benchmark = True
    frames = FrameSet(arguments.data / "training")
    real = FrameSet(arguments.real) if arguments.real is not None else None
    shown = len(real) if real is not None else 0
    plan = Plan(arguments.steps, arguments.batch, arguments.seed, frames.class_names(), shown)
    run = Run(plan, arguments.out, WIDTHS, arguments.device)
    class_weight = class_weights(frames, plan.classes).to(arguments.device)
    clock, feed = Clock(plan.steps, arguments.seconds), Feed(frames, real, plan, arguments.device)

    def step() -> Mapping[str, torch.Tensor]:
        progress = clock.progress(run.step)
        batch = feed(run.step, progress >= 1 - WHOLE_FRAMES)
        run.frames = len(frames)
        return run.train_step(batch, class_weight, progress)

    train(run, plan.steps, step, arguments.save_every, over=lambda: clock.progress(run.step) >= 1.0)


if __name__ == "__main__":
    main()
