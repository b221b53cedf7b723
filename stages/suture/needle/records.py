"""Estimates as artifacts keep them, and back."""

from __future__ import annotations

import numpy as np
from scenewright.schemas.base import as_transform
from scenewright.schemas.suture_needle import NeedleEstimateRecord
from scenewright.stages.suture.needle.observation import NeedleEstimate
from scenewright.stages.suture.rig import NeedlePose


def as_estimate_record(answer: NeedleEstimate) -> NeedleEstimateRecord:
    """Return the record of an estimate; an infinite covariance becomes None."""
    bounded = bool(np.isfinite(answer.covariance).all())
    return NeedleEstimateRecord(
        camera_from_needle=None if answer.pose is None else as_transform(answer.pose.camera_from_needle),
        covariance=tuple(tuple(float(x) for x in row) for row in answer.covariance) if bounded else None,
        tip_probability=float(answer.tip_probability),
        abstained=answer.abstained,
    )


def as_estimate(record: NeedleEstimateRecord) -> NeedleEstimate:
    """Return the estimate of a record."""
    pose = None if record.camera_from_needle is None else NeedlePose(np.array(record.camera_from_needle))
    covariance = np.full((6, 6), np.inf) if record.covariance is None else np.array(record.covariance)
    return NeedleEstimate(pose, covariance, record.tip_probability, record.abstained)
