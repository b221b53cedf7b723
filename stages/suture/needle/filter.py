"""One pose from several frames, of which some may be wrong.

Every frame's estimate is carried to the last frame by the motion the arm's kinematics report for the needle between
them. The estimate with which most others agree (by their covariances) is the seed; those that agree are averaged on the
tangent space, weighted by their information. Errors that frames share (the calibration's) do not shrink: the fused
covariance keeps a floor. Tip or swage is decided by the sum of the frames' log-odds.
"""

from __future__ import annotations

import numpy as np
from scenewright.stages.suture.needle.observation import NeedleEstimate
from scenewright.stages.suture.rig import NeedlePose
from scipy.spatial.transform import Rotation

STEP_SHIFT, STEP_TURN = 0.0002, np.radians(0.5)
"""What the kinematics' motion from frame to frame is off by: standard deviations [m], [rad]."""
SHARED = 0.25
"""Share of a frame's variance that all frames have in common."""
AGREES = 16.8
"""Squared Mahalanobis distance (6 degrees of freedom, 99 %) within which two frames agree."""
LEAST_SHIFT, LEAST_TURN = 0.00015, np.radians(0.6)
"""What two frames may differ by beside their covariances: standard deviations [m], [rad]."""


def difference(pose: NeedlePose, other: NeedlePose) -> np.ndarray:
    """Return (6,): the shift [m] of the centre and the rotation vector [rad], camera frame, from `pose` to `other`."""
    turn = Rotation.from_matrix(other.camera_from_needle[:3, :3] @ pose.camera_from_needle[:3, :3].T).as_rotvec()
    return np.concatenate([other.centre - pose.centre, turn])


def moved(pose: NeedlePose, step: np.ndarray) -> NeedlePose:
    """Return `pose` moved by `step` (6,) as `difference` gives it."""
    matrix = pose.camera_from_needle.copy()
    matrix[:3, :3] = Rotation.from_rotvec(step[3:]).as_matrix() @ matrix[:3, :3]
    matrix[:3, 3] += step[:3]
    return NeedlePose(matrix)


def _carry_to_last(estimate: NeedleEstimate, motion: np.ndarray, steps: int) -> tuple[NeedlePose, np.ndarray]:
    """Return an estimate's pose and covariance in the last frame, `steps` frames later."""
    assert estimate.pose is not None
    rotation = np.kron(np.eye(2), motion[:3, :3])
    drift = np.diag([STEP_SHIFT**2] * 3 + [STEP_TURN**2] * 3) * steps
    floor = np.diag([LEAST_SHIFT**2] * 3 + [LEAST_TURN**2] * 3)
    return NeedlePose(
        motion @ estimate.pose.camera_from_needle
    ), rotation @ estimate.covariance @ rotation.T + drift + floor


def either_way(pose: NeedlePose, other: NeedlePose) -> tuple[np.ndarray, bool]:
    """Return the difference to `other`, or to it with tip and swage exchanged where that is the smaller turn."""
    straight, exchanged = difference(pose, other), difference(pose, other.swapped())
    if np.linalg.norm(exchanged[3:]) < np.linalg.norm(straight[3:]):
        return exchanged, True
    return straight, False


def fuse(frames: list[tuple[NeedleEstimate, np.ndarray]]) -> NeedleEstimate:
    """Return the pose in the last frame of `frames`: estimates, oldest first, each with the motion (4, 4; camera frame,
    as the kinematics report it) that carries the needle from its frame to the last one.

    Frames that abstained count if they have a guess, with their own (large) covariance. Abstains if no frame has one,
    or if fewer than half of them agree.
    """
    usable = []
    for age, (estimate, motion) in enumerate(reversed(frames)):
        if estimate.pose is not None and np.isfinite(estimate.covariance).all():
            usable.append((*_carry_to_last(estimate, motion, age), estimate))
    if not usable:
        return NeedleEstimate.none("No frame shows the needle.")
    groups = []
    for pose, covariance, _ in usable:
        agreeing = []
        for index, (other_pose, other_covariance, _) in enumerate(usable):
            step, exchanged = either_way(pose, other_pose)
            if step @ np.linalg.solve(covariance + other_covariance, step) < AGREES:
                agreeing.append((index, exchanged))
        # sure frames count for more than unsure ones, which agree with anything
        trust = sum(0.0 if usable[index][2].abstained else 1.0 for index, _ in agreeing) + 0.1 * len(agreeing)
        groups.append((trust - 1e6 * np.trace(covariance[:3, :3]), agreeing, pose))
    _, agreeing, pose = max(groups, key=lambda group: group[0])
    pose, covariance, odds = _average(pose, agreeing, usable)
    if odds < 0:
        pose = pose.swapped()
    reason = ""
    if 2 * len(agreeing) < len(usable):
        reason = f"Only {len(agreeing)} of {len(usable)} frames agree."
    return NeedleEstimate(pose, covariance, float(1.0 / (1.0 + np.exp(-min(abs(odds), 30.0)))), reason)


def _average(
    pose: NeedlePose, agreeing: list[tuple[int, bool]], usable: list[tuple[NeedlePose, np.ndarray, NeedleEstimate]]
) -> tuple[NeedlePose, np.ndarray, float]:
    """Return the agreeing frames' mean, its covariance, and the log-odds that its tip is the tip."""
    odds = 0.0
    information = np.zeros((6, 6))
    for _ in range(3):
        information[:] = 0.0
        pull, odds = np.zeros(6), 0.0
        for index, exchanged in agreeing:
            other_pose, covariance, estimate = usable[index]
            step = difference(pose, other_pose.swapped() if exchanged else other_pose)
            distance = float(step @ np.linalg.solve(covariance, step))
            weight = np.linalg.inv(covariance) / (1.0 + distance / 12.0)
            information += weight
            pull += weight @ step
            sure = float(np.log(estimate.tip_probability / max(1.0 - estimate.tip_probability, 1e-6)))
            odds += -sure if exchanged else sure
        pose = moved(pose, np.linalg.solve(information, pull))
    # what the frames share does not shrink with their number
    fused = np.linalg.inv(information)
    return pose, fused * (1.0 - SHARED) + SHARED * fused * len(agreeing), odds
