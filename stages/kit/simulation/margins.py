"""How sure a verdict of physics is: the distance to its threshold, in units of the spread over runs that begin a
little otherwise. A pose from a map is exact to millimetres; what a tenth of one decides is decided by chance."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

RUNS = 8
"""Runs that begin a little otherwise."""
SHIFT, TURN = 1e-4, np.radians(0.01)
"""By how much each pose begins otherwise [m], [rad]: a tenth of what Bullet pads meshes with, less than poses are known
by, and a thousand times what floats round away."""
MARGINAL = 2.0
"""A verdict nearer to its threshold than this reads marginal."""
LARGEST = 99.0
"""Margins are not told beyond this."""


def margin(value: float, limit: float, values: Sequence[float]) -> float:
    """Return the distance of `value` to `limit` in standard deviations of the runs' `values`, from 0 to `LARGEST`."""
    spread, distance = float(np.std(values, ddof=1)), abs(value - limit)
    return float(min(distance / spread, LARGEST)) if spread > 0.0 else LARGEST


def perturbed(pose: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Return a pose (4, 4) shifted by `SHIFT` and turned about its origin by `TURN`, each in a random direction."""
    shift, axis = (direction / np.linalg.norm(direction) for direction in random.normal(size=(2, 3)))
    near = pose.copy()
    near[:3, 3] += SHIFT * shift
    near[:3, :3] = Rotation.from_rotvec(TURN * axis).as_matrix() @ pose[:3, :3]
    return near


def is_marginal(found: float | None) -> bool:
    """Whether a verdict with this margin reads marginal; without one it is far from its threshold."""
    return found is not None and found < MARGINAL
