"""Making the world upright: from a stated axis, from the floor, or from how the camera was held.

The floor is the lowest well-supported level plane: the largest plane of a room is a wall or a table (7-Scenes kitchen).
Planes are fitted freely, wherever the cameras look, and then asked whether they may be level: a limit on the fit itself
would cut a slanted slice out of a floor that lies outside of it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from scenewright.stages.kit.geometry.cells import cell_keys
from scenewright.stages.kit.geometry.planes import PlaneFit, plane_distances, ransac_plane
from scenewright.stages.kit.geometry.transforms import rotation_between, transform_from

MAXIMUM_TILT = math.radians(35.0)
"""Largest angle between a level plane's normal and the cameras' up, however they were held."""
MAXIMUM_LEAN = math.radians(65.0)
"""The same where the cameras' x axes lie in the plane: a camera that looks down is level all the same. More is a wall
in front of a camera that looks up."""
HELD_LEVEL = math.radians(15.0)
"""Root mean square angle of the cameras' x axes to a plane that they lie in."""
PARALLEL_ANGLE = math.radians(6.0)
"""Horizontal surfaces of one room are parallel within this, as measured by a handheld depth camera."""
AXIS_ANGLE = math.radians(1.0)
"""A plane that is level to this with an axis of the log's world makes that axis up: it is no accident."""
SAME_HEIGHT = 0.01
"""A floor nearer than this to z = 0 of a log whose z is up is at 0 [m]."""
DISTANCE_THRESHOLD = 0.03
"""Thickness of a plane [m]: noise of structured light at 3 m and a little drift of the poses."""
POOR_FIT = 0.8 * DISTANCE_THRESHOLD / math.sqrt(3)
"""Residual [m] from which a plane is a slice of what is none: points all over the thickness have 1 / sqrt(3) of it."""
MAXIMUM_PLANES = 12
"""Most planes that are looked at for the floor; by eye."""
MINIMUM_SHARE = 0.015
"""A plane with fewer of the (5 cm grid) points is not well supported."""
PLAIN_SHARE = 0.1
"""Share of the points with which a plane square to the log's z is level where nothing agrees with the cameras' up."""
BELOW_SHARE = 0.05
"""Share of points farther than 10 cm below a plane over which it is a table, not the floor."""
NEARLY_LEVEL = math.radians(10.0)
"""A log whose axis is so near to up was meant to be level."""
LEAST_TURN = 0.17
"""Cameras whose x axes leave their common line by less (root mean square cosine, 10 degrees) did not turn about."""
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
    axis: str | None = None
    """Axis of the log's world that the normal is, where a level plane said so."""
    on_side: bool = False
    """Whether it is the floor of cameras that lie on their side."""
    rival: str | None = None
    """What may be up instead, as the cameras may lie on their side: an axis of the log's world, or some plane."""

    @property
    def is_lowest(self) -> bool:
        """Whether almost nothing lies below; else it is a table, and the floor was not seen."""
        return self.below_share <= BELOW_SHARE


def camera_up(world_from_camera: np.ndarray) -> np.ndarray | None:
    """Return the unit direction (3,) that is up by how the cameras (N, 4, 4) were held, or None when they cancel out.

    Cameras that turned about and were held level have x axes that are square to up, wherever they looked (total least
    squares, the method `vertical` of nerfstudio); else it is the mean of -y, which leans with cameras that look down.
    Where that cancels out, cameras that turned about on their side have y axes that are square to up.
    """
    mean = -world_from_camera[:, :3, 1].mean(axis=0)
    forward = world_from_camera[:, :3, 2].mean(axis=0)
    turned, pole = _turned_about(world_from_camera[:, :3, 0])
    if math.isfinite(turned):
        side = float(pole @ mean)
        if abs(side) < LEAST_TURN:  # they look straight down, or every way
            side = -float(pole @ forward)
        if abs(side) >= LEAST_TURN:
            return pole * math.copysign(1.0, side)
    length = float(np.linalg.norm(mean))
    if length > 0.2:
        return mean / length
    turned, pole = _turned_about(world_from_camera[:, :3, 1])
    return -pole * math.copysign(1.0, float(pole @ forward)) if math.isfinite(turned) else None


def on_their_side(world_from_camera: np.ndarray) -> bool | None:
    """Whether cameras (N, 4, 4) turned about on their side, as phones held upright, and not level; None where they
    turned too little to tell."""
    level, side = (_turned_about(world_from_camera[:, :3, axis])[0] for axis in (0, 1))
    return side < level if math.isfinite(min(level, side)) else None


