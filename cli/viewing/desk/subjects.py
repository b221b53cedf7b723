"""Which artifacts can be put right, and what of one and of what it was made from there is to put right."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from scenewright.cli.viewing.desk.generations import before_edits, behind
from scenewright.cli.viewing.desk.graph_subject import GraphSubject
from scenewright.cli.viewing.desk.map_subject import MapSubject
from scenewright.cli.viewing.desk.scene_subject import SceneSubject
from scenewright.cli.viewing.desk.subject import Subject
from scenewright.schemas.artifact import Artifact
from scenewright.schemas.cad_scene import CadScene
from scenewright.schemas.contact_graph import ContactGraph
from scenewright.schemas.edits import Edit
from scenewright.schemas.errors import BadInput
from scenewright.schemas.panoptic_map import PanopticMap

SUBJECTS: tuple[tuple[type[Artifact], type[Subject[Any]]], ...] = (
    (CadScene, SceneSubject),
    (ContactGraph, GraphSubject),
    (PanopticMap, MapSubject),
)
"""The last made first: an edit that several can be asked for is of the first of them."""


def subjects_of(artifact: Artifact, edits: Path) -> list[Subject[Any]]:
    """Return what can be put right of an artifact and of what it was made from, the last made first. Of what the same
    file of edits was applied to, it is what was there before them.

    Raises BadInput where there is nothing, and what reading it raises.
    """
    subjects: list[Subject[Any]] = []
    kinds_taken: frozenset[type[Edit]] = frozenset()
    for kind, subject in SUBJECTS:
        nearest = next(behind(artifact, kind), None)
        if nearest is not None:
            subjects.append(subject(before_edits(nearest, edits), kinds_taken))
            kinds_taken |= subjects[-1].table.keys()
    if not subjects:
        raise BadInput(
            f"{artifact.root}: neither it nor anything it was made from can be edited, or that is not there any more",
            hint="give a panoptic map, a contact graph or a CAD scene",
        )
    return subjects
