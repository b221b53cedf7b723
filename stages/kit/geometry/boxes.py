"""Gravity-aligned boxes: minimum box of points, corners, footprints, exact overlap of two boxes."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike
from scenewright.schemas.hand_written import UprightBox
from scenewright.schemas.scene_parts import Box
from scipy.spatial import ConvexHull, QhullError
from scipy.spatial.transform import Rotation

TILT_TOLERANCE = 1e-6
"""How far (as 1 - cosine) a box's z axis may lean before it no longer counts as gravity-aligned."""


def box_from_bounds(minimum: ArrayLike, maximum: ArrayLike) -> Box:
    """Return the axis-aligned box between two corners (3,) [m]. Raises ValueError when minimum > maximum."""
    low, high = np.asarray(minimum, dtype=float).reshape(3), np.asarray(maximum, dtype=float).reshape(3)
    if np.any(low > high):
        raise ValueError(f"box minimum {low} exceeds maximum {high}")
    return gravity_aligned_box((low + high) / 2.0, high - low, 0.0)


def gravity_aligned_box(center: ArrayLike, size: ArrayLike, yaw: float) -> Box:
    """Return the box with `center` (3,) [m], full edge lengths `size` (3,) [m], turned by `yaw` [rad] about z."""
    cx, cy, cz = (float(v) for v in np.asarray(center, dtype=float))
    sx, sy, sz = (float(v) for v in np.asarray(size, dtype=float))
    half = 0.5 * float(yaw)
    return Box(center=(cx, cy, cz), orientation=(0.0, 0.0, math.sin(half), math.cos(half)), size=(sx, sy, sz))


def upright_box(written: UprightBox) -> Box:
    """Return a box that was written by hand as other artifacts have it."""
    return gravity_aligned_box(written.center, written.size, math.radians(written.yaw_degrees))


def minimum_box(points: np.ndarray) -> Box:
    """Return the gravity-aligned box of points (N, 3) [m] whose footprint has the least area.

    The footprint is the minimum-area rectangle of the convex hull of (x, y) (one side lies on a hull edge), the
    height is the extent in z: gravity-aligned form of the minimal box of Han 2024, section 2.2.2. The yaw is in
    [-pi/4, pi/4), so that the same points always give the same axes. Raises ValueError without points or when
    they are not finite.
    """
    points = np.asarray(points, dtype=float).reshape(-1, 3)
    if len(points) == 0:
        raise ValueError("no points to put a box around")
    if not np.isfinite(points).all():
        raise ValueError("points are not finite")
    center, size, yaw = minimum_rectangle(points[:, :2])
    low, high = points[:, 2].min(), points[:, 2].max()
    return gravity_aligned_box((*center, (low + high) / 2.0), (*size, high - low), yaw)


