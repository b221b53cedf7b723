"""Ranking-based CAD matching: equations 2.7 to 2.10 of Han 2024."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import permutations, product

import numpy as np
from scenewright.stages.cad.shapes import Observed, Planes, Shape
from scenewright.stages.kit.geometry.transforms import transform_from_yaw
from scipy.optimize import linear_sum_assignment

FORBIDDEN = 1e6
"""Cost of assigning a supporting plane to one that does not support."""
SUPPORTING_UNMATCHED = 3.0
"""A supporting plane without partner costs so many times what another one costs."""
UPWARD = 0.9
"""-a_th: a plane of the turned model supports when its normal points up at least this much."""


@dataclass(frozen=True)
class Match:
    """One oriented CAD candidate."""

    shape: Shape
    frame: Observed
    orientation: int
    """Index into `cube_rotations`."""
    error: float
    pairs: tuple[tuple[int, int], ...]
    """f_Pi: (plane of x, plane of y)."""

    @property
    def tilt(self) -> float:
        """d_b of equation 2.10."""
        return upright_error(CUBE_ROTATIONS[self.orientation])


def cube_rotations() -> np.ndarray:
    """Return the 24 rotations (24, 3, 3) of a cube; the first four are upright, by quarter turns about z."""
    rotations = []
    for order in permutations(range(3)):
        for signs in product((1.0, -1.0), repeat=3):
            matrix = np.zeros((3, 3))
            matrix[range(3), order] = signs
            if np.linalg.det(matrix) > 0:
                rotations.append(matrix)

    def upright_first(matrix: np.ndarray) -> tuple[float, float]:
        return -round(matrix[2, 2]), round(float(np.arctan2(matrix[1, 0], matrix[0, 0])) % (2 * np.pi), 6)

    return np.array(sorted(rotations, key=upright_first))


CUBE_ROTATIONS = cube_rotations()
"""The 24 turns of a cube onto itself (24, 3, 3); the first four are upright."""


def size_error(size_x: np.ndarray, size_y: np.ndarray) -> float:
    """Equation 2.8: distance of the relative box sizes, each (3,)."""
    return float(np.linalg.norm(size_x / np.linalg.norm(size_x) - size_y / np.linalg.norm(size_y)))


def plane_costs(
    normals_x: np.ndarray, offsets_x: np.ndarray, normals_y: np.ndarray, offsets_y: np.ndarray
) -> np.ndarray:
    """Return the summand of equation 2.9 for all pairs (P, Q); offsets are already divided by the box diagonals."""
    return np.abs(offsets_x[:, None] - offsets_y[None, :]) + 1.0 - normals_x @ normals_y.T


def assign_planes(
    costs: np.ndarray, supporting_x: np.ndarray, supporting_y: np.ndarray, unmatched: float | None
) -> tuple[float, tuple[tuple[int, int], ...]] | None:
    """Return (d_pi, f_Pi) of equation 2.9 for costs (P, Q), or None when no admissible assignment exists.

    Jonker-Volgenant on the cost matrix; supporting planes of x only go to supporting planes of y. `unmatched`: the
    cost of leaving a plane of x out; None demands an injection, so that models with fewer planes are rejected.
    """
    count_x, count_y = costs.shape
    if count_x == 0:
        return 0.0, ()
    if unmatched is None and count_y < count_x:
        return None
    costs = np.where(supporting_x[:, None] & ~supporting_y[None, :], FORBIDDEN, costs)
    if unmatched is not None:
        # One private way out for each plane of x. What carries something needs a partner more than the rest, but a
        # plane that only noise or a misjudged support made must not cost a table every model.
        spare = np.full((count_x, count_x), FORBIDDEN)
        np.fill_diagonal(spare, np.where(supporting_x, SUPPORTING_UNMATCHED * unmatched, unmatched))
        costs = np.concatenate([costs, spare], axis=1)
    rows, columns = linear_sum_assignment(costs)
    chosen = costs[rows, columns]
    if np.any(chosen >= FORBIDDEN):
        return None
    pairs = tuple((int(r), int(c)) for r, c in zip(rows, columns, strict=True) if c < count_y)
    return float(chosen.sum()), pairs


def upright_error(rotation: np.ndarray) -> float:
    """Equation 2.10: d_b = 1 + g . z(y); 0 upright, 1 on its side, 2 upside down. `rotation` (3, 3)."""
    return 1.0 - float(rotation[2, 2])


def matching_error(
    frame: Observed, shape: Shape, rotation: np.ndarray, weights: tuple[float, float, float], unmatched: float | None
) -> tuple[float, tuple[tuple[int, int], ...]] | None:
    """Return (D(x, y), f_Pi) of equation 2.7 for y turned by `rotation` (3, 3) in the frame of x, or None."""
    frame_from_world = transform_from_yaw(-frame.yaw, np.zeros(3))[:3, :3]
    size_y = np.abs(rotation) @ shape.size
    turned = shape.planes.normals @ rotation.T
    supporting = shape.planes.supporting if rotation[2, 2] > UPWARD else turned[:, 2] >= UPWARD
    x: Planes = frame.planes
    costs = plane_costs(
        x.normals @ frame_from_world.T,
        x.offsets / np.linalg.norm(frame.size),
        turned,
        shape.planes.offsets / np.linalg.norm(shape.size),
    )
    assigned = assign_planes(costs, x.supporting, supporting, unmatched)
    if assigned is None:
        return None
    plane_error, pairs = assigned
    error = (
        weights[0] * size_error(frame.size, size_y) + weights[1] * plane_error + weights[2] * upright_error(rotation)
    )
    return error, pairs


def rank_matches(
    frames: list[Observed],
    shapes: list[Shape],
    *,
    weights: tuple[float, float, float],
    unmatched: float | None,
    scale_range: tuple[float, float],
    keep: int,
    upright_only: bool = False,
) -> tuple[list[Match], dict[str, int]]:
    """Return the `keep` oriented candidates with the least matching error, and why others were discarded.

    Every shape (model and state) is tried in 24 orientations (with `upright_only` in the 4 upright ones) and every
    frame of the object. Ties fall to the model's
    name, then the order of states, frames and orientations.
    """
    matches: list[Match] = []
    rotations = CUBE_ROTATIONS[:4] if upright_only else CUBE_ROTATIONS
    rejected = {"no admissible plane assignment": 0, "scale out of range": 0}
    for shape in shapes:
        for frame in frames:
            ratio = float(np.linalg.norm(frame.size) / np.linalg.norm(shape.size))
            if not scale_range[0] <= ratio <= scale_range[1]:
                rejected["scale out of range"] += len(rotations)
                continue
            for orientation, rotation in enumerate(rotations):
                error_and_pairs = matching_error(frame, shape, rotation, weights, unmatched)
                if error_and_pairs is None:
                    rejected["no admissible plane assignment"] += 1
                else:
                    matches.append(Match(shape, frame, orientation, *error_and_pairs))
    matches.sort(key=lambda match: match.error)
    rejected["matching rank"] = max(0, len(matches) - keep)
    return matches[:keep], rejected
