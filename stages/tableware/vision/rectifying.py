"""From an oblique RGB-D image to the view from straight above: find the table's plane, resample over it.

The table is the highest of the large planes that are nearly parallel to the largest (a floor may fill more of the
image); the workspace is the largest connected piece of it with what stands there. The image is resampled as a mesh of
its pixels: patches between neighbours at like depth are filled, what no ray saw stays without depth.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.kit.compiled import compiled
from scenewright.stages.kit.geometry.planes import ransac_plane
from scenewright.stages.tableware.world.overhead import OverheadCamera, overhead_camera

POINTS = 20_000
"""Points that planes are looked for in."""
NEAREST, FARTHEST = 0.15, 3.0
"""Depths [m] that count: a table is within reach."""
THICKNESS = 0.010
"""Points this near to a plane are on it [m]."""
WIDTH = 0.003
"""Width of the last fit's weights [m]."""
LEAST_SHARE, LEAST_AREA = 0.12, 0.04
"""Share of the points that the table holds, and its area [m^2]."""
RIVAL = 0.35
"""A higher parallel plane is the table when it holds this share of the points of the largest."""
STEEPEST = np.deg2rad(75.0)
"""Angle between the viewing direction and the table's normal, beyond which nothing can be told."""
MOST_SIDES = (1.40, 0.82)
"""What the virtual view shows of a table along x and y [m]."""
CELL = 0.01
"""Edge of a cell of the map in which the table's outline is found [m]; by eye."""
JUMP = 0.03
"""Neighbours whose depths differ by more than this share are not one surface."""
SUBDIVISION = 4
"""Steps along each side of a patch between four pixels; by eye."""


@dataclass(frozen=True)
class Rectified:
    """The view from above, and where the given camera stands over the table."""

    color: np.ndarray
    depth: np.ndarray
    view: OverheadCamera
    """Straight above the middle of the workspace."""
    world_from_camera: np.ndarray
    """(4, 4) of the given camera; the world's origin is the middle of the workspace, z its normal."""
    sides: tuple[float, float]
    notes: tuple[str, ...]


def back_projected(depth: np.ndarray, camera: Camera) -> np.ndarray:
    """Return (H, W, 3) points in the camera frame [m]; zero where there is no depth."""
    columns = (np.arange(camera.width) - camera.cx) / camera.fx
    rows = (np.arange(camera.height) - camera.cy) / camera.fy
    return np.stack([columns[None, :] * depth, rows[:, None] * depth, depth], axis=2)


def table_plane(
    depth: np.ndarray, camera: Camera, seed: int = 0, up: np.ndarray | None = None
) -> tuple[np.ndarray, float]:
    """Return (normal (3,) towards the camera, offset) of the table in the camera frame.

    `depth` (H, W) [m], 0 where unknown; `up` (3,) the world's vertical in the camera frame where it is known. Raises
    BadInput when no plane is large enough, or when it is seen at too flat an angle.
    """
    points = back_projected(depth, camera).reshape(-1, 3)
    points = points[(points[:, 2] > NEAREST) & (points[:, 2] < FARTHEST)]
    if len(points) < 500:
        raise BadInput(
            f"{len(points)} pixels have a depth between {NEAREST} and {FARTHEST} m",
            hint="check the depth image and its scale: --depth-scale is metres a unit",
        )
    random = np.random.default_rng([seed, 73])
    points = points[random.permutation(len(points))[:POINTS]]
    total, remaining, planes = len(points), points, []
    direction = up
    for _ in range(3):
        fit = ransac_plane(
            remaining,
            distance_threshold=THICKNESS,
            iterations=400,
            random=random,
            direction=direction,
            maximum_angle=None if direction is None else np.deg2rad(12.0),
        )
        if fit is None or len(fit.inliers) < LEAST_SHARE * total:
            break
        sign = 1.0 if fit.offset > 0.0 else -1.0  # the camera, at the origin, is above
        planes.append((len(fit.inliers), sign * fit.normal, sign * fit.offset))
        direction = planes[0][1]
        remaining = np.delete(remaining, fit.inliers, axis=0)
        if len(remaining) < 500:
            break
    if not planes:
        raise BadInput(
            "no plane large enough for a table is in the depth image",
            hint="show more of the table, or give the camera's pose",
        )
    rivals = [plane for plane in planes if plane[0] >= RIVAL * planes[0][0]]
    _, normal, offset = min(rivals, key=lambda plane: plane[2])
    normal, offset = _refine_plane(points, normal, offset)
    if abs(normal[2]) < np.cos(STEEPEST):
        raise BadInput(
            f"the table is seen at {np.rad2deg(np.arccos(abs(normal[2]))):.0f} degrees off its normal",
            hint="look down on it at 75 degrees or less",
        )
    return normal, offset


