"""Making the world upright: from a stated axis, from the floor, or from how the camera was held.

The floor is the lowest well-supported plane whose normal agrees with the cameras' mean up: the largest plane of a
room is a wall or a table (7-Scenes kitchen).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scenewright.stages.kit.geometry.cells import cell_keys
from scenewright.stages.kit.geometry.planes import PlaneFit, plane_distances, ransac_plane
from scenewright.stages.kit.geometry.transforms import rotation_between, transform_from

MAXIMUM_TILT = math.radians(35.0)
"""Largest angle between the floor's normal and the cameras' mean up."""
PARALLEL_ANGLE = math.radians(6.0)
"""Horizontal surfaces of one room are parallel within this, as measured by a handheld depth camera."""
DISTANCE_THRESHOLD = 0.03
"""Thickness of a plane [m]: noise of structured light at 3 m and a little drift of the poses."""
MAXIMUM_PLANES = 8
"""Most planes that are looked at for the floor; by eye."""
MINIMUM_SHARE = 0.015
"""A plane with fewer of the (5 cm grid) points is not well supported."""
BELOW_SHARE = 0.05
"""Share of points farther than 10 cm below a plane over which it is a table, not the floor."""
AXES = {
    "x": (1.0, 0.0, 0.0),
    "-x": (-1.0, 0.0, 0.0),
    "y": (0.0, 1.0, 0.0),
    "-y": (0.0, -1.0, 0.0),
    "z": (0.0, 0.0, 1.0),
    "-z": (0.0, 0.0, -1.0),
}
"""Up directions by the names that the option gives them."""


@dataclass(frozen=True)
class FloorFit:
    """The floor in the log's world: up is the normal, and normal.p + offset is the height over the floor [m]."""

    normal: np.ndarray
    offset: float
    inlier_count: int
    residual: float
    """Root mean square distance of the inliers [m]."""
    below_share: float
    """Share of the points further than 10 cm below."""


def mean_camera_up(world_from_camera: np.ndarray) -> np.ndarray | None:
    """Return the unit mean (3,) of -y of the cameras (N, 4, 4), or None when they cancel out."""
    total = -world_from_camera[:, :3, 1].mean(axis=0)
    length = float(np.linalg.norm(total))
    return total / length if length > 0.2 else None


def grid_samples(points: np.ndarray, normals: np.ndarray, size: float) -> tuple[np.ndarray, np.ndarray]:
    """Return one point (M, 3) and its normal for every occupied cell of a grid of `size` [m], in cell order."""
    _, first = np.unique(cell_keys(points, size), return_index=True)
    return points[first], normals[first]


def find_floor(points: np.ndarray, normals: np.ndarray, up: np.ndarray, random: np.random.Generator) -> FloorFit | None:
    """Return the floor among points (N, 3) [m] with unit normals that face the camera, or None.

    Upward-facing planes near `up` are taken out one by one; the direction in which parallel ones have most support
    is vertical, and the lowest of these that leaves almost nothing below is the floor.
    """
    facing = np.flatnonzero(normals @ up > math.cos(MAXIMUM_TILT + PARALLEL_ANGLE))
    if len(facing) < 50:
        return None
    planes = _horizontal_planes(points[facing], normals[facing], up, MINIMUM_SHARE * len(points), random)
    if not planes:
        return None
    cosine = math.cos(PARALLEL_ANGLE)
    support = [sum(len(q.inliers) for q in planes if q.normal @ p.normal > cosine) for p in planes]
    vertical = planes[int(np.argmax(support))].normal
    candidates = []
    for plane in planes:
        if plane.normal @ vertical > cosine:
            below = float((plane_distances(points, plane.normal, plane.offset) < -0.1).mean())
            candidates.append((below, plane))
    below, floor = min(candidates, key=lambda pair: pair[0])
    if below > BELOW_SHARE:
        return None
    distances = plane_distances(points[facing][floor.inliers], floor.normal, floor.offset)
    residual = float(np.sqrt((distances**2).mean()))
    return FloorFit(floor.normal, float(floor.offset), len(floor.inliers), residual, below)


def _horizontal_planes(
    points: np.ndarray, normals: np.ndarray, up: np.ndarray, least: float, random: np.random.Generator
) -> list[PlaneFit]:
    planes: list[PlaneFit] = []
    remaining = np.arange(len(points))
    while len(planes) < MAXIMUM_PLANES and len(remaining) > least:
        plane = ransac_plane(
            points[remaining],
            distance_threshold=DISTANCE_THRESHOLD,
            iterations=1000,
            random=random,
            normals=normals[remaining],
            normal_weight=0.05,
            direction=up,
            maximum_angle=MAXIMUM_TILT,
        )
        if plane is None or len(plane.inliers) < max(least, 20):
            break
        sign = 1.0 if plane.normal @ up > 0 else -1.0
        planes.append(PlaneFit(sign * plane.normal, sign * plane.offset, remaining[plane.inliers]))
        keep = np.ones(len(remaining), dtype=bool)
        keep[plane.inliers] = False
        remaining = remaining[keep]
    return planes


def wall_yaw(normals: np.ndarray) -> float | None:
    """Return the angle [rad] in (-45, 45] degrees by which walls are turned from the x and y axes, or None.

    `normals` (N, 3) are in an upright world. The horizontal ones vote modulo 90 degrees; None when fewer than a
    third of them agree within 7.5 degrees, or fewer than 200 vote.
    """
    horizontal = normals[np.abs(normals[:, 2]) < 0.2]
    if len(horizontal) < 200:
        return None
    quarter = math.pi / 2
    angles = np.arctan2(horizontal[:, 1], horizontal[:, 0]) % quarter
    bins = 90
    histogram = np.bincount((angles / quarter * bins).astype(int) % bins, minlength=bins).astype(float)
    kernel = np.ones(15) / 15
    smooth = np.convolve(np.concatenate([histogram[-7:], histogram, histogram[:7]]), kernel, mode="valid")
    peak = (float(np.argmax(smooth)) + 0.5) / bins * quarter
    difference = (angles - peak + quarter / 2) % quarter - quarter / 2
    close = np.abs(difference) < math.radians(7.5)
    if close.mean() < 1 / 3:
        return None
    yaw = (peak + float(np.median(difference[close]))) % quarter
    return yaw - quarter if yaw > quarter / 2 else yaw


def upright_from_floor(floor: FloorFit) -> np.ndarray:
    """Return world_from_log (4, 4): the smallest rotation that makes the floor's normal z, and z = 0 on the floor."""
    rotation = rotation_between(floor.normal, np.array([0.0, 0.0, 1.0]))
    return transform_from(rotation, np.array([0.0, 0.0, floor.offset]))


def upright_from_direction(up: np.ndarray, points: np.ndarray | None = None) -> np.ndarray:
    """Return world_from_log (4, 4) that makes `up` (3,) z; with points (N, 3) their lowest percentile gets z = 0."""
    rotation = rotation_between(up, np.array([0.0, 0.0, 1.0]))
    height = 0.0 if points is None or len(points) == 0 else -float(np.percentile(points @ rotation[2], 1.0))
    return transform_from(rotation, np.array([0.0, 0.0, height]))
