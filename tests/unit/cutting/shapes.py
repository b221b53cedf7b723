"""What a fragment is, measured without any of the planner's code: sections, chords and boxes of plain meshes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import trimesh


def section_area(mesh: trimesh.Trimesh, origin: np.ndarray, normal: np.ndarray) -> float:
    """Return the area that a plane cuts out of a closed mesh [m^2], by the shoelace formula over its segments."""
    segments, faces = trimesh.intersections.mesh_plane(mesh, normal, origin, return_faces=True)
    if len(segments) == 0:
        return 0.0
    ahead = np.cross(normal, mesh.face_normals[faces])
    along = segments[:, 1] - segments[:, 0]
    segments = np.where(((along * ahead).sum(axis=1) > 0)[:, None, None], segments, segments[:, ::-1]) - origin
    return abs(float(0.5 * (np.cross(segments[:, 0], segments[:, 1]) @ normal).sum()))


def chord(mesh: trimesh.Trimesh, origin: np.ndarray, direction: np.ndarray) -> float:
    """Return how much of a line lies in a closed mesh [m]."""
    a, b, c = (mesh.triangles[:, k] for k in range(3))
    p = np.cross(direction, c - a)
    det = ((b - a) * p).sum(axis=1)
    with np.errstate(all="ignore"):
        u = ((origin - a) * p).sum(axis=1) / det
        q = np.cross(origin - a, b - a)
        v = (q @ direction) / det
        t = ((c - a) * q).sum(axis=1) / det
        hits = (np.abs(det) > 1e-18) & (u >= 0) & (v >= 0) & (u + v <= 1)
    entering = np.sign(mesh.face_normals[hits] @ direction)
    return abs(float((t[hits] * entering).sum()))


def box_of(mesh: trimesh.Trimesh) -> np.ndarray:
    """Return the edges (3,) [m] of the smallest box around a mesh, shortest first."""
    return np.sort(trimesh.bounds.oriented_bounds(mesh)[1])


def is_what_it_is_called(name: str, fragments: Sequence[trimesh.Trimesh], thing: trimesh.Trimesh) -> list[bool]:
    """Return whether each fragment, lying where it was in the thing, is what the word says."""
    edges = box_of(thing)
    long = long_direction(name, fragments, thing)
    right = []
    for mesh in fragments:
        box = box_of(mesh)
        along = mesh.vertices @ long
        middle = mesh.center_mass + long * (0.5 * (along.min() + along.max()) - mesh.center_mass @ long)
        if name == "slices":
            whole = section_area(mesh, middle, long) > 0.9 * section_area(thing, middle, long)
            right.append(whole and np.ptp(along) < 1.55 * edges[0])
        elif name == "strips":
            uncut = np.ptp(along) > 0.9 * chord(thing, mesh.center_mass, long)
            right.append(uncut and box[2] > 1.9 * box[1])
        else:
            right.append(box[2] / box[0] < (1.55 if name == "cubes" else 4.1))
    return right


def long_direction(name: str, fragments: Sequence[trimesh.Trimesh], thing: trimesh.Trimesh) -> np.ndarray:
    """Return the direction (3,) along which a thing is longest. Where several are (a ball, a disc, a cube; a cone's box
    leans), that along which slices are thin or strips run, if it is as long as the longest but for a few percent."""
    to_box, edges = trimesh.bounds.oriented_bounds(thing)
    long = to_box[int(np.argmax(edges)), :3]
    middle = fragments[len(fragments) // 2]
    to_box, edges_of_middle = trimesh.bounds.oriented_bounds(middle)
    other = to_box[int(np.argmin(edges_of_middle) if name == "slices" else np.argmax(edges_of_middle)), :3]
    return other if np.ptp(thing.vertices @ other) > 0.95 * edges.max() else long


def evenness(name: str, fragments: Sequence[trimesh.Trimesh], thing: trimesh.Trimesh) -> float:
    """Return the largest over the smallest fragment: thickness of slices, volume of everything else."""
    long = long_direction(name, fragments, thing)
    sizes = [np.ptp(mesh.vertices @ long) if name == "slices" else mesh.volume for mesh in fragments]
    return float(max(sizes) / min(sizes))
