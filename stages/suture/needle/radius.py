"""Needles of other radii.

Masks fix a needle's place up to its size: a needle of radius r before eyes that stand b apart looks in every pixel like
one of the estimators' radius R before eyes R / r times as far apart, where all lengths are R / r times as long. So the
rig goes in with that baseline, and what comes out is measured back.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scenewright.stages.suture.needle.observation import NeedleEstimate
from scenewright.stages.suture.rig import NEEDLE_RADIUS, NeedlePose, StereoRig


def as_if_usual(rig: StereoRig, radius: float) -> StereoRig:
    """Return the rig before which a needle of the usual radius looks as one of `radius` [m] does before this one."""
    return rig if radius == NEEDLE_RADIUS else replace(rig, baseline=rig.baseline * NEEDLE_RADIUS / radius)


def pose_scaled(pose: NeedlePose, factor: float) -> NeedlePose:
    """Return the pose with lengths `factor` times as long."""
    moved = np.array(pose.camera_from_needle, dtype=float)
    moved[:3, 3] *= factor
    return NeedlePose(moved)


def in_metres(estimate: NeedleEstimate, radius: float) -> NeedleEstimate:
    """Return what an estimator said of a needle of `radius` [m] before the rig of `as_if_usual`."""
    if radius == NEEDLE_RADIUS:
        return estimate
    factor = radius / NEEDLE_RADIUS
    lengths = np.array([factor, factor, factor, 1.0, 1.0, 1.0])
    pose = None if estimate.pose is None else pose_scaled(estimate.pose, factor)
    return replace(estimate, pose=pose, covariance=estimate.covariance * np.outer(lengths, lengths))


def swage_of(pose: NeedlePose, radius: float) -> np.ndarray:
    """Return where the thread leaves a needle of `radius` [m]: (3,) [m]."""
    if radius == NEEDLE_RADIUS:
        return pose.swage
    return np.asarray(pose.centre + (pose.swage - pose.centre) * (radius / NEEDLE_RADIUS))
