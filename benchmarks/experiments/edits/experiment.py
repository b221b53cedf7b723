"""Edits made on one map of a generated room, applied again to maps fused with other parameters.

Arms: `ours` (`edit map`), `number` (the thing of that number), `nearest` (the nearest thing of the class). Cases:
the map on which the edits were made, and maps fused otherwise from the same frames and the same spoiled masks. An edit
counts when it can be carried out on the map on which it was made.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from pydantic import Field
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.schemas.sequence import Sequence as SequenceArtifact
from scenewright.stages.edit import MapState, read_state
from scenewright.stages.kit.measurement.bootstrap import Interval, figure_interval
from scenewright.stages.kit.stage import Parameters

from benchmarks.experiment import RESAMPLES, SEED_OF_INTERVALS, Bench, Experiment, Measure, Results, Trial
from benchmarks.experiments.edits.landing import ARMS, by_geometry
from benchmarks.experiments.edits.making import KINDS, edits_of
from benchmarks.experiments.edits.truth import truth_of
from benchmarks.generated_rooms import RECIPES, STEPS, make_library, make_room
from benchmarks.graph_scores import read_room
from benchmarks.steps import opened, step
from benchmarks.tabulation import Figure

SIZE = (320, 240)
MADE_ON = "same"
FUSED: dict[str, dict[str, Any]] = {
    MADE_ON: {},
    "voxels_15": {"voxel_size": 0.015},
    "voxels_30": {"voxel_size": 0.03},
    "every_second": {"every": 2},
    "near": {"maximum_depth": 2.5},
    "thesis": {"merging": "thesis"},
}
"""Case -> parameters of `fuse`."""
CORRUPTION = 0.2
"""Of the true masks."""
TUNING = tuple(f"{recipe}-40" for recipe in RECIPES)
REPORTING = tuple(f"{recipe}-{seed}" for seed in range(8100, 8113) for recipe in RECIPES)
LANDINGS = ("right", "wrong", "conflict", "absent")

Landed = dict[str, float]
"""`<kind>/<landing>` -> edits of a room."""


class EditsParameters(Parameters):
    """Options of the experiment."""

    frames: int = Field(40, ge=1, description="Frames of every room")


def measure(bench: Bench, trials: Sequence[Trial]) -> Iterator[tuple[Trial, Landed]]:
    """Yield where the edits of one room land, for every case and arm."""
    name = trials[0].seed
    made = make_room(bench.out / "rooms", name, bench.parameters.frames, size=SIZE)
    gravity = opened(SequenceArtifact, made.sequence).info.gravity
    room = read_room(made.ground_truth, np.array(gravity.world_from_log))
    segments = step(
        "segment",
        made.folder / "segments",
        {"backend": "ground-truth", "corruption": CORRUPTION},
        sequence=made.sequence,
    )

    def fused(case: str) -> MapState:
        path = made.folder / f"map_{case}"
        step("fuse", path, FUSED[case], sequence=made.sequence, segments=segments)
        return read_state(opened(PanopticMap, path))[0]

    first = fused(MADE_ON)
    known = truth_of(first, room)
    asked = [edit for edit in edits_of(first, known, room) if by_geometry(edit, first, known, room) == "right"]
    for case in dict.fromkeys(trial.case for trial in trials):
        state = first if case == MADE_ON else fused(case)
        truth = truth_of(state, room)
        for trial in trials:
            if trial.case == case:
                landed = dict.fromkeys((f"{kind}/{landing}" for kind in KINDS for landing in LANDINGS), 0.0)
                for edit in asked:
                    where = ARMS[trial.arm](edit, state, truth, room)
                    if where is not None:
                        landed[f"{edit.edit.what}/{where}"] += 1
                yield trial, landed


def share(*landings: str, of: Sequence[str] = LANDINGS, kinds: Sequence[str] = KINDS) -> Measure:
    """Return the share [%] of edits that land so, of those that land in one of `of`."""

    def figure(records: Sequence[Mapping[str, float]]) -> float | None:
        total = _sum(records, kinds, of)
        return 100 * _sum(records, kinds, landings) / total if total else None

    return Measure(figure, "%")


def _sum(records: Sequence[Mapping[str, float]], kinds: Sequence[str], landings: Sequence[str]) -> float:
    return sum(record[f"{kind}/{landing}"] for record in records for kind in kinds for landing in landings)


def number(*landings: str) -> Measure:
    """Return the number of edits that land so."""
    return Measure(lambda records: _sum(records, KINDS, landings), interval=False)


def seeds_of(bench: Bench, case: str) -> Sequence[str]:
    """The rooms."""
    return TUNING if bench.tuning else REPORTING


def prepare(bench: Bench, trials: Sequence[Trial]) -> None:
    """Make the library, which all rooms share."""
    make_library(bench.out / "rooms")


def all_others(results: Results) -> dict[str, Figure]:
    """Return the figures over all maps but the one on which the edits were made, with intervals over rooms."""
    flat: dict[str, Figure] = {}
    for arm in results.arms():
        rooms: dict[str, list[Landed]] = {}
        for trial, record in results.records.items():
            if trial.arm == arm and trial.case != MADE_ON:
                rooms.setdefault(trial.seed, []).append(record)
        groups = list(rooms.values())
        for name, measure in MEASURES.items() if groups else ():
            value = measure.of([record for group in groups for record in group])
            interval = _interval(measure, groups) if measure.interval else None
            low, high = (None, None) if interval is None else (interval.low, interval.high)
            if value is not None:
                flat[f"{arm}/all_others/{name}"] = Figure(value, low, high, len(groups), measure.unit)
    return flat


def _interval(measure: Measure, groups: Sequence[Sequence[Landed]]) -> Interval | None:
    random = np.random.default_rng(SEED_OF_INTERVALS)
    return figure_interval(
        lambda drawn: measure.of([record for k in drawn for record in groups[k]]),
        range(len(groups)),
        random,
        resamples=RESAMPLES,
    )


def _of_kind(kind: str) -> tuple[str, Measure]:
    return f"{kind}_right", share("right", kinds=(kind,))


MEASURES: dict[str, Measure] = {
    "right": share("right"),
    "wrong": share("wrong"),
    "conflict": share("conflict"),
    "absent": share("absent"),
    "right_of_present": share("right", of=("right", "wrong", "conflict")),
    **dict(_of_kind(kind) for kind in KINDS),
    "edits": number(*LANDINGS),
    "wrong_edits": number("wrong"),
}

EXPERIMENT = Experiment(
    name="edits",
    title="Edits by hand on maps fused with other parameters",
    simulated="Rooms, walks, pictures and noisy depth; masks are the true ones with errors put in; the "
    "edits are made by a script.",
    knows="The edit alone: class, box, a point on the surface.",
    does_not_show="People, real rooms, masks of a detector; what an edit is worth for the scene that follows.",
    arms={"ours": "ours", "number": "same number", "nearest": "nearest of the class"},
    cases=tuple(FUSED),
    tuning=TUNING,
    reporting=REPORTING,
    seeds_of=seeds_of,
    together=lambda trial: trial.seed,
    measure=measure,
    record=Landed,
    measures=MEASURES,
    more_figures=all_others,
    parameters=EditsParameters,
    quick_seeds=4,
    prepare=prepare,
    steps=("fuse", "segment", *STEPS),
)
