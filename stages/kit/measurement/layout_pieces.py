"""Floor, walls and ceiling of a CAD scene as the convex slabs that they collide with once it is exported."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scenewright.schemas.cad_scene import ShellFile
from scenewright.schemas.contact_graph import ContactGraphFile
from scenewright.stages.kit.formats.mesh_files import read_mesh
from scenewright.stages.kit.geometry.layout_slabs import Slab, slabs_of_layout, slabs_of_panel
from scenewright.stages.kit.measurement.convex_overlap import ConvexPiece, convex_piece


def layout_pieces(
    graph: ContactGraphFile, layout_folder: Path, shell: ShellFile | None
) -> dict[str, list[ConvexPiece]]:
    """Return layout node -> the slabs that it collides with in the exported scene, as convex pieces in the world.

    Those of the shell, where it has any of the node; else made of planes, mesh (`<node>.ply` in `layout_folder`, where
    there is one) and box, as the scene's files make them.
    """
    plates = plates_of(shell)
    boxes = [node.box for node in graph.nodes if node.box is not None]
    if not boxes:
        return {}
    centers = np.array([box.center for box in boxes])
    middle = 0.5 * (centers.min(axis=0) + centers.max(axis=0))
    pieces_of: dict[str, list[ConvexPiece]] = {}
    for node in graph.nodes:
        if node.node_type != "layout" or node.box is None:
            continue
        slabs = plates.get(node.id)
        if slabs is None:
            file = layout_folder / f"{node.id}.ply"
            mesh = read_mesh(file, may_be_empty=True) if file.is_file() else None
            slabs = slabs_of_layout(node.id, node.class_name, node.planes, node.box, mesh, graph, middle)
        pieces_of[node.id] = [piece for slab in slabs if (piece := _slab_piece(slab)) is not None]
    return pieces_of


def plates_of(shell: ShellFile | None) -> dict[str, list[Slab]]:
    """Return layout node -> the boxes of its plates, for the nodes of a shell."""
    plates: dict[str, list[Slab]] = {}
    for panel in () if shell is None else shell.panels:
        plates.setdefault(panel.node, []).extend(slabs_of_panel(panel))
    return plates


def _slab_piece(slab: Slab) -> ConvexPiece | None:
    corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)]) * slab.size
    piece = convex_piece(corners)
    return None if piece is None else piece.placed(slab.world_from_slab)