def _refine_plane(points: np.ndarray, normal: np.ndarray, offset: float) -> tuple[np.ndarray, float]:
    """Return the plane of points (N, 3) near one, by Welsch's weights: what stands on the table lifts a plain fit."""
    for width in (0.006, 0.004, WIDTH, WIDTH, WIDTH, WIDTH):
        distance = points @ normal + offset
        near_plane = points[np.abs(distance) < 3.0 * width]
        weight = np.exp(-0.5 * (distance[np.abs(distance) < 3.0 * width] / width) ** 2)
        if weight.sum() < 50.0:
            break
        center = weight @ near_plane / weight.sum()
        centred = near_plane - center
        turned = np.linalg.eigh((centred * weight[:, None]).T @ centred)[1][:, 0]
        normal = turned if turned @ normal > 0.0 else -turned
        offset = -float(normal @ center)
    return normal, float(offset)


def rectify(
    color: np.ndarray,
    depth: np.ndarray,
    camera: Camera,
    plane: tuple[np.ndarray, float],
    world_from_camera: np.ndarray | None = None,
    sides: tuple[float, float] | None = None,
) -> Rectified:
    """Return the view from straight above the workspace.

    `plane` is the table's in the camera frame. Without `world_from_camera` (4, 4) the workspace is the largest
    connected piece of the table, x along its longer side; with it the world and `sides` are given.
    """
    notes: list[str] = []
    depth = np.where(depth < FARTHEST, depth, 0.0)
    points = back_projected(depth, camera)
    measured = depth > 0.0
    if world_from_camera is None:
        frame = _table_frame(plane)
        flat = points[measured] @ frame[:3, :3].T + frame[:3, 3]
        frame, sides, cut = _workspace_frame(frame, flat)
        if cut:
            notes.append(
                f"the table is larger than what can be looked at together: {sides[0]:.2f} x {sides[1]:.2f} m "
                "of it were searched"
            )
    else:
        frame = world_from_camera
    assert sides is not None
    view = overhead_camera()
    world = points @ frame[:3, :3].T + frame[:3, 3]
    top, picture = _splat_downwards(
        world.astype(np.float64),
        depth.astype(np.float64),
        color,
        _LooksDown(
            view.camera.fx,
            view.camera.cx,
            view.camera.cy,
            float(view.world_from_camera[2, 3]),
            view.camera.height,
            view.camera.width,
        ),
    )
    has_height = top > 0.0
    ground = has_height & (np.abs(float(view.world_from_camera[2, 3]) - top) < THICKNESS)
    tone = np.median(picture[ground], axis=0) if ground.any() else np.median(picture[has_height], axis=0)
    picture[~has_height] = np.rint(tone).astype(np.uint8)
    return Rectified(picture, top.astype(np.float32), view, frame, sides, tuple(notes))


def _table_frame(plane: tuple[np.ndarray, float]) -> np.ndarray:
    """Return (4, 4) table_from_camera: z along the plane's normal, its surface at 0, image right along x."""
    normal, offset = plane
    x = np.array([1.0, 0.0, 0.0]) - normal[0] * normal
    x /= np.linalg.norm(x)
    frame = np.eye(4)
    frame[:3, :3] = np.stack([x, np.cross(normal, x), normal])
    frame[2, 3] = offset
    return frame


