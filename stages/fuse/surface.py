"""The zero surface of the map as a triangle mesh: surface nets over voxel blocks (Gibson 1998), one vertex a cell.

A cell is the cube between eight voxel centres. It has a vertex, the mean of the zero crossings on its edges, as soon as
one edge crosses; every crossing edge yields two triangles between the four cells around it. Unlike marching cubes this
asks only for the two ends of an edge to be observed, so surfaces end where observation ends, not a voxel before. Blocks
are visited in canonical order and voxels in their order, which makes vertex and face order canonical too.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import prange
from scenewright.stages.fuse.voxel_blocks import FIXED_POINT, SIDE, VOXELS, VoxelBlocks, find, pack
from scenewright.stages.kit.compiled import compiled

SMALL_STEPS, ALL = 0b000111, 0b111111
"""Bits of a voxel's crossings."""
BEHIND = np.float32(-1.0)
"""Value of a voxel behind what was seen [truncation distances]."""
OWN_HITS = 2
"""A step that is large makes a surface in cells in which at least so many points were measured."""
NEAR_HITS = 4
"""Any surface needs so many points measured in a cell or those around it: else it was interpolated into thin air."""


@dataclass(frozen=True)
class Surface:
    """vertices (V, 3) float32 [m], faces (F, 3) int32 (counter-clockwise from free space), colors (V, 3) uint8,
    segment (V,) int32: global segment label as stored in the nearest surface voxel, 0 none."""

    vertices: np.ndarray
    faces: np.ndarray
    colors: np.ndarray
    segment: np.ndarray