def _turned_about(axes: np.ndarray) -> tuple[float, np.ndarray]:
    """Return how far unit axes (N, 3) lie off a plane in which they turned, as a share of the turn, and the normal of
    that plane; infinite where they did not."""
    _, spread, directions = np.linalg.svd(axes, full_matrices=True)
    spread = np.append(spread, np.zeros(3))[:3] / math.sqrt(max(len(axes), 1))
    turned = spread[1] > LEAST_TURN and spread[2] < spread[1] / 3
    return float(spread[2] / spread[1]) if turned else math.inf, directions[2]


def grid_samples(points: np.ndarray, normals: np.ndarray, size: float) -> tuple[np.ndarray, np.ndarray]:
    """Return one point (M, 3) and its normal for every occupied cell of a grid of `size` [m], in cell order."""
    _, first = np.unique(cell_keys(points, size), return_index=True)
    return points[first], normals[first]


def find_floor(
    points: np.ndarray,
    normals: np.ndarray,
    up: np.ndarray,
    random: np.random.Generator,
    world_from_camera: np.ndarray | None = None,
) -> FloorFit | None:
    """Return the floor among points (N, 3) [m] with unit normals that face the camera, or None without a level plane.

    Planes that may be level by `up` (3,) and the cameras (M, 4, 4) are taken out one by one; the direction in which
    parallel ones have most support is vertical, unless an axis of the log's world lies along a plane of as much; the
    lowest of these is the floor. Where much lies below even that, it says which way is up all the same.
    """
    poses = np.zeros((0, 4, 4)) if world_from_camera is None else world_from_camera
    facing = normals @ up > math.cos(MAXIMUM_LEAN + PARALLEL_ANGLE)
    planes = [p for p in _planes(points, normals, facing, random) if _may_be_level(p.normal, up, poses[:, :3, 0])]
    axes = {} if _is_world_of_a_camera(poses) else {name: np.array(axis) for name, axis in AXES.items()}
    if axes and not planes:
        planes = _plain_planes(points, normals, axes["z"], poses[:, :3, 0], random)
    upright = _lowest_level(points, planes, up, axes) if planes else None
    return _of_cameras_on_their_side(upright, points, normals, poses, axes, random)


def _lowest_level(points: np.ndarray, planes: list[PlaneFit], up: np.ndarray, axes: dict[str, np.ndarray]) -> FloorFit:
    """Return the lowest of the planes that are square to what most support is for."""
    cosine = math.cos(PARALLEL_ANGLE)
    support = [sum(len(q.inliers) for q in planes if q.normal @ p.normal > cosine) for p in planes]
    # Of a plane that the cameras' up leans from, less is believed.
    weight = [size * max(float(p.normal @ up), 0.1) for size, p in zip(support, planes, strict=True)]
    chosen = int(np.argmax(weight))
    vertical, name = planes[chosen].normal, None
    along = [
        (size, axis)
        for size, p in zip(support, planes, strict=True)
        for axis, direction in axes.items()
        if size >= support[chosen] and p.normal @ direction > math.cos(AXIS_ANGLE)
    ]
    if along:
        name = max(along)[1]
        vertical = axes[name]
    level = [plane for plane in planes if plane.normal @ vertical > cosine]
    below = [float((plane_distances(points, plane.normal, plane.offset) < -0.1).mean()) for plane in level]
    lowest = int(np.argmin(below))
    return _floor_fit(points, level[lowest], below[lowest], name)


