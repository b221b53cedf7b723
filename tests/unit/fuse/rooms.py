"""Rooms of which every surface is known: as cameras would see them, and as sheets of one vertex a voxel."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import trimesh
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.fuse.free_space import FreeSpace
from scenewright.stages.fuse.layout.evidence import Scene
from scenewright.stages.kit.geometry.cells import cell_keys
from scenewright.stages.kit.geometry.transforms import look_at

from tests.unit.fuse.scenes import Block, rays, render

VOXEL = 0.05
WIDE = Camera(width=160, height=120, fx=72.0, fy=72.0, cx=79.5, cy=59.5)
THICK = 0.1

Corners = tuple[tuple[float, float, float], tuple[float, float, float]]


def walls_around(x: float, y: float, height: float, *, but: str = "") -> tuple[Block, ...]:
    """Floor, ceiling and four walls of a room of x * y * height [m] from the origin; `but` leaves some out by letter:
    n(orth, +y), s, e(ast, +x), w, f(loor), c(eiling)."""
    t = THICK
    sides = {
        "f": Block("floor", (-t, -t, -t), (x + t, y + t, 0.0)),
        "c": Block("ceiling", (-t, -t, height), (x + t, y + t, height + t)),
        "w": Block("wall", (-t, -t, -t), (0.0, y + t, height + t)),
        "e": Block("wall", (x, -t, -t), (x + t, y + t, height + t)),
        "s": Block("wall", (-t, -t, -t), (x + t, 0.0, height + t)),
        "n": Block("wall", (-t, y, -t), (x + t, y + t, height + t)),
    }
    return tuple(block for letter, block in sides.items() if letter not in but)


def look_around(*eyes: tuple[float, float, float], looks: int = 4) -> list[np.ndarray]:
    """Poses that look level, down and up in so many directions from each place."""
    poses = []
    for eye in np.array(eyes, float):
        for turn in 2 * np.pi * (np.arange(looks) + 0.25) / looks:
            ahead = np.array([np.cos(turn), np.sin(turn), 0.0])
            poses += [look_at(eye, eye + ahead + [0.0, 0.0, tilt]) for tilt in (0.0, -0.9, 0.9)]
    return poses


def seen(blocks: Sequence[Block], poses: Sequence[np.ndarray], *, far: float = 8.0) -> tuple[Scene, np.ndarray]:
    """Return what cameras see of blocks, a vertex a voxel, with the space that they looked through, and the number of
    the block (V,) that each vertex is of. No mask says anything."""
    blocks, free = tuple(blocks), FreeSpace()
    points, normals, owners = [], [], []
    for pose in poses:
        depth, image = render(blocks, pose, WIDE)
        depth = np.where(depth < far, depth, 0).astype(np.float32)
        free.add_frame(WIDE, depth, pose, far)
        hit = depth > 0
        directions = rays(WIDE, pose)[hit]
        points.append(pose[:3, 3] + directions * depth[hit][:, None])
        owners.append(image[hit] - 1)
        normals.append(_normals(blocks, points[-1], owners[-1], directions))
    place, normal, owner = np.concatenate(points), np.concatenate(normals), np.concatenate(owners)
    # By cell and facing: what lies exactly between two cells is in one of them.
    key = cell_keys(place + VOXEL / 3, VOXEL) * 27 + (np.rint(normal).astype(np.int64) + 1) @ [9, 3, 1]
    first = np.unique(key, return_index=True)[1]
    count, nothing = len(first), np.zeros(len(first))
    cameras = np.array([pose[:3, 3] for pose in poses])
    scene = Scene(place[first], normal[first], np.full(count, VOXEL**2), nothing, nothing, cameras, free)
    return scene, owner[first]


def _normals(blocks: Sequence[Block], points: np.ndarray, owner: np.ndarray, directions: np.ndarray) -> np.ndarray:
    low, high = (np.array([getattr(block, end) for block in blocks])[owner] for end in ("minimum", "maximum"))
    off = np.concatenate([np.abs(points - low), np.abs(points - high)], axis=1)
    facing = np.concatenate([directions > 0, directions < 0], axis=1)
    face = np.where(facing, off, np.inf).argmin(axis=1)
    return np.concatenate([-np.eye(3), np.eye(3)])[face]


def sheet(low: np.ndarray, high: np.ndarray, axis: int, outwards: int, voxel: float) -> trimesh.Trimesh:
    """A rectangle of one vertex a voxel: the side of a box that lies low (-1) or high (1) on an axis."""
    first, second = [k for k in range(3) if k != axis]
    u, v = (np.arange(low[k], high[k] + 1e-9, voxel) for k in (first, second))
    points = np.zeros((len(u), len(v), 3))
    points[..., first], points[..., second] = u[:, None], v[None]
    points[..., axis] = high[axis] if outwards > 0 else low[axis]
    corner = np.arange(len(u) * len(v)).reshape(len(u), len(v))
    a, b, c, d = corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:]
    faces = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])
    turned = (outwards > 0) == (axis == 1)
    return trimesh.Trimesh(points.reshape(-1, 3), faces[:, ::-1] if turned else faces, process=False)


def sheets(*boxes: Corners, voxel: float = 0.02) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return vertices, faces, and the part of every vertex: floor 0, wall 1, then the boxes in order, without feet."""
    sides = [[sheet(np.array([-2.0, -2, 0]), np.array([2.0, 2, 0]), 2, 1, voxel)]]
    sides.append([sheet(np.array([-2.0, 2, 0]), np.array([2.0, 2, 2.4]), 1, -1, voxel)])
    for low, high in boxes:
        ends = [(axis, way) for axis in range(3) for way in (-1, 1) if (axis, way) != (2, -1)]
        sides.append([sheet(np.array(low), np.array(high), axis, way, voxel) for axis, way in ends])
    owner = np.repeat(np.arange(len(sides)), [sum(len(s.vertices) for s in part) for part in sides])
    whole = trimesh.util.concatenate([side for part in sides for side in part])
    return np.asarray(whole.vertices), np.asarray(whole.faces), owner
