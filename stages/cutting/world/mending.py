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
GROWN = 0.001
"""Share of a body that is nothing: parts that do not quite touch are grown by it, faces so near a hull lie on it. More
than files round, less than a knife can do."""
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
    merged.update_faces(merged.nondegenerate_faces())
    once = merged.copy()
    once.update_faces(once.unique_faces())
    if once.is_watertight:
        parts = [once]
    elif parts := closed_parts(merged):
        mended.append(f"{len(parts)} closed parts that share faces or edges united")
    elif _is_hull(once):
        parts = [once.convex_hull]
        mended.append("faces that lie over each other taken for the convex body that they enclose")
    else:
        filled = once.copy()
        filled.fill_holes()
        if not filled.is_watertight:
            raise _open(once, path)
        parts = [filled]
        mended.append("holes filled")
    if any(not part.is_winding_consistent or part.volume < 0 for part in parts):
        for part in parts:
            trimesh.repair.fix_normals(part)
        mended.append("faces turned outwards")
    components = [component for part in parts for component in part.split(only_watertight=False)]
    try:
        bodies = [Body.of_mesh(part.vertices, part.faces) for part in components]
    except ValueError as error:
        raise BadInput(f"{path}: no closed body: {error}", hint="repair it in a mesh editor") from None
    if len(bodies) == 1:
        return bodies[0], mended
    united = unite(bodies)
    if len(united) > 1:
        united = unite([body.grown(GROWN) for body in bodies])
        mended.append(f"parts grown by {100 * GROWN:g} % to close the gaps between them")
    if len(united) > 1:
        raise BadInput(f"{path}: {len(unite(bodies))} bodies that do not hang together", hint="give them one by one")
    if len(parts) == 1:
        mended.append(f"{len(components)} bodies that pass through each other united")
    return united[0], mended


def closed_parts(mesh: trimesh.Trimesh) -> list[trimesh.Trimesh]:
    """Return the parts of a mesh that are closed by themselves, in the order of its faces, each as short a run of faces
    as closes; none where the last one stays open. A part is closed where every edge has an even number of faces."""
    parts: list[trimesh.Trimesh] = []
    once: set[tuple[int, int]] = set()
    first = 0
    for number, (a, b, c) in enumerate(mesh.faces.tolist(), start=1):
        for edge in ((a, b), (b, c), (c, a)):
            once ^= {(min(edge), max(edge))}
        if once:
            continue
        part = trimesh.Trimesh(mesh.vertices, mesh.faces[first:number], process=False)
        part.remove_unreferenced_vertices()
        if part.is_watertight and part.volume != 0.0:  # a face and its reverse close as well, around nothing
            parts.append(part)
        first = number
    return parts if not once else []


def _is_hull(mesh: trimesh.Trimesh) -> bool:
    """Whether faces leave no edge open, and each of them lies on the convex hull."""
    inside = GROWN * mesh.scale
    if min(mesh.extents) < inside or (_edge_counts(mesh) == 1).any():
        return False
    heights = (mesh.vertices[None] - mesh.triangles_center[:, None]) * mesh.face_normals[:, None]
    sides = heights.sum(axis=2)
    return bool((np.minimum(sides.max(axis=1), -sides.min(axis=1)) < inside).all())


def _edge_counts(mesh: trimesh.Trimesh) -> np.ndarray:
    """Return how many faces each edge has (E,)."""
    return np.asarray(np.unique(mesh.edges_sorted, axis=0, return_counts=True)[1])


def _open(mesh: trimesh.Trimesh, path: Path) -> BadInput:
    counts = _edge_counts(mesh)
    if (counts == 1).any():
        return BadInput(f"{path}: open: {(counts == 1).sum()} edges have one face", hint="close it in a mesh editor")
    return BadInput(
        f"{path}: {(counts > 2).sum()} edges have three faces or more",
        hint="take away faces that lie over each other or inside, in a mesh editor",
    )


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
