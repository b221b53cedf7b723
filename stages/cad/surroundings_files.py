"""Read what a map shows without a name, write it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import trimesh
from scenewright.schemas.errors import BadInput
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.stages.cad.parameters import CadParameters
from scenewright.stages.cad.surroundings import Piece, nameless_surface
from scenewright.stages.kit.formats.entity_meshes import EntityMesh, load_entity_mesh
from scenewright.stages.kit.formats.numpy_files import read_arrays
from scenewright.stages.kit.formats.ply_files import ColoredMesh, canonical_order, write_ply


def surroundings_of(
    panoptic_map: PanopticMap, pieces: list[Piece], left: Sequence[int], parameters: CadParameters
) -> EntityMesh | None:
    """Return what the map shows that belongs to nothing, None when there is no such.

    `pieces`: convex pieces of what the scene holds; `left`: instances whose surface counts as nobody's where no piece
    is (what lay on a counter that was mapped as one lump with it). Raises BadInput for a map whose labels do not
    fit its mesh.
    """
    path = panoptic_map.path("mesh_labels.npz")
    if not path.is_file() or not panoptic_map.path("mesh.ply").is_file():
        return None
    mesh = load_entity_mesh(panoptic_map.path("mesh.ply"))
    (instance,) = read_arrays(path, "instance", shapes=("V",), hint="make the map again")
    if len(instance) != len(mesh.vertices):
        raise BadInput(f"{path}: {len(instance)} labels for {len(mesh.vertices)} vertices", hint="make the map again")
    return nameless_surface(
        mesh,
        np.where(np.isin(instance, left), 0, instance),
        pieces,
        clearance=parameters.surroundings_clearance,
        smallest_area=parameters.surroundings_area,
        tolerance=parameters.resting_tolerance,
    )


def rounded_area(surface: EntityMesh | None) -> float:
    """Return the area [m²] of a mesh, for a summary; 0 without one."""
    return 0.0 if surface is None else round(float(trimesh.triangles.area(surface.vertices[surface.faces]).sum()), 2)


def write_surface(surface: EntityMesh, path: Path) -> None:
    """Write the surface as PLY, vertices and faces in canonical order."""
    path.parent.mkdir(exist_ok=True)
    colored = ColoredMesh(surface.vertices.astype(np.float32), surface.faces.astype(np.int32), surface.colors)
    write_ply(path, canonical_order(colored)[0])
