"""Train the small RAFT-Stereo on our own renderings; stop and start again at will.

    scenewright train raft-stereo --pairs FOLDER --out FOLDER [--quick] [--steps N] [--seed N]

A step sees random shapes (made on the fly), crops of rooms and of the needle world (docs/MAPPING.md says how they are
rendered). Its samples depend on the seed and the step's number alone, and the state is written every few minutes: a run
that was stopped ends with the bytes of one that was not, on the same machine. The result is
`raft_stereo_small.safetensors`, the moving average of the weights.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import torch
from scenewright.stages.disparity.raft.architecture import SMALL
from scenewright.stages.disparity.raft.checkpoint import save_network
from scenewright.stages.disparity.raft.matching import SMALL_UPDATES
from scenewright.stages.disparity.raft.network import RaftStereo
from scenewright.stages.disparity.training.raft_stereo import StereoTraining
from scenewright.stages.disparity.training.raft_stereo.crops import TEXTURES, Kept, Sample, kept_sample, shapes_sample
from scenewright.stages.disparity.training.raft_stereo.kept_pairs import stems
from scenewright.stages.disparity.training.raft_stereo.shapes import texture_bank
from scenewright.stages.kit.training.run import TrainingRun, rate_at, take_steps
from torch.nn import functional

PEAK_RATE, WEIGHT_DECAY, WARM_UP = 1e-3, 1e-4, 0.05
FIRST_MOVES = 0.05
"""The head of the updates begins with weights this much smaller, so that the first disparities are small."""
GAMMA = 0.85
"""Weight of an update's error against the next one's."""
VALIDATION_SEED = 7
"""Seed of the shapes that validation shows; training never draws them."""
FILE = "raft_stereo_small.safetensors"


@dataclass(frozen=True)
class Plan:
    """What a run is: steps; samples of each kind a step; updates of the disparity; seed."""

    steps: int
    shapes: int
    rooms: int
    needles: int
    updates: int
    seed: int
    pairs: int


class Sources:
    """Where samples come from."""

    def __init__(self, folder: Path, seed: int) -> None:
        self.rooms, self.needles = Kept(stems(folder, "room")), Kept(stems(folder, "needle", "endoscope"))
        self.bank = texture_bank(seed, TEXTURES)

    def samples(self, plan: Plan, step: int) -> list[Sample]:
        """Return the samples of a step."""
        numbers = range(plan.shapes + plan.rooms + plan.needles)
        generators = [np.random.default_rng([plan.seed, 2, step, number]) for number in numbers]
        found = [shapes_sample(self.bank, random) for random in generators[: plan.shapes]]
        for kind, chosen in (
            (self.rooms, generators[plan.shapes : plan.shapes + plan.rooms]),
            (self.needles, generators[plan.shapes + plan.rooms :]),
        ):
            found += [kept_sample(kind.any(random), random) for random in chosen]
        return found


def tensors_of(samples: list[Sample]) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Return left, right (N, 3, H, W) float32 and disparity (N, H, W)."""
    left, right, disparity = (torch.from_numpy(np.stack([sample[k] for sample in samples])) for k in range(3))
    return left.permute(0, 3, 1, 2).float(), right.permute(0, 3, 1, 2).float(), disparity


def loss_of(full: torch.Tensor, coarse: list[torch.Tensor], truth: torch.Tensor) -> torch.Tensor:
    """Return the mean distance [px] over known pixels, a weighted mean over the updates (Lipson et al., section 3.4).
    The coarse disparities are spread by bilinear interpolation, which is cheaper than the learned one."""
    known = torch.isfinite(truth)
    factor = truth.shape[2] // coarse[0].shape[2]
    spread = functional.interpolate(factor * torch.stack(coarse, dim=1), truth.shape[1:], mode="bilinear")
    each = (spread - torch.nan_to_num(truth)[:, None]).abs() * known[:, None]
    distances = each.sum(dim=(0, 2, 3)) / known.sum()
    weights = torch.tensor([GAMMA ** (len(coarse) - k) for k in range(len(coarse))])
    return ((full - truth)[known].abs().mean() + (weights * distances).sum()) / (1 + weights.sum())


class Run(TrainingRun):
    """A training run and its state on disk."""

    average_decay, gradient_norm, keeps_gradients = 0.995, 1.0, True

    def __init__(self, plan: Plan, out: Path) -> None:
        self.plan = plan
        torch.manual_seed(plan.seed)
        network = RaftStereo(SMALL).to(memory_format=torch.channels_last)  # type: ignore[call-overload]
        for module in network.modules():
            if isinstance(module, torch.nn.Conv2d):
                torch.nn.init.kaiming_normal_(module.weight, mode="fan_out", nonlinearity="relu")
        with torch.no_grad():
            network.update_block.flow_head.conv2.weight *= FIRST_MOVES
        super().__init__(network, asdict(plan), out, PEAK_RATE, WEIGHT_DECAY)

    def train_step(self, sources: Sources) -> float:
        """Take one step and return the error of the last update [px]."""
        self.network.train()
        left, right, truth = tensors_of(sources.samples(self.plan, self.step))
        with torch.autocast("cpu", torch.bfloat16):
            full, coarse = self.network.updates(left, right, self.plan.updates)
        self.descend(loss_of(full, coarse, truth), rate_at(self.step, self.plan.steps, PEAK_RATE, WARM_UP))
        return float((full.detach() - truth)[torch.isfinite(truth)].abs().mean())

    def averaged(self) -> RaftStereo:
        """Return a network with the moving average of the weights, for use."""
        network = RaftStereo(SMALL)
        network.load_state_dict(self.average)
        return network.eval()

    def save(self) -> None:
        """Write the state, and the checkpoint as it would be used now."""
        super().save()
        description = (
            f"trained on random shapes and {self.plan.pairs} rendered pairs, step {self.step} of {self.plan.steps}, "
            f"seed {self.plan.seed}"
        )
        save_network(self.out / FILE, self.averaged(), description)


def validation(run: Run, bank: list[np.ndarray], count: int = 24) -> dict[str, float]:
    """Return error [px] and bad-2 [%] on shapes that are not trained on, beside the best constant's error (the median
    of each sample's truth)."""
    samples = [shapes_sample(bank, np.random.default_rng([VALIDATION_SEED, number])) for number in range(count)]
    left, right, truth = tensors_of(samples)
    network = run.averaged()
    with torch.inference_mode():
        found = network.updates(left, right, SMALL_UPDATES)[0]
    known = torch.isfinite(truth)
    error = (found - truth)[known].abs()
    middle = torch.nanmedian(truth.flatten(1), dim=1).values[:, None, None]
    return {
        "error": round(float(error.mean()), 3),
        "bad2": round(100 * float((error > 2).float().mean()), 2),
        "constant": round(float((middle - truth)[known].abs().mean()), 3),
    }


def train(options: StereoTraining, out: Path) -> None:
    """Train, or go on with a training. Raises BadInput for a folder without pairs."""
    torch.set_num_threads(1)
    sources = Sources(options.pairs, options.seed)
    held_out = texture_bank(options.seed + 1000, TEXTURES)
    pairs = len(sources.rooms.stems) + len(sources.needles.stems)
    plan = Plan(10 if options.quick else options.steps, 2, 1, 1, 4, options.seed, pairs)
    run = Run(plan, out)
    take_steps(
        run,
        plan.steps,
        lambda: {"error": run.train_step(sources)},
        options.save_every,
        lambda: {"held_out": validation(run, held_out)},
        500,
    )
