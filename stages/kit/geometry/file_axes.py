"""Units and axes of files of other people, by the names that options give them."""

from __future__ import annotations

import numpy as np
from scenewright.stages.kit.known_names import AxisName, UnitName

Direction = tuple[float, float, float]
UNITS: dict[UnitName, float] = {"m": 1.0, "dm": 0.1, "cm": 0.01, "mm": 0.001, "inch": 0.0254, "foot": 0.3048}
"""Metres a unit."""
AXES: dict[AxisName, Direction] = {
    "+x": (1.0, 0.0, 0.0),
    "-x": (-1.0, 0.0, 0.0),
    "+y": (0.0, 1.0, 0.0),
    "-y": (0.0, -1.0, 0.0),
    "+z": (0.0, 0.0, 1.0),
    "-z": (0.0, 0.0, -1.0),
}
"""Unit directions by the names that options give them."""


def upright_rotation(up: Direction) -> np.ndarray:
    """Return the rotation (3, 3) that turns `up` to z, the shortest way."""
    z, start = np.array([0.0, 0.0, 1.0]), np.asarray(up) / np.linalg.norm(up)
    turn, cosine = np.cross(start, z), float(start @ z)
    if np.linalg.norm(turn) < 1e-12:
        return np.eye(3) if cosine > 0 else np.diag([1.0, -1.0, -1.0])
    skew = np.array([[0, -turn[2], turn[1]], [turn[2], 0, -turn[0]], [-turn[1], turn[0], 0]])
    return clean(np.eye(3) + skew + skew @ skew / (1.0 + cosine))


def size_under(points: np.ndarray, up: Direction) -> np.ndarray:
    """Return the extents (3,), the last one upwards, of points (N, 3) in a frame with this up axis, in their unit."""
    return np.ptp(points @ upright_rotation(up).T, axis=0)


def clean(rotation: np.ndarray) -> np.ndarray:
    """Return the rotation with entries next to -1, 0 and 1 made exact: most models lie along their axes."""
    rounded = np.round(rotation)
    return np.where(np.abs(rotation - rounded) < 1e-9, rounded, rotation) + 0.0


def unit_name(unit: float) -> str:
    """Return `cm` for 0.01, the number of metres for an unnamed unit."""
    return next((name for name, metres in UNITS.items() if abs(metres - unit) < 1e-9 * metres), f"{unit:g} m")


def axis_name(direction: Direction) -> str:
    """Return `+z` and the like, numbers for a direction along no axis."""
    for name, axis in AXES.items():
        if np.allclose(direction, axis, atol=1e-6):
            return name
    return ",".join(f"{v:.2f}" for v in direction)


def size_text(size: np.ndarray) -> str:
    """Return extents as `0.44 x 0.47 x 0.91 m`."""
    return " x ".join(f"{v:.3g}" for v in size) + " m"
