"""Ours: a new picture is explained at once where it is not yet, and depth and cover count in the loss.

None are added by gradient: on the tuning log that made pictures that were learned better and those held out worse.
"""

from __future__ import annotations

import numpy as np
from scenewright.stages.kit.rendering.splatting.rasterizer import Picture
from scenewright.stages.splat.density import Density
from scenewright.stages.splat.losses import LossWeights
from scenewright.stages.splat.methods.method import Method, Rate
from scenewright.stages.splat.seeding import DEPTH_ERROR, Seeds, at_pixels, filled
from scenewright.stages.splat.views import PosedView

SPACING = 4
"""A Gaussian is set in each unexplained square of so many pixels."""
WIDTH = 0.5
"""Standard deviation of a new Gaussian, over the spacing; by eye."""
OPACITY = 0.7
"""Opacity of a new Gaussian; by eye."""
COVERED = 0.6
"""Alpha from which on a pixel counts as explained, unless what is shown lies behind the measured depth."""


def seed(view: PosedView, shown: Picture, camera_from_world: np.ndarray, random: np.random.Generator) -> Seeds:
    """Return a Gaussian as wide as its share of the picture in every square that the Gaussians so far do not explain.

    Where depth is unknown, the nearest known one is guessed.
    """
    measured = np.zeros(view.color.shape[:2], np.float32) if view.depth is None else view.depth
    depth = filled(measured)
    expected = shown.depth / np.maximum(shown.alpha, 1e-6)
    behind = (measured > 0) & (expected > measured * (1 + DEPTH_ERROR))
    open_pixels = ((shown.alpha < COVERED) | behind) & (depth > 0)
    height, width = depth.shape
    rows, columns = np.meshgrid(np.arange(0, height, SPACING), np.arange(0, width, SPACING), indexing="ij")
    jitter = random.integers(0, SPACING, (2, *rows.shape))
    pixels = np.stack([np.minimum(rows + jitter[0], height - 1), np.minimum(columns + jitter[1], width - 1)], axis=-1)
    pixels = pixels.reshape(-1, 2)
    pixels = pixels[open_pixels[pixels[:, 0], pixels[:, 1]]]
    deviations = WIDTH * SPACING * depth[pixels[:, 0], pixels[:, 1]] / view.camera.fx
    gaussians = at_pixels(view, pixels, depth, deviations, OPACITY, camera_from_world)
    return Seeds(gaussians, measured[pixels[:, 0], pixels[:, 1]] <= 0)


METHOD = Method(
    seed=seed,
    loss=LossWeights(similarity=0.2, depth=0.1, cover=0.02),
    density=Density(begin=300, every=100, gradient=0.0008, size=0.02, least_opacity=0.03, largest=0.8, most=0),
    rates={
        "means": Rate(1.6e-4, 1.6e-5),
        "quaternions": Rate(2e-3),
        "log_scales": Rate(1e-2, 2e-3),
        "logit_opacities": Rate(0.05),
        "harmonics": Rate(1e-2, 2.5e-3, 5000),
    },
    pose_rate=Rate(1e-3, 5e-5, 5000),
    degree_every=500,
    visible_alone=True,
    carried=True,
)
"""Our method's constants (docs/SPLATS.md)."""
