"""Frames of an endless furnished corridor, cheap to make: one cell is rendered and segmented, all others are it, moved.

The corridor repeats every LENGTH metres along x. A camera walks down the middle, looking left and right; its frames in
cell k are those in cell 0 with poses moved by k * LENGTH, so any number of frames and any area costs the rendering of
one cell. Masks are the true ones, cut by the geometric segmentation of the depth, as `segment` writes them: numbers in
a frame mean nothing beyond the frame, so they need not be changed from cell to cell either.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh
from scenewright.schemas.scene_parts import Camera
from scenewright.schemas.segments import FrameSegment
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.kit.geometry.cameras import back_project
from scenewright.stages.kit.geometry.transforms import look_at
from scenewright.stages.segment.fusion_ours import fuse
from scenewright.stages.segment.geometric import segment_depth
from scenewright.stages.segment.one_frame import describe
from scenewright.stages.segment.panoptic import PanopticFrame, PanopticMask
from scenewright.stages.segment.parameters import SegmentParameters
from scenewright.stages.segment.settings import fusion_settings, geometric_settings

CAMERA = Camera(width=640, height=480, fx=525.0, fy=525.0, cx=319.5, cy=239.5)
LENGTH, WIDTH, HEIGHT = 4.0, 2.5, 2.5
"""Of a cell [m]."""
AREA = LENGTH * WIDTH
"""Floor of a cell [m^2]."""
RANGE = 4.0
"""Of the sensor [m]."""
PER_CELL = 60
"""More instances than a cell has."""
THICK = 0.05
ROOM = (
    ("floor", (0, -1.25, -THICK), (4, 1.25, 0)),
    ("ceiling", (0, -1.25, 2.5), (4, 1.25, 2.5 + THICK)),
    ("wall", (0, -1.25 - THICK, 0), (4, -1.25, 2.5)),
    ("wall", (0, 1.25, 0), (4, 1.25 + THICK, 2.5)),
)
FURNITURE = (
    ("cabinet", (0.2, 0.75, 0), (1.1, 1.25, 1.1)),
    ("table", (1.5, 0.65, 0.7), (2.7, 1.25, 0.74)),
    ("table", (1.5, 0.65, 0), (1.56, 0.71, 0.7)),
    ("table", (2.64, 0.65, 0), (2.7, 0.71, 0.7)),
    ("chair", (1.8, 0.3, 0.42), (2.2, 0.65, 0.46)),
    ("chair", (1.8, 0.3, 0.46), (2.2, 0.34, 0.9)),
    ("monitor", (1.9, 1.0, 0.85), (2.4, 1.05, 1.2)),
    ("bottle", (1.6, 0.8, 0.74), (1.68, 0.88, 1.0)),
    ("cup", (2.5, 0.8, 0.74), (2.58, 0.88, 0.84)),
    ("fridge", (3.0, 0.65, 0), (3.6, 1.25, 1.8)),
    ("shelf", (0.5, -1.25, 0), (1.5, -0.95, 1.8)),
    ("sofa", (1.8, -1.25, 0), (3.3, -0.55, 0.45)),
    ("sofa", (1.8, -1.25, 0.45), (3.3, -1.05, 0.85)),
    ("bin", (3.5, -1.2, 0), (3.75, -0.95, 0.4)),
    ("box", (0.1, -1.2, 0), (0.4, -0.9, 0.3)),
)
SAME = {2: 1, 3: 1, 5: 4, 12: 11}
"""Pieces of furniture (places in FURNITURE) that belong to another piece."""


@dataclass(frozen=True)
class CorridorFrame:
    """One frame of the first cell: depth (H, W) float32 [m], colour (H, W, 3) uint8, world_from_camera (4, 4), ids
    (H, W) int32 as `listing` explains them."""

    depth: np.ndarray
    color: np.ndarray
    pose: np.ndarray
    ids: np.ndarray
    listing: tuple[FrameSegment, ...]
    masks: PanopticFrame
    """The true masks before they were cut."""


def instance_of(number: int, cell: int) -> int:
    """Return the true instance of entity `number` of cell `cell` (-1 is the one behind the first)."""
    return 1 + number + PER_CELL * (cell + 1)


def class_of(instance: int) -> str:
    """Return the class of a true instance."""
    return (ROOM + FURNITURE)[(instance - 1) % PER_CELL][0]


def walk(count: int) -> np.ndarray:
    """Return world_from_camera (count, 4, 4) of one cell: forward, looking to both sides and down."""
    poses = []
    for share in np.arange(count) / count:
        yaw = np.radians(60) * np.sin(4 * np.pi * share)
        eye = np.array([LENGTH * share, 0.0, 1.5])
        ahead = np.array([np.cos(yaw), np.sin(yaw), -0.5])
        poses.append(look_at(eye, eye + ahead))
    return np.array(poses)


def corridor_scene():  # type: ignore[no-untyped-def]  # open3d has no types
    """Return the cells in and around the first one as an open3d RaycastingScene, and the true instance of each of its
    geometries, and last of none (N + 1,)."""
    import open3d as o3d

    scene, instances = o3d.t.geometry.RaycastingScene(), []
    for cell in (-1, 0, 1, 2):
        for number, (_, low, high) in enumerate(ROOM + FURNITURE):
            middle = np.add(low, high) / 2 + [cell * LENGTH, 0, 0]
            box = trimesh.creation.box(np.subtract(high, low), trimesh.transformations.translation_matrix(middle))
            scene.add_triangles(box.vertices.astype(np.float32), box.faces.astype(np.uint32))
            owner = len(ROOM) + SAME.get(number - len(ROOM), number - len(ROOM)) if number >= len(ROOM) else number
            instances.append(instance_of(owner, cell))
    return scene, np.array([*instances, 0])


def make_frames(count: int, seed: int = 0) -> list[CorridorFrame]:
    """Render and segment `count` frames of the first cell, with the axial noise of a structured-light camera (Nguyen,
    Izadi & Lovell, 2012)."""
    random = np.random.default_rng(seed)
    scene, table = corridor_scene()
    palette = random.integers(40, 220, (PER_CELL, 3)).astype(np.uint8)
    return [_frame(scene, pose, table, palette, random) for pose in walk(count)]


def _frame(  # type: ignore[no-untyped-def]
    scene, pose: np.ndarray, table: np.ndarray, palette: np.ndarray, random: np.random.Generator
) -> CorridorFrame:
    import open3d as o3d

    directions = back_project(np.ones((CAMERA.height, CAMERA.width), dtype=np.float32), CAMERA) @ pose[:3, :3].T
    rays = np.concatenate([np.broadcast_to(pose[:3, 3], directions.shape), directions], axis=-1)
    hit = scene.cast_rays(o3d.core.Tensor(rays.astype(np.float32)))  # type: ignore[call-overload]
    true = np.minimum(hit["t_hit"].numpy(), 2 * RANGE)
    geometry = hit["geometry_ids"].numpy().astype(np.int64)
    instances = table[np.minimum(geometry, len(table) - 1)].astype(np.int32)
    depth = true + (0.0012 + 0.0019 * (true - 0.4) ** 2) * random.standard_normal(true.shape)
    depth = np.where(true <= RANGE, np.round(depth * 1000) / 1000, 0).astype(np.float32)
    color = palette[(instances - 1) % PER_CELL]
    vocabulary = load_vocabulary()
    masks = {}
    for instance in np.unique(instances[instances > 0]).tolist():
        entry = vocabulary.by_name(class_of(instance))
        masks[instance] = PanopticMask(entry.id, entry.kind == "thing")
    panoptic = PanopticFrame(instances, masks)
    options = SegmentParameters.model_validate({})
    geometric = segment_depth(depth, CAMERA, geometric_settings(options))
    fused = fuse(geometric.labels, panoptic, geometric.points, fusion_settings(options))
    return CorridorFrame(depth, color, pose, fused.ids, describe(0, fused).segments, panoptic)


def moved(pose: np.ndarray, cell: int) -> np.ndarray:
    """Return the pose (4, 4) of a frame of the first cell in cell `cell`."""
    result = pose.copy()
    result[0, 3] += cell * LENGTH
    return result
