"""The files of a panoptic map."""

from __future__ import annotations

import zipfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from stages.fuse.closing import ClosedMap, mesh_name
from stages.fuse.voxel_blocks import FIXED_POINT, VoxelBlocks
from stages.kit.formats.ply_files import ColoredMesh, write_ply

FIXED_TIMESTAMP = (1980, 1, 1, 0, 0, 0)


def write_arrays(path: Path, arrays: Mapping[str, np.ndarray]) -> None:
    """Write arrays as NPZ that np.load reads: names sorted, fixed time stamps, fast compression, the same bytes."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        for name in sorted(arrays):
            entry = zipfile.ZipInfo(f"{name}.npy", date_time=FIXED_TIMESTAMP)
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.create_system = 3
            entry.external_attr = 0o644 << 16
            with archive.open(entry, "w", force_zip64=True) as file:
                np.lib.format.write_array(file, np.ascontiguousarray(arrays[name]), allow_pickle=False)


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
    write_ply(root / "mesh.ply", ColoredMesh(closed.surface.vertices, closed.surface.faces, closed.surface.colors))
    for entity in closed.entities:
        write_ply(root / mesh_name(entity.instance), entity.mesh)


def write_payload(root: Path, closed: ClosedMap, blocks: VoxelBlocks) -> None:
    """Write every file of schemas/panoptic_map.py under `root`."""
    write_meshes(root, closed)
    labelled = closed.labelled
    labels = {"instance": labelled.instance, "segment": labelled.segment, "class_id": labelled.class_id}
    write_arrays(root / "mesh_labels.npz", labels)
    write_arrays(root / "counts.npz", closed.counts.as_arrays())
    write_arrays(root / "volume.npz", volume_arrays(blocks, closed.merged))
