"""From key frames to every frame: poses, uncertainty, confidence, faults."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from scenewright.stages.kit.geometry.transforms import inverse
from scenewright.stages.kit.registration.alignment import Alignment
from scenewright.stages.kit.registration.pairs import with_systematic_error
from scenewright.stages.kit.registration.rigid_motion import between, fraction, orthonormal, skew
from scenewright.stages.poses.estimation import Estimate


@dataclass(frozen=True)
class FramePose:
    """One frame of the result."""

    frame: int
    world_from_camera: np.ndarray | None
    """None: no pose."""
    status: Literal["key", "tracked", "interpolated", "unposed"]
    fault: str = ""
    confidence: float = 0.0
    """Share of its depth that its key frame does not contradict, times how much of it was compared (0 to 1)."""
    uncertainty: float | None = None
    """Standard deviation of its position along an axis, beside the first key frame [m]."""


def largest_part(estimate: Estimate) -> int:
    """Return the part with most frames, the earliest of equals."""
    counts = np.zeros(int(estimate.parts.max(initial=-1)) + 1, dtype=int)
    for tracked in estimate.track.frames:
        if tracked.key is not None:
            counts[estimate.parts[tracked.key]] += 1
    return int(np.argmax(counts)) if len(counts) else -1


def frame_poses(estimate: Estimate) -> list[FramePose]:
    """Return the pose of every tracked frame, in order.

    A frame lies where its key frame and the next one of the same stretch put it: what optimisation changed between
    the two is spread over the frames between them, by their number.
    """
    main_part = largest_part(estimate)
    track, poses = estimate.track, estimate.world_from_key
    next_link = {link.target: link for link in track.links}
    own_link = {link.source: link.alignment for link in track.links}
    deviations = key_deviations(estimate)
    result = []
    for tracked in track.frames:
        key = tracked.key
        if key is None or estimate.parts[key] != main_part:
            result.append(FramePose(tracked.frame, None, "unposed", tracked.fault or "not_joined"))
            continue
        alignment, link = tracked.alignment, next_link.get(key)
        if alignment is None:
            pose, doubt = poses[key], 0.0
        else:
            pose, doubt = poses[key] @ tracked.key_from_frame, position_deviation(alignment)
            if link is not None:
                done = between(poses[key], poses[link.source]) @ inverse(link.alignment.target_from_source)
                span = track.keys[link.source].frame - track.keys[key].frame
                share = (tracked.frame - track.keys[key].frame) / span
                pose = poses[key] @ fraction(done, float(np.clip(share, 0, 1))) @ tracked.key_from_frame
        evidence = alignment or own_link.get(key)
        result.append(
            FramePose(
                tracked.frame,
                orthonormal(pose),
                "key" if alignment is None else "tracked",
                tracked.fault,
                confidence=1.0 if evidence is None else evidence.agreement * min(1.0, 2 * evidence.overlap),
                uncertainty=float(np.hypot(deviations[key], doubt)),
            )
        )
    return result


def key_deviations(estimate: Estimate) -> np.ndarray:
    """Return the standard deviation (K,) of each key frame's position along an axis [m], its part's first being exact.

    The covariances of the pose graph, scaled up where its edges contradict each other more than they claim.
    """
    covariances = estimate.solution.covariances
    result = np.zeros(len(covariances))
    for key, (covariance, pose) in enumerate(zip(covariances, estimate.world_from_key, strict=True)):
        # A left perturbation turns about the world's origin: at the camera it shifts by t + w x c.
        shift = np.hstack([-skew(pose[:3, 3]), np.eye(3)])
        result[key] = np.sqrt(max(float(np.trace(shift @ covariance @ shift.T)) / 3, 0.0))
    return result * np.sqrt(max(estimate.solution.variance_factor, 1.0))


def position_deviation(alignment: Alignment) -> float:
    """Return the standard deviation of a frame's position along an axis beside its key frame [m]."""
    covariance = np.linalg.inv(with_systematic_error(alignment.information))
    shift = np.hstack([-skew(alignment.target_from_source[:3, 3]), np.eye(3)])
    return float(np.sqrt(max(np.trace(shift @ covariance @ shift.T) / 3, 0.0)))
