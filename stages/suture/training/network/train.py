"""Train the network that finds needle and thread; stop and start again at will.

    scenewright train suture-network --out FOLDER [--quick] [--steps N] [--batch N] [--seed N]
    scenewright train suture-network --out OTHER --views FOLDER/views --start CHECKPOINT [--steps N]
    scenewright train suture-network --out THIRD --views FOLDER/views --start OTHER/... --cluttered
    scenewright train suture-network --out END --views FOLDER/views --start THIRD/... --cluttered --trials

Views that are not in FOLDER/views yet are rendered first (seeds 0 to 99 before the two cameras, in the second run to
149; 200 to 211 before the endoscope, in the third to 249; in the fourth 250 to 299 too, and views of the trials 800 to
849; 450 to 455 validate, and the trials 850 to 853). A step's samples depend on the seed and
on the number of the step alone, and the state is written every few minutes, so that a run that was stopped ends with
the bytes of one that was not, on the same machine. The result is `segmentation.safetensors`, the moving average of the
weights.
"""

from __future__ import annotations

import hashlib
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import torch
from scenewright.stages.kit.training.run import TrainingRun, rate_at, take_steps
from scenewright.stages.suture.rig import ENDOSCOPE, TWO_CAMERAS
from scenewright.stages.suture.segmentation.checkpoint import load_network, save_network
from scenewright.stages.suture.segmentation.infer import Segmenter, normalised
from scenewright.stages.suture.segmentation.model import CLASSES, SutureNetwork
from scenewright.stages.suture.training.network import NetworkTraining
from scenewright.stages.suture.training.network.samples import Views, masks_of, sample
from scenewright.stages.suture.training.network.trial_views import kept_trial
from scenewright.stages.suture.training.network.views import kept_view
from torch.nn import functional

WEIGHT_DECAY, WARM_UP = 0.02, 0.03
FILE = "segmentation.safetensors"
SAMPLES_A_PICTURE = 2
"""Crops from one decoded picture. By eye."""
CAMERAS, ENDOSCOPES, VALIDATION = range(100), range(200, 212), range(450, 456)
CAMERAS_REFINED, ENDOSCOPES_CLUTTERED = range(150), range(200, 250)
"""The refinement sees more views of the two cameras, the third run more of the endoscope's."""
CAMERAS_OF_TRIALS, TRIALS, TRIALS_VALIDATION = range(250, 300), range(800, 850), range(850, 854)
"""The fourth sees more of the two cameras, and whole suture trials (trial_views.py)."""


@dataclass(frozen=True)
class Phase:
    """Peak learning rate, weights of the classes in the loss, share of the crops about the needle, of those where it is
    before jaws, and of the crops with blood and highlights."""

    peak_rate: float
    weights: tuple[float, float, float]
    needles: float
    before_jaws: float = 0.0
    clutter: float = 0.0


FIRST, REFINED = Phase(4e-3, (1.0, 1.0, 0.3), 0.35), Phase(2e-3, (2.0, 1.0, 0.3), 0.55)
CLUTTERED = Phase(2e-3, (2.0, 1.0, 0.3), 0.5, before_jaws=0.5, clutter=0.6)
"""The needle is the rarest class and bright jaws the hardest background: a second run goes on with more of it. A third
learns what is thin and bright and no needle, and needles and jaws under blood; a fourth sees trials as well."""


@dataclass(frozen=True)
class Plan:
    """What a run is."""

    steps: int
    batch: int
    seed: int
    pictures: int
    start: str = ""
    cluttered: bool = False
    trials: bool = False

    @property
    def phase(self) -> Phase:
        """What the run asks for: a beginning, or a refinement of the checkpoint with the digest `start`."""
        if self.cluttered:
            return CLUTTERED
        return REFINED if self.start else FIRST


