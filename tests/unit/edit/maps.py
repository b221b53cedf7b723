"""Maps of a small room made by hand, whole or cut otherwise: numbers, spacing and what masks split differ."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import trimesh
from scenewright.schemas.panoptic_map import PanopticMap

from tests.panoptic_maps import box_mesh, floor_mesh, table_mesh, write_map
from tests.unit.viewing.artifacts import seal

FLOOR, TABLE, CUP, TWIN, SHELF = "floor", "table", "cup", "cup", "cabinet"
ROOM = {
    1: ("floor", floor_mesh()),
    2: ("table", table_mesh()),
    3: ("cup", box_mesh((0.2, 0.0, 0.75), (0.28, 0.08, 0.85))),
    4: ("cup", box_mesh((-0.3, 0.0, 0.75), (-0.22, 0.08, 0.85))),
    5: ("cabinet", box_mesh((-1.0, 0.8, 0.0), (-0.2, 1.1, 0.9))),
}
"""Instance -> class and surface [m]."""


def dense(mesh: trimesh.Trimesh, spacing: float) -> trimesh.Trimesh:
    """The same surface with edges of at most `spacing` [m]."""
    return trimesh.Trimesh(*trimesh.remesh.subdivide_to_size(mesh.vertices, mesh.faces, spacing), process=False)


def room_map(
    root: Path,
    *,
    spacing: float = 0.02,
    number: dict[int, int] | None = None,
    classes: dict[int, str] | None = None,
    without: tuple[int, ...] = (),
    joined: dict[int, int] | None = None,
    unnamed: tuple[int, ...] = (),
) -> PanopticMap:
    """Write the room as a sealed map. `number`: other instance numbers; `joined`: instances that are one with another;
    `unnamed`: those whose surface is there without a name."""
    number, joined = number or {}, joined or {}
    meshes: dict[int, trimesh.Trimesh] = {}
    names: dict[int, str] = {}
    for k, (class_name, mesh) in ROOM.items():
        if k in without:
            continue
        of = joined.get(k, k)
        new = number.get(of, of)
        part = dense(mesh, spacing)
        meshes[new] = trimesh.util.concatenate([meshes[new], part]) if new in meshes else part
        names.setdefault(new, (classes or {}).get(of, class_name))
    root.mkdir(parents=True)
    made = write_map(root, meshes, names)
    if unnamed:
        _forget(made, [number.get(k, k) for k in unnamed])
    seal(root, "panoptic_map")
    return PanopticMap(root)


def _forget(panoptic_map: PanopticMap, instances: list[int]) -> None:
    info = panoptic_map.info
    kept = tuple(entity for entity in info.entities if entity.instance not in instances)
    info.model_copy(update={"entities": kept}).write(panoptic_map.path("entities.json"))
    path = panoptic_map.path("mesh_labels.npz")
    with np.load(path, allow_pickle=False) as archive:
        labels = {name: np.where(np.isin(archive["instance"], instances), 0, archive[name]) for name in archive.files}
    np.savez(path, **labels)
    for instance in instances:
        panoptic_map.path(f"entities/{instance}.ply").unlink()
