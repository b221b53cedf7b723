"""Wiring of `edit scene`: a CAD scene and what a person put right become another CAD scene."""

from __future__ import annotations

from pathlib import Path

from scenewright.schemas.cad_library import CadLibrary
from scenewright.schemas.cad_scene import CadScene
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.stages.edit.anchoring import Fitting
from scenewright.stages.edit.applying import apply_edits
from scenewright.stages.edit.edits_file import read_edits
from scenewright.stages.edit.outcome import outcome_of, write_records
from scenewright.stages.edit.parameters import EditMapParameters
from scenewright.stages.edit.scene_edits import SCENE_EDITS
from scenewright.stages.edit.scene_state import SceneState
from scenewright.stages.kit.stage import Context


def run(
    cad_scene: CadScene,
    edits: Path,
    library: CadLibrary | None,
    panoptic_map: PanopticMap | None,
    *,
    parameters: EditMapParameters,
    context: Context,
) -> CadScene:
    """Apply the edits of scenes in their order and write the scene that results, and what became of each (edits.json).

    The library has the models that an edit may choose, the map the meshes of what no model is to stand for. The outcome
    is `conflicts` when an edit was not applied. Raises BadInput when the edits or the scene are broken.
    """
    edits_file, before = read_edits(edits), cad_scene.info
    state = SceneState(
        cad_scene.graph,
        {entry.node: entry for entry in before.replacements},
        cad_scene,
        None if library is None else library.path("models"),
        None if panoptic_map is None else panoptic_map.root,
        context.output,
    )
    with context.progress.step("apply the edits"):
        records = apply_edits(state, edits_file.edits, Fitting(**parameters.model_dump()), SCENE_EDITS)
    with context.progress.step("write the scene"):
        state.write(context.output)
        replacements = tuple(state.replacements.values())
        before.model_copy(update={"replacements": replacements}).write(context.output / "scene.json")
        state.graph.write(context.output / "graph.json")
    summary = write_records(records, len(edits_file.edits), context)
    decisions = [entry.decision for entry in replacements]
    summary |= {
        "cad": decisions.count("cad"),
        "mesh": decisions.count("mesh"),
        "layout": decisions.count("layout"),
        "joints": sum(len(entry.joint_evidence or {}) for entry in replacements),
        "joints_held": sum(len(entry.held) for entry in replacements),
    }
    return CadScene(context.output, outcome=outcome_of(records), summary=summary)
