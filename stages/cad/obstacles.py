"""What stands in a scene whatever models are chosen: layout, and things that keep their mesh."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from pathlib import Path

import numpy as np
import trimesh
from scenewright.schemas.cad_scene import ShellFile
from scenewright.schemas.contact_graph import ContactGraphFile, GraphNode
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.kit.formats.mesh_files import read_mesh
from scenewright.stages.kit.formats.mobility import mobility
from scenewright.stages.kit.formats.scene_supports import (
    Carried,
    carried_by,
    cut_below,
    furniture_pieces,
    levelled,
    resting_height,
    standing_points,
)
from scenewright.stages.kit.geometry.box_cover import cover_with_boxes
from scenewright.stages.kit.geometry.boxes import box_yaw
from scenewright.stages.kit.geometry.layout_slabs import level_of_layout
from scenewright.stages.kit.geometry.solids import hull_or_box
from scenewright.stages.kit.geometry.transforms import transform_from_yaw
from scenewright.stages.kit.measurement.layout_pieces import layout_pieces
from scipy.spatial import QhullError


def obstacles_of(
    graph: ContactGraphFile, layout_folder: Path, mesh_folder: Path, shell: ShellFile | None = None
) -> dict[str, list[tuple[np.ndarray, np.ndarray]]]:
    """Return node -> convex pieces, vertices (V, 3) and faces (F, 3) in the world, of layout (slabs) and of things that
    keep their mesh: the shapes that they have in the exported scene, or nearly so. The folders hold their meshes,
    `<node>.ply`, world frame; `shell`: plates of the layout, where the map tells them."""
    solids = {}
    for name, pieces in layout_pieces(graph, layout_folder, shell).items():
        solids[name] = [_hull(piece.vertices) for piece in pieces]
    carriable = {entry.name for entry in load_vocabulary().classes if entry.movable}
    for node in graph.nodes:
        file = mesh_folder / f"{node.id}.ply"
        mesh = read_mesh(file, may_be_empty=True) if file.is_file() else None
        if mesh is not None and len(mesh.faces):
            solids[node.id] = _in_physics(graph, node, mesh, carriable)
    return solids


def _in_physics(
    graph: ContactGraphFile, node: GraphNode, mesh: trimesh.Trimesh, carriable: Collection[str]
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return the pieces that the exported scene gives a thing with its mesh, by what is free there (and `urdf` does not
    hold): boxes where it stays, convex pieces as furniture or laden, a hull where an arm carries it."""
    nodes = {entry.id: entry for entry in graph.nodes}
    points, carried = np.asarray(mesh.vertices, dtype=float), carried_by(graph, nodes, node.id)
    mobile = mobility(graph, node, carriable, ())
    rests_at = resting_height(graph, nodes, node.id) if mobile.movable else None
    if mobile.furniture or (mobile.movable and carried):
        pieces = furniture_pieces(points, np.asarray(mesh.faces), rests_at)
        return [_hull(piece) for piece in cut_below(pieces, np.eye(4), carried)]
    if mobile.movable:
        return [_hull(points if rests_at is None else standing_points(points, rests_at))]
    return _cover(node, mesh, carried)


def floor_levels(graph: ContactGraphFile, layout_folder: Path) -> dict[str, float]:
    """Return floor node -> height [m] of the level slab that it becomes in the exported scene."""
    levels = {}
    for node in graph.nodes:
        if node.class_name != "floor" or node.box is None:
            continue
        file = layout_folder / f"{node.id}.ply"
        mesh = read_mesh(file, may_be_empty=True) if file.is_file() else None
        levels[node.id] = level_of_layout(node.id, node.class_name, node.planes, node.box, mesh, graph)
    return levels


def _cover(node: GraphNode, mesh: trimesh.Trimesh, carried: Sequence[Carried]) -> list[tuple[np.ndarray, np.ndarray]]:
    yaw = 0.0 if node.box is None else box_yaw(node.box)
    turn = transform_from_yaw(yaw, np.zeros(3))[:3, :3]
    pieces = []
    for center, size in levelled(cover_with_boxes(mesh, yaw), yaw, np.eye(4), carried):
        solid = trimesh.creation.box(extents=size)
        pieces.append(((np.asarray(solid.vertices) + center) @ turn.T, np.asarray(solid.faces)))
    return pieces


def _hull(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    try:
        hull = trimesh.convex.convex_hull(points, qhull_options="QbB Pp Qt QJ")
    except QhullError:
        hull = hull_or_box(points)
    return np.asarray(hull.vertices, dtype=float), np.asarray(hull.faces)
