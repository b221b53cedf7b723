"""Which rotations leave a shape as it is, and rotation errors that forgive them."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import permutations, product

import numpy as np
from scipy.spatial import cKDTree

TOLERANCE = 0.01
"""A rotation leaves a shape as it is when its points move off the shape by less than this share of the diagonal."""


@dataclass(frozen=True)
class Symmetry:
    """The proper rotations (about the middle of its box) after which a shape looks the same."""

    rotations: tuple[np.ndarray, ...] = (np.eye(3),)
    """(3, 3) each, in the model frame; the identity comes first. All are rotations of the cube."""
    round: bool = False
    """Whether every turn about z leaves the shape as it is."""


NO_SYMMETRY = Symmetry()


def cube_rotations() -> list[np.ndarray]:
    """Return the 24 rotations (3, 3) that map the coordinate axes onto themselves, the identity first."""
    rotations = []
    for order in permutations(range(3)):
        for signs in product((1.0, -1.0), repeat=3):
            rotation = np.zeros((3, 3))
            rotation[range(3), order] = signs
            if np.linalg.det(rotation) > 0:
                rotations.append(rotation)
    return rotations


def shape_symmetry(points: np.ndarray, tolerance: float = TOLERANCE) -> Symmetry:
    """Return the symmetry of a shape given by samples (N, 3) of its surface, in its model frame (z up).

    The 24 rotations of the cube about the middle of the box are tried, and for roundness the turns by 1/8 and 1/5
    about z. A rotation counts when the mean distance from rotated points to the nearest point grows by less than
    `tolerance` times the diagonal over that of the points among themselves.
    """
    low, high = points.min(axis=0), points.max(axis=0)
    centered = points - 0.5 * (low + high)
    size = high - low
    allowed = tolerance * float(np.linalg.norm(size))
    tree = cKDTree(centered)
    spacing = float(np.mean(tree.query(centered, k=2)[0][:, 1]))

    def leaves_it(rotation: np.ndarray) -> bool:
        if np.abs(np.abs(rotation) @ size - size).max() > 4 * allowed and _is_cube_rotation(rotation):
            return False  # another box cannot hold the same shape: saves the search
        return float(np.mean(tree.query(centered @ rotation.T)[0])) - spacing < allowed

    symmetries = [rotation for rotation in cube_rotations() if leaves_it(rotation)]
    identity = np.eye(3)
    others = [rotation for rotation in symmetries if not np.array_equal(rotation, identity)]
    is_round = leaves_it(_turn(np.pi / 4)) and leaves_it(_turn(2 * np.pi / 5))
    return Symmetry((identity, *others), is_round)


def symmetric_rotation_error(true: np.ndarray, estimated: np.ndarray, symmetry: Symmetry) -> tuple[float, np.ndarray]:
    """Return (angle [rad], rotation (3, 3)) between two orientations, modulo what leaves the true shape as it is.

    `true` and `estimated` are (3, 3) world_from_model. The angle is the smallest between `true @ g` and `estimated`
    over the rotations g of the symmetry, and `g` the one where it is smallest: `estimated` is about `true @ g`, so
    axis i of the true model lies along the axis j of the other with |g[i, j]| = 1. For round shapes only the
    directions of the z axes are compared.
    """
    best, best_rotation = np.inf, np.eye(3)
    for rotation in symmetry.rotations:
        turned = true @ rotation
        off = turned.T @ estimated
        angle = angle_between(off[:, 2], np.array([0.0, 0.0, 1.0])) if symmetry.round else rotation_angle(off)
        if angle < best - 1e-9:
            best, best_rotation = angle, rotation
    return best, best_rotation


def rotation_angle(rotation: np.ndarray) -> float:
    """Return the angle [rad] of a rotation (3, 3), in [0, pi]; from sine and cosine, exact near 0 and pi."""
    sine = 0.5 * np.linalg.norm(
        [rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0], rotation[1, 0] - rotation[0, 1]]
    )
    return float(np.arctan2(sine, 0.5 * (np.trace(rotation) - 1.0)))


def angle_between(a: np.ndarray, b: np.ndarray) -> float:
    """Return the angle [rad] between two directions (3,), in [0, pi]."""
    return float(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b))


def _turn(angle: float) -> np.ndarray:
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])


def _is_cube_rotation(rotation: np.ndarray) -> bool:
    return bool(np.isin(np.abs(rotation), (0.0, 1.0)).all())
