"""CAD models in place of objects: the scene, its candidates, what the global check changed."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from scenewright.schemas.cad_library import CadLibrary
from scenewright.schemas.cad_scene import CadScene, Replacement
from scenewright.schemas.ground_truth import GroundTruth
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.schemas.sequence import Sequence
from scenewright.stages.report.candidates import object_views
from scenewright.stages.report.global_check import checked_scenes
from scenewright.stages.report.page import Page
from scenewright.stages.report.placed_models import ModelShelf
from scenewright.stages.report.room import DrawnView, draw
from scenewright.stages.report.surfaces import cad_model, true_model
from scenewright.stages.report.views import View, top_view


def view(page: Page) -> dict[str, Any] | None:
    """Return pictures of the scene, its decisions and candidates; None when nothing is in it."""
    cad_scene, room = page.given("cad_scene", CadScene), page.room
    model = cad_model(cad_scene) if cad_scene is not None else None
    if cad_scene is None or model is None:
        return None
    seen_from = room.whole(model)
    pictures = [draw(model, seen_from, "CAD scene", room.font_size(20.0))]
    if room.in_image_colours is not None:
        pictures.append(replace(room.in_image_colours, caption="The map from the same place."))
    pictures += _true_room(page, seen_from)
    from_above = top_view(room.scanned or model, round(0.75 * room.width))
    pictures.append(draw(model, from_above, "CAD scene from above", room.font_size(15.5)))
    scene = cad_scene.info
    decisions = [r.decision for r in scene.replacements]
    return {
        "cad_views": pictures,
        "replacements": [_replacement_row(r) for r in scene.replacements if r.decision != "layout"],
        "cad_text": f"CAD models: {decisions.count('cad')}; objects that keep their mesh: {decisions.count('mesh')}; "
        f"layout: {decisions.count('layout')}. The global check went from {scene.conflicts_before} to "
        f"{scene.conflicts_after} colliding pairs in {scene.iterations} iterations.",
        **_candidates(page, cad_scene, seen_from),
    }


def _true_room(page: Page, seen_from: View) -> list[DrawnView]:
    ground_truth, sequence = page.given("ground_truth", GroundTruth), page.given("sequence", Sequence)
    if ground_truth is None:
        return []
    upright = sequence is None or ground_truth.info.source == "scan"
    moved = np.eye(4) if upright or sequence is None else np.array(sequence.info.gravity.world_from_log)
    truth = true_model(ground_truth, moved)
    if truth is None:
        return []
    return [replace(draw(truth, seen_from, "The true room from the same place"), of_masks=False)]


def _candidates(page: Page, cad_scene: CadScene, seen_from: View) -> dict[str, Any]:
    """Return the scene before and after the global check, and the candidates of every object."""
    shelf = ModelShelf(cad_scene, page.given("cad_library", CadLibrary))
    size, parameters = page.room.font_size(20.0), page.parameters
    objects = (
        object_views(
            cad_scene,
            shelf,
            page.given("panoptic_map", PanopticMap),
            count=parameters.candidates,
            width=parameters.candidate_width,
        )
        if parameters.candidates
        else []
    )
    return {
        "checked": [draw(scene.model, seen_from, scene.caption, size) for scene in checked_scenes(cad_scene, shelf)],
        "objects_changed": [entry for entry in objects if entry.changed],
        "objects_kept": [entry for entry in objects if not entry.changed],
    }


def _replacement_row(replacement: Replacement) -> dict[str, str]:
    chosen = replacement.chosen
    rejected = ", ".join(f"{count} {reason}" for reason, count in sorted(replacement.rejected.items()))
    others = ", ".join(dict.fromkeys(c.model_id for c in replacement.alternatives[:4]))
    decision = chosen.model_id if chosen is not None and replacement.decision == "cad" else replacement.decision
    if replacement.reason:
        decision += f" ({replacement.reason})"
    if replacement.inferred is not None:
        inferred = replacement.inferred
        decision += f"; inferred: {inferred.what or 'nothing'}, {inferred.because}"
    return {
        "node": replacement.node,
        "what": decision,
        "scale": f"{chosen.scale:.3f}" if chosen else "",
        "matching": f"{chosen.matching_error:.3f}" if chosen else "",
        "alignment": f"{1000 * chosen.alignment_error:.0f} mm" if chosen else "",
        "rest": "; ".join(text for text in (others, f"rejected: {rejected}" if rejected else "") if text),
    }
