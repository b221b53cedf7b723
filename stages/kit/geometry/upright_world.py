"""Choosing how the world is made upright, and saying how it was done."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import Literal

import numpy as np
from scenewright.schemas.base import as_transform
from scenewright.schemas.errors import BadInput
from scenewright.schemas.sequence import Gravity
from scenewright.stages.kit.geometry.gravity import (
    AXES,
    MAXIMUM_LEAN,
    MAXIMUM_TILT,
    NEARLY_LEVEL,
    POOR_FIT,
    FloorFit,
    camera_up,
    find_floor,
    grid_samples,
    on_their_side,
    upright_from_direction,
    upright_from_floor,
    wall_yaw,
)
from scenewright.stages.kit.geometry.transforms import transform_from_yaw

GRID = 0.05
"""Edge of the cells of which one point each is looked at [m]."""
REASON = re.compile("; (doubtful|note): (.*)$")
"""How a detail ends that says why up may be wrong, and how grave that is."""
CLOUD = Callable[[], tuple[np.ndarray, np.ndarray]]


def make_upright(
    method: str,
    up_axis: str,
    stated: str | None,
    poses: np.ndarray,
    cloud: CLOUD,
    random: np.random.Generator,
    measured_up: np.ndarray | None = None,
) -> Gravity:
    """Return what makes the world upright.

    `method` and `up_axis` are the options `gravity` and `up`; `stated` says where the log states that its z is up
    (None: it does not); `poses` (N, 4, 4) are log_from_camera; `cloud` returns surface points and normals in the
    log's world, and is called only when the floor is looked for; `measured_up` (3,) is what an IMU says of the log's
    world. Raises BadInput when the floor, or an IMU, was demanded and there is none.
    """
    if method == "none":
        return _gravity("none", np.eye(4), "not asked for")
    if method == "given":
        return _gravity("given", upright_from_direction(np.array(AXES[up_axis])), f"option: {up_axis} of the log is up")
    if method == "auto" and stated is not None:
        return _gravity("given", np.eye(4), stated)
    if len(poses) == 0:
        return _gravity("none", np.eye(4), "the log has no poses")
    if method == "imu" and measured_up is None:
        raise BadInput("no IMU of the log says where up is", hint="--gravity auto")
    measured = measured_up is not None and method in ("auto", "imu")
    up = measured_up if measured else camera_up(poses)
    if up is None:
        return _gravity("none", np.eye(4), "the cameras' up directions cancel out")
    source = "the IMU's up" if measured else "the cameras' up"
    points, normals = grid_samples(*cloud(), GRID)
    held = None if measured else poses
    floor = find_floor(points, normals, up, random, held) if method in ("auto", "floor") else None
    if floor is not None and (floor.is_lowest or method == "auto"):
        return _from_floor(floor, points, normals, up, source)
    if method == "floor":
        raise BadInput("no floor was seen: no supported plane near the cameras' up", hint="--gravity camera-up")
    upright, turned = _turned_to_walls(upright_from_direction(up, points), normals)
    if measured:
        detail = f"mean of the IMU's acceleration, lowest percentile of the points at z = 0; {turned}"
        return _gravity("imu", upright, detail)
    why = "asked for" if method == "camera-up" else "no floor was seen"
    detail = f"how the cameras were held ({why}), lowest percentile of the points at z = 0; {turned}"
    if method == "auto" and on_their_side(poses):
        detail += "; doubtful: the cameras may lie on their side"
    return _gravity("mean_camera_up", upright, detail)


def _from_floor(floor: FloorFit, points: np.ndarray, normals: np.ndarray, up: np.ndarray, source: str) -> Gravity:
    """Return what the floor, or a level plane above it, says of points (N, 3) with normals (N, 3)."""
    upright = upright_from_floor(floor) if floor.is_lowest else upright_from_direction(floor.normal, points)
    turned = "the log's z is up"
    if floor.axis != "z":  # a log that is upright already stays as it is
        upright, turned = _turned_to_walls(upright, normals)
        turned = f"the log's {floor.axis} is up, {turned}" if floor.axis else turned
    lean = math.acos(np.clip(floor.normal @ up, -1, 1))
    what = "lowest supported plane" if floor.is_lowest else "level plane, the lowest percentile of the points at z = 0"
    detail = (
        f"{what}: {floor.inlier_count} of {len(points)} grid points within 3 cm, rms {floor.residual * 1000:.1f} mm, "
        f"{100 * floor.below_share:.1f} % of the points below, {math.degrees(lean):.1f} deg from {source}; {turned}"
    )
    method: Literal["floor_plane", "level_plane"] = "floor_plane" if floor.is_lowest else "level_plane"
    return _gravity(method, upright, detail + _doubt(floor, lean, source), floor.inlier_count)


def _doubt(floor: FloorFit, lean: float, source: str) -> str:
    """Return the end of a detail, as REASON reads it, for a floor that leans by an angle [rad] from where up seemed to
    be; empty where nothing speaks against it."""
    away = {name: math.acos(np.clip(floor.normal @ np.array(axis), -1, 1)) for name, axis in AXES.items()}
    name = min(away, key=lambda name: away[name])
    if floor.axis is None and away[name] < NEARLY_LEVEL and floor.residual > POOR_FIT:
        angle = math.degrees(away[name])
        return f"; doubtful: the plane fits poorly and turns the log's {name}, which may be up, by {angle:.1f} deg"
    if floor.rival:
        rival = f"the log's {floor.rival}" if floor.rival in AXES else floor.rival
        return f"; doubtful: the cameras may lie on their side, and {rival} be up"
    if floor.on_side:
        return "; note: the cameras lie on their side"
    if lean > (MAXIMUM_TILT if floor.axis is None else MAXIMUM_LEAN):
        return (
            f"; note: the floor leans by {math.degrees(lean):.0f} deg from {source}, as where cameras look down on it"
        )
    return ""


def _turned_to_walls(upright: np.ndarray, normals: np.ndarray) -> tuple[np.ndarray, str]:
    yaw = wall_yaw(normals @ upright[:3, :3].T)
    if yaw is None:
        return upright, "yaw kept (no dominant wall direction)"
    return transform_from_yaw(-yaw, np.zeros(3)) @ upright, f"turned {-math.degrees(yaw):.1f} deg to the walls"


def _gravity(
    method: Literal["given", "floor_plane", "level_plane", "mean_camera_up", "imu", "none"],
    world_from_log: np.ndarray,
    detail: str,
    inlier_count: int = 0,
) -> Gravity:
    return Gravity(method=method, world_from_log=as_transform(world_from_log), inlier_count=inlier_count, detail=detail)
