"""The scene stage by stage against ground truth: contact graph, CAD replacement, physics; ours beside the thesis."""

from __future__ import annotations

import os
from collections.abc import Sequence

from benchmarks.experiment import Bench, Experiment
from benchmarks.experiments.scene.arms import ARMS, CASES, REAL
from benchmarks.experiments.scene.figures_of_merit import MEASURES
from benchmarks.experiments.scene.measuring import Outcome, SceneParameters, annotated_runs, measure, prepare
from benchmarks.experiments.scene.notes import notes
from benchmarks.generated_rooms import REPORTING, STEPS, TUNING_UNTRAINED


def seeds_of(bench: Bench, case: str) -> Sequence[str]:
    """The rooms; the annotated logs of the case `real`."""
    if case == REAL:
        return annotated_runs(bench.parameters.real)
    return TUNING_UNTRAINED if bench.tuning else REPORTING


EXPERIMENT = Experiment(
    name="scene",
    title="From a map to a scene in physics: contact graph, CAD replacement, settling",
    simulated="Rooms, walks, pictures and noisy depth; in the case perfect the map is the true surface that was seen, "
    "in the others the masks are the true ones with errors of level 0.3. The case real is of recorded logs.",
    knows="The map; the library that the rooms were furnished from (another one in held_out_shapes).",
    does_not_show="How it works with furniture that no library resembles, or with masks of a detector.",
    arms={arm.name: arm.title for arm in ARMS},
    cases=(*CASES, REAL),
    default_cases=lambda bench: [*CASES, *([REAL] if annotated_runs(bench.parameters.real) else [])],
    tuning=TUNING_UNTRAINED,
    reporting=REPORTING,
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
    steps=("graph", "cad", "urdf", "truth supports", *STEPS),
    pairs=(("ours", "thesis"), ("ours", "best_single")),
    compared=("support_f1", "scan2cad_success", "functional", "settled_rooms", "edit_distance", "collisions"),
    notes=notes,
)
