"""Floor, walls and ceiling from the geometry of the whole sequence; object detectors have no classes for them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

HEIGHT_BIN = 0.02
"""Width of the bins of heights in which floor and ceiling are sought [m]; by eye."""
OFFSET_BIN = 0.04
"""Width of the bins of a wall's distance from the origin [m]; by eye."""
AZIMUTH_BIN = np.radians(3.0)
"""Width of the bins of a wall's direction [rad]; by eye."""
MINIMUM_WALL_HEIGHT = 1.0
"""Least height of a plane's points, bottom to top, for a wall [m]; by eye."""
MINIMUM_WALL_TOP = 1.25
"""A wall is seen up to here over the floor [m]: kitchen units and desks end below."""
MINIMUM_HIGH_SHARE = 0.3
"""Share of a wall's points that lie a metre over the floor or higher: the front of a kitchen unit that runs into a
pillar has few."""
MINIMUM_WALL_LENGTH = 1.0
"""Narrower upright planes are sides of tall furniture [m]."""


@dataclass(frozen=True)
class WallPlane:
    """An upright plane that bounds the room: normal.p + offset = 0, the normal points into the room."""

    normal: np.ndarray
    """(3,) world frame, horizontal."""
    offset: float


@dataclass(frozen=True)
class Room:
    """What bounds the room, as far as it was seen. World frame, z up, metres."""

    floor: float | None
    ceiling: float | None
    walls: tuple[WallPlane, ...]


@dataclass(frozen=True)
class SurfaceSample:
    """Points (N, 3) [m] with unit normals (N, 3) in the world frame, and the height of the camera."""

    points: np.ndarray
    normals: np.ndarray
    camera_height: float


def sample_surface(
    points: np.ndarray, normals: np.ndarray, world_from_camera: np.ndarray, *, step: int = 8
) -> SurfaceSample:
    """Return every `step`-th pixel of a frame's points and normals (H, W, 3) in the world frame."""
    cloud, directions = points[::step, ::step].reshape(-1, 3), normals[::step, ::step].reshape(-1, 3)
    keep = (cloud[:, 2] > 0) & directions.any(axis=1)
    rotation = world_from_camera[:3, :3]
    return SurfaceSample(
        cloud[keep] @ rotation.T + world_from_camera[:3, 3],
        directions[keep] @ rotation.T,
        float(world_from_camera[2, 3]),
    )


def find_room(samples: Iterable[SurfaceSample], *, floor_is_zero: bool) -> Room:
    """Return the floor height, ceiling height and walls that the samples support.

    `floor_is_zero` says that the sequence's world frame has its origin on the floor (gravity from the floor plane,
    or given); a lowest plane elsewhere than at z = 0 is then no floor, otherwise one less than 0.9 m below the
    cameras is none (a log that shows only a table has no floor).
    """
    sample_list = list(samples)
    if not sample_list:
        return Room(None, None, ())
    points = np.concatenate([part.points for part in sample_list])
    normals = np.concatenate([part.normals for part in sample_list])
    camera_height = float(np.median([part.camera_height for part in sample_list]))
    floor = find_floor(points[:, 2], normals[:, 2])
    if floor is not None and (abs(floor) > 0.15 if floor_is_zero else camera_height - floor < 0.9):
        floor = None
    base = floor if floor is not None else (0.0 if floor_is_zero else camera_height - 1.5)
    ceiling = find_ceiling(points[:, 2], normals[:, 2], lowest=base + 2.0)
    return Room(floor, ceiling, find_walls(points, normals, base))


def find_floor(heights: np.ndarray, upwardness: np.ndarray) -> float | None:
    """Return the height of the lowest well-supported upward surface, or None.

    `heights` (N,) [m], `upwardness` (N,) the z of the normals. Well supported: a tenth of the best-supported height;
    and at most one point in a hundred lies more than 15 cm below.
    """
    level = heights[upwardness > 0.9]
    if level.size < 50:
        return None
    low = float(level.min())
    counts = np.bincount(((level - low) / HEIGHT_BIN).astype(int))
    support = np.convolve(counts, np.ones(5), mode="same")
    for index in np.flatnonzero(support >= 0.1 * support.max()):
        # Climb to the top of this hill of the histogram.
        while index + 1 < support.size and support[index + 1] > support[index]:
            index += 1
        height = low + (float(index) + 0.5) * HEIGHT_BIN
        height = float(np.median(level[np.abs(level - height) < 0.06]))
        if np.mean(heights < height - 0.15) <= 0.01:
            return height
    return None


def find_ceiling(heights: np.ndarray, upwardness: np.ndarray, *, lowest: float) -> float | None:
    """Return the height of the best-supported downward surface above `lowest` [m], or None under 1 % of all points."""
    level = heights[(upwardness < -0.9) & (heights > lowest)]
    if level.size < max(50, 0.01 * heights.size):
        return None
    counts = np.bincount(((level - lowest) / HEIGHT_BIN).astype(int))
    height = lowest + (int(np.argmax(np.convolve(counts, np.ones(5), mode="same"))) + 0.5) * HEIGHT_BIN
    at_height = level[np.abs(level - height) < 0.06]
    return float(np.median(at_height)) if at_height.size else None


