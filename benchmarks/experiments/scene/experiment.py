"""The scene stage by stage against ground truth: contact graph, CAD replacement, physics; ours beside the thesis."""

from __future__ import annotations

import os
from collections.abc import Sequence

from benchmarks.experiment import Bench, Experiment
from benchmarks.experiments.scene.arms import ARMS, CASES, OF_INDEPENDENT, OF_MAPS, OF_PERFECT, REAL
from benchmarks.experiments.scene.figures_of_merit import MEASURES
from benchmarks.experiments.scene.measuring import Outcome, SceneParameters, annotated_runs, measure, prepare
from benchmarks.experiments.scene.notes import notes
from benchmarks.generated_rooms import (
    INDEPENDENT,
    REPORTING,
    ROOMS,
    STEPS,
    TUNING_INDEPENDENT,
    TUNING_UNTRAINED,
    room_of,
    with_draws,
)
from benchmarks.reporting_seeds import Method


def seeds_of(bench: Bench, case: str) -> Sequence[str]:
    """The rooms; the annotated logs of the case `real`."""
    if case == REAL:
        return annotated_runs(bench.parameters.real)
    if case in OF_INDEPENDENT:
        return TUNING_INDEPENDENT if bench.tuning else with_draws(INDEPENDENT)
    return TUNING_UNTRAINED if bench.tuning else with_draws(REPORTING)


def runs(arm: str, case: str) -> bool:
    """Arms that differ by their map run where there are maps of arms."""
    return arm not in OF_MAPS or case not in OF_PERFECT | {REAL}


EXPERIMENT = Experiment(
    name="scene",
    title="From a map to a scene in physics: contact graph, CAD replacement, settling",
    simulated="Rooms, walks, pictures and noisy depth; in the cases perfect the map is the true surface that was seen, "
    "in the others the masks are the true ones with errors that last, at a detector's rates on real frames; in "
    "drifting the poses drift, in estimated they are estimated. The case real is of recorded logs.",
    knows="The map; the library that the rooms were furnished from (in held_out and independent one that lacks their "
    "styles).",
    does_not_show="How it works with furniture that no library resembles, or with masks of a detector.",
    arms={arm.name: arm.title for arm in ARMS},
    cases=(*CASES, REAL),
    default_cases=lambda bench: [*CASES, *([REAL] if annotated_runs(bench.parameters.real) else [])],
    tuning=TUNING_UNTRAINED + TUNING_INDEPENDENT,
    reporting=with_draws(REPORTING + INDEPENDENT),
    cluster=room_of,
    runs=runs,
    seed_group=ROOMS,
    method=Method(
        ("segment", "fuse", "graph", "cad", "urdf"),
        {
            arm.name: {"graph": arm.graph.model_dump(mode="json"), "cad": arm.cad.model_dump(mode="json")}
            for arm in ARMS
        },
    ),
    seeds_of=seeds_of,
    together=lambda trial: (trial.case == REAL, trial.seed),
    measure=measure,
    record=Outcome,
    measures=MEASURES,
    parameters=SceneParameters,
    places=frozenset({"maps", "real", "as_is", "keep"}),
    quick_seeds=3,
    quick={"frames": 40},
    jobs=min(2, os.cpu_count() or 1),
    prepare=prepare,
    steps=("poses", "graph", "cad", "urdf", "truth supports", *STEPS),
    pairs=(
        ("ours", "thesis"),
        ("ours", "thesis_chosen"),
        ("ours", "thesis_on_ours"),
        ("ours_on_thesis", "thesis_released"),
        ("ours", "ours_on_thesis"),
        ("ours", "best_single"),
    ),
    compared=(
        "support_f1",
        "scan2cad_success",
        "functional",
        "at_rest",
        "settled_rooms",
        "edit_distance",
        "collisions",
    ),
    notes=notes,
)