def _of_cameras_on_their_side(
    upright: FloorFit | None,
    points: np.ndarray,
    normals: np.ndarray,
    poses: np.ndarray,
    axes: dict[str, np.ndarray],
    random: np.random.Generator,
) -> FloorFit | None:
    """Return the floor that cameras (M, 4, 4) see which may lie on their side; `upright` is what it is if they do not.

    A wall is as level to them as a floor is to others. Axes of the log's world that are up by custom decide: a large
    plane square to y or z is no accident, where `upright` leans from both. Else `upright` stands, and says of cameras
    that turned about on their side that another plane may be the floor.
    """
    on_side = on_their_side(poses) if len(poses) else False
    usual = {name: axis for name, axis in axes.items() if name.strip("-") != "x"}
    accords = upright is not None and any(upright.normal @ axis > math.cos(NEARLY_LEVEL) for axis in usual.values())
    if on_side is False or (accords and not on_side):
        return upright
    found = [
        _floor_fit(points, plane, 0.0, name)
        for name, axis in usual.items()
        for plane in _plain_planes(points, normals, axis, poses[:, :3, 1], random)
    ]
    if found and not accords:  # a ceiling is as level as a floor
        floor = max(found, key=lambda fit: (not str(fit.axis).startswith("-"), fit.inlier_count))
        axis = str(floor.axis)
        opposite = axis[1:] if axis.startswith("-") else f"-{axis}"
        faced = opposite == axis[1:] or any(fit.axis == opposite for fit in found)
        return replace(floor, on_side=True, rival=opposite if faced else None)
    if found and upright is not None:
        other = max(found, key=lambda fit: fit.inlier_count)
        return upright if other.axis == upright.axis else replace(upright, rival=other.axis)
    if not on_side or upright is None or upright.axis is not None:
        return upright
    return replace(upright, rival="another plane")


def _floor_fit(points: np.ndarray, plane: PlaneFit, below: float, axis: str | None) -> FloorFit:
    normal, offset = plane.normal, float(plane.offset)
    if axis is not None:
        normal = np.array(AXES[axis])
        offset = -float(np.median(points[plane.inliers] @ normal))
        offset = 0.0 if axis == "z" and abs(offset) < SAME_HEIGHT else offset
    distances = plane_distances(points[plane.inliers], plane.normal, plane.offset)
    residual = float(np.sqrt((distances**2).mean()))
    return FloorFit(normal, offset, len(plane.inliers), residual, below, axis)


def _may_be_level(normal: np.ndarray, up: np.ndarray, across: np.ndarray) -> bool:
    """Whether a plane may be level by the cameras' up (3,) and x axes (M, 3)."""
    return float(normal @ up) > math.cos(MAXIMUM_LEAN if _lie_in(across, normal) else MAXIMUM_TILT)


def _lie_in(across: np.ndarray, normal: np.ndarray) -> bool:
    """Whether x axes (M, 3) of cameras lie in a plane, as they do in one that the cameras are held level over."""
    return len(across) > 0 and float(np.sqrt(np.mean((across @ normal) ** 2))) < math.sin(HELD_LEVEL)


def _is_world_of_a_camera(poses: np.ndarray) -> bool:
    """Whether a log's world is that of one of its cameras (N, 4, 4), OpenCV or OpenGL: its axes say nothing of up."""
    own = np.diag([1.0, -1.0, -1.0, 1.0])
    return any(bool((np.abs(poses - pose).max(axis=(1, 2)) < 1e-3).any()) for pose in (np.eye(4), own) if len(poses))


def _plain_planes(
    points: np.ndarray, normals: np.ndarray, axis: np.ndarray, across: np.ndarray, random: np.random.Generator
) -> list[PlaneFit]:
    """Return large planes square to an axis (3,) that x axes (M, 3) of cameras lie in, or y axes: the cameras look
    straight down, hang upside down, or lie on their side."""
    return [
        plane
        for plane in _planes(points, normals, normals @ axis > math.cos(2 * PARALLEL_ANGLE), random)
        if plane.normal @ axis > math.cos(AXIS_ANGLE)
        and _lie_in(across, plane.normal)
        and len(plane.inliers) > PLAIN_SHARE * len(points)
        and (plane_distances(points, plane.normal, plane.offset) < -0.1).mean() <= BELOW_SHARE
    ]


def _planes(points: np.ndarray, normals: np.ndarray, among: np.ndarray, random: np.random.Generator) -> list[PlaneFit]:
    """Return planes of the points that `among` (N,) names, largest first; the inliers index all points (N, 3)."""
    planes: list[PlaneFit] = []
    remaining = np.flatnonzero(among)
    least = max(MINIMUM_SHARE * len(points), 20)
    while len(planes) < MAXIMUM_PLANES and len(remaining) > max(least, 50):
        plane = ransac_plane(
            points[remaining],
            distance_threshold=DISTANCE_THRESHOLD,
            iterations=1000,
            random=random,
            normals=normals[remaining],
            normal_weight=0.05,
        )
        if plane is None or len(plane.inliers) < least:
            break
        planes.append(PlaneFit(plane.normal, plane.offset, remaining[plane.inliers]))
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