def find_walls(points: np.ndarray, normals: np.ndarray, floor: float, *, maximum: int = 12) -> tuple[WallPlane, ...]:
    """Return the upright planes that bound the room, best supported first.

    `points`, `normals` (N, 3), world frame. Planes come from votes of the points for (azimuth, offset); a plane is a
    wall when its points span at least a metre in height and length, reach 1.25 m over the `floor`, and hardly
    anything (3 %) was seen behind that part of it.
    """
    upright = np.abs(normals[:, 2]) < 0.25
    remaining = np.flatnonzero(upright & (points[:, 2] > floor + 0.1))
    least = max(100, int(0.01 * len(points)))
    walls = []
    for _ in range(maximum):
        plane = _strongest_upright_plane(points[remaining], normals[remaining])
        if plane is None:
            break
        distance = points[remaining] @ plane.normal + plane.offset
        on_plane = (np.abs(distance) < 0.06) & (normals[remaining] @ plane.normal > 0.9)
        if on_plane.sum() < least:
            break
        if _bounds_room(points[remaining[on_plane]], points, plane, floor):
            walls.append(plane)
        remaining = remaining[~on_plane]
    return tuple(walls)


def _strongest_upright_plane(points: np.ndarray, normals: np.ndarray) -> WallPlane | None:
    if len(points) < 100:
        return None
    azimuth = np.arctan2(normals[:, 1], normals[:, 0])
    columns = int(round(2 * np.pi / AZIMUTH_BIN))
    reach = float(np.abs(points[:, :2]).max()) * 1.5 + OFFSET_BIN
    rows = int(2 * reach / OFFSET_BIN) + 1
    cells = []
    for shift in (-1, 0, 1):
        column = (np.rint(azimuth / AZIMUTH_BIN).astype(int) + shift) % columns
        along = points[:, 0] * np.cos(column * AZIMUTH_BIN) + points[:, 1] * np.sin(column * AZIMUTH_BIN)
        cells.append(column * rows + ((along + reach) / OFFSET_BIN).astype(int))
    votes = np.bincount(np.concatenate(cells), minlength=rows * columns)
    best = int(np.argmax(votes))
    angle = (best // rows) * AZIMUTH_BIN
    normal = np.array([np.cos(angle), np.sin(angle), 0.0])
    offset = -((best % rows + 0.5) * OFFSET_BIN - reach)
    for _ in range(3):
        inliers = points[(np.abs(points @ normal + offset) < 0.08) & (normals @ normal > 0.9)]
        if len(inliers) < 50:
            break
        # Least squares line through the inliers' ground plan.
        centred = inliers[:, :2] - inliers[:, :2].mean(axis=0)
        direction = np.linalg.eigh(centred.T @ centred)[1][:, 0]
        refined = np.array([direction[0], direction[1], 0.0])
        normal = refined if refined @ normal > 0 else -refined
        offset = -float((inliers @ normal).mean())
    return WallPlane(normal, offset)


def _bounds_room(inliers: np.ndarray, points: np.ndarray, plane: WallPlane, floor: float) -> bool:
    along = np.array([-plane.normal[1], plane.normal[0], 0.0])
    position = inliers @ along
    left, right = np.percentile(position, [2, 98])
    bottom, top = np.percentile(inliers[:, 2], [2, 98])
    if right - left < MINIMUM_WALL_LENGTH or top - bottom < MINIMUM_WALL_HEIGHT or top < floor + MINIMUM_WALL_TOP:
        return False
    if np.mean(inliers[:, 2] > floor + 1.0) < MINIMUM_HIGH_SHARE:
        return False
    within = (points @ along > left) & (points @ along < right) & (points[:, 2] > bottom) & (points[:, 2] < top)
    behind = within & (points @ plane.normal + plane.offset < -0.2)
    return bool(behind.sum() <= 0.03 * within.sum())


def room_masks(
    points: np.ndarray, normals: np.ndarray, world_from_camera: np.ndarray, room: Room
) -> dict[str, np.ndarray]:
    """Return masks (H, W) bool of `floor`, `wall` and `ceiling` pixels of a frame, as far as the room has them.

    `points`, `normals` (H, W, 3), camera frame. A pixel belongs to a surface when it lies within 5 cm + 1 % of its
    depth of it (depth noise grows with distance) and its normal agrees within about 30 degrees.
    """
    valid = points[..., 2] > 0
    tolerance = 0.05 + 0.01 * points[..., 2]
    rotation, translation = world_from_camera[:3, :3], world_from_camera[:3, 3]
    height = points @ rotation[2] + translation[2]
    up = normals @ rotation[2]
    masks = {}
    if room.floor is not None:
        masks["floor"] = valid & (np.abs(height - room.floor) < tolerance) & (up > 0.85)
    if room.ceiling is not None:
        masks["ceiling"] = valid & (np.abs(height - room.ceiling) < tolerance) & (up < -0.85)
    if room.walls:
        mask = np.zeros(valid.shape, dtype=bool)
        for wall in room.walls:
            in_camera = rotation.T @ wall.normal
            distance = points @ in_camera + (wall.normal @ translation + wall.offset)
            mask |= valid & (np.abs(distance) < tolerance) & (normals @ in_camera > 0.85)
        masks["wall"] = mask
    return masks
