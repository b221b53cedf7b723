"""Cubic splines through noisy samples with a prior on their bend, and how sure they are (Eilers and Marx 1996)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline
from scipy.linalg import solveh_banded

DEGREE = 3
"""Degree of the splines."""
ROUNDS = 5
"""Rounds in which samples are weighed anew; by eye."""
FLAT = 1e-9
"""Added to the information's diagonal, so that what nothing determines can be solved."""


@dataclass(frozen=True)
class FittedSpline:
    """A cubic B-spline and its coefficients' covariance; `residuals` (N,) of the samples in standard deviations."""

    spline: BSpline
    covariance: np.ndarray
    residuals: np.ndarray

    def deviation(self, places: np.ndarray) -> np.ndarray:
        """Return the standard deviation (M,) of the spline's value at `places` (M,)."""
        knots = self.spline.t
        # rounding may put the last place beyond the last knot
        inside = np.clip(places, knots[DEGREE], knots[-DEGREE - 1])
        design = BSpline.design_matrix(inside, knots, DEGREE).toarray()
        return np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", design, self.covariance, design), 0.0))


def fitted(
    places: np.ndarray,
    values: np.ndarray,
    deviations: np.ndarray,
    end: float,
    spacing: float,
    bend: float,
    scale: float = np.inf,
) -> FittedSpline:
    """Return the spline over [0, end] with knots about `spacing` apart through (places (N,), values (N,)).

    `deviations` (N,) are the values' standard deviations, `bend` that of the second derivative (the prior). With a
    finite `scale` samples far off lose their weight (Cauchy's, at so many standard deviations).
    """
    pieces = max(round(end / spacing), 1)
    step = end / pieces
    knots = step * np.arange(-DEGREE, pieces + DEGREE + 1)
    design = BSpline.design_matrix(np.clip(places, knots[DEGREE], knots[-DEGREE - 1]), knots, DEGREE).toarray()
    size = pieces + DEGREE
    second = np.diff(np.eye(size), 2, axis=0) / (bend * step**2)
    prior = second.T @ second
    weights = 1.0 / np.asarray(deviations, dtype=float) ** 2
    trust = np.ones(len(values))
    for _ in range(ROUNDS if np.isfinite(scale) else 1):
        information = (design * (weights * trust)[:, None]).T @ design + prior
        # a straight line is free of the prior: far too weak a one keeps the system regular without samples
        information[np.diag_indices(size)] += FLAT
        right = design.T @ (weights * trust * values)
        coefficients = _solve_banded(information, right[:, None])[:, 0]
        residuals = (values - design @ coefficients) * np.sqrt(weights)
        if np.isfinite(scale):
            trust = 1.0 / (1.0 + (residuals / scale) ** 2)
    covariance = _solve_banded(information, np.eye(size))
    return FittedSpline(BSpline(knots, coefficients, DEGREE), covariance, residuals)


def _solve_banded(information: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Return the solution (N, K) of the symmetric system whose matrix has DEGREE diagonals on either side."""
    bands = np.zeros((DEGREE + 1, len(information)))
    for offset in range(min(DEGREE + 1, len(information))):
        bands[DEGREE - offset, offset:] = np.diagonal(information, offset)
    return np.asarray(solveh_banded(bands, right))
