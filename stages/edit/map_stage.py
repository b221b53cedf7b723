"""`scenewright edit map`: a panoptic map and what a person put right become another panoptic map."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
from scenewright.schemas.base import as_transform
from scenewright.schemas.panoptic_map import BecauseFile, PanopticMap
from scenewright.stages.edit.anchoring import Fitting
from scenewright.stages.edit.applying import apply_edits
from scenewright.stages.edit.edits_file import read_edits
from scenewright.stages.edit.map_edits import MAP_EDITS
from scenewright.stages.edit.map_state import MapState, read_state
from scenewright.stages.edit.outcome import outcome_of, write_records
from scenewright.stages.edit.parameters import EditMapParameters
from scenewright.stages.kit.formats.map_files import mesh_name, write_arrays
from scenewright.stages.kit.formats.ply_files import write_ply
from scenewright.stages.kit.stage import Context

KEPT = ("counts.npz", "volume.npz", "free_space.npz", "layout.json")
"""Which masks were seen where, the voxels, what was seen empty, and the planes that bound the room: edits say nothing
about these."""
EDITED = "mesh.ply"
BY_A_PERSON = "a person named it"
"""Rule of a name, in because.json."""


def run(panoptic_map: PanopticMap, edits: Path, *, parameters: EditMapParameters, context: Context) -> PanopticMap:
    """Apply the edits in their order and write the map that results, with what became of each in edits.json.

    The outcome is `conflicts` when an edit was not applied. Snapshots are left out: they are maps of before.
    Raises BadInput when the edits or the map are broken.
    """
    edits_file = read_edits(edits)
    with context.progress.step("read the map"):
        state, info = read_state(panoptic_map)
    with context.progress.step("apply the edits"):
        vertices_before = len(state.surface.vertices)
        records = apply_edits(state, edits_file.edits, Fitting(**parameters.model_dump()), MAP_EDITS)
        entities, meshes = state.finished()
    with context.progress.step("write the map"):
        root = context.output
        (root / "entities").mkdir(parents=True, exist_ok=True)
        changed: dict[str, object] = {"entities": tuple(entities)}
        if state.turned is not None:
            before = np.eye(4) if info.world_from_sequence is None else np.array(info.world_from_sequence)
            changed["world_from_sequence"] = as_transform(state.turned @ before)
        info.model_copy(update=changed).write(root / "entities.json")
        for entity in entities:
            if entity.instance in meshes:
                write_ply(root / mesh_name(entity.instance), meshes[entity.instance])
            else:
                shutil.copyfile(panoptic_map.path(entity.mesh), root / entity.mesh)
        if len(state.surface.vertices) == vertices_before and state.turned is None:
            shutil.copyfile(panoptic_map.path(EDITED), root / EDITED)
        else:
            write_ply(root / EDITED, state.surface)
        _write_labels(root, state)
        if panoptic_map.because is not None:
            _reasons(panoptic_map.because, state).write(root / "because.json")
        for name in KEPT if state.turned is None else KEPT[:1]:  # the others lie along the axes of before
            if panoptic_map.path(name).is_file():
                shutil.copyfile(panoptic_map.path(name), root / name)
    summary = write_records(records, len(edits_file.edits), context)
    summary |= {"entities": len(entities), "vertices": len(state.surface.vertices)}
    return PanopticMap(root, outcome=outcome_of(records), summary=summary)


def _reasons(because: BecauseFile, state: MapState) -> BecauseFile:
    """Return the reasons of the things that stay; a person's name has that one."""
    rows = [row for row in because.entities if row.instance in state.entities]
    named = {"name": BY_A_PERSON, "posterior": 1.0}
    told = tuple(row.model_copy(update=named) if row.instance in state.renamed else row for row in rows)
    return because.model_copy(update={"entities": told})


def _write_labels(root: Path, state: MapState) -> None:
    labels = {"instance": state.instance, "segment": state.segment, "class_id": state.class_ids()}
    write_arrays(root / "mesh_labels.npz", labels)
