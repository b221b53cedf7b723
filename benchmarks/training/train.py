"""Train the network of `--backend network`; stop and start again at will.

    python -m benchmarks.training.train --data FOLDER --out FOLDER [--real FOLDER] [--steps N] [--batch N] [--seed N]
                                        [--device cuda] [--workers N] [--seconds N]

The state (network, moving average, optimiser) is written every few minutes as safetensors with a small JSON beside it;
the same command goes on from there. A step's samples and their changes depend on the seed and the number of the step
alone, so that a run that was stopped ends with the bytes of one that was not, on the same processor with one thread
(not with `--seconds`, under which the rate falls by the clock). `--real` adds frames of `real_frames` to every batch.
The result is `panoptic.safetensors`: the moving average of the weights.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import torch
from pydantic import Field
from torch.nn import functional

from benchmarks.options import Recipe, asked
from benchmarks.training.feeding import fed
from benchmarks.training.run import TrainingRun, rate_at, train
from benchmarks.training.samples import FrameSet, varied
from benchmarks.training.targets import IGNORED
from stages.segment.backends.network.features import CHANNELS
from stages.segment.backends.network.model import PanopticNetwork, Widths
from stages.segment.backends.network.weights import save_checkpoint

PEAK_RATE, WEIGHT_DECAY = 4e-3, 0.02
WARM_UP, WHOLE_FRAMES = 0.04, 0.12
"""Shares of the steps: the rate rises during the first; the last of them see whole frames instead of crops."""
CENTRE_WEIGHT, OFFSET_WEIGHT = 200.0, 0.05
SMOOTHING = 0.05


REAL_SHARE = 0.08
"""Of the samples of a batch, where there are real frames."""
WIDTHS = Widths(encoder=(32, 64, 96, 160, 224), decoder=(32, 64, 96, 144), blocks=2)


@dataclass(frozen=True)
class Plan:
    """What a run is."""

    steps: int
    batch: int
    seed: int
    classes: tuple[str, ...]
    frames: int
    real_frames: int = 0


@dataclass(frozen=True)
class Batch:
    """Inputs (batch, 16, H, W) float16 and what the heads should say, all (batch, ..., h, w) (see Targets)."""

    inputs: np.ndarray
    classes: np.ndarray
    weight: np.ndarray
    centres: np.ndarray
    offsets: np.ndarray
    things: np.ndarray
    told: np.ndarray


class Feed:
    """The batches of a run: any of them can be made for itself, in another process too."""

    def __init__(self, frames: FrameSet, real: FrameSet | None, plan: Plan) -> None:
        self.frames, self.real, self.plan = frames, real, plan

    def __call__(self, step: int, whole: bool) -> Batch:
        """Return the batch of a step; `whole`: frames, not crops of them."""
        plan = self.plan
        per_epoch = max(1, len(self.frames) // plan.batch)
        epoch, place = divmod(step, per_epoch)
        order = np.random.default_rng([plan.seed, 1, epoch]).permutation(len(self.frames))
        chosen = [self.frames[int(index)] for index in order[place * plan.batch : (place + 1) * plan.batch]]
        if self.real is not None:
            random = np.random.default_rng([plan.seed, 3, step])
            for k in np.flatnonzero(random.random(len(chosen)) < REAL_SHARE):
                chosen[k] = self.real[int(random.integers(len(self.real)))]
        made = [
            varied(frame, plan.classes, np.random.default_rng([plan.seed, 2, step, k]), whole=whole)
            for k, frame in enumerate(chosen)
        ]
        targets = [entry for _, entry in made]
        return Batch(
            np.stack([inputs for inputs, _ in made]).astype(np.float16),
            np.stack([t.classes for t in targets]),
            np.stack([t.weight for t in targets]).astype(np.float16),
            np.stack([t.centres for t in targets]).astype(np.float16),
            np.stack([t.offsets for t in targets]).astype(np.float16),
            np.stack([t.things for t in targets]),
            np.stack([t.told for t in targets]),
        )


def loss_of(
    outputs: tuple[torch.Tensor, torch.Tensor, torch.Tensor], batch: Batch, class_weight: torch.Tensor
) -> tuple[torch.Tensor, dict[str, torch.Tensor]]:
    """Return the loss and its parts: weighted cross entropy of the classes, squared error of the heat map where it is
    known what is there, absolute error of the offsets on things."""
    logits, centres, offsets = (output.float() for output in outputs)
    device = logits.device
    classes = torch.from_numpy(batch.classes).to(device).long()
    weight = torch.from_numpy(batch.weight).to(device).float() * (classes != IGNORED)
    heat = torch.from_numpy(batch.centres).to(device).float()[:, None]
    wanted = torch.from_numpy(batch.offsets).to(device).float()
    things = torch.from_numpy(batch.things).to(device).float()[:, None]
    told = torch.from_numpy(batch.told).to(device).float()[:, None]
    each = functional.cross_entropy(
        logits, classes, weight=class_weight, ignore_index=IGNORED, reduction="none", label_smoothing=SMOOTHING
    )
    semantic = (each * weight).sum() / weight.sum().clamp(min=1)
    centre = ((centres - heat) ** 2 * told).mean()
    offset = ((offsets - wanted).abs() * things).sum() / (things.sum() * 2).clamp(min=1)
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
        self.plan, self.widths, self.device = plan, widths, device
        torch.manual_seed(plan.seed)
        network = PanopticNetwork(len(CHANNELS), len(plan.classes), widths).to(device)
        super().__init__(network, _plan_record(plan), out, PEAK_RATE, WEIGHT_DECAY)

    def train_step(self, batch: Batch, class_weight: torch.Tensor, progress: float) -> dict[str, float]:
        """Take one step, `progress` (0..1) into the run, and return the parts of its loss."""
        self.network.train()
        inputs = torch.from_numpy(batch.inputs).to(self.device).float().contiguous(memory_format=torch.channels_last)
        with torch.autocast(self.device, torch.bfloat16):
            outputs = self.network(inputs)
        loss, parts = loss_of(outputs, batch, class_weight)
        self.descend(loss, rate_at(round(progress * self.plan.steps), self.plan.steps, PEAK_RATE, WARM_UP))
        return {name: float(value) for name, value in parts.items()}

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
            f"trained on {self.plan.frames} frames of generated rooms and tabletops{real}, "
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

    def orders(self, first: int) -> Iterator[tuple[int, bool]]:
        """Yield what to make: every step that is left, and whether it sees whole frames."""
        for step in range(first, self.steps):
            yield step, self.progress(step) >= 1 - WHOLE_FRAMES


class Options(Recipe):
    """Options."""

    data: Path = Field(description="Folder of benchmarks.training.data")
    real: Path | None = Field(None, description="Folder of benchmarks.training.real_frames")
    steps: int = Field(2500, description="Steps")
    batch: int = Field(32, description="Frames a step")
    seed: int = Field(0, description="Seed")
    device: str = Field("cpu", description="cpu, or cuda")
    threads: int = Field(1, description="Of the processor")
    workers: int = Field(0, description="Processes that make the samples, beside the one that trains")
    seconds: float = Field(float("inf"), description="Ends after so many, however many steps were taken")
    save_every: float = Field(240.0, description="Seconds between states")


def main() -> None:
    """Train, or go on with a training."""
    arguments = asked(Options)
    torch.set_num_threads(arguments.threads)
    frames = FrameSet(arguments.data / "training")
    real = FrameSet(arguments.real) if arguments.real is not None else None
    shown = len(real) if real is not None else 0
    plan = Plan(arguments.steps, arguments.batch, arguments.seed, frames.class_names(), len(frames), shown)
    run = Run(plan, arguments.out, WIDTHS, arguments.device)
    class_weight = class_weights(frames, plan.classes).to(arguments.device)
    clock = Clock(plan.steps, arguments.seconds)
    feed = Feed(frames, real, plan)
    batches = fed(feed, clock.orders(run.step), arguments.workers)

    def step() -> dict[str, float]:
        return run.train_step(next(batches), class_weight, clock.progress(run.step))

    train(run, plan.steps, step, arguments.save_every, over=lambda: clock.progress(run.step) >= 1.0)
    batches.close()


if __name__ == "__main__":
    main()
