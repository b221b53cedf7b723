"""CAD scenes: chosen models where they stand, meshes that stayed, layout, and the graph over them."""

from __future__ import annotations

import numpy as np

from schemas.cad_scene import CadScene
from stages.kit.formats.cad_models import posed_mesh, read_model
from stages.kit.viewing.canvas import Canvas
from stages.kit.viewing.graph_view import draw_graph
from stages.kit.viewing.meshes import load_mesh


def draw_cad_scene(cad_scene: CadScene, canvas: Canvas) -> None:
    """Draw what stands for every node, and a table of the decisions."""
    rows = ["| node | decision | model | matching error | alignment error [m] |", "|---|---|---|---|---|"]
    for replacement in cad_scene.scene.replacements:
        chosen = replacement.chosen
        if replacement.decision == "cad" and chosen is not None:
            folder = cad_scene.path("models") / chosen.model_id
            mesh = posed_mesh(folder, read_model(folder), chosen.joints, chosen.scale)
            canvas.transform(f"cad/{replacement.node}", np.array(chosen.world_from_model))
            canvas.mesh(f"cad/{replacement.node}", mesh)
            errors = f"{chosen.matching_error:.3f} | {chosen.alignment_error:.3f}"
            rows.append(f"| {replacement.node} | cad | {chosen.model_id} | {errors} |")
            continue
        group = "layout" if replacement.decision == "layout" else "meshes"
        path = cad_scene.path(group) / f"{replacement.node}.ply"
        if path.exists():
            canvas.mesh(f"{group}/{replacement.node}", load_mesh(path), front_only=True)
        rows.append(f"| {replacement.node} | {replacement.decision} | {replacement.reason} | | |")
    draw_graph(cad_scene.graph, canvas)
    canvas.document("replacements", "\n".join(rows))
