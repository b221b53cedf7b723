"""Gaussians where the picture asks for more, fewer where they do nothing (Kerbl et al. 2023, section 5)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scenewright.stages.kit.rendering.splatting.gaussians import Gaussians

SPLIT, SHRINK = 2, 1.6
"""A Gaussian that is split becomes so many, each so much smaller."""


@dataclass(frozen=True)
class Density:
    """When and how Gaussians are added and removed; steps count from the first picture."""

    begin: int
    """First step."""
    every: int
    """Steps between."""
    gradient: float
    """Mean derivative of the loss by the centre, in half pictures, above which more are wanted."""
    size: float
    """Larger ones are split, smaller ones doubled [m]."""
    least_opacity: float
    """Fainter ones are removed."""
    largest: float
    """... and larger ones, once opacities were reset [m]."""
    reset_every: int = 0
    """Opacities are lowered to twice the least after so many of these rounds; 0: never."""
    most: int = 1_000_000
    """No more are added than make so many Gaussians."""


class Pull:
    """How strongly the loss pulled at each Gaussian's centre since the last round."""

    def __init__(self, count: int) -> None:
        self.sums, self.seen = np.zeros(count), np.zeros(count)

    def add(self, centers: np.ndarray, visible: np.ndarray, width: int, height: int) -> None:
        """Add derivatives (N, 2) [1/px] by the centres of what a picture of this size showed."""
        self.sums += np.linalg.norm(centers, axis=1) * 0.5 * max(width, height)
        self.seen += visible

    def extend(self, count: int) -> None:
        """Make room for Gaussians that were added at the end."""
        added = np.zeros(count - len(self.sums))
        self.sums, self.seen = np.concatenate([self.sums, added]), np.concatenate([self.seen, added])

    def keep(self, kept: np.ndarray) -> None:
        """Forget all Gaussians but these (N,)."""
        self.sums, self.seen = self.sums[kept], self.seen[kept]

    def means(self) -> np.ndarray:
        """Return the mean pull (N,)."""
        return self.sums / np.maximum(self.seen, 1)


def grown(
    gaussians: Gaussians, pull: np.ndarray, density: Density, random: np.random.Generator
) -> tuple[Gaussians, np.ndarray, np.ndarray]:
    """Return the Gaussians to add, the rows (M,) that they come from, and which (N,) make way for them."""
    pulled = pull > density.gradient
    room = max(0, density.most - len(gaussians))
    if pulled.sum() > room:
        rows = np.flatnonzero(pulled)
        pulled[:] = False
        pulled[rows[np.argsort(-pull[rows], kind="stable")[:room]]] = True
    large = np.exp(gaussians.log_scales.max(axis=1)) > density.size
    split, doubled = pulled & large, pulled & ~large
    halves = np.repeat(np.flatnonzero(split), SPLIT)
    halved = gaussians.taken(halves)
    offsets = random.standard_normal(halved.means.shape).astype(np.float32) * np.exp(halved.log_scales)
    halved.means += np.einsum("nij,nj->ni", _turns(halved.quaternions), offsets).astype(np.float32)
    halved.log_scales -= np.float32(np.log(SHRINK))
    return halved.joined(gaussians.taken(doubled)), np.concatenate([halves, np.flatnonzero(doubled)]), split


def useless(gaussians: Gaussians, density: Density, was_reset: bool) -> np.ndarray:
    """Return which Gaussians (N,) are to be removed."""
    faint = gaussians.logit_opacities < np.log(density.least_opacity / (1 - density.least_opacity))
    broken = ~np.isfinite(gaussians.means).all(axis=1) | ~np.isfinite(gaussians.log_scales).all(axis=1)
    if not was_reset:
        return faint | broken
    return faint | broken | (np.exp(gaussians.log_scales.max(axis=1)) > density.largest)


def _turns(quaternions: np.ndarray) -> np.ndarray:
    """Return rotation matrices (N, 3, 3) of quaternions (N, 4), w x y z."""
    w, x, y, z = (quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)).T
    rows = (
        (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
