"""Relative pose error: by how much a path drifts over a second, and over a metre (Sturm et al. 2012)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scenewright.stages.kit.measurement.pose_error import associate


@dataclass(frozen=True)
class RelativeError:
    """Errors of motions between two moments, over all pairs that lie that far apart."""

    translation_rmse: float
    """Root mean square of the translation errors [m]."""
    rotation_mean: float
    """Mean angle of the rotation errors [rad]."""
    pairs: int


def relative_error(
    true_poses: np.ndarray, poses: np.ndarray, places: np.ndarray, distance: float, slack: float
) -> RelativeError | None:
    """Compare motions of `poses` with those of `true_poses`, both (N, 4, 4) world_from_camera, pair by pair.

    `places` (N,) are ascending positions along the sequence, in seconds or metres. Each pose is paired with the first
    one at least `distance` farther on, unless that lies more than `slack` beyond. None without any pair.
    """
    ends = np.searchsorted(places, places + distance - 1e-9)
    starts = np.flatnonzero(ends < len(places))
    ends = ends[starts]
    is_close = places[ends] - places[starts] <= distance + slack
    starts, ends = starts[is_close], ends[is_close]
    if not len(starts):
        return None
    errors = _inverse(_motions(true_poses, starts, ends)) @ _motions(poses, starts, ends)
    traces = np.trace(errors[:, :3, :3], axis1=1, axis2=2)
    return RelativeError(
        translation_rmse=float(np.sqrt(np.mean(np.sum(errors[:, :3, 3] ** 2, axis=1)))),
        rotation_mean=float(np.arccos(np.clip((traces - 1.0) / 2.0, -1.0, 1.0)).mean()),
        pairs=len(starts),
    )


@dataclass(frozen=True)
class Drift:
    """Relative errors of one trajectory."""

    per_second: RelativeError | None
    per_metre: RelativeError | None
    """Over a metre of the true way."""


def trajectory_drift(
    true_times: np.ndarray, true_poses: np.ndarray, times: np.ndarray, poses: np.ndarray, tolerance: float = 0.02
) -> Drift:
    """Relative errors over 1 s and over 1 m of poses (M, 4, 4) at times (M,) [s] against (N, 4, 4) at (N,)."""
    true_rows, rows = associate(true_times, times, tolerance)
    truth, estimate = true_poses[true_rows], poses[rows]
    if len(rows) < 2:
        return Drift(None, None)
    travelled = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(truth[:, :3, 3], axis=0), axis=1))])
    return Drift(
        per_second=relative_error(truth, estimate, np.asarray(times)[rows], 1.0, 0.5),
        per_metre=relative_error(truth, estimate, travelled, 1.0, 0.5),
    )


def _motions(poses: np.ndarray, starts: np.ndarray, ends: np.ndarray) -> np.ndarray:
    return _inverse(poses[starts]) @ poses[ends]


def _inverse(poses: np.ndarray) -> np.ndarray:
    result = np.tile(np.eye(4), (len(poses), 1, 1))
    result[:, :3, :3] = np.swapaxes(poses[:, :3, :3], 1, 2)
    result[:, :3, 3] = -np.einsum("nij,nj->ni", result[:, :3, :3], poses[:, :3, 3])
    return result
