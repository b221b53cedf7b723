"""What depth of real cameras is wrong by, beyond the noise of the generated logs, at the levels of real logs.

Levels: `python -m benchmarks.depth_errors` on the annotated logs; docs/results/mapping.md. A camera has one set of
faults.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scenewright.schemas.scene_parts import Camera

BIAS = 0.013
"""Largest share by which depth is too long or too short: kitchen, living room and office differ by as much."""
BENDING = 0.010
"""Largest 1/z by which a plane bends at the corner of the picture [1/m]: that of the kitchen."""
SHIFT = 8.0
"""Largest shift of the picture against the depth, along each axis [pixels at 640 width]: that of the office."""


@dataclass(frozen=True)
class DepthFaults:
    """The faults of one camera."""

    bias: float
    bending: float
    shift: tuple[float, float]

    def depth(self, depth: np.ndarray, camera: Camera) -> np.ndarray:
        """Return depth (H, W) [m] scaled and bent: 1/z' = 1/z - bending * r^2, r = 1 at the corner; 0 stays 0."""
        v, u = np.mgrid[0 : camera.height, 0 : camera.width]
        square = ((u - camera.cx) ** 2 + (v - camera.cy) ** 2) / (camera.cx**2 + camera.cy**2)
        with np.errstate(divide="ignore"):
            bent = 1.0 / (1.0 / depth.astype(float) - self.bending * square)
        return np.where(depth > 0, (1.0 + self.bias) * bent, 0.0).astype(np.float32)

    def shifted(self, ids: np.ndarray) -> np.ndarray:
        """Return masks (H, W) as a picture beside the depth has them; nothing comes in over the border."""
        du, dv = (round(value * ids.shape[1] / 640) for value in self.shift)
        moved = np.roll(ids, (dv, du), (0, 1))
        moved[: max(dv, 0)], moved[:, : max(du, 0)] = 0, 0
        if dv < 0:
            moved[dv:] = 0
        if du < 0:
            moved[:, du:] = 0
        return moved


def drawn_faults(random: np.random.Generator) -> DepthFaults:
    """Return faults drawn evenly up to the levels, of either sign."""
    bias, bending, du, dv = random.uniform(-1.0, 1.0, 4) * [BIAS, BENDING, SHIFT, SHIFT]
    return DepthFaults(float(bias), float(bending), (float(du), float(dv)))