@compiled(inline="always")
def voxel_at(neighbours: np.ndarray, rank: int, x: int, y: int, z: int) -> int:
    """Return slot * 512 + index of a voxel at -8 <= x, y, z < 16 relative to a block, or -1 where there is no block."""
    slot = neighbours[rank, (x // SIDE + 1) + 3 * (y // SIDE + 1) + 9 * (z // SIDE + 1)]
    if slot < 0:
        return -1
    return slot * VOXELS + (x % SIDE) + SIDE * (y % SIDE) + SIDE * SIDE * (z % SIDE)


@compiled(parallel=True)
def _crossings(
    order: np.ndarray,
    neighbours: np.ndarray,
    tsdf: np.ndarray,
    weight: np.ndarray,
    minimum_weight: float,
    jump: float,
    crossings: np.ndarray,
) -> None:
    """Tell of every voxel in `crossings` (C * 512,) uint8 which of its edges in x, y, z cross zero: bit 0, 1, 2 where
    the step is at most `jump`, bit 3, 4, 5 where it is larger or ends behind what was seen."""
    for rank in prange(order.shape[0]):
        for cell in range(VOXELS):
            x, y, z = cell % SIDE, (cell // SIDE) % SIDE, cell // (SIDE * SIDE)
            voxel = order[rank] * VOXELS + cell
            here_seen = weight[voxel] >= minimum_weight
            for axis in range(3):
                a, b, c = int(axis == 0), int(axis == 1), int(axis == 2)
                next_voxel = voxel_at(neighbours, rank, x + a, y + b, z + c)
                there_seen = next_voxel >= 0 and weight[next_voxel] >= minimum_weight
                if here_seen and there_seen:
                    if (tsdf[voxel] < 0) != (tsdf[next_voxel] < 0):
                        crossings[voxel] |= 1 << axis if abs(tsdf[voxel] - tsdf[next_voxel]) <= jump else 8 << axis
                elif here_seen or there_seen:
                    last = voxel if here_seen else next_voxel
                    if 0 <= tsdf[last] <= jump:
                        # From the last voxel that was seen, one more towards where it was seen from.
                        away = -1 if here_seen else 2
                        last = voxel_at(neighbours, rank, x + away * a, y + away * b, z + away * c)
                    if last >= 0 and weight[last] >= minimum_weight and tsdf[last] > jump:
                        crossings[voxel] |= 8 << axis


@compiled
def _measured_near(neighbours: np.ndarray, rank: int, x: int, y: int, z: int, hits: np.ndarray) -> bool:
    total = 0
    for k in range(z - 1, z + 2):
        for j in range(y - 1, y + 2):
            for i in range(x - 1, x + 2):
                voxel = voxel_at(neighbours, rank, i, j, k)
                if voxel >= 0:
                    total += hits[voxel]
                    if total >= NEAR_HITS:
                        return True
    return False


@compiled(parallel=True)
def _vertices(
    write: bool,
    order: np.ndarray,
    neighbours: np.ndarray,
    coordinates: np.ndarray,
    crossings: np.ndarray,
    hits: np.ndarray,
    tsdf: np.ndarray,
    weight: np.ndarray,
    color: np.ndarray,
    segment: np.ndarray,
    voxel_size: float,
    minimum_weight: float,
    offsets: np.ndarray,
    index: np.ndarray,
    vertices: np.ndarray,
    colors: np.ndarray,
    labels: np.ndarray,
) -> None:
    """Count the vertices of every block into `offsets`, or (write) store them from offsets[rank] on."""
    for rank in prange(order.shape[0]):
        count = 0
        start = offsets[rank]
        origin = coordinates[order[rank]]
        value = np.empty(8, dtype=np.float32)
        voxels = np.empty(8, dtype=np.int64)
        edges = np.empty(8, dtype=np.uint8)
        for cell in range(VOXELS):
            x, y, z = cell % SIDE, (cell // SIDE) % SIDE, cell // (SIDE * SIDE)
            edge_mask = ALL if hits[order[rank] * VOXELS + cell] >= OWN_HITS else SMALL_STEPS
            any_edges = 0
            for corner in range(8):
                voxel = voxel_at(neighbours, rank, x + (corner & 1), y + ((corner >> 1) & 1), z + (corner >> 2))
                voxels[corner] = voxel
                edges[corner] = crossings[voxel] & edge_mask if voxel >= 0 else 0
                any_edges |= edges[corner]
            if any_edges == 0 or not _measured_near(neighbours, rank, x, y, z, hits):
                continue
            for corner in range(8):
                if voxels[corner] >= 0 and weight[voxels[corner]] < minimum_weight:
                    voxels[corner] = -1
                value[corner] = tsdf[voxels[corner]] if voxels[corner] >= 0 else BEHIND
            count_of_edges = 0
            sum_x = 0.0
            sum_y = 0.0
            sum_z = 0.0
            red = 0.0
            green = 0.0
            blue = 0.0
            for axis in range(3):
                bit = 1 << axis
                for corner in range(8):
                    if corner & bit or not edges[corner] & (9 << axis):
                        continue
                    first, second = value[corner], value[corner | bit]
                    along = first / (first - second)
                    count_of_edges += 1
                    sum_x += (corner & 1) + (along if axis == 0 else 0.0)
                    sum_y += ((corner >> 1) & 1) + (along if axis == 1 else 0.0)
                    sum_z += (corner >> 2) + (along if axis == 2 else 0.0)
                    if write:
                        near_corner, far_corner = (corner | bit, corner) if along > 0.5 else (corner, corner | bit)
                        nearest = voxels[near_corner] if voxels[near_corner] >= 0 else voxels[far_corner]
                        red += color[nearest, 0]
                        green += color[nearest, 1]
                        blue += color[nearest, 2]
            if count_of_edges == 0:
                continue
            if write:
                vertex = start + count
                index[rank * VOXELS + cell] = vertex
                vertices[vertex, 0] = (origin[0] * SIDE + x + 0.5 + sum_x / count_of_edges) * voxel_size
                vertices[vertex, 1] = (origin[1] * SIDE + y + 0.5 + sum_y / count_of_edges) * voxel_size
                vertices[vertex, 2] = (origin[2] * SIDE + z + 0.5 + sum_z / count_of_edges) * voxel_size
                scale = 1.0 / (count_of_edges * FIXED_POINT)
                colors[vertex, 0] = np.uint8(min(255.0, red * scale + 0.5))
                colors[vertex, 1] = np.uint8(min(255.0, green * scale + 0.5))
                colors[vertex, 2] = np.uint8(min(255.0, blue * scale + 0.5))
                best = np.float32(2.0)
                for corner in range(8):
                    if voxels[corner] >= 0 and segment[voxels[corner]] > 0 and abs(value[corner]) < best:
                        best = abs(value[corner])
                        labels[vertex] = segment[voxels[corner]]
            count += 1
        if not write:
            offsets[rank] = count


@compiled(parallel=True)
def _faces(
    write: bool,
    order: np.ndarray,
    rank_of_slot: np.ndarray,
    neighbours: np.ndarray,
    crossings: np.ndarray,
    hits: np.ndarray,
    tsdf: np.ndarray,
    weight: np.ndarray,
    minimum_weight: float,
    index: np.ndarray,
    vertices: np.ndarray,
    offsets: np.ndarray,
    faces: np.ndarray,
) -> None:
    """Count the faces of every block into `offsets`, or (write) store them from offsets[rank] on."""
    for rank in prange(order.shape[0]):
        count = 0
        start = offsets[rank]
        quad = np.empty(4, dtype=np.int64)
        for cell in range(VOXELS):
            x, y, z = cell % SIDE, (cell // SIDE) % SIDE, cell // (SIDE * SIDE)
            voxel = order[rank] * VOXELS + cell
            if crossings[voxel] == 0:
                continue
            for axis in range(3):
                if not crossings[voxel] & (9 << axis):
                    continue
                least = OWN_HITS if crossings[voxel] & (8 << axis) else 0
                # The four cells around the edge, counter-clockwise seen from its far end.
                complete = True
                for turn in range(4):
                    second = 1 if turn == 1 or turn == 2 else 0
                    third = 1 if turn >= 2 else 0
                    a, b, c = x, y, z
                    if axis == 0:
                        b, c = y - 1 + second, z - 1 + third
                    elif axis == 1:
                        c, a = z - 1 + second, x - 1 + third
                    else:
                        a, b = x - 1 + second, y - 1 + third
                    around = voxel_at(neighbours, rank, a, b, c)
                    if around < 0:
                        complete = False
                        break
                    quad[turn] = index[rank_of_slot[around // VOXELS] * VOXELS + around % VOXELS]
                    if quad[turn] < 0 or hits[around] < least:
                        complete = False
                        break
                if not complete:
                    continue
                if write:
                    if weight[voxel] >= minimum_weight and tsdf[voxel] >= 0:
                        quad[1], quad[3] = quad[3], quad[1]
                    first = 0.0
                    second_diagonal = 0.0
                    for k in range(3):
                        first += (vertices[quad[0], k] - vertices[quad[2], k]) ** 2
                        second_diagonal += (vertices[quad[1], k] - vertices[quad[3], k]) ** 2
                    turn = 0 if first <= second_diagonal else 1
                    face = start + count
                    for k in range(3):
                        faces[face, k] = quad[(turn + k) % 4]
                        faces[face + 1, k] = quad[(turn + (k + 2 if k else 0)) % 4]
                    faces[face + 1, 1] = quad[(turn + 2) % 4]
                    faces[face + 1, 2] = quad[(turn + 3) % 4]
                count += 2
        if not write:
            offsets[rank] = count


@compiled
def _neighbours(order: np.ndarray, coordinates: np.ndarray, keys: np.ndarray, slots: np.ndarray) -> np.ndarray:
    """Return the slots (B, 27) int32 of the blocks around every block, -1 where there is none."""
    result = np.empty((order.shape[0], 27), dtype=np.int32)
    for rank in range(order.shape[0]):
        x, y, z = coordinates[order[rank]]
        for side in range(27):
            result[rank, side] = find(keys, slots, pack(x + side % 3 - 1, y + (side // 3) % 3 - 1, z + side // 9 - 1))
    return result


def find_neighbours(order: np.ndarray, blocks: VoxelBlocks) -> np.ndarray:
    """Return the slots (B, 27) int32 of the blocks around every block of `order`, x fastest; -1: no block."""
    return _neighbours(order, blocks.coordinates, blocks.keys, blocks.slots)


def _starts(counts: np.ndarray) -> tuple[np.ndarray, int]:
    ends = np.cumsum(counts)
    return ends - counts, int(ends[-1]) if len(ends) else 0


def extract_surface(
    blocks: VoxelBlocks, *, minimum_weight: float, jump: float = 0.75, tsdf: np.ndarray | None = None
) -> Surface:
    """Return the zero surface of the map, or of other values `tsdf` (C, 512) float32 for its voxels.

    Voxels under `minimum_weight` count as unobserved. Neighbouring voxels whose values [truncation distances] differ by
    more than `jump` make a surface only where points were measured (hits.py): on a plane that was seen at a flat angle,
    not between what lies behind a silhouette and the free space beside it. Such a plane may also be where what was seen
    ends, its other side hidden by itself. Ours; the published systems draw every step or none.
    """
    order = blocks.canonical_order()
    neighbours = find_neighbours(order, blocks)
    rank_of_slot = np.empty(len(order), dtype=np.int32)
    rank_of_slot[order] = np.arange(len(order), dtype=np.int32)
    tsdf, weight = (blocks.tsdf if tsdf is None else tsdf).reshape(-1), blocks.weight.reshape(-1)
    fields = (blocks.color.reshape(-1, 3), blocks.segment.reshape(-1))
    crossings = np.zeros(blocks.capacity * VOXELS, dtype=np.uint8)
    _crossings(order, neighbours, tsdf, weight, minimum_weight, jump, crossings)
    crossing_arrays = crossings, blocks.hits.reshape(-1)
    index = np.full(len(order) * VOXELS, -1, dtype=np.int32)

    def vertex_pass(write: bool, offsets: np.ndarray, count: int) -> Surface:
        arrays = np.zeros((count, 3), np.float32), np.zeros((count, 3), np.uint8), np.zeros(count, np.int32)
        _vertices(
            write,
            order,
            neighbours,
            blocks.coordinates,
            *crossing_arrays,
            tsdf,
            weight,
            *fields,
            blocks.voxel_size,
            minimum_weight,
            offsets,
            index,
            *arrays,
        )
        return Surface(arrays[0], np.zeros((0, 3), np.int32), arrays[1], arrays[2])

    offsets = np.zeros(len(order), dtype=np.int64)
    vertex_pass(False, offsets, 0)
    surface = vertex_pass(True, *_starts(offsets))

    def face_pass(write: bool, offsets: np.ndarray, count: int) -> np.ndarray:
        faces = np.zeros((count, 3), dtype=np.int32)
        _faces(
            write,
            order,
            rank_of_slot,
            neighbours,
            *crossing_arrays,
            tsdf,
            weight,
            minimum_weight,
            index,
            surface.vertices,
            offsets,
            faces,
        )
        return faces

    offsets = np.zeros(len(order), dtype=np.int64)
    face_pass(False, offsets, 0)
    faces = face_pass(True, *_starts(offsets))
    return _without_lone_vertices(Surface(surface.vertices, faces, surface.colors, surface.segment))


def _without_lone_vertices(surface: Surface) -> Surface:
    used = np.zeros(len(surface.vertices), dtype=bool)
    used[surface.faces] = True
    new_index = np.cumsum(used, dtype=np.int32) - np.int32(1)
    return Surface(surface.vertices[used], new_index[surface.faces], surface.colors[used], surface.segment[used])
