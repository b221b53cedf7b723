"""Train the network of `--backend network`; stop and start again at will.

    scenewright train network --frames FOLDER --out FOLDER [--real FOLDER] [--device cuda] [--seconds N]

The state (network, moving average, optimiser) is written every few minutes as safetensors with a small JSON beside it;
the same command goes on from there. A step's samples and their changes depend on the seed, the number of the step and
the frames that are there by then (a folder that is still written is read as it grows), so that a run that was stopped
ends with the bytes of one that was not, on the same processor with one thread (not with `--seconds`, under which the
rate falls by the clock). The results are `panoptic.safetensors`, the moving average of the weights, and
`validation.json`.
"""

from __future__ import annotations

import json
import logging
import math
import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import torch
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.kit.training.run import TrainingRun, rate_at, take_steps
from scenewright.stages.segment.backends.network.backend import load_predictor
from scenewright.stages.segment.backends.network.features import CHANNELS
from scenewright.stages.segment.backends.network.model import PanopticNetwork, Widths
from scenewright.stages.segment.backends.network.weights import save_checkpoint
from scenewright.stages.segment.training.network import NetworkTraining
from scenewright.stages.segment.training.network.drawing import drawn
from scenewright.stages.segment.training.network.drawn_targets import TargetBatch
from scenewright.stages.segment.training.network.samples import FrameSet, Store
from scenewright.stages.segment.training.network.targets import IGNORED
from scenewright.stages.segment.training.network.validation import qualities
from torch.nn import functional

_LOGGER = logging.getLogger("scenewright")
PEAK_RATE, WEIGHT_DECAY = 4e-3, 0.02
WARM_UP, WHOLE_FRAMES = 0.04, 0.12
"""Shares of the steps: the rate rises during the first; the last of them see whole frames instead of crops."""
CENTRE_WEIGHT, OFFSET_WEIGHT = 200.0, 0.05
SMOOTHING = 0.05
"""Probability that the target spreads over all classes (label smoothing)."""
REAL_SHARE = 0.08
"""Share of real frames in a batch, where there are any."""
LOOKED_FOR_EVERY = 200
"""After so many steps frames that were written meanwhile are taken."""
QUICK_STEPS, QUICK_BATCH = 12, 4
FILE = "panoptic.safetensors"
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
            self.out / FILE,
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


def train(options: NetworkTraining, out: Path) -> None:
    """Train, or go on with a training; then measure on the validation frames."""
    torch.set_num_threads(options.threads)
    torch.backends.cudnn.benchmark = True
    steps, batch = (QUICK_STEPS, QUICK_BATCH) if options.quick else (options.steps, options.batch)
    frames = FrameSet(options.frames / "training")
    real = FrameSet(options.real) if options.real is not None else None
    shown = len(real) if real is not None else 0
    plan = Plan(steps, batch, options.seed, frames.class_names(), shown)
    run = Run(plan, out, WIDTHS, options.device)
    class_weight = class_weights(frames, plan.classes).to(options.device)
    clock = Clock(plan.steps, math.inf if options.seconds is None else options.seconds)
    feed = Feed(frames, real, plan, options.device)

    def step() -> Mapping[str, torch.Tensor]:
        progress = clock.progress(run.step)
        batch = feed(run.step, progress >= 1 - WHOLE_FRAMES)
        run.frames = len(frames)
        return run.train_step(batch, class_weight, progress)

    take_steps(run, plan.steps, step, options.save_every, over=lambda: clock.progress(run.step) >= 1.0)
    predictor = load_predictor(out / FILE, load_vocabulary())
    measured = qualities(predictor, FrameSet(options.frames / "validation"))
    (out / "validation.json").write_text(json.dumps(measured, indent=1) + "\n")
    for name, figures in measured.items():
        _LOGGER.info("validation, %s: PQ %.3f over %d classes", name, figures["pq"], figures["classes"])
