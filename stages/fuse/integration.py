"""Projective TSDF integration with colour and a label vote per voxel (Han 2024, section 2.3.3; Oleynikova 2017).

Weights follow Voxblox: a measurement at depth z weighs min(1, 1/z^2), as the noise of depth cameras grows with z^2,
and falls linearly to zero from one voxel behind the surface to the truncation distance, as what lies behind a surface
is a guess; thin boards seen from both sides survive that way. 1/z^2 is what inverse variances give for a deviation of
1 % of the depth; where a frame states the deviation of a pixel, that one takes its place.
"""

from __future__ import annotations

import numpy as np
from numba import parallel_chunksize, prange
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.fuse.hits import count_hits, sure_depth
from scenewright.stages.fuse.voxel_blocks import FIXED_POINT, SIDE, VoxelBlocks
from scenewright.stages.kit.compiled import compiled

FULL_WEIGHT_DEVIATION = 0.02
"""Depth of this standard deviation, or less, weighs 1 [m]."""
LARGEST_VOTE = 32000
"""Largest lead of a voxel's label: it has 16 bits with a sign."""
CHUNK = 64
"""Blocks that a thread takes at a time: blocks differ in how much of them is seen, threads in what else they do."""


def intrinsics_of(camera: Camera) -> np.ndarray:
    """Return (fx, fy, cx, cy) [pixels] as (4,) float64."""
    return np.array([camera.fx, camera.fy, camera.cx, camera.cy], dtype=np.float64)


