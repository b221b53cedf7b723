"""Figures of the camera path."""

from __future__ import annotations

import numpy as np

from stages.evaluate.results import Part
from stages.kit.measurement.pose_error import trajectory_error


def measure_trajectory(
    part: Part, true_times: np.ndarray, true_poses: np.ndarray, times: np.ndarray, poses: np.ndarray
) -> None:
    """Record absolute trajectory error (as it is, and after rigid alignment) and mean rotation error."""
    error = trajectory_error(true_times, true_poses, times, poses)
    part.set("poses_associated", error.associated if error else 0)
    part.set("ate_rmse_m", error.rmse if error else None)
    part.set("ate_rmse_aligned_m", error.rmse_aligned if error else None)
    part.set("rotation_error_mean_rad", error.rotation_mean if error else None)
