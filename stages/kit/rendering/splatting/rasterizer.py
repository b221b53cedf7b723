"""What rendering splats means: the same in every implementation.

A Gaussian's covariance is projected by the Jacobian of the pinhole camera at its centre, at directions no farther out
than 15 % of the picture beyond its edge (EWA splatting, Zwicker et al. 2001), and widened by DILATION. At a pixel its
alpha is opacity x exp(-distance^2 / 2), at most LARGEST_ALPHA; below SMALLEST_ALPHA it is not there. From front to
back by z-depth of the centres every channel collects transmittance x alpha x value, until the transmittance would fall
below LEAST_TRANSMITTANCE. The constants are gsplat's. Pixel centres stand at integer coordinates (`Camera`). Colour
depends on the direction to the centre; the loss is not differentiated through that direction.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.kit.rendering.splatting.gaussians import GaussianGradients, Gaussians

DILATION = 0.3
"""Added to both variances in the picture [px^2]."""
SMALLEST_ALPHA = 1.0 / 255.0
"""Opacity below which a Gaussian is not drawn on a pixel (gsplat)."""
LARGEST_ALPHA = 0.999
"""Largest opacity of a Gaussian on a pixel (gsplat)."""
LEAST_TRANSMITTANCE = 1e-4
"""Transmittance below which a pixel is done (gsplat)."""
NEAR = 0.05
"""What is nearer to the camera's plane is not drawn [m]."""
MARGIN = 0.15
"""How far beyond the picture's edge, over its size, the Jacobian is taken at the centre itself."""


@dataclass(frozen=True)
class View:
    """Where the picture is taken from."""

    camera: Camera
    camera_from_world: np.ndarray
    """(4, 4)."""
    background: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Colour behind everything; other channels have 0 there."""


@dataclass(frozen=True)
class Picture:
    """What was rendered, or derivatives of a loss by it."""

    color: np.ndarray
    """(H, W, 3), not clipped at 1."""
    depth: np.ndarray
    """(H, W): sum of weight x z-depth of centres [m]; over `alpha` it is the expected depth."""
    alpha: np.ndarray
    """(H, W): sum of weights, 0 to 1."""
    features: np.ndarray
    """(H, W, F)."""


class Drawn(Protocol):
    """A picture, and the way back from it."""

    picture: Picture
    visible: np.ndarray
    """(N,) bool: whether a pixel of the picture lies within its reach, hidden or not."""

    def backward(self, gradients: Picture) -> GaussianGradients:
        """Return the derivatives of a loss by the Gaussians and the camera, given those by the picture."""
        ...


class Rasterizer(Protocol):
    """Draws Gaussians."""

    def draw(self, gaussians: Gaussians, view: View) -> Drawn:
        """Return what the view shows. Raises ValueError for a picture without pixels."""
        ...


def direction_limits(camera: Camera) -> tuple[float, float, float, float]:
    """Return least and greatest x/z, then y/z, at which the Jacobian is taken.

    The edge of the picture lies half a pixel beyond its outermost centres.
    """
    cx, cy = camera.cx + 0.5, camera.cy + 0.5
    return (
        -cx / camera.fx - MARGIN * camera.width / camera.fx,
        (camera.width - cx) / camera.fx + MARGIN * camera.width / camera.fx,
        -cy / camera.fy - MARGIN * camera.height / camera.fy,
        (camera.height - cy) / camera.fy + MARGIN * camera.height / camera.fy,
    )
