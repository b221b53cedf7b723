"""Figures of the camera path."""

from __future__ import annotations

import numpy as np
from scenewright.schemas.trajectory import PosesFile
from scenewright.stages.evaluate.results import Part
from scenewright.stages.kit.measurement.pose_error import trajectory_error
from scenewright.stages.kit.measurement.relative_pose_error import trajectory_drift


def measure_trajectory(
    part: Part, true_times: np.ndarray, true_poses: np.ndarray, times: np.ndarray, poses: np.ndarray
) -> None:
    """Record absolute error (as it is, and after rigid alignment), and relative error per second and per metre."""
    error = trajectory_error(true_times, true_poses, times, poses)
    part.set("poses_associated", error.associated if error else 0)
    part.set("ate_rmse_m", error.rmse if error else None)
    part.set("ate_rmse_aligned_m", error.rmse_aligned if error else None)
    part.set("rotation_error_mean_rad", error.rotation_mean if error else None)
    drift = trajectory_drift(true_times, true_poses, times, poses)
    for name, relative in (("second", drift.per_second), ("metre", drift.per_metre)):
        part.set(f"rpe_per_{name}_m", relative.translation_rmse if relative else None)
        part.set(f"rpe_per_{name}_rad", relative.rotation_mean if relative else None)


def count_poses(part: Part, info: PosesFile) -> None:
    """Record what an estimated trajectory says of itself."""
    part.set("frames", len(info.frames))
    part.set("frames_unposed", sum(frame.status == "unposed" for frame in info.frames))
    part.set("loops", sum(loop.weight >= 0.5 for loop in info.loops))
    part.set("drift_per_metre", info.drift)
