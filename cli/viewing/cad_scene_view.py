"""CAD scenes: chosen models where they stand, what else was tried, meshes that stayed, layout, the graph over them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from scenewright.cli.viewing.inputs import input_artifact
from scenewright.schemas.cad_library import CadLibrary
from scenewright.schemas.cad_scene import SURROUNDINGS, UNEXPLAINED, CadCandidate, CadScene, Replacement
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.stages.kit.drawing.palette import UNEXPLAINED_COLOR
from scenewright.stages.kit.formats.cad_models import read_model
from scenewright.stages.kit.formats.painted_models import painted_mesh
from scenewright.stages.kit.measurement.cad_candidates import candidates_of
from scenewright.stages.kit.viewing.canvas import Canvas, bytes_of
from scenewright.stages.kit.viewing.graphs import draw_graph
from scenewright.stages.kit.viewing.meshes import load_mesh
from scenewright.stages.kit.viewing.scenes import trust_of_models

CANDIDATES = "candidates"
"""Candidates that were not chosen lie below this path: drawn, but hidden at first, as they stand in the chosen ones."""
MAP = "map"
"""What the scene was made from: hidden at first, to be compared."""
REST = "unexplained"
"""Mapped surface that nothing in the scene lies near to: hidden at first."""
DRAWN_CANDIDATES = 3
"""Most candidates that are drawn of each object, beside the chosen one."""


def draw_cad_scene(cad_scene: CadScene, canvas: Canvas) -> None:
    """Draw what stands for every node and the next candidates, with tables of decisions and candidates.

    Candidates whose model the scene has no copy of come from the library that it was made from, where that is still
    there.
    """
    draw_cad_scene_of(cad_scene, input_artifact(cad_scene, CadLibrary), input_artifact(cad_scene, PanopticMap), canvas)


def draw_cad_scene_of(
    cad_scene: CadScene, library: CadLibrary | None, panoptic_map: PanopticMap | None, canvas: Canvas
) -> None:
    """Draw a scene that was made from this library and map, where these are there."""
    roots = [cad_scene.path("models")] + ([library.path("models")] if library is not None else [])
    rows = ["| node | decision | model | matching error | alignment error [m] |", "|---|---|---|---|---|"]
    for replacement in cad_scene.info.replacements:
        chosen = replacement.chosen
        _draw_candidates(replacement, roots, canvas)
        if replacement.decision == "cad" and chosen is not None:
            folder = roots[0] / chosen.model_id
            _draw_model(f"cad/{replacement.node}", chosen, folder, canvas, replacement.part_colors)
            errors = f"{chosen.matching_error:.3f} | {chosen.alignment_error:.3f}"
            rows.append(f"| {replacement.node} | cad | {chosen.model_id} | {errors} |")
            continue
        group = "layout" if replacement.decision == "layout" else "meshes"
        path = cad_scene.path(group) / f"{replacement.node}.ply"
        if path.exists():
            canvas.mesh(f"{group}/{replacement.node}", load_mesh(path), front_only=True)
        rows.append(f"| {replacement.node} | {replacement.decision} | {replacement.reason} | | |")
    nameless = cad_scene.path("meshes") / f"{SURROUNDINGS}.ply"
    if nameless.exists():
        canvas.mesh(SURROUNDINGS, load_mesh(nameless), front_only=True)
    if cad_scene.path(UNEXPLAINED).exists():
        rest = load_mesh(cad_scene.path(UNEXPLAINED))
        color = np.array(bytes_of(UNEXPLAINED_COLOR), np.uint8)
        canvas.mesh(REST, rest, np.tile(color, (len(rest.vertices), 1)))
    if panoptic_map is not None and panoptic_map.path("mesh.ply").exists():
        canvas.mesh(MAP, load_mesh(panoptic_map.path("mesh.ply")), front_only=True)
    draw_graph(cad_scene.graph, canvas, CANDIDATES, MAP, REST, trusted=trust_of_models(cad_scene.info))
    canvas.document("replacements", "\n".join(rows))
    canvas.document(CANDIDATES, candidate_table(cad_scene))


def _draw_candidates(replacement: Replacement, roots: list[Path], canvas: Canvas) -> None:
    others = [candidate for role, candidate in candidates_of(replacement) if "chosen" not in role]
    for number, candidate in enumerate(others[:DRAWN_CANDIDATES], start=1):
        folder = next((root / candidate.model_id for root in roots if (root / candidate.model_id).is_dir()), None)
        if folder is not None:
            path = f"{CANDIDATES}/{replacement.node}/{number}_{candidate.model_id}"
            _draw_model(path, candidate, folder, canvas)


def _draw_model(
    path: str,
    candidate: CadCandidate,
    folder: Path,
    canvas: Canvas,
    colors: Mapping[str, tuple[int, int, int]] | None = None,
) -> None:
    canvas.transform(path, np.array(candidate.world_from_model))
    canvas.mesh(path, painted_mesh(folder, read_model(folder), candidate, colors))


def candidate_table(cad_scene: CadScene) -> str:
    """Return the candidates of every object in Markdown: errors, scale, joints, what was rejected and why."""
    lines: list[str] = []
    for replacement in cad_scene.info.replacements:
        if replacement.decision == "layout":
            continue
        candidates = candidates_of(replacement)
        lines += (
            [f"### {replacement.node}", "", replacement.reason, ""]
            if replacement.reason
            else [f"### {replacement.node}", ""]
        )
        if candidates:
            lines += [
                "| model | | matching error | alignment error [mm] | scale | joints |",
                "|---|---|--:|--:|--:|---|",
            ]
        for role, candidate in candidates:
            joints = ", ".join(f"{name} {value:.2f}" for name, value in sorted(candidate.joints.items()))
            lines.append(
                f"| {candidate.model_id} | {role} | {candidate.matching_error:.3f} | "
                f"{1000 * candidate.alignment_error:.1f} | {candidate.scale:.3f} | {joints} |"
            )
        if replacement.rejected:
            rejected = ", ".join(f"{count} {reason}" for reason, count in sorted(replacement.rejected.items()))
            lines += ["", f"Rejected: {rejected}."]
        lines.append("")
    return "\n".join(lines)
