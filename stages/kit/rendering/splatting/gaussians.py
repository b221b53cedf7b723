"""Gaussians in space, and gradients of a loss with respect to them."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np


@dataclass
class Gaussians:
    """N Gaussians, as they are optimised."""

    means: np.ndarray
    """(N, 3) [m], world."""
    quaternions: np.ndarray
    """(N, 4) w x y z, of any length but zero: world_from_gaussian."""
    log_scales: np.ndarray
    """(N, 3): logarithms of standard deviations along its axes [m]."""
    logit_opacities: np.ndarray
    """(N,): opacity is the logistic function of it."""
    harmonics: np.ndarray
    """(N, K, 3), K = (degree + 1)^2: colour by direction, less 0.5 (`harmonics.py`)."""
    features: np.ndarray
    """(N, F): further channels, rendered like colour; F may be 0."""

    def __post_init__(self) -> None:
        """Raise ValueError for arrays that do not belong together."""
        count, basis = len(self.means), self.harmonics.shape[1] if self.harmonics.ndim == 3 else 0
        expected = {
            "means": (count, 3),
            "quaternions": (count, 4),
            "log_scales": (count, 3),
            "logit_opacities": (count,),
            "harmonics": (count, basis, 3),
            "features": (count, self.features.shape[-1]),
        }
        for name, shape in expected.items():
            if getattr(self, name).shape != shape:
                raise ValueError(f"{name} has shape {getattr(self, name).shape}, expected {shape}")
        if basis not in (1, 4, 9, 16):
            raise ValueError(f"{basis} harmonics a colour, expected 1, 4, 9 or 16")

    def __len__(self) -> int:
        return len(self.means)

    def arrays(self) -> dict[str, np.ndarray]:
        """Return every array by name, in the order of the fields."""
        return {field.name: getattr(self, field.name) for field in fields(self)}

    def taken(self, rows: np.ndarray) -> Gaussians:
        """Return the Gaussians of these rows, or where a mask (N,) is true."""
        return Gaussians(**{name: array[rows] for name, array in self.arrays().items()})

    def joined(self, others: Gaussians) -> Gaussians:
        """Return these and, after them, the others."""
        theirs = others.arrays()
        return Gaussians(**{name: np.concatenate([array, theirs[name]]) for name, array in self.arrays().items()})


@dataclass(frozen=True)
class GaussianGradients:
    """Derivatives of a loss by what `Gaussians` holds, shape for shape, and by the camera."""

    means: np.ndarray
    quaternions: np.ndarray
    log_scales: np.ndarray
    logit_opacities: np.ndarray
    harmonics: np.ndarray
    features: np.ndarray
    centers: np.ndarray
    """(N, 2): by where its centre stands in the picture [1/px]; what asks for more Gaussians."""
    twist: np.ndarray
    """(6,): by a small motion of the camera, (translation [m], rotation [rad]): camera_from_world becomes
    exp(twist) camera_from_world."""
