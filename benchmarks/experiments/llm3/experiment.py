"""Box packing by proposals and motion-planning feedback: tables 4.1 and 4.2 (Han 2024), and harder suites."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from scenewright.stages.pack import MotionPlanner, PackingWorld, run_loop

from benchmarks.experiment import Bench, Experiment, Measure, Results, Trial, count, mean, only, ratio
from benchmarks.experiments.llm3.arms import ARMS, EVERYWHERE, make_instance
from benchmarks.tabulation import Figure, markdown

TUNING, REPORTING = range(100), range(1000, 1100)
RIVALS = ("random", "random_restarts", "backtracking", "backtracking_corners", "ours_no_reasons")


@dataclass(frozen=True)
class Run:
    """What an attempt came to."""

    success: bool
    proposer_calls: int
    motion_planner_calls: int
    mesh_calls: int
    iterations: int
    seconds: float
    """CPU time of planning, one thread."""
    boxes: int
    fill: float
    failures: tuple[str, ...] = ()
    """Kind of the failure that ended each iteration, at most forty."""


def attempt(arm: str, case: str, seed: int, world: PackingWorld) -> Run:
    """Return what one arm did on one instance."""
    proposer = ARMS[arm].make(seed)
    started = time.process_time()
    run = run_loop(world, proposer, ARMS[arm].budget(case))
    seconds = time.process_time() - started
    failures = [e.task.kind if e.task else _kind(e.feedback[-1].failure) for e in run.attempts if e.task or e.feedback]
    return Run(
        success=run.success,
        proposer_calls=run.proposer_calls,
        motion_planner_calls=run.motion_calls,
        mesh_calls=run.mesh_calls,
        iterations=len(run.attempts),
        seconds=seconds,
        boxes=len(world.instance.boxes),
        fill=world.instance.fill,
        failures=tuple(filter(None, failures))[:40],
    )


def _kind(failure: object) -> str:
    return str(getattr(failure, "kind", ""))


def measure(bench: Bench, trials: Sequence[Trial]) -> Iterator[tuple[Trial, Run]]:
    """Yield the attempts seed by seed: what a stopped run leaves has whole pairs."""
    planner = MotionPlanner()
    with PackingWorld(make_instance("published/easy", 0), planner=planner) as world:
        attempt("ours", "published/easy", 0, world)  # compiles what is compiled; its time is not kept
    for trial in sorted(trials, key=lambda t: (int(t.seed), EVERYWHERE.index(t.case))):
        with PackingWorld(make_instance(trial.case, int(trial.seed)), planner=planner) as world:
            yield trial, attempt(trial.arm, trial.case, int(trial.seed), world)
    planner.close()


def more_figures(results: Results) -> dict[str, float | Figure | None]:
    """Motion-planner calls of a rival over ours where both solve, and how often both or one of them do."""
    flat: dict[str, float | Figure | None] = {}
    for case in results.cases:
        for rival in RIVALS:
            pairs, at = results.pairs(rival, "ours", case), f"{rival}/{case}"
            both = [(r.motion_planner_calls, o.motion_planner_calls) for r, o in pairs if r.success and o.success]
            if pairs:
                flat |= {
                    f"{at}/calls_over_ours": ratio(both),
                    f"{at}/both_solve": len(both),
                    f"{at}/only_ours_solves": sum(o.success and not r.success for r, o in pairs),
                    f"{at}/only_the_rival_solves": sum(r.success and not o.success for r, o in pairs),
                }
    return flat


def printed(results: Results) -> str:
    """What the thesis prints."""
    cells = (
        ("LLM3 Backtrack", "100/1.6/11.8", "100/4.4/28.4", "60/11.4/39.8", "80/9.5/50", "50/13.5/44.8"),
        ("Backtrack, no reasons", "100/1.8/12.6", "90/6.3/32", "40/15.1/55.3", "30/14.6/16", "30/15.8/48"),
        ("LLM3 Scratch", "100/1.7/13.2", "100/7/46.1", "70/8.8/30.9", "70/11.5/50.2", "60/10.6/32"),
        ("Scratch, no reasons", "100/2.4/17.6", "60/12.3/45.3", "50/13.7/42.8", "30/16.2/45.7", "40/13.2/24"),
    )
    head = ("as printed", "S1 Easy", "S1 Medium", "S1 Hard = S2 Small", "S2 Medium", "S2 Large")
    title = "Table 4.1 (Han 2024): 10 attempts a cell, GPT-4 Turbo, success % / proposer calls / motion-planner calls"
    samplers = (("Random", "109.6", "663.1"), ("LLM", "10.8", "70.2"), ("LLM + Feedback", "7.9", "53.2"))
    return "\n".join(
        (
            markdown(title, head, cells),
            markdown("Table 4.2", ("as printed", "iterations", "motion-planner calls"), samplers),
        )
    )


EXPERIMENT = Experiment(
    name="llm3",
    title="Box packing by proposals and motion-planning feedback (LLM³)",
    simulated="Arm, boxes and baskets; no language model is asked.",
    knows="Poses and sizes of boxes and basket, not heights of obstacles nor the reach.",
    does_not_show="How good a language model is: the `scripted` arms are a stand-in, `ours` is geometry.",
    arms={name: name for name in ARMS},
    cases=EVERYWHERE,
    runs=lambda arm, case: case in ARMS[arm].cases,
    tuning=tuple(map(str, TUNING)),
    reporting=tuple(map(str, REPORTING)),
    together=lambda trial: "",
    measure=measure,
    record=Run,
    measures={
        "success": mean("success"),
        "proposer_calls": mean("proposer_calls"),
        "motion_planner_calls": mean("motion_planner_calls"),
        "iterations": mean("iterations", interval=False),
        "seconds": mean("seconds", "s"),
        "boxes": only("boxes"),
        "fill": only("fill"),
        "instances": Measure(count, interval=False),
    },
    more_figures=more_figures,
    quick_seeds=10,
    steps=("pack",),
    notes=printed,
)
