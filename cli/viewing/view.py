"""Open any artifact in Rerun: which viewer draws which kind."""

from __future__ import annotations

import importlib
from pathlib import Path

import schemas.kinds  # noqa: F401 (registers every kind)
from cli.viewing.canvas import Canvas, import_rerun
from schemas.errors import BadInput, UsageError
from stages.engine.reading import open_artifact

VIEWERS = {
    "sequence": ("sequence_view", "draw_sequence"),
    "disparity": ("disparity_view", "draw_disparity"),
    "trajectory": ("sequence_view", "draw_trajectory"),
    "segments": ("segments_view", "draw_segments"),
    "panoptic_map": ("map_view", "draw_map"),
    "contact_graph": ("graph_view", "draw_contact_graph"),
    "cad_scene": ("cad_scene_view", "draw_cad_scene"),
    "interactive_scene": ("scene_view", "draw_scene"),
    "packing": ("packing_view", "draw_packing"),
    "tableware_detections": ("tableware_view", "draw_tableware_detections"),
    "tableware_scene": ("tableware_view", "draw_tableware_scene"),
    "tableware_plan": ("tableware_view", "draw_tableware_plan"),
    "tableware_trial": ("tableware_view", "draw_tableware_trial"),
    "tableware_evaluation": ("tableware_view", "draw_tableware_evaluation"),
    "suture_evaluation": ("suture_view", "draw_suture_evaluation"),
    "suture_needle": ("suture_view", "draw_suture_needle"),
    "suture_scene": ("suture_view", "draw_suture_scene"),
    "suture_thread": ("suture_view", "draw_suture_thread"),
    "suture_trial": ("suture_view", "draw_suture_trial"),
    "plan": ("plan_view", "draw_plan"),
    "ground_truth": ("truth_view", "draw_ground_truth"),
    "cad_library": ("library_view", "draw_library"),
    "evaluation": ("document_view", "draw_evaluation"),
    "report": ("document_view", "draw_report"),
    "exported_sequence": ("document_view", "draw_export"),
}
"""Kind -> module and function; the function takes the typed artifact and the canvas."""


def view_artifact(path: Path, save: Path | None = None) -> None:
    """Show an artifact in a Rerun window, or write it to `save` (an .rrd file).

    Raises BadInput (no artifact, or nothing to draw), UsageError (`save` is no .rrd file), MissingDependency.
    """
    if save is not None and save.suffix != ".rrd":
        raise UsageError(f"{save}: the file to write must end in .rrd")
    import_rerun()
    artifact = open_artifact(path)
    if artifact.kind not in VIEWERS:
        raise BadInput(f"{path}: a {artifact.kind!r} artifact has no view", hint="open its files in Foxglove or Rerun")
    module, function = VIEWERS[artifact.kind]
    draw = getattr(importlib.import_module(f"cli.viewing.{module}"), function)
    with Canvas(f"{artifact.kind} {Path(path).name}", save) as canvas:
        draw(artifact, canvas)
