"""The files of a panoptic map."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scenewright.stages.fuse.closing import ClosedMap
from scenewright.stages.fuse.free_space import FreeSpace
from scenewright.stages.fuse.voxel_blocks import FIXED_POINT, VoxelBlocks
from scenewright.stages.kit.formats.map_files import mesh_name, write_arrays
from scenewright.stages.kit.formats.ply_files import ColoredMesh, write_ply


def volume_arrays(blocks: VoxelBlocks, merged: np.ndarray) -> dict[str, np.ndarray]:
    """Return the voxels in canonical block order: block_coordinates (B, 3) int32, tsdf (B, 512) float16 in truncation
    distances, weight (B, 512) float16, segment (B, 512) int32 merged labels, color (B, 512, 3) uint8."""
    order = blocks.canonical_order()
    return {
        "block_coordinates": blocks.coordinates[order],
        "tsdf": blocks.tsdf[order].astype(np.float16),
        "weight": blocks.weight[order].astype(np.float16),
        "segment": merged[blocks.segment[order]],
        "color": np.minimum(blocks.color[order] // FIXED_POINT, 255).astype(np.uint8),
    }


def write_meshes(root: Path, closed: ClosedMap) -> None:
    """Write what a contact graph is built from: entities.json, a mesh per entity and the whole mesh."""
    (root / "entities").mkdir(parents=True, exist_ok=True)
    closed.file.write(root / "entities.json")
    if closed.layout is not None:
        closed.layout.write(root / "layout.json")
    if closed.because is not None:
        closed.because.write(root / "because.json")
    write_ply(root / "mesh.ply", ColoredMesh(closed.surface.vertices, closed.surface.faces, closed.surface.colors))
    for entity in closed.entities:
        write_ply(root / mesh_name(entity.instance), entity.mesh)


def write_payload(root: Path, closed: ClosedMap, blocks: VoxelBlocks, free_space: FreeSpace | None) -> None:
    """Write every file of schemas/panoptic_map.py under `root`. `free_space`: None of maps of other rules than ours."""
    write_meshes(root, closed)
    labelled = closed.labelled
    labels = {"instance": labelled.instance, "segment": labelled.segment, "class_id": labelled.class_id}
    write_arrays(root / "mesh_labels.npz", labels)
    write_arrays(root / "counts.npz", closed.counts.as_arrays())
    write_arrays(root / "volume.npz", volume_arrays(blocks, closed.merged))
    if free_space is not None:
        write_arrays(root / "free_space.npz", free_space.as_arrays())