@compiled(parallel=True, nogil=True, error_model="numpy")
def _integrate(
    touched: np.ndarray,
    coordinates: np.ndarray,
    tsdf: np.ndarray,
    weight: np.ndarray,
    color: np.ndarray,
    segment: np.ndarray,
    votes: np.ndarray,
    depth: np.ndarray,
    deviation: np.ndarray,
    image: np.ndarray,
    index_image: np.ndarray,
    label_of_index: np.ndarray,
    canonical: np.ndarray,
    camera_from_world: np.ndarray,
    intrinsics: np.ndarray,
    voxel_size: float,
    truncation: float,
    label_band: float,
    near: float,
    far: float,
    maximum_weight: float,
) -> None:
    height, width = depth.shape
    fx, fy, cx, cy = np.float32(intrinsics[0]), np.float32(intrinsics[1]), np.float32(intrinsics[2]), intrinsics[3]
    cx_half, cy_half = np.float32(cx + 0.5), np.float32(cy + 0.5)
    last_column, last_row = np.float32(width), np.float32(height)
    band, reach = np.float32(truncation), np.float32(label_band)
    one, zero = np.float32(1.0), np.float32(0.0)
    voxel = np.float32(voxel_size)
    inverse_band = one / band
    drop = one / (band - voxel) if band > voxel else zero
    heaviest, nearest, farthest = np.float32(maximum_weight), np.float32(near), np.float32(far)
    step = (camera_from_world[:, :3] * voxel_size).astype(np.float32)
    variance = np.float32(FULL_WEIGHT_DEVIATION * FULL_WEIGHT_DEVIATION)
    has_deviation = deviation.shape[0] > 0
    has_color = image.shape[0] > 0
    has_labels = index_image.shape[0] > 0
    for number in prange(touched.shape[0]):
        slot = touched[number]
        # The block's origin goes through float64, the small offsets inside it through float32.
        corner = (coordinates[slot] * SIDE + 0.5) * voxel_size
        start_x = np.float32(np.dot(camera_from_world[0, :3], corner) + camera_from_world[0, 3])
        start_y = np.float32(np.dot(camera_from_world[1, :3], corner) + camera_from_world[1, 3])
        start_z = np.float32(np.dot(camera_from_world[2, :3], corner) + camera_from_world[2, 3])
        us, vs, zs = np.empty(SIDE, np.float32), np.empty(SIDE, np.float32), np.empty(SIDE, np.float32)
        for row_number in range(SIDE * SIDE):
            k, j = np.float32(row_number // SIDE), np.float32(row_number % SIDE)
            row_x = start_x + step[0, 1] * j + step[0, 2] * k
            row_y = start_y + step[1, 1] * j + step[1, 2] * k
            row_z = start_z + step[2, 1] * j + step[2, 2] * k
            for i in range(SIDE):  # without branches: eight voxels are projected at a time
                offset = np.float32(i)
                zs[i] = row_z + step[2, 0] * offset
                inverse = one / zs[i]
                us[i] = fx * (row_x + step[0, 0] * offset) * inverse + cx_half
                vs[i] = fy * (row_y + step[1, 0] * offset) * inverse + cy_half
            for i in range(SIDE):
                z, u, v = zs[i], us[i], vs[i]
                if z < nearest:
                    continue
                if not (zero <= u < last_column and zero <= v < last_row):
                    continue
                column, row = int(u), int(v)
                measured = depth[row, column]
                if not (nearest <= measured <= farthest):
                    continue
                distance = measured - z
                if distance <= -band:
                    continue
                voxel_index = row_number * SIDE + i
                gain = min(one, one / (measured * measured))
                if has_deviation:
                    sigma = deviation[row, column]
                    if sigma > zero:
                        gain = min(one, variance / (sigma * sigma))
                if distance < -voxel:
                    gain *= (band + distance) * drop
                old_weight = weight[slot, voxel_index]
                total = old_weight + gain
                value = min(one, distance * inverse_band)
                tsdf[slot, voxel_index] = (tsdf[slot, voxel_index] * old_weight + value * gain) / total
                weight[slot, voxel_index] = min(total, heaviest)
                if distance > band:
                    continue
                if has_color:
                    share = gain / total
                    if (
                        color[slot, voxel_index, 0] == 0
                        and color[slot, voxel_index, 1] == 0
                        and color[slot, voxel_index, 2] == 0
                    ):
                        share = one
                    for channel in range(3):
                        before = np.float32(color[slot, voxel_index, channel])
                        now = np.float32(image[row, column, channel]) * np.float32(FIXED_POINT)
                        color[slot, voxel_index, channel] = np.uint16(before + share * (now - before) + np.float32(0.5))
                if has_labels and abs(distance) <= reach:
                    label = label_of_index[index_image[row, column]]
                    if label > 0:
                        if canonical[segment[slot, voxel_index]] == label:
                            votes[slot, voxel_index] = min(votes[slot, voxel_index] + 1, LARGEST_VOTE)
                        else:
                            votes[slot, voxel_index] -= 1
                            if votes[slot, voxel_index] < 0:
                                segment[slot, voxel_index] = label
                                votes[slot, voxel_index] = 1


NO_IMAGE = np.zeros((0, 0, 3), dtype=np.uint8)
"""Stands for the image of a frame without colour."""
NO_DEVIATION = np.zeros((0, 0), dtype=np.float32)
"""Stands for the deviations of a frame that states none."""
NO_INDEX = np.zeros((0, 0), dtype=np.uint16)
"""Stands for the segments of a frame without any."""
NO_LABELS = np.zeros(1, dtype=np.int32)
"""Stands for the labels of a frame without segments."""


def integrate(
    blocks: VoxelBlocks,
    depth: np.ndarray,
    camera: Camera,
    world_from_camera: np.ndarray,
    *,
    truncation: float,
    near: float,
    far: float,
    deviation: np.ndarray | None = None,
    color: np.ndarray | None = None,
    index_image: np.ndarray | None = None,
    label_of_index: np.ndarray = NO_LABELS,
    canonical: np.ndarray = NO_LABELS,
    label_band: float | None = None,
    maximum_weight: float = 1000.0,
    stride: int = 4,
) -> int:
    """Fuse one frame into `blocks`; return the number of blocks it touched.

    depth (H, W) float32 [m], 0 invalid; deviation (H, W) float32 [m], its standard deviation, 0 unknown, or None;
    world_from_camera (4, 4); color (H, W, 3) uint8 or None. Voxels centred within `label_band` [m] (default: the
    truncation) of the measured depth vote: the pixel's index in index_image (H, W) uint16 gives their global segment
    label label_of_index[index] (int32, 0: no vote). `canonical` (int32) tells which label each earlier label was merged
    into. The vote: same label +1, another -1, below 0 it takes over with 1. Voxels in front of the band count as free
    (value 1) in the blocks that are touched. Every voxel is written by one thread only, so the result does not depend
    on their number.
    """
    intrinsics = intrinsics_of(camera)
    world_from_camera = np.ascontiguousarray(world_from_camera, dtype=np.float64)
    depth = np.ascontiguousarray(depth, dtype=np.float32)
    touched = blocks.touch(
        depth, intrinsics, world_from_camera, truncation=truncation, near=near, far=far, stride=stride
    )
    count_hits(blocks, sure_depth(depth, deviation), intrinsics, world_from_camera, near=near, far=far)
    with parallel_chunksize(CHUNK):
        _integrate(
            touched,
            blocks.coordinates,
            blocks.tsdf,
            blocks.weight,
            blocks.color,
            blocks.segment,
            blocks.votes,
            depth,
            NO_DEVIATION if deviation is None else np.ascontiguousarray(deviation, dtype=np.float32),
            NO_IMAGE if color is None else np.ascontiguousarray(color),
            NO_INDEX if index_image is None else index_image,
            label_of_index,
            canonical,
            np.ascontiguousarray(np.linalg.inv(world_from_camera)),
            intrinsics,
            blocks.voxel_size,
            truncation,
            truncation if label_band is None else label_band,
            near,
            far,
            maximum_weight,
        )
    return len(touched)
