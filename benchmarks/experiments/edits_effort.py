"""Edits, clicks and minutes until a room's scene settles with the right supports.

One arm: the script of benchmarks/experiments/edits/effort.py. Cases: `spoiled`, generated rooms with spoiled masks;
`recorded`, the maps that `make real` made of recorded logs, with what was annotated by eye (data/annotations/real).
"""

from __future__ import annotations

import shutil
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from pydantic import Field
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.schemas.scene_parts import TREE_RELATIONS
from scenewright.schemas.sequence import Sequence as SequenceArtifact
from scenewright.stages.edit import read_state
from scenewright.stages.evaluate import nearest_labels
from scenewright.stages.kit.geometry.boxes import upright_box
from scenewright.stages.kit.stage import Parameters
from scenewright.stages.truth import SupportAnnotation, instances_of, read_support_annotation

from benchmarks.board.real import ANNOTATED, ANNOTATIONS
from benchmarks.experiment import Bench, Experiment, Measure, Trial, mean
from benchmarks.experiments.edits.effort import Told, TrueNode, is_layout, put_room_right
from benchmarks.generated_rooms import STEPS, make_library, make_room
from benchmarks.graph_scores import read_room
from benchmarks.steps import opened, step

TUNING, REPORTING = ("kitchen-40", "office-40"), ("kitchen-8200", "office-8200", "bedroom-8200")
SIZE = (320, 240)
NEAR = 0.05
"""A vertex belongs to the true surface at most this far [m]."""

Figures = dict[str, float]


class EffortParameters(Parameters):
    """Options of the experiment."""

    frames: int = Field(40, ge=1, description="Frames of every generated room")
    corruption: float = Field(0.5, ge=0, le=1, description="Errors put into the true masks of generated rooms")
    runs: Path = Field(Path("outputs/experiments/real"), description="Folder that `make real` wrote")


def seeds_of(bench: Bench, case: str) -> Sequence[str]:
    """The rooms; of recordings, those of which `make real` has made the map."""
    if case == "spoiled":
        return TUNING if bench.tuning else REPORTING
    runs = bench.parameters.runs
    return [log for log in ANNOTATED if (runs / log / "panoptic_map" / "manifest.json").is_file()]


def inputs(bench: Bench, trial: Trial) -> list[Path]:
    """Annotation and map of a recording; rooms are made."""
    if trial.case == "spoiled":
        return []
    return [ANNOTATIONS / f"{trial.seed}.json", bench.parameters.runs / trial.seed / "panoptic_map"]


def measure(bench: Bench, trials: Sequence[Trial]) -> Iterator[tuple[Trial, Figures]]:
    """Yield what one room takes."""
    (trial,) = trials
    library = make_library(bench.out / "rooms")
    if trial.case == "spoiled":
        folder, panoptic_map, told = generated_room(bench, trial.seed)
    else:
        annotation, panoptic_map = inputs(bench, trial)
        folder = bench.out / "recorded" / trial.seed
        told = told_by(read_support_annotation(annotation), vertices_of(panoptic_map))
    work = folder / "work"
    shutil.rmtree(work, ignore_errors=True)
    yield trial, put_room_right(work, panoptic_map, library, told)


def vertices_of(panoptic_map: Path) -> np.ndarray:
    """Return the vertices (V, 3) [m] of a map, world of the sequence."""
    vertices: np.ndarray = read_state(opened(PanopticMap, panoptic_map))[0].surface.vertices.astype(float)
    return vertices


def generated_room(bench: Bench, name: str) -> tuple[Path, Path, Told]:
    """Return the folder of a room, its map from spoiled masks, and what is true of it."""
    made = make_room(bench.out / "rooms", name, bench.parameters.frames, size=SIZE)
    options = {"backend": "ground-truth", "corruption": bench.parameters.corruption}
    segments = step("segment", made.folder / "segments", options, sequence=made.sequence)
    panoptic_map = step("fuse", made.folder / "map", sequence=made.sequence, segments=segments)
    gravity = opened(SequenceArtifact, made.sequence).info.gravity
    room = read_room(made.ground_truth, np.array(gravity.world_from_log))
    nodes = {
        entry.instance: TrueNode(
            entry.name,
            entry.class_name,
            entry.box,
            wanted=entry.instance not in room.optional and not is_layout(entry.class_name),
        )
        for entry in room.objects
    }
    owner = nearest_labels(vertices_of(panoptic_map), room.points, room.instances, NEAR)
    links = [link for link in room.graph.links if link.relation in TREE_RELATIONS]
    return made.folder, panoptic_map, Told(nodes, owner, {link.target: (link.source, link.relation) for link in links})


def told_by(annotation: SupportAnnotation, vertices: np.ndarray) -> Told:
    """Return what an annotation, whose things are found by boxes, says of a map with these vertices (V, 3) [m]."""
    _, owner = instances_of(annotation, vertices, np.zeros(len(vertices), np.int64), None, 0.0)
    nodes = {}
    for k, node in enumerate(annotation.nodes, 1):
        assert node.find.box is not None
        wanted = not node.optional and not is_layout(node.class_name)
        nodes[k] = TrueNode(node.name, node.class_name, upright_box(node.find.box), wanted)
    return Told(
        nodes,
        owner,
        parent={relation.child: (relation.parent, relation.relation) for relation in annotation.relations},
        as_good={relation.child: (*relation.also, *relation.uncertain) for relation in annotation.relations},
    )


MEASURES: dict[str, Measure] = {
    name: mean(name, unit)
    for name, unit in (
        ("edits", ""), ("clicks", ""), ("minutes", "min"), ("things", ""), ("wrong_before", ""), ("wrong_after", ""),
        ("settles_before", ""), ("settles_after", ""), ("held", ""), ("free_before", ""), ("free_after", ""),
        ("taken_back", ""),
    )
}  # fmt: skip

EXPERIMENT = Experiment(
    name="edits_effort",
    title="What it takes to put a room right by hand",
    simulated=(
        "Generated rooms: walks, pictures, noisy depth, errors of true masks; logs are recordings. A script "
        "that knows the truth makes the edits through the page's interface. Minutes are the keystroke-level "
        "model's."
    ),
    knows="Everything: it stands in for somebody who was in the room.",
    does_not_show="How long people take and what they overlook; of recordings what nobody annotated.",
    arms={"script": "a script at the desk"},
    cases=("spoiled", "recorded"),
    tuning=TUNING,
    reporting=REPORTING,
    seeds_of=seeds_of,
    inputs=inputs,
    places=frozenset({"runs"}),
    measure=measure,
    record=Figures,
    measures=MEASURES,
    parameters=EffortParameters,
    steps=("edit map", "edit graph", "edit scene", "graph", "cad", "urdf", "fuse", "segment", *STEPS),
)
