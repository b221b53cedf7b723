"""Cutting towards goals that somebody else cut: table 6.1 (Han 2024), and growth with the number of fragments."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scenewright.stages.cutting import CELLS, Learned, attempt, carry_out, imagine, learn_methods, make_food, make_trial
from scenewright.stages.cutting.demonstrations.recipes import TRAINING_SHARE

from benchmarks.experiment import Bench, Experiment, Measure, Results, Trial, count, mean
from benchmarks.tabulation import markdown

TRAININGS, GOALS = 5, 20
GROWTH = {f"cubes{n}": n for n in (8, 16, 32, 64, 128, 200)}
NETWORKS = ("thesis", "bc", "qnet")
ARMS = {
    "scatter": "the scripted cutter again",
    "ours": "ours",
    "ours_perceived": "ours, seen by two depth cameras",
    "ours_together": "ours, through several pieces at once",
    "thesis": "thesis",
    "bc": "BC",
    "qnet": "QNet",
}
SHARED = (
    "scenewright.stages.cutting.trying",
    "scenewright.stages.cutting.methods",
    "scenewright.stages.cutting.ours.imagining",
)


def seeds(first: int) -> tuple[str, ...]:
    """Return `training-goal`, every training before the next goal: the first few have all of them."""
    return tuple(f"{first + training}-{goal}" for goal in range(GOALS) for training in range(TRAININGS))


TUNING, REPORTING = seeds(0), seeds(1000)


@dataclass(frozen=True)
class Run:
    """What an arm came to; overlaps are None where the goal has no bodies."""

    count_exact: bool
    count_error: int
    plan_seconds: float
    iou: float | None = None
    iou_thesis: float | None = None
    volume_error: float | None = None
    shape_distance: float | None = None
    strokes: int | None = None


def measure(bench: Bench, trials: Sequence[Trial]) -> Iterator[tuple[Trial, Run]]:
    """Yield the trials of one training seed, whose model is learned once."""
    training = int(trials[0].seed.split("-")[0])
    shown = [make_trial("n1m1", (training, k)) for k in range(round(TRAINING_SHARE * CELLS["n1m1"].trials))]
    learned = learn_methods(shown, [arm for arm in NETWORKS if any(trial.arm == arm for trial in trials)], training)
    for trial in sorted(trials, key=lambda trial: int(trial.seed.split("-")[1])):
        goal = 1000 * training + int(trial.seed.split("-")[1])
        if trial.case in GROWTH:
            yield trial, grown(learned, GROWTH[trial.case], goal)
            continue
        reached = attempt(learned, trial.arm, trial.case, goal)
        scores = reached.scores
        yield (
            trial,
            Run(
                scores.count_exact,
                scores.count_error,
                reached.seconds,
                scores.iou,
                scores.iou_thesis,
                scores.volume_error,
                scores.shape_distance,
                reached.strokes,
            ),
        )


def grown(learned: Learned, wanted: int, seed: int) -> Run:
    """Return a plan of so many cubes out of a loaf, asked for in words."""
    objects = [make_food("bread", np.random.default_rng(seed))]
    wish = imagine(objects, [(wanted, "cubes")], learned.grammar)
    carving = carry_out(learned.policy_for(wish), objects, most=wanted + 1)
    error = abs(len(carving.board) - wanted)
    return Run(error == 0, error, carving.seconds)


def runs(arm: str, case: str) -> bool:
    """Whether the arm runs in the case: only ours plans for goals in words."""
    return case not in GROWTH or arm == "ours"


def seeds_of(bench: Bench, case: str) -> Sequence[str]:
    """The goals; growth takes one of each training."""
    every = TUNING if bench.tuning else REPORTING
    return every[:TRAININGS] if case in GROWTH else every


def printed(results: Results) -> str:
    """What the thesis prints."""
    rows = (
        ("n1m1", "0.37", "0.40", "0.58", "0.57"),
        ("n1m2", "0.35", "0.32", "0.49", "0.62"),
        ("n2m1", "0.44", "0.34", "0.56", "0.62"),
        ("n2m2", "0.42", "0.29", "0.52", "0.56"),
        ("n2m3", "0.38", "0.28", "0.52", "0.60"),
        ("n3m4", "0.38", "0.22", "0.52", "0.56"),
    )
    head = ("as printed", "BC", "QNet", "thesis", "people")
    return markdown("Table 6.1 (Han 2024): mean best-matched IoU, unmatched fragments left out", head, rows)


EXPERIMENT = Experiment(
    name="cutting",
    title="Cutting towards goals that were cut by somebody else",
    simulated=(
        "Foods, planes, and the cutter who demonstrates and cuts the goals. Fragments are cut exactly and "
        "pushed apart, without physics. For `ours_perceived` physics lays them on a board, and two noisy "
        "depth cameras are rendered."
    ),
    knows=(
        "Every fragment's whole shape; `ours_perceived` only what its cameras see; the goal's fragments as "
        "bodies. `scatter` also knows the recipe of the goal."
    ),
    does_not_show="What people would do: `scatter` is a script that misses by chance. No real camera.",
    arms=ARMS,
    cases=(*CELLS, *GROWTH),
    runs=runs,
    tuning=TUNING,
    reporting=REPORTING,
    seeds_of=seeds_of,
    together=lambda trial: trial.seed.split("-")[0],
    measure=measure,
    record=Run,
    code=dict.fromkeys(ARMS, SHARED) | {"ours_perceived": (*SHARED, "scenewright.stages.cutting.sight.perceiving")},
    measures={
        "iou": mean("iou"),
        "iou_thesis": mean("iou_thesis"),
        "count_exact": mean("count_exact", interval=False),
        "count_error": mean("count_error", interval=False),
        "volume_error": mean("volume_error"),
        "shape_distance": mean("shape_distance"),
        "plan_seconds": mean("plan_seconds", "s"),
        "strokes": mean("strokes"),
        "goals": Measure(count, interval=False),
    },
    pairs=(("ours", "scatter"), ("ours", "thesis"), ("thesis", "bc"), ("thesis", "qnet")),
    compared=("iou",),
    quick_seeds=2,
    notes=printed,
)
