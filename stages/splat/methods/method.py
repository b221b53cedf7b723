"""What makes one way of building a splat another."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scenewright.stages.kit.rendering.splatting.rasterizer import Picture
from scenewright.stages.splat.density import Density
from scenewright.stages.splat.losses import LossWeights
from scenewright.stages.splat.seeding import Seeds
from scenewright.stages.splat.views import PosedView

Seeding = Callable[[PosedView, Picture, np.ndarray, np.random.Generator], Seeds]
"""(new view, what the Gaussians so far show there, camera_from_world, random) -> Gaussians to add."""


@dataclass(frozen=True)
class Rate:
    """A learning rate that falls exponentially from `first` to `last` within `steps`."""

    first: float
    last: float | None = None
    steps: int = 30_000

    def at(self, step: int) -> float:
        """Return the rate of a step."""
        if self.last is None:
            return self.first
        return float(self.first * (self.last / self.first) ** min(step / self.steps, 1.0))


@dataclass(frozen=True)
class Method:
    """A way of building a splat out of posed pictures that arrive one after another."""

    seed: Seeding
    loss: LossWeights
    density: Density
    rates: dict[str, Rate]
    """Of means, quaternions, log scales, logits of opacity, and harmonics (higher degrees: /20)."""
    pose_rate: Rate
    degree_every: int
    """Steps after which colour may have harmonics of one degree more, up to 3."""
    visible_alone: bool
    """Move only Gaussians that the picture shows; else all are carried on by their momentum."""
    carried: bool
    """Where poses are adjusted, Gaussians go with the view that set them."""
