"""Frames of one room in one light: what a camera's exposure and white balance changed is taken out of their colours.

A camera that sets both itself shows the same wall bright in one frame and dark in the next. Where a frame sees mapped
surface again, the ratio of its colours to the map's, channel by channel, is what changed. It is taken out before the
frame is fused, so each frame needs those before it alone. A frame's cost does not grow with the map: it asks for the
voxels under some of its own pixels.
"""

from __future__ import annotations

from collections import defaultdict

import cv2
import numpy as np
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.fuse.integration import intrinsics_of
from scenewright.stages.fuse.voxel_blocks import FIXED_POINT, SIDE, VoxelBlocks, find, pack
from scenewright.stages.kit.compiled import compiled

KEPT = 0.95
"""Share of a change that is taken out: what is left lets the map drift to the mean of the frames, and no error add up.
Set on the recorded kitchen and office of the data folder."""
STRIDE = 8
"""Every so many-th pixel of every so many-th row is asked: 4,800 of an image of 640 x 480."""
LEAST_PIXELS = 50
"""Fewer that see mapped surface again tell no ratio: the last one of their camera holds."""
LEAST_CHANGE = 0.02
"""Smaller changes of all channels are noise of the estimate, and nothing is done (natural logarithm)."""
DARK, BRIGHT = 8, 247
"""Values between these tell a ratio: beyond, cameras cut off."""
WIDEST = 1.5
"""Largest change that is believed (natural logarithm): five times as bright."""
ON_SURFACE = 0.25
"""Voxels within this share of the truncation of a surface have its colour."""


class Exposure:
    """How the exposure of each camera stands to the map's: a state that goes from frame to frame."""

    def __init__(self) -> None:
        self.changes: dict[str, np.ndarray] = defaultdict(lambda: np.zeros(3))
        """(3,) natural logarithm of a camera's colours over the map's, by its name."""

    def corrected(
        self,
        blocks: VoxelBlocks,
        camera: Camera,
        name: str,
        depth: np.ndarray,
        color: np.ndarray,
        world_from_camera: np.ndarray,
        far: float,
    ) -> np.ndarray:
        """Return the colours (H, W, 3) uint8 of a frame as the map would have them.

        name: of its camera; depth (H, W) float32 [m], used up to `far`; world_from_camera (4, 4).
        """
        now, before = seen_again(blocks, camera, depth, color, world_from_camera, far)
        told = ((now > DARK) & (now < BRIGHT) & (before > DARK) & (before < BRIGHT)).all(axis=1)
        if np.count_nonzero(told) >= LEAST_PIXELS:
            ratio = np.median(np.log(now[told] / before[told]), axis=0)
            self.changes[name] = KEPT * np.clip(ratio, -WIDEST, WIDEST)
        change = self.changes[name]
        if np.abs(change).max() < LEAST_CHANGE:
            return color
        levels = np.arange(256.0)[:, None] * np.exp(-change)
        table = np.clip(np.rint(levels), 0, 255).astype(np.uint8)
        return cv2.LUT(np.ascontiguousarray(color), table[None])


def seen_again(
    blocks: VoxelBlocks, camera: Camera, depth: np.ndarray, color: np.ndarray, world_from_camera: np.ndarray, far: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return the colours (N, 3) of a frame's pixels and of the mapped surface that they see, 0 to 255. far [m]."""
    rows, columns, slots, voxels = _voxels_on_surface(
        depth,
        intrinsics_of(camera),
        world_from_camera,
        far,
        blocks.voxel_size,
        blocks.keys,
        blocks.slots,
        blocks.weight,
        blocks.tsdf,
    )
    return color[rows, columns].astype(float), blocks.color[slots, voxels].astype(float) / FIXED_POINT


@compiled(nogil=True)
def _voxels_on_surface(
    depth: np.ndarray,
    intrinsics: np.ndarray,
    world_from_camera: np.ndarray,
    far: float,
    voxel_size: float,
    keys: np.ndarray,
    slots: np.ndarray,
    weight: np.ndarray,
    tsdf: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return row and column of pixels, and slot and voxel of the mapped surface at their depth, (N,) each."""
    height, width = depth.shape
    fx, fy, cx, cy = intrinsics
    samples = ((height + STRIDE - 1) // STRIDE) * ((width + STRIDE - 1) // STRIDE)
    found = np.empty((4, samples), dtype=np.int64)
    count = 0
    turn = world_from_camera[:3, :3] / voxel_size
    eye_x, eye_y, eye_z = world_from_camera[:3, 3] / voxel_size
    for row in range(STRIDE // 2, height, STRIDE):
        y = (row - cy) / fy
        for column in range(STRIDE // 2, width, STRIDE):
            z = depth[row, column]
            if not 0 < z <= far:
                continue
            x = (column - cx) / fx
            i = int(np.floor(z * (turn[0, 0] * x + turn[0, 1] * y + turn[0, 2]) + eye_x))
            j = int(np.floor(z * (turn[1, 0] * x + turn[1, 1] * y + turn[1, 2]) + eye_y))
            k = int(np.floor(z * (turn[2, 0] * x + turn[2, 1] * y + turn[2, 2]) + eye_z))
            slot = find(keys, slots, pack(i // SIDE, j // SIDE, k // SIDE))
            voxel = (i % SIDE) + SIDE * (j % SIDE) + SIDE * SIDE * (k % SIDE)
            if slot >= 0 and weight[slot, voxel] > 0 and abs(tsdf[slot, voxel]) < ON_SURFACE:
                found[:, count] = row, column, slot, voxel
                count += 1
    rows, columns, blocks, voxels = found[:, :count]
    return rows, columns, blocks, voxels
