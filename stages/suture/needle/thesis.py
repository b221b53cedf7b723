"""The thesis's estimator of the needle's pose (Srinivas 2024, section 3.1), as it is written.

The mask applied to the disparity gives a point cloud; RANSAC fits a plane; the plane's inliers are projected onto it;
RANSAC fits a circle there; the two farthest of the circle's inliers are the endpoints; circle and endpoints are carried
back into space. The thesis states no thresholds and no iterations: ours were chosen on tuning seeds so that it does
best. It does not say which endpoint is the tip, so none is.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scenewright.stages.suture.needle.estimator import Estimator
from scenewright.stages.suture.needle.filter import difference
from scenewright.stages.suture.needle.observation import NeedleEstimate, NeedleObservation
from scenewright.stages.suture.rig import NeedlePose
from scipy.spatial.transform import Rotation

PLANE_THRESHOLD = 0.0010
"""Distance of an inlier from the plane [m]; by eye."""
CIRCLE_THRESHOLD = 0.0010
"""Distance of an inlier from the circle [m]; by eye."""
ROUNDS = 400
"""Rounds of each RANSAC; by eye."""


def thesis_estimate(observation: NeedleObservation, seed: int = 0) -> NeedleEstimate:
    """Return the thesis's estimate. Its covariance is unknown (infinite) and its tip a coin's toss."""
    observation.check()
    if observation.disparity is None:
        return NeedleEstimate.none("There is no disparity.")
    rows, columns = np.nonzero(observation.left_mask)
    disparity = observation.disparity[rows, columns]
    points = observation.rig.triangulate(np.stack([columns, rows], axis=1), disparity)
    points = points[np.isfinite(points).all(axis=1)]
    if len(points) < 3:
        return NeedleEstimate.none(f"Only {len(points)} points of the needle have a depth; a plane needs three.")
    random = np.random.default_rng(seed)
    fitted = ransac_plane(points, PLANE_THRESHOLD, ROUNDS, random)
    if fitted is None:
        return NeedleEstimate.none("The needle's points lie on one line: no plane is theirs.")
    origin, normal, inliers = fitted
    first = np.cross(normal, [1.0, 0.0, 0.0] if abs(normal[0]) < 0.7 else [0.0, 1.0, 0.0])
    first /= np.linalg.norm(first)
    second = np.cross(normal, first)
    flat = (points[inliers] - origin) @ np.stack([first, second], axis=1)
    circle = ransac_circle(flat, CIRCLE_THRESHOLD, ROUNDS, random)
    if circle is None:
        return NeedleEstimate.none("The needle's points in their plane lie on one line: no circle is theirs.")
    middle, _, on_circle = circle
    ends = farthest_pair(flat[on_circle])
    centre = origin + middle[0] * first + middle[1] * second
    tip, swage = (origin + end[0] * first + end[1] * second for end in ends)
    body = points[inliers].mean(axis=0) - centre
    return NeedleEstimate(_pose(centre, normal, tip, swage, body), np.full((6, 6), np.inf), 0.5, "")


def thesis_average(estimates: Sequence[NeedleEstimate], motions: Sequence[np.ndarray]) -> NeedleEstimate:
    """Return the mean of the thesis's estimates carried to the last frame: the thesis averages ten normals."""
    poses = [
        NeedlePose(motion @ estimate.pose.camera_from_needle)
        for estimate, motion in zip(estimates, motions, strict=True)
        if estimate.pose is not None
    ]
    if not poses:
        return NeedleEstimate.none("No frame shows the needle.")
    first = poses[-1]
    total = np.zeros(6)
    for pose in poses:
        straight, exchanged = difference(first, pose), difference(first, pose.swapped())
        total += straight if np.linalg.norm(straight[3:]) <= np.linalg.norm(exchanged[3:]) else exchanged
    mean = total / len(poses)
    matrix = first.camera_from_needle.copy()
    matrix[:3, :3] = Rotation.from_rotvec(mean[3:]).as_matrix() @ matrix[:3, :3]
    matrix[:3, 3] += mean[:3]
    return NeedleEstimate(NeedlePose(matrix), np.full((6, 6), np.inf), 0.5, "")