def batch_of(views: Views, plan: Plan, step: int) -> tuple[torch.Tensor, torch.Tensor]:
    """Return inputs (batch, 3, H, W) and targets (batch, 3, H, W) of a step."""
    number, phase = max(plan.batch // SAMPLES_A_PICTURE, 1), plan.phase
    per_epoch = max(1, len(views) // number)
    epoch, place = divmod(step, per_epoch)
    order = np.random.default_rng([plan.seed, 1, epoch]).permutation(len(views))
    made = []
    for index in order[place * number : (place + 1) * number]:
        picture, bodies = views[int(index)]
        for turn in range(plan.batch // number):
            random = np.random.default_rng([plan.seed, 2, step, int(index), turn])
            made.append(sample(picture, bodies, random, phase.needles, phase.before_jaws, phase.clutter))
    inputs = normalised(torch.from_numpy(np.stack([image for image, _ in made])))
    return inputs, torch.from_numpy(np.stack([masks for _, masks in made]))


def loss_of(logits: torch.Tensor, targets: torch.Tensor, weights: tuple[float, float, float]) -> torch.Tensor:
    """Return cross entropy and 1 - Dice (over the batch, Milletari et al. 2016), summed over the weighted classes."""
    entropy = functional.binary_cross_entropy_with_logits(logits, targets, reduction="none").mean(dim=(0, 2, 3))
    found = torch.sigmoid(logits)
    both = (found * targets).sum(dim=(0, 2, 3))
    each = (found * found).sum(dim=(0, 2, 3)) + (targets * targets).sum(dim=(0, 2, 3))
    dice = 1.0 - (2.0 * both + 1.0) / (each + 1.0)
    return (torch.tensor(weights) * (8.0 * entropy + dice)).sum()


class Run(TrainingRun):
    """A training run and its state on disk."""

    average_decay, gradient_norm, single_precision = 0.997, 5.0, True

    def __init__(self, plan: Plan, out: Path, start: Path | None = None) -> None:
        self.plan = plan
        torch.manual_seed(plan.seed)
        network = SutureNetwork() if start is None else load_network(start)[0]
        super().__init__(network, asdict(plan), out, plan.phase.peak_rate, WEIGHT_DECAY)

    def train_step(self, views: Views) -> float:
        """Take one step and return its loss."""
        self.network.train()
        inputs, targets = batch_of(views, self.plan, self.step)
        loss = loss_of(self.network(inputs), targets, self.plan.phase.weights)
        self.descend(loss, rate_at(self.step, self.plan.steps, self.plan.phase.peak_rate, WARM_UP))
        return float(loss.detach())

    def averaged(self) -> SutureNetwork:
        """Return a network with the moving average of the weights, for use."""
        network = SutureNetwork()
        network.load_state_dict(self.average)
        return network.eval()

    def save(self) -> None:
        """Write the state, and the checkpoint as it would be used now."""
        super().save()
        description = (
            f"trained on {self.plan.pictures} rendered images, step {self.step} of {self.plan.steps}, "
            f"batch {self.plan.batch}, seed {self.plan.seed}" + (", a refinement" if self.plan.start else "")
        )
        save_network(self.out / FILE, self.averaged(), description)


def overlap(network: SutureNetwork, views: Views) -> dict[str, float]:
    """Return the intersection over union of every class over all pixels of the views' pictures."""
    segmenter = Segmenter(network, "")
    both, either = np.zeros(len(CLASSES)), np.zeros(len(CLASSES))
    for index in range(len(views)):
        picture, bodies = views[index]
        found, truth = segmenter.probabilities(picture) > 0.5, masks_of(bodies) > 0.5
        both += (found & truth).sum(axis=(1, 2))
        either += (found | truth).sum(axis=(1, 2))
    shares = both / np.maximum(either, 1)
    return {name: round(float(share), 4) for name, share in zip(CLASSES, shares, strict=True)}


def train(options: NetworkTraining, out: Path) -> None:
    """Render what is missing, then train or go on with a training."""
    torch.set_num_threads(1)
    folder = options.views or out / "views"
    few = 2 if options.quick else None
    cameras = CAMERAS if options.start is None or options.cluttered else CAMERAS_REFINED
    stems = [kept_view(folder, TWO_CAMERAS, seed) for seed in cameras[:few]]
    stems += [
        kept_view(folder, ENDOSCOPE, seed) for seed in (ENDOSCOPES_CLUTTERED if options.cluttered else ENDOSCOPES)[:few]
    ]
    validations = {"overlap": Views([kept_view(folder, TWO_CAMERAS, seed) for seed in VALIDATION[:few]])}
    if options.trials:
        stems += [kept_view(folder, TWO_CAMERAS, seed) for seed in CAMERAS_OF_TRIALS[:few]]
        stems += [stem for seed in TRIALS[:few] for stem in kept_trial(folder, seed)]
        validations["trials"] = Views([stem for seed in TRIALS_VALIDATION[:few] for stem in kept_trial(folder, seed)])
    views = Views(stems)
    digest = "" if options.start is None else hashlib.sha256(options.start.read_bytes()).hexdigest()[:16]
    plan = Plan(
        40 if options.quick else options.steps,
        options.batch,
        options.seed,
        len(views),
        digest,
        options.cluttered,
        options.trials,
    )
    run = Run(plan, out, options.start)
    take_steps(
        run,
        plan.steps,
        lambda: {"loss": run.train_step(views)},
        options.save_every,
        lambda: {name: overlap(run.averaged(), seen) for name, seen in validations.items()},
        600,
    )
