"""Adam over the arrays of Gaussians, row by row, whose rows come and go (Kingma & Ba 2015)."""

from __future__ import annotations

import numba
import numpy as np
from scenewright.stages.kit.compiled import compiled
from scenewright.stages.kit.rendering.splatting.gaussians import GaussianGradients, Gaussians

FIRST, SECOND, EPSILON = 0.9, 0.999, 1e-15
"""Decay of the moments, and what keeps the division finite: those of Kerbl et al. (2023)."""
HIGHER = 20.0
"""Coefficients of colour above degree 0 learn so much more slowly."""


class RowAdam:
    """Moments of every parameter of every Gaussian, and how often each Gaussian was moved."""

    def __init__(self) -> None:
        self.steps = np.zeros(0, np.int64)
        self.moments: dict[str, np.ndarray] = {}

    def extend(self, gaussians: Gaussians) -> None:
        """Make room for Gaussians, and for coefficients of their colours, that were added at the end."""
        for name, array in gaussians.arrays().items():
            moments = np.zeros((len(array), 2, int(np.prod(array.shape[1:]))), np.float32)
            earlier_moments = self.moments.get(name, moments[:0])
            moments[: len(earlier_moments), :, : earlier_moments.shape[2]] = earlier_moments
            self.moments[name] = moments
        self.steps = np.concatenate([self.steps, np.zeros(len(gaussians) - len(self.steps), np.int64)])

    def keep(self, rows: np.ndarray) -> None:
        """Keep the rows where a mask (N,) is true."""
        self.moments = {name: moments[rows] for name, moments in self.moments.items()}
        self.steps = self.steps[rows]

    def forget(self, name: str) -> None:
        """Set the moments of a parameter to zero."""
        self.moments[name][:] = 0

    def step(
        self, gaussians: Gaussians, gradients: GaussianGradients, rates: dict[str, float], moved: np.ndarray
    ) -> None:
        """Move the Gaussians where `moved` (N,) is true, in place, by the rate of each parameter; coefficients of
        colour above degree 0 by its HIGHER-th part."""
        self.steps[moved] += 1
        for name, rate in rates.items():
            array = getattr(gaussians, name)
            gradient = np.ascontiguousarray(getattr(gradients, name), np.float32).reshape(len(array), -1)
            columns = np.full(gradient.shape[1], rate, np.float32)
            if name == "harmonics":
                columns[3:] /= HIGHER
            if gradient.size:
                _step(array.reshape(len(array), -1), gradient, self.moments[name], self.steps, moved, columns)


@compiled(parallel=True)
def _step(values, gradients, moments, steps, moved, rates):  # type: ignore[no-untyped-def]
    """Move values (N, D) by the rates (D,) where `moved` (N,) is true; moments (N, 2, D) are kept up."""
    for row in numba.prange(len(values)):
        if not moved[row]:
            continue
        first, second = 1 - FIRST ** steps[row], 1 - SECOND ** steps[row]
        for k in range(values.shape[1]):
            gradient = gradients[row, k]
            moments[row, 0, k] = FIRST * moments[row, 0, k] + (1 - FIRST) * gradient
            moments[row, 1, k] = SECOND * moments[row, 1, k] + (1 - SECOND) * gradient * gradient
            scale = np.sqrt(moments[row, 1, k] / second) + EPSILON
            values[row, k] -= rates[k] * (moments[row, 0, k] / first) / scale
