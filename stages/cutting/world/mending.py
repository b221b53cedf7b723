"""Closed bodies out of a user's meshes: mended where the libraries can, which is said; else refused with the reason."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import numpy as np
import trimesh
from scenewright.schemas.errors import BadInput
from scenewright.stages.cutting.world.body import Body, unite
from scenewright.stages.cutting.world.canonical import canonical
from scenewright.stages.cutting.world.voxels import Grid, occupancy
from scenewright.stages.kit.formats.mesh_files import read_mesh

LONGEST, SHORTEST = 1.0, 0.004
"""Edge of what lies on a board [m]."""
MOST_FACES = 200_000
"""Most triangles of a mesh that is cut; by eye."""
UNLIKE = 0.05
"""Share by which the volume that faces enclose may differ from the space inside: overlaps count twice."""
LATTICE = 64
"""Steps along each edge of the box around a mesh, at which it is asked what is inside."""
SUFFIXES = (".ply", ".obj", ".stl", ".glb")


def read_body(path: Path, unit: Literal["m", "mm"]) -> tuple[Body, list[str]]:
    """Return the closed body in a mesh file, centred, and what was mended of it.

    Raises BadInput: no mesh, open, self-intersecting, in pieces, of a size that is no food's.
    """
    mesh = read_mesh(path, hint="give a closed mesh (PLY, OBJ, STL, GLB)")
    if len(mesh.faces) > MOST_FACES:
        raise BadInput(f"{path}: {len(mesh.faces)} triangles, at most {MOST_FACES} are cut", hint="decimate it")
    if unit == "mm":
        mesh.apply_scale(1e-3)
    _check_size(float(np.ptp(mesh.vertices, axis=0).max()), path, unit)
    body, mended = _close(mesh, path)
    inside = _space_inside(body)
    if abs(inside - body.volume) > UNLIKE * max(inside, body.volume):
        raise BadInput(
            f"{path}: self-intersecting: its faces enclose {1e6 * body.volume:.2f} cm3, the space inside is "
            f"{1e6 * inside:.2f} cm3",
            hint="unite its parts in a mesh editor",
        )
    return body.shifted(-body.moments[0]), mended


def _space_inside(body: Body) -> float:
    """Return the volume [m^3] of the space that is inside by the parity of faces, on a lattice that is as fine along
    thin edges as along long ones."""
    shape = canonical(body)
    low, high = shape.bounds
    step = (high - low) / LATTICE
    filled = occupancy((shape.vertices - low) / step, shape.faces, Grid(np.zeros(3), 1.0, (LATTICE,) * 3))
    return float(filled.sum() * step.prod())


def _check_size(longest: float, path: Path, unit: str) -> None:
    if longest > LONGEST:
        hint = "is it in millimetres? give --unit mm" if unit == "m" else "give a mesh of what lies on a board"
        raise BadInput(f"{path}: {longest:.1f} m long, at most {LONGEST:.0f} m are cut", hint=hint)
    if longest < SHORTEST:
        hint = "is it in metres? give --unit m" if unit == "mm" else "give a mesh in metres"
        raise BadInput(f"{path}: {1e3 * longest:.2f} mm long, at least {1e3 * SHORTEST:.0f} mm are cut", hint=hint)


def _close(mesh: trimesh.Trimesh, path: Path) -> tuple[Body, list[str]]:
    mended = []
    merged = trimesh.Trimesh(mesh.vertices, mesh.faces, process=True)  # files like STL repeat vertices: not a fault
    merged.update_faces(merged.nondegenerate_faces() & merged.unique_faces())
    if not merged.is_watertight:
        merged.fill_holes()
        if not merged.is_watertight:
            edges = len(trimesh.grouping.group_rows(merged.edges_sorted, require_count=1))
            raise BadInput(f"{path}: open: {edges} edges have one face", hint="close it in a mesh editor")
        mended.append("holes filled")
    if not merged.is_winding_consistent or merged.volume < 0:
        trimesh.repair.fix_normals(merged)
        mended.append("faces turned outwards")
    components = merged.split(only_watertight=False)
    try:
        if len(components) == 1:
            return Body.of_mesh(merged.vertices, merged.faces), mended
        united = unite([Body.of_mesh(part.vertices, part.faces) for part in components])
    except ValueError as error:
        raise BadInput(f"{path}: no closed body: {error}", hint="repair it in a mesh editor") from None
    if len(united) > 1:
        raise BadInput(f"{path}: {len(united)} bodies that do not hang together", hint="give them one by one")
    return united[0], [*mended, f"{len(components)} bodies that pass through each other united"]


def read_bodies_of(folder: Path, unit: Literal["m", "mm"]) -> tuple[list[Body], list[str]]:
    """Return the bodies of the mesh files of a folder by name, or of one file. Raises BadInput."""
    folder = Path(folder)
    paths = [folder] if folder.is_file() else sorted(p for p in folder.iterdir() if p.suffix.lower() in SUFFIXES)
    if not paths:
        raise BadInput(f"{folder}: holds no meshes", hint=f"known: {', '.join(SUFFIXES)}")
    bodies_read = [(path, *read_body(path, unit)) for path in paths]
    return [body for _, body, _ in bodies_read], [
        f"{path.name}: {text}" for path, _, mended in bodies_read for text in mended
    ]
