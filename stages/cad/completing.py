"""Which things of a scene are completed, so that they stand on what carries them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from scenewright.schemas.base import as_vector
from scenewright.schemas.cad_scene import Inferred
from scenewright.schemas.contact_graph import ContactGraphFile, GraphNode
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.cad.completion import STILL, Completion, completion_of
from scenewright.stages.cad.free_space import FreeSpace
from scenewright.stages.cad.surroundings import Convex, Piece, convex_of
from scenewright.stages.kit.formats.mesh_files import read_mesh
from scenewright.stages.kit.formats.mobility import mobility
from scenewright.stages.kit.formats.scene_supports import carried_by, support_height
from scenewright.stages.kit.geometry.boxes import box_yaw
from scenewright.stages.kit.geometry.solids import hull_or_box

NO_ROOM = "it would not stand, and nothing that would make it stand has room"
"""Why a thing that could be pushed is held."""


def completed(
    graph: ContactGraphFile,
    meshes: Path,
    pieces: Mapping[str, Sequence[Piece]],
    levels: Mapping[str, float],
    shifts: Mapping[str, np.ndarray],
    free_space: FreeSpace,
) -> dict[str, Inferred]:
    """Return node -> what is added to it, for what keeps its mesh (`meshes`/<node>.ply, where it stands) and would not
    stand as it was seen. What cannot be helped has no pieces.

    `graph`: cg'; `pieces`: node -> convex pieces of what stands in the scene, world frame; `levels`: floor node ->
    height [m] that its slab has in physics; `shifts`: node -> how far (3,) it went from where it was seen [m]. What was
    added to one thing is in the way of the next.
    """
    nodes = {node.id: node for node in graph.nodes}
    carriable = {entry.name for entry in load_vocabulary().classes if entry.movable}
    solids = {name: tuple(convex_of(vertices) for vertices, _ in some) for name, some in pieces.items()}
    found: dict[str, Inferred] = {}
    for node in graph.nodes:
        height, file = support_height(graph, nodes, node.id), meshes / f"{node.id}.ply"
        mobile = mobility(graph, node, carriable, ())
        is_laden = mobile.movable and bool(carried_by(graph, nodes, node.id))
        if height is None or node.box is None or not (mobile.furniture or is_laden) or not file.is_file():
            continue
        mesh = read_mesh(file, may_be_empty=True)
        if not len(mesh.faces):
            continue
        link = graph.parent_link(node.id)
        carrier = "" if link is None else link.source
        others, height = _others(solids, nodes, {node.id, carrier}), levels.get(carrier, height)
        points = np.asarray(mesh.vertices, dtype=float)
        seen = [vertices for vertices, _ in pieces[node.id]]
        yaw, went = box_yaw(node.box), shifts.get(node.id, STILL)
        added = completion_of(points, np.asarray(mesh.faces), seen, height, yaw, free_space, others, went)
        if added is None:
            found[node.id] = Inferred(what="", because=NO_ROOM)
        elif added.pieces:
            found[node.id] = _record(added, carrier, float(points[:, 2].min()) - height)
            solids[node.id] = (*solids.get(node.id, ()), *(convex_of(piece) for piece in added.pieces))
    return found


def hulls_of(inferred: Inferred) -> list[Piece]:
    """Return what is added to a thing as convex pieces, world frame."""
    solids = [hull_or_box(np.array(corners)) for corners in inferred.pieces]
    return [(solid.vertices, solid.faces) for solid in solids]


def _others(solids: Mapping[str, Sequence[Convex]], nodes: Mapping[str, GraphNode], left_out: set[str]) -> list[Convex]:
    """Return what stands in a room but for floors, which everything goes down to."""
    floors = {name for name, node in nodes.items() if node.class_name == "floor"}
    return [piece for name, some in solids.items() if name not in left_out | floors for piece in some]


def _record(added: Completion, carrier: str, gap: float) -> Inferred:
    corners = [hull_or_box(piece).vertices for piece in added.pieces]
    ends = f"ends {1000 * gap:.0f} mm above {carrier}" if gap > 0.0 else f"reaches down to {carrier}"
    return Inferred(
        what=added.what,
        because=f"what was seen {ends} and would not stand there",
        pieces=tuple(tuple(as_vector(np.round(corner, 4)) for corner in piece) for piece in corners),
    )