THESIS = Estimator(
    "the thesis's estimator", lambda observation, seed, guess: thesis_estimate(observation, seed), thesis_average
)


def _pose(centre: np.ndarray, normal: np.ndarray, tip: np.ndarray, swage: np.ndarray, body: np.ndarray) -> NeedlePose:
    """Return the pose whose ends lie nearest to `tip` and `swage` with the arc on the side of `body`."""
    x_axis = tip - swage
    x_axis = x_axis - (x_axis @ normal) * normal
    x_axis /= np.linalg.norm(x_axis) + 1e-15
    if np.cross(normal, x_axis) @ body < 0:
        normal = -normal
    matrix = np.eye(4)
    matrix[:3, :3] = np.stack([x_axis, np.cross(normal, x_axis), normal], axis=1)
    matrix[:3, 3] = centre
    return NeedlePose(matrix)


def ransac_plane(
    points: np.ndarray, threshold: float, rounds: int, random: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """Return (origin, unit normal, inliers (N,) bool) of the plane with most of points (N, 3) within `threshold`,
    refitted to them by least squares; None if all samples were degenerate."""
    triples = random.integers(0, len(points), (rounds, 3))
    a, b, c = points[triples[:, 0]], points[triples[:, 1]], points[triples[:, 2]]
    normals = np.cross(b - a, c - a)
    lengths = np.linalg.norm(normals, axis=1)
    usable = lengths > 1e-12
    if not usable.any():
        return None
    normals, a = normals[usable] / lengths[usable, None], a[usable]
    distances = np.abs(points @ normals.T - np.einsum("ij,ij->i", normals, a))
    best = int(np.argmax((distances < threshold).sum(axis=0)))
    inliers = distances[:, best] < threshold
    origin = points[inliers].mean(axis=0)
    normal = np.linalg.svd(points[inliers] - origin, full_matrices=False)[2][2]
    return origin, normal, inliers


def ransac_circle(
    flat: np.ndarray, threshold: float, rounds: int, random: np.random.Generator
) -> tuple[np.ndarray, float, np.ndarray] | None:
    """Return (centre (2,), radius, inliers (N,) bool) of the circle with most of points (N, 2) within `threshold`;
    None if all samples were degenerate. The radius is free, as in the thesis."""
    triples = random.integers(0, len(flat), (rounds, 3))
    a, b, c = flat[triples[:, 0]], flat[triples[:, 1]], flat[triples[:, 2]]
    ab, ac = b - a, c - a
    area = 2.0 * (ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0])
    usable = np.abs(area) > 1e-12
    if not usable.any():
        return None
    a, ab, ac, area = a[usable], ab[usable], ac[usable], area[usable]
    ab2, ac2 = (ab**2).sum(axis=1), (ac**2).sum(axis=1)
    offset = np.stack([ac[:, 1] * ab2 - ab[:, 1] * ac2, ab[:, 0] * ac2 - ac[:, 0] * ab2], axis=1) / area[:, None]
    centres, radii = a + offset, np.linalg.norm(offset, axis=1)
    gaps = np.abs(np.linalg.norm(flat[None] - centres[:, None], axis=2) - radii[:, None])
    best = int(np.argmax((gaps < threshold).sum(axis=1)))
    return centres[best], float(radii[best]), gaps[best] < threshold


def farthest_pair(flat: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the two points (2,) of (N, 2) that are farthest from each other."""
    squared = ((flat[:, None] - flat[None]) ** 2).sum(axis=2)
    first, second = np.unravel_index(int(np.argmax(squared)), squared.shape)
    return flat[first], flat[second]