def minimum_rectangle(points: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Return (center (2,), size (2,), yaw) of the least-area rectangle around points (N, 2), N >= 1.

    `yaw` is in [-pi/4, pi/4). Collinear points give a rectangle of width 0 along their line.
    """
    points = np.asarray(points, dtype=float).reshape(-1, 2)
    hull = convex_hull(points)
    edges = np.roll(hull, -1, axis=0) - hull
    edges = edges[np.linalg.norm(edges, axis=1) > 0] if len(hull) > 1 else np.array([[1.0, 0.0]])
    # All directions modulo a quarter turn; rounding folds equal edges so that ties resolve the same way everywhere.
    angles = np.arctan2(edges[:, 1], edges[:, 0])
    angles = np.unique(np.round((angles + math.pi / 4) % (math.pi / 2) - math.pi / 4, 12))
    angles = angles[np.argsort(np.abs(angles), kind="stable")]
    cosine, sine = np.cos(angles), np.sin(angles)
    along = hull @ np.stack([cosine, sine])
    across = hull @ np.stack([-sine, cosine])
    length, width = np.ptp(along, axis=0), np.ptp(across, axis=0)
    area = length * width
    # Within rounding the angle nearest to the axes wins.
    best = int(np.flatnonzero(area <= area.min() + 1e-12 + 1e-9 * area.min())[0])
    middle = np.array(
        [(along[:, best].min() + along[:, best].max()) / 2, (across[:, best].min() + across[:, best].max()) / 2]
    )
    rotation = np.array([[cosine[best], -sine[best]], [sine[best], cosine[best]]])
    return rotation @ middle, np.array([length[best], width[best]]), float(angles[best])


def box_at_yaw(points: np.ndarray, yaw: float) -> Box:
    """Return the gravity-aligned box of points (N, 3) [m], N >= 1, whose axes are turned by `yaw` [rad] about z."""
    cosine, sine = math.cos(yaw), math.sin(yaw)
    world_from_box = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    turned = np.asarray(points, dtype=float) @ world_from_box
    low, high = turned.min(axis=0), turned.max(axis=0)
    return gravity_aligned_box(world_from_box @ ((low + high) / 2.0), high - low, yaw)


def turned_to(box: Box, yaw: float) -> Box:
    """Return the box turned about its own vertical axis until its yaw is `yaw` [rad]."""
    return gravity_aligned_box(box.center, box.size, yaw)


def is_round(points: np.ndarray, tolerance: float = 0.05) -> bool:
    """Whether points (N, 2) are as wide in every direction, within the share `tolerance`: a bottle, a bowl; a cup with
    a handle is not, nor is a square, which is 41 % wider along its diagonal."""
    hull = convex_hull(points)
    angles = np.arange(0.0, math.pi, math.radians(5.0))
    widths = np.ptp(hull @ np.stack([np.cos(angles), np.sin(angles)]), axis=0)
    return bool(widths.max() <= (1.0 + tolerance) * widths.min())


def convex_hull(points: np.ndarray) -> np.ndarray:
    """Return the hull vertices (K, 2) of points (N, 2), counter-clockwise; K is 1 or 2 for degenerate input."""
    points = np.asarray(points, dtype=float).reshape(-1, 2)
    if len(points) >= 3:
        try:
            return points[ConvexHull(points).vertices]
        except QhullError:  # all on one line, or in one point
            pass
    points = np.unique(points, axis=0)
    if len(points) <= 2:
        return points
    # Collinear: the two ends along the direction of largest spread.
    centred = points - points.mean(axis=0)
    direction = np.linalg.svd(centred, full_matrices=False)[2][0]
    order = np.argsort(centred @ direction, kind="stable")
    return points[[order[0], order[-1]]]


def box_rotation(box: Box) -> np.ndarray:
    """Return the (3, 3) rotation world_from_box."""
    return Rotation.from_quat(box.orientation).as_matrix()


def box_yaw(box: Box) -> float:
    """Return the rotation of a gravity-aligned box about z [rad], in (-pi, pi].

    Raises ValueError when the box leans.
    """
    rotation = box_rotation(box)
    if rotation[2, 2] < 1.0 - TILT_TOLERANCE:
        raise ValueError("the box is not gravity-aligned")
    return math.atan2(rotation[1, 0], rotation[0, 0])


def box_corners(box: Box) -> np.ndarray:
    """Return the corners (8, 3) [m] in the world frame: x varies slowest, z fastest, minimum first."""
    signs = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
    return (signs * np.asarray(box.size)) @ box_rotation(box).T + np.asarray(box.center)


def footprint(box: Box) -> np.ndarray:
    """Return the ground rectangle (4, 2) [m] of a gravity-aligned box, counter-clockwise."""
    yaw = box_yaw(box)
    cosine, sine = math.cos(yaw), math.sin(yaw)
    half_x, half_y = box.size[0] / 2, box.size[1] / 2
    local = np.array([[-half_x, -half_y], [half_x, -half_y], [half_x, half_y], [-half_x, half_y]])
    return local @ np.array([[cosine, sine], [-sine, cosine]]) + np.asarray(box.center[:2])


def bottom(box: Box) -> float:
    """Return the height of the bottom face of a gravity-aligned box [m]."""
    return box.center[2] - box.size[2] / 2


def top(box: Box) -> float:
    """Return the height of the top face of a gravity-aligned box [m]."""
    return box.center[2] + box.size[2] / 2


def box_volume(box: Box) -> float:
    """Return the volume [m^3]."""
    return float(np.prod(box.size))


def with_extent(box: Box, low: float, high: float) -> Box:
    """Return the same footprint between the heights `low` and `high` [m]. Raises ValueError when low > high."""
    if low > high:
        raise ValueError(f"box bottom {low} is above its top {high}")
    return gravity_aligned_box(
        (box.center[0], box.center[1], (low + high) / 2), (box.size[0], box.size[1], high - low), box_yaw(box)
    )


def refined_box(box: Box, height: float, maximum_extension: float) -> Box:
    """Return the box with its bottom on the plane at `height` [m], top and footprint kept (equation 2.1 holds).

    Boxes grow downwards by at most `maximum_extension` [m] (beyond that the box stays as observed, it is no missing
    leg any more). A bottom below the plane is raised to it: points below a supporting surface are noise. A box that
    lies wholly below the plane stays.
    """
    low, high = box.center[2] - box.size[2] / 2, top(box)
    if height >= high or low - height > maximum_extension:
        return box
    return with_extent(box, height, high)


def transform_points_to_box(box: Box, points: np.ndarray) -> np.ndarray:
    """Return world points (N, 3) [m] in the frame of the box (origin at its centre)."""
    return (np.asarray(points, dtype=float) - np.asarray(box.center)) @ box_rotation(box)


def points_in_box(box: Box, points: np.ndarray, margin: float = 0.0) -> np.ndarray:
    """Return (N,) bool: which world points (N, 3) lie in the box grown by `margin` [m] on every side."""
    local = np.abs(transform_points_to_box(box, points))
    return np.all(local <= np.asarray(box.size) / 2 + margin, axis=1)


def polygon_area(polygon: np.ndarray) -> float:
    """Return the signed area of a simple polygon (K, 2), positive when counter-clockwise; 0 when K < 3."""
    if len(polygon) < 3:
        return 0.0
    x, y = polygon[:, 0] - polygon[0, 0], polygon[:, 1] - polygon[0, 1]
    return float(0.5 * np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


def clip_polygon(subject: np.ndarray, clip: np.ndarray) -> np.ndarray:
    """Return the part of polygon `subject` (K, 2) inside the convex counter-clockwise polygon `clip` (M, 2).

    Sutherland-Hodgman; exact for convex subjects. An empty (0, 2) array means that they do not meet.
    """
    result = [np.asarray(point, dtype=float) for point in subject]
    for start, end in zip(clip, np.roll(clip, -1, axis=0), strict=True):
        if not result:
            break
        edge = end - start
        side = [edge[0] * (p[1] - start[1]) - edge[1] * (p[0] - start[0]) for p in result]
        clipped: list[np.ndarray] = []
        for k, point in enumerate(result):
            before = k - 1
            if (side[k] >= 0) != (side[before] >= 0):
                share = side[before] / (side[before] - side[k])
                clipped.append(result[before] + share * (point - result[before]))
            if side[k] >= 0:
                clipped.append(point)
        result = clipped
    return np.array(result).reshape(-1, 2)


def footprint_overlap(a: Box, b: Box) -> float:
    """Return the area [m^2] in which the footprints of two gravity-aligned boxes meet."""
    reach = math.hypot(*a.size[:2]) / 2 + math.hypot(*b.size[:2]) / 2
    if math.hypot(a.center[0] - b.center[0], a.center[1] - b.center[1]) >= reach:
        return 0.0
    return max(0.0, polygon_area(clip_polygon(footprint(a), footprint(b))))


def boxes_overlap_volume(a: Box, b: Box) -> float:
    """Return the volume [m^3] that two gravity-aligned boxes share (exact)."""
    height = min(top(a), top(b)) - max(bottom(a), bottom(b))
    return height * footprint_overlap(a, b) if height > 0 else 0.0


def box_iou(a: Box, b: Box) -> float:
    """Return intersection over union in [0, 1] of two gravity-aligned boxes (exact polygon clipping).

    Two boxes without volume have 0.
    """
    shared = boxes_overlap_volume(a, b)
    union = box_volume(a) + box_volume(b) - shared
    return float(np.clip(shared / union, 0.0, 1.0)) if union > 0 else 0.0
