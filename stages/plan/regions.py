"""Affordances of a body from its shape: level places that carry things, and which doors to open to get a hand there.

`library` derives the affordances of its models alike (docs/LIBRARY.md); here they are derived of bodies as they stand
in a scene, so that generated rooms, reconstructed ones and what was looked at from near by are treated the same way.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
import trimesh
from scenewright.schemas.scene_parts import Joint
from scenewright.stages.kit.motion.doors import body_from_moved
from scenewright.stages.kit.simulation.shapes import joined

LEVEL = 0.98
"""Least upward part of the normal of a face that things stand on (11 degrees); by eye."""
MERGE_HEIGHT = 0.006
"""Faces whose heights differ by less are one surface [m]; by eye."""
LEAST_AREA = 0.005
"""Smaller surfaces carry nothing [m^2]; by eye."""
LEAST_WIDTH = 0.06
"""Narrower surfaces carry nothing [m]; by eye."""
LEAST_SURFACE = 0.2
"""Share of the rectangle that has to have surface."""
LEAST_CLEARANCE = 0.04
"""Surfaces with less room above carry nothing [m]."""
OPEN_AIR = 2.0
"""Nothing within this above a surface counts as open air [m]."""
LEVELS = (0.25, 0.5, 0.75)
"""Shares of the free height at which a way out is looked for."""
LEAST_WAY_OUT = 0.4
"""Share of the lines sideways that have to be free (but for doors) for a way out."""
NEAR_LEVEL = 0.06
"""An item stands on a region when its bottom is at most this far from its level [m]."""
BESIDE = 0.03
"""How far the middle of a foot may lie outside of the region that it stands on [m]; by eye."""
SLIDE_STEP = 0.015
"""Distance between two looks at what is over a drawer as it slides [m]: rails are not thinner."""
CELL = 0.02
"""Edge of the cells on which surface and free height are noted [m]."""
CIRCLE = np.column_stack([np.cos(np.pi / 4 * np.arange(8)), np.sin(np.pi / 4 * np.arange(8))])
"""Eight directions around a spot (8, 2), of length 1."""


@dataclass(frozen=True)
class Region:
    """A level rectangle of a body that things can stand on. Body frame with all joints at 0, metres."""

    body: str
    link: str
    low: np.ndarray
    """(2,)"""
    high: np.ndarray
    level: float
    clearance: float
    """Free height above; `OPEN_AIR` when nothing is there."""
    doors: tuple[str, ...]
    """Joints to open before a hand gets there."""
    joint: Joint | None
    """The joint that moves the region: of a drawer, or of a door with shelves."""
    free: np.ndarray
    """(X, Y) free height [m] over each cell of `CELL`, in a drawer the least while it slides; 0 where the rectangle has
    no surface at this level."""

    def carries(self, spot: np.ndarray, radius: float, height: float) -> bool:
        """Whether there is surface under, and room above, the middle and the rim of a round foot at `spot` (2,)."""
        points = np.concatenate([spot[None], spot + radius * CIRCLE])
        cells = np.floor((points - self.low) / CELL).astype(int)
        inside = np.all((cells >= 0) & (cells < self.free.shape), axis=1)
        return bool(inside.all() and (self.free[cells[:, 0], cells[:, 1]] > height).all())

    def free_height(self, spot: np.ndarray, radius: float) -> float:
        """Return the least free height [m] over the middle and the rim of a round foot at `spot` (2,), where there is
        surface under them; `OPEN_AIR` where there is none."""
        cells = np.floor((np.concatenate([spot[None], spot + radius * CIRCLE]) - self.low) / CELL).astype(int)
        cells = cells[np.all((cells >= 0) & (cells < self.free.shape), axis=1)]
        free = self.free[cells[:, 0], cells[:, 1]]
        return float(free[free > 0].min(initial=OPEN_AIR))

    @property
    def covered(self) -> bool:
        """Whether hands come from the side: something is above that does not go away."""
        drawer = self.joint is not None and self.joint.type == "prismatic"
        return self.clearance < OPEN_AIR and not drawer

    @property
    def carries_things(self) -> bool:
        """Whether things can be put here: shelves in a swinging door are left alone."""
        return self.joint is None or self.joint.type == "prismatic"

    def takes(self, radius: float, height: float) -> bool:
        """Whether an upright thing of this footprint radius and height [m] has room here."""
        wide = float((self.high - self.low).min())
        return self.carries_things and wide > 2 * radius and self.clearance > height + 0.015


@dataclass(frozen=True)
class _Shape:
    mesh: trimesh.Trimesh
    owner: np.ndarray
    """(F,) number of the link of each face."""
    joints: dict[int, Joint]
    """Number of a link -> the joint that moves it."""

    def hits(self, start: np.ndarray, direction: np.ndarray) -> list[list[tuple[float, int]]]:
        """Return, per ray from start (N, 3), (distance, link number) of everything that it meets."""
        rays = np.tile(direction, (len(start), 1))
        places, ray, faces = self.mesh.ray.intersects_location(start, rays, multiple_hits=True)
        met: list[list[tuple[float, int]]] = [[] for _ in start]
        distances = np.linalg.norm(places.reshape(-1, 3) - start[ray], axis=1)  # without a hit trimesh may give (0,)
        for index, distance, owner in zip(ray.tolist(), distances.tolist(), self.owner[faces].tolist(), strict=True):
            met[index].append((distance, owner))
        return met


def find_regions(body: str, joints: Iterable[Joint], meshes: Mapping[str, trimesh.Trimesh]) -> tuple[Region, ...]:
    """Return the regions of a body, largest first. `meshes`: link -> collision mesh in the body frame with all of its
    `joints` at 0."""
    if not meshes:
        return ()
    shape = _shape(joints, meshes)
    regions = []
    for number, link in enumerate(meshes):
        for low, high, level in _levels(shape, number):
            region = _region(shape, body, link, number, low, high, level)
            if region is not None:
                regions.append(region)
    return tuple(sorted(regions, key=lambda region: -float(np.prod(region.high - region.low))))


def _shape(joints: Iterable[Joint], meshes: Mapping[str, trimesh.Trimesh]) -> _Shape:
    by_part = {joint.part: joint for joint in joints}
    owner = np.repeat(np.arange(len(meshes)), [len(mesh.faces) for mesh in meshes.values()])
    moved = {number: by_part[link] for number, link in enumerate(meshes) if link in by_part}
    return _Shape(joined(list(meshes.values())), owner, moved)


def _levels(shape: _Shape, number: int) -> list[tuple[np.ndarray, np.ndarray, float]]:
    """Return rectangles (low (2,), high (2,), height) of the upward faces of a link, one a height."""
    up = np.flatnonzero((shape.owner == number) & (shape.mesh.face_normals[:, 2] > LEVEL))
    triangles = shape.mesh.triangles[up]
    heights, areas = triangles[:, :, 2].mean(axis=1), shape.mesh.area_faces[up]
    unused = np.ones(len(up), dtype=bool)
    levels = []
    for face in np.argsort(-heights, kind="stable"):
        if not unused[face]:
            continue
        group = unused & (np.abs(heights - heights[face]) < MERGE_HEIGHT)
        unused &= ~group
        corners = triangles[group].reshape(-1, 3)
        low, high = corners[:, :2].min(axis=0), corners[:, :2].max(axis=0)
        if areas[group].sum() > LEAST_AREA and float((high - low).min()) > LEAST_WIDTH:
            levels.append((low, high, float(heights[face])))
    return levels


def _region(
    shape: _Shape, body: str, link: str, number: int, low: np.ndarray, high: np.ndarray, level: float
) -> Region | None:
    points, counts = _cells(low, high, level + 0.002)
    below = shape.hits(points, np.array([0.0, 0.0, -1.0]))
    surface = np.array([bool(entries) and min(entries)[0] < 0.008 for entries in below])
    if surface.mean() < LEAST_SURFACE or not surface.any():
        return None
    over = points[surface]
    above = shape.hits(over, np.array([0.0, 0.0, 1.0]))
    free = np.zeros(len(points))
    free[surface] = [min((distance for distance, _ in entries), default=OPEN_AIR) for entries in above]
    joint = shape.joints.get(number)
    if joint is not None and joint.type == "prismatic":
        free[surface] = np.minimum(free[surface], _room_on_the_way(shape, over, number, joint))
    clearance = min(float(np.median(free[surface])), OPEN_AIR)
    if clearance < LEAST_CLEARANCE:
        return None
    doors: tuple[str, ...] | None
    if joint is not None:
        doors = (joint.name,)
    elif clearance >= OPEN_AIR:
        doors = ()
    else:
        doors = _ways_in(shape, over[:: max(1, len(over) // 12)], clearance)
    if doors is None:
        return None
    return Region(body, link, low, high, level, clearance, doors, joint, free.reshape(counts))


def _room_on_the_way(shape: _Shape, points: np.ndarray, number: int, joint: Joint) -> np.ndarray:
    """Return the least free height [m] over points (N, 3) of a drawer while it slides: what stands in it passes under
    the rail that its front hides."""
    least = np.full(len(points), OPEN_AIR)
    for value in np.arange(SLIDE_STEP, joint.upper + SLIDE_STEP, SLIDE_STEP):
        moved = points + body_from_moved(joint, min(float(value), joint.upper))[:3, 3]
        for row, entries in enumerate(shape.hits(moved, np.array([0.0, 0.0, 1.0]))):
            over = (distance for distance, owner in entries if owner != number)
            least[row] = min(least[row], min(over, default=OPEN_AIR))
    return least


def _cells(low: np.ndarray, high: np.ndarray, height: float) -> tuple[np.ndarray, tuple[int, int]]:
    """Return the middles (N, 3) of the cells of a rectangle, and how many there are along x and y."""
    counts = np.maximum(1, np.floor((high - low) / CELL).astype(int))
    x, y = (low[axis] + CELL * (np.arange(counts[axis]) + 0.5) for axis in (0, 1))
    grid = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    return np.column_stack([grid, np.full(len(grid), height)]), (int(counts[0]), int(counts[1]))


def _ways_in(shape: _Shape, points: np.ndarray, clearance: float) -> tuple[str, ...] | None:
    """Return the joints to open so that straight lines lead out sideways, the fewest; None: there is no way."""
    best: tuple[str, ...] | None = None
    for direction in ((0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 1.0, 0.0)):
        starts = np.concatenate([points + [0.0, 0.0, height * clearance] for height in LEVELS])
        blocked: set[str] = set()
        free = 0
        for entries in shape.hits(starts, np.array(direction)):
            owners = {number for _, number in entries}
            if all(number in shape.joints for number in owners):
                free += 1
                blocked |= {shape.joints[number].name for number in owners}
        names = tuple(sorted(blocked))
        if free >= LEAST_WAY_OUT * len(starts) and (best is None or len(names) < len(best)):
            best = names
    return best


def region_at(regions: Iterable[Region], feet: Iterable[np.ndarray]) -> Region | None:
    """Return the region on which a thing stands, None when it stands on none of them. `feet`: the middle of its foot
    (3,) in the closed body frame of each region."""
    best: tuple[float, Region] | None = None
    for region, foot in zip(regions, feet, strict=True):
        off = abs(float(foot[2]) - region.level)
        over = bool(np.all(foot[:2] > region.low - BESIDE) and np.all(foot[:2] < region.high + BESIDE))
        if over and off < (NEAR_LEVEL if best is None else best[0]):
            best = (off, region)
    return None if best is None else best[1]
