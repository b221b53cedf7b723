"""LEGS (Srinivas 2024, chapter 9, and its public code): constants of docs/SPLATS.md's table."""

from __future__ import annotations

import numpy as np
from scenewright.stages.kit.rendering.splatting.rasterizer import Picture
from scenewright.stages.splat.density import Density
from scenewright.stages.splat.losses import LossWeights
from scenewright.stages.splat.methods.method import Method, Rate
from scenewright.stages.splat.seeding import Seeds, at_pixels
from scenewright.stages.splat.views import PosedView

PIXELS, DEVIATION, OPACITY = 500, 0.02, 0.2
"""Pixels with depth at which a new picture seeds Gaussians, their standard deviation [m] and their opacity."""


def seed(view: PosedView, shown: Picture, camera_from_world: np.ndarray, random: np.random.Generator) -> Seeds:
    """Return a Gaussian of 2 cm at each of 500 random pixels with depth."""
    depth = np.zeros(view.color.shape[:2], np.float32) if view.depth is None else view.depth
    with_depth = np.argwhere(depth > 0)
    pixels = with_depth[np.sort(random.permutation(len(with_depth))[:PIXELS])]
    gaussians = at_pixels(view, pixels, depth, np.full(len(pixels), DEVIATION), OPACITY, camera_from_world)
    return Seeds(gaussians, np.zeros(len(pixels), bool))


METHOD = Method(
    seed=seed,
    loss=LossWeights(similarity=0.2),
    density=Density(begin=500, every=100, gradient=0.0008, size=0.01, least_opacity=0.1, largest=0.8, reset_every=30),
    rates={
        "means": Rate(1.6e-4, 1.6e-6),
        "quaternions": Rate(1e-3),
        "log_scales": Rate(5e-3, 1e-3),
        "logit_opacities": Rate(0.05),
        "harmonics": Rate(2.5e-3),
    },
    pose_rate=Rate(1e-3, 5e-5),
    degree_every=1000,
    visible_alone=False,
    carried=False,
)
"""The thesis's constants (docs/SPLATS.md)."""
