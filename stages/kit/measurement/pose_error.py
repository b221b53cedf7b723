"""Errors of poses: position, yaw, trajectories."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree


def yaw_of(rotation: np.ndarray) -> float:
    """Return the angle about world z that turns the x axis to where it points, in (-pi, pi]. `rotation` (3, 3)."""
    return float(np.arctan2(rotation[1, 0], rotation[0, 0]))


def yaw_error(true: float, estimated: float, period: float = 2.0 * np.pi) -> float:
    """Absolute difference of two yaw angles [rad] modulo `period`: pi for shapes that look the same after half a turn.

    The result lies in [0, period / 2]; period 0 (round shapes) gives 0.
    """
    if period == 0.0:
        return 0.0
    difference = (estimated - true) % period
    return float(min(difference, period - difference))


def rotation_period(points: np.ndarray, tolerance: float = 0.01) -> float:
    """Return after which turn about z (through the origin) a shape looks the same: 2 pi, pi, pi / 2, or 0 for any turn.

    `points` (N, 3): surface samples in the model frame, whose origin is the middle of the footprint. A turn counts
    when the mean distance from turned points to the nearest point grows by less than `tolerance` times the diagonal
    over that of the points among themselves. Turns by 1/8 and 1/5 stand for any turn.
    """
    tree = cKDTree(points)
    diagonal = float(np.linalg.norm(np.ptp(points, axis=0)))
    spacing = float(np.mean(tree.query(points, k=2)[0][:, 1]))

    def same_after(angle: float) -> bool:
        cosine, sine = np.cos(angle), np.sin(angle)
        turned = points @ np.array([[cosine, sine, 0.0], [-sine, cosine, 0.0], [0.0, 0.0, 1.0]])
        return float(np.mean(tree.query(turned)[0])) - spacing < tolerance * diagonal

    if same_after(np.pi / 4) and same_after(2 * np.pi / 5):
        return 0.0
    if same_after(np.pi / 2):
        return float(np.pi / 2)
    return float(np.pi) if same_after(np.pi) else float(2 * np.pi)


def position_error(true: np.ndarray, estimated: np.ndarray) -> tuple[float, float]:
    """Return (distance in space, distance in the ground plane) of two (3,) positions [m]."""
    difference = np.asarray(estimated, dtype=float) - np.asarray(true, dtype=float)
    return float(np.linalg.norm(difference)), float(np.linalg.norm(difference[:2]))


def align_rigidly(source: np.ndarray, target: np.ndarray) -> np.ndarray:
    """Return the (4, 4) target_from_source of least squares, without scale (Umeyama 1991). Points (N, 3).

    Raises ValueError for fewer than three points.
    """
    if len(source) < 3 or source.shape != target.shape:
        raise ValueError(f"rigid alignment needs two equal sets of three points or more, got {source.shape}")
    source_mean, target_mean = source.mean(axis=0), target.mean(axis=0)
    u, _, vt = np.linalg.svd((target - target_mean).T @ (source - source_mean))
    flip = np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ vt)) or 1.0])
    rotation = u @ flip @ vt
    result = np.eye(4)
    result[:3, :3] = rotation
    result[:3, 3] = target_mean - rotation @ source_mean
    return result


@dataclass(frozen=True)
class TrajectoryError:
    """Absolute trajectory error over associated poses (Sturm 2012)."""

    rmse: float
    """Root mean square distance of the camera centres as they are [m]."""
    rmse_aligned: float
    """The same after rigid alignment [m]."""
    rotation_mean: float
    """Mean angle between the orientations as they are [rad]."""
    associated: int


def associate(true_times: np.ndarray, times: np.ndarray, tolerance: float = 0.02) -> tuple[np.ndarray, np.ndarray]:
    """Pair each time (M,) with the nearest true time (N, sorted) within `tolerance` [s]. Returns two index arrays."""
    if not len(true_times) or not len(times):
        return np.zeros(0, dtype=int), np.zeros(0, dtype=int)
    right = np.clip(np.searchsorted(true_times, times), 0, len(true_times) - 1)
    before = np.maximum(right - 1, 0)
    nearest = np.where(np.abs(true_times[before] - times) <= np.abs(true_times[right] - times), before, right)
    matched = np.nonzero(np.abs(true_times[nearest] - times) <= tolerance)[0]
    return nearest[matched], matched


def trajectory_error(
    true_times: np.ndarray, true_poses: np.ndarray, times: np.ndarray, poses: np.ndarray, tolerance: float = 0.02
) -> TrajectoryError | None:
    """Absolute trajectory error of poses (M, 4, 4) world_from_camera at times (M,) against (N, 4, 4) at (N,).

    Returns None when fewer than three poses can be associated.
    """
    true_rows, rows = associate(true_times, times, tolerance)
    if len(rows) < 3:
        return None
    truth, estimate = true_poses[true_rows], poses[rows]
    centres, true_centres = estimate[:, :3, 3], truth[:, :3, 3]
    aligned = align_rigidly(centres, true_centres)
    moved = centres @ aligned[:3, :3].T + aligned[:3, 3]
    traces = np.einsum("nij,nij->n", truth[:, :3, :3], estimate[:, :3, :3])
    angles = np.arccos(np.clip((traces - 1.0) / 2.0, -1.0, 1.0))
    return TrajectoryError(
        rmse=float(np.sqrt(np.mean(np.sum((centres - true_centres) ** 2, axis=1)))),
        rmse_aligned=float(np.sqrt(np.mean(np.sum((moved - true_centres) ** 2, axis=1)))),
        rotation_mean=float(angles.mean()),
        associated=len(rows),
    )
