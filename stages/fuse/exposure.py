"""Frames of one room in one light: what a camera's exposure and white balance changed is taken out of their colours.

A camera that sets both itself shows the same wall bright in one frame and dark in the next. Where a frame sees mapped
surface again, the ratio of its colours to the map's, channel by channel, is what changed. It is taken out before the
frame is fused, so each frame needs those before it alone.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.fuse.voxel_blocks import FIXED_POINT, SIDE, VOXELS, VoxelBlocks

KEPT = 0.95
"""Share of a change that is taken out: what is left lets the map drift to the mean of the frames, and no error add up.
Set on the recorded kitchen and office of the data folder."""
LEAST_VOXELS = 200
"""Fewer that are seen again tell no ratio: the last one holds."""
MOST_BLOCKS = 400
"""Blocks that are looked at, evenly over those in sight."""
LEAST_CHANGE = 0.02
"""Smaller changes of all channels are noise of the estimate, and nothing is done (natural logarithm)."""
DARK, BRIGHT = 8, 247
"""Values between these tell a ratio: beyond, cameras cut off."""
WIDEST = 1.5
"""Largest change that is believed (natural logarithm): five times as bright."""
ON_SURFACE = 0.25
"""Voxels within this share of the truncation of a surface have its colour."""


@dataclass
class Exposure:
    """How a camera's exposure stands to the map's; a state that goes from frame to frame."""

    change: np.ndarray
    """(3,) natural logarithm of the frame's colours over the map's."""

    def corrected(
        self,
        blocks: VoxelBlocks,
        camera: Camera,
        depth: np.ndarray,
        color: np.ndarray,
        world_from_camera: np.ndarray,
        truncation: float,
    ) -> np.ndarray:
        """Return the colours (H, W, 3) uint8 of a frame as the map would have them. depth (H, W), truncation [m]."""
        now, before = seen_again(blocks, camera, depth, color, world_from_camera, truncation)
        told = ((now > DARK) & (now < BRIGHT) & (before > DARK) & (before < BRIGHT)).all(axis=1)
        if np.count_nonzero(told) >= LEAST_VOXELS:
            ratio = np.median(np.log(now[told] / before[told]), axis=0)
            self.change = KEPT * np.clip(ratio, -WIDEST, WIDEST)
        if np.abs(self.change).max() < LEAST_CHANGE:
            return color
        levels = np.arange(256.0)[:, None] * np.exp(-self.change)
        table = np.clip(np.rint(levels), 0, 255).astype(np.uint8)
        return np.stack([table[color[..., channel], channel] for channel in range(3)], axis=-1)


def seen_again(
    blocks: VoxelBlocks,
    camera: Camera,
    depth: np.ndarray,
    color: np.ndarray,
    world_from_camera: np.ndarray,
    truncation: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the colours (N, 3) of mapped voxels in a frame and in the map, 0 to 255, where both show the same
    surface."""
    size, edge = blocks.voxel_size, SIDE * blocks.voxel_size
    coordinates = blocks.coordinates[: blocks.count]
    rows, columns, far = projected((coordinates + 0.5) * edge, camera, world_from_camera)
    reach = 0.5 * np.sqrt(3.0) * edge
    near = np.nonzero(rows >= 0)[0]
    near = near[np.abs(depth[rows[near], columns[near]] - far[near]) < reach]
    if len(near) == 0:
        return np.zeros((0, 3)), np.zeros((0, 3))
    chosen = near[np.unique(np.linspace(0, len(near) - 1, MOST_BLOCKS).astype(int))]
    inner = np.arange(VOXELS)
    offsets = np.column_stack([inner % SIDE, inner // SIDE % SIDE, inner // SIDE**2]) + 0.5
    slot, voxel = np.nonzero((blocks.weight[chosen] > 0) & (np.abs(blocks.tsdf[chosen]) < ON_SURFACE))
    points = (coordinates[chosen][slot] * SIDE + offsets[voxel]) * size
    rows, columns, far = projected(points, camera, world_from_camera)
    kept = np.nonzero(rows >= 0)[0]
    kept = kept[np.abs(depth[rows[kept], columns[kept]] - far[kept]) < ON_SURFACE * truncation]
    before = blocks.color[chosen[slot[kept]], voxel[kept]].astype(float) / FIXED_POINT
    return color[rows[kept], columns[kept]].astype(float), before


def projected(
    points: np.ndarray, camera: Camera, world_from_camera: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return row and column (N,) of points (N, 3), world, in an image, -1 beside it, and how far before it they are
    [m]."""
    local = (points - world_from_camera[:3, 3]) @ world_from_camera[:3, :3]
    z = np.maximum(local[:, 2], 1e-6)
    column = np.floor(camera.fx * local[:, 0] / z + camera.cx + 0.5)
    row = np.floor(camera.fy * local[:, 1] / z + camera.cy + 0.5)
    inside = (local[:, 2] > 0) & (row >= 0) & (row < camera.height) & (column >= 0) & (column < camera.width)
    return np.where(inside, row, -1).astype(int), np.where(inside, column, -1).astype(int), local[:, 2]
