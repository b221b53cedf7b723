"""Edits, clicks and minutes until a room's scene settles with the right supports.

One arm: the script of benchmarks/experiments/edits/effort.py; one case: generated rooms with spoiled masks.
"""

from __future__ import annotations

import shutil
from collections.abc import Iterator, Sequence

import numpy as np
from pydantic import Field

from benchmarks.experiment import Bench, Experiment, Measure, Trial, mean
from benchmarks.experiments.edits.effort import Told, TrueNode, put_room_right
from benchmarks.generated_rooms import STEPS, make_library, make_room
from benchmarks.graph_scores import read_room
from benchmarks.steps import opened, step
from schemas.panoptic_map import PanopticMap
from schemas.scene_parts import TREE_RELATIONS
from schemas.sequence import Sequence as SequenceArtifact
from schemas.vocabulary import load_vocabulary
from stages.edit.map_state import read_state
from stages.evaluate.point_labels import nearest_labels
from stages.kit.stage import Parameters

SIZE = (320, 240)
CORRUPTION = 0.2
NEAR = 0.05
"""A vertex belongs to the true surface at most this far [m]."""

Figures = dict[str, float]


class EffortParameters(Parameters):
    """Options of the experiment."""

    frames: int = Field(40, ge=1, description="Frames of every room")
    corruption: float = Field(0.5, ge=0, le=1, description="Errors put into the true masks")


def measure(bench: Bench, trials: Sequence[Trial]) -> Iterator[tuple[Trial, Figures]]:
    """Yield what one room takes."""
    (trial,) = trials
    made = make_room(bench.out / "rooms", trial.seed, bench.parameters.frames, size=SIZE)
    options = {"backend": "ground-truth", "corruption": bench.parameters.corruption}
    segments = step("segment", made.folder / "segments", options, sequence=made.sequence)
    panoptic_map = step("fuse", made.folder / "map", sequence=made.sequence, segments=segments)
    gravity = opened(SequenceArtifact, made.sequence).info.gravity
    room = read_room(made.ground_truth, np.array(gravity.world_from_log))
    vertices = read_state(opened(PanopticMap, panoptic_map))[0].surface.vertices.astype(float)
    vocabulary = load_vocabulary()
    told = Told(
        nodes={
            entry.instance: TrueNode(
                entry.name,
                entry.class_name,
                entry.box,
                wanted=entry.instance not in room.optional and vocabulary.by_name(entry.class_name).node != "layout",
            )
            for entry in room.objects
        },
        owner=nearest_labels(vertices, room.points, room.instances, NEAR),
        parent={
            link.target: (link.source, link.relation) for link in room.graph.links if link.relation in TREE_RELATIONS
        },
    )
    work = made.folder / "work"
    shutil.rmtree(work, ignore_errors=True)
    yield trial, put_room_right(work, panoptic_map, make_library(bench.out / "rooms"), told)


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
    simulated="Rooms, walks, pictures and noisy depth; masks are the true ones with errors put in; the edits are made "
    "by a script that knows the truth, through what the page talks to; minutes are those of the keystroke-level model.",
    knows="Everything: it stands in for somebody who was in the room.",
    does_not_show="How long people take, what they overlook, and real rooms.",
    arms={"script": "a script at the desk"},
    cases=("spoiled",),
    tuning=("kitchen-40", "office-40"),
    reporting=("kitchen-8200", "office-8200", "bedroom-8200"),
    measure=measure,
    record=Figures,
    measures=MEASURES,
    parameters=EffortParameters,
    steps=("edit map", "edit graph", "edit scene", "graph", "cad", "urdf", "fuse", "segment", *STEPS),
)