def _workspace_frame(frame: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, tuple[float, float], bool]:
    """Return (world_from_camera (4, 4), sides [m], whether the table was cut to what the view shows) of points (N, 3)
    in the table's frame. Raises BadInput where the largest piece of table is too small."""
    near_table = points[(points[:, 2] > -THICKNESS) & (points[:, 2] < 0.35)]
    cells = np.floor(near_table[:, :2] / CELL).astype(int)
    low = cells.min(axis=0)
    shape = cells.max(axis=0) - low + 3
    if shape.max() > 1000:
        near_table = near_table[np.abs(near_table[:, :2] - np.median(near_table[:, :2], axis=0)).max(axis=1) < 2.0]
        cells = np.floor(near_table[:, :2] / CELL).astype(int)
        low = cells.min(axis=0)
        shape = cells.max(axis=0) - low + 3
    grid = np.zeros(shape, dtype=np.uint8)
    grid[tuple((cells - low + 1).T)] = 1
    grid = cv2.morphologyEx(grid, cv2.MORPH_CLOSE, np.ones((5, 5), np.uint8))
    grid = cv2.morphologyEx(grid, cv2.MORPH_OPEN, np.ones((7, 7), np.uint8))
    count, labels, boxes, _ = cv2.connectedComponentsWithStats(grid)
    if count < 2:
        raise BadInput("no piece of table is large enough to work on", hint="show more of the table")
    largest = 1 + int(np.argmax(boxes[1:, cv2.CC_STAT_AREA]))
    area = float(boxes[largest, cv2.CC_STAT_AREA]) * CELL**2
    if area < LEAST_AREA:
        raise BadInput(f"the largest piece of table is {area:.3f} m^2", hint="show more of the table")
    places = (np.argwhere(labels == largest) + low - 0.5) * CELL
    (x, y), (width, height), degrees = cv2.minAreaRect(places.astype(np.float32))
    if height > width:
        width, height, degrees = height, width, degrees + 90.0
    turn = np.deg2rad(degrees)
    if np.cos(turn) < 0.0:
        turn += np.pi
    sides = (min(float(width), MOST_SIDES[0]), min(float(height), MOST_SIDES[1]))
    move = np.eye(4)
    cos, sin = np.cos(turn), np.sin(turn)
    move[:2, :2] = [[cos, sin], [-sin, cos]]
    move[:2, 3] = -move[:2, :2] @ np.array([x, y])
    return move @ frame, sides, sides != (float(width), float(height))


class _LooksDown(NamedTuple):
    """A camera at height `above` [m]: focal length, principal point and size [px]."""

    focal: float
    cx: float
    cy: float
    above: float
    rows: int
    columns: int


@compiled
def _splat_downwards(
    world: np.ndarray, depth: np.ndarray, color: np.ndarray, camera: _LooksDown
) -> tuple[np.ndarray, np.ndarray]:
    """Return (z-depth (rows, columns) [m], colour) from a camera that looks straight down: patches between four
    neighbouring pixels are filled where their depths are alike; the highest point counts."""
    focal, cx, cy, above, rows, columns = camera
    top = np.zeros((rows, columns))
    picture = np.zeros((rows, columns, 3), np.uint8)
    for r in range(depth.shape[0]):
        for c in range(depth.shape[1]):
            if depth[r, c] <= 0.0:
                continue
            steps = 1
            if r + 1 < depth.shape[0] and c + 1 < depth.shape[1]:
                low = min(depth[r, c], depth[r + 1, c], depth[r, c + 1], depth[r + 1, c + 1])
                high = max(depth[r, c], depth[r + 1, c], depth[r, c + 1], depth[r + 1, c + 1])
                if low > 0.0 and high - low < JUMP * low:
                    steps = SUBDIVISION
            for i in range(steps):
                for j in range(steps):
                    a, b = i / steps, j / steps
                    x, y, z = world[r, c, 0], world[r, c, 1], world[r, c, 2]
                    if steps > 1:
                        w00, w10, w01, w11 = (1 - a) * (1 - b), a * (1 - b), (1 - a) * b, a * b
                        x = w00 * x + w10 * world[r + 1, c, 0] + w01 * world[r, c + 1, 0] + w11 * world[r + 1, c + 1, 0]
                        y = w00 * y + w10 * world[r + 1, c, 1] + w01 * world[r, c + 1, 1] + w11 * world[r + 1, c + 1, 1]
                        z = w00 * z + w10 * world[r + 1, c, 2] + w01 * world[r, c + 1, 2] + w11 * world[r + 1, c + 1, 2]
                    range_ = above - z
                    if range_ < 0.05:
                        continue
                    column, row = int(cx + focal * x / range_ + 0.5), int(cy - focal * y / range_ + 0.5)
                    if not (0 <= column < columns and 0 <= row < rows):
                        continue
                    if top[row, column] == 0.0 or range_ < top[row, column]:
                        top[row, column] = range_
                        near_r, near_c = r + (1 if a > 0.5 else 0), c + (1 if b > 0.5 else 0)
                        for k in range(3):
                            picture[row, column, k] = color[near_r, near_c, k]
    return top, picture
