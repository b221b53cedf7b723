"""Motion queries: three planners on the same seeded queries, one after the other in one process, CPU time each.

A path counts as success when a mesh checker of its own finds it free at a third of the resolution; one that it does
not is counted as rejected_by_mesh. No planner sees the check of another.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pydantic import Field

from benchmarks.experiment import Bench, Experiment, Measure, Results, Trial, mean, statistic
from benchmarks.experiments.planning_motion.arms import ARMS, RESOLUTION
from benchmarks.experiments.planning_motion.queries import (
    MotionQuery,
    QuerySet,
    drawer_set,
    free_set,
    room_set,
    shelf_set,
)
from stages.kit.motion.rrt_connect import FINER, densify
from stages.kit.stage import Parameters

QUERIES = 100
TUNING, REPORTING = range(0, QUERIES), range(1000, 1000 + QUERIES)
SETS: dict[str, Callable[[], QuerySet]] = {"free": free_set, "shelf": shelf_set, "drawer": drawer_set}
ROOM = "reconstructed_room"
EVERYWHERE = "all"


class MotionParameters(Parameters):
    """Options of the experiment."""

    scene: Path | None = Field(None, description=f"Interactive scene for the case {ROOM}")


@dataclass(frozen=True)
class Answer:
    """What a planner made of a query."""

    milliseconds: float
    """Of CPU."""
    length: float | None
    """Of a path that the mesh checker accepts [rad]."""
    rejected: bool
    """Whether there was one that it does not."""

    @property
    def success(self) -> float:
        """Whether there is a path."""
        return float(self.length is not None)


def inputs(bench: Bench, trial: Trial) -> list[Path]:
    """The scene."""
    return [bench.parameters.scene] if trial.case == ROOM else []


def measure(bench: Bench, trials: Sequence[Trial]) -> Iterator[tuple[Trial, Answer]]:
    """Yield the answers to the queries of one set, seed by seed."""
    case = trials[0].case
    queries = room_set(bench.parameters.scene) if case == ROOM else SETS[case]()
    warm = queries.query(TUNING[0])
    for arm in ARMS.values():
        arm(queries.checker, warm, 0)  # compile, build the arrays
    for trial in sorted(trials, key=lambda t: (int(t.seed), list(ARMS).index(t.arm))):
        yield trial, answered(queries, trial.arm, int(trial.seed))
    queries.world.close()


def answered(queries: QuerySet, arm: str, seed: int) -> Answer:
    """Ask one planner."""
    query = queries.query(seed)
    started = time.process_time()
    path = ARMS[arm](queries.checker, query, seed)
    spent = 1e3 * (time.process_time() - started)
    good = path is not None and _accepted(queries, query, path)
    length = float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum()) if path is not None and good else None
    return Answer(spent, length, path is not None and not good)


def _accepted(queries: QuerySet, query: MotionQuery, path: np.ndarray) -> bool:
    points = densify(path, np.full(7, RESOLUTION / FINER))
    ends = np.allclose(path[0], query.start) and np.allclose(path[-1], query.goal)
    return bool(ends) and all(
        queries.checker.check_meshes(np.concatenate([query.base, point])) is None for point in points
    )


def p95(values: Sequence[float]) -> float:
    """The 95th percentile."""
    return float(np.quantile(values, 0.95))


MEASURES = {
    "success": mean("success"),
    "median_ms": Measure(statistic("milliseconds", np.median), "ms"),
    "p95_ms": Measure(statistic("milliseconds", p95), "ms"),
    "mean_ms": mean("milliseconds", "ms"),
    "rejected_by_mesh": Measure(statistic("rejected", np.sum), interval=False),
}


def more_figures(results: Results) -> dict[str, float | None]:
    """Lengths, which are compared over the queries that every planner solved, and how many those are."""
    flat: dict[str, float | None] = {}
    for case in results.cases:
        answers = {seed: [results.get(arm, case, seed) for arm in results.arms(case)] for seed in results.seeds(case)}
        solved = [seed for seed, found in answers.items() if all(a is not None and a.length is not None for a in found)]
        flat |= {
            f"{EVERYWHERE}/{case}/queries": float(len(answers)),
            f"{EVERYWHERE}/{case}/solved_by_all": float(len(solved)),
        }
        for arm in results.arms(case):
            lengths = [results.records[Trial(arm, case, seed)].length for seed in solved]
            flat[f"{arm}/{case}/path_length"] = float(np.mean(lengths)) if lengths else None
    return flat


EXPERIMENT = Experiment(
    name="planning_motion",
    title="Arm motions beside OMPL with pybullet's checks",
    simulated="Everything: boxes and rooms around a Panda, and its queries.",
    knows="The scene's exact geometry.",
    does_not_show="Execution, or planning against what a camera sees.",
    arms={
        "ours": "compiled RRT-Connect",
        "ompl_pybullet": "OMPL's RRT-Connect, pybullet's checks",
        "mesh_fallback": "OMPL's RRT-Connect with the meshes' checks, repeated where a closer look finds a hit",
    },
    cases=(*SETS, ROOM),
    default_cases=lambda bench: [*SETS, *([ROOM] if bench.parameters.scene else [])],
    tuning=tuple(map(str, TUNING)),
    reporting=tuple(map(str, REPORTING)),
    together=lambda trial: trial.case,
    measure=measure,
    record=Answer,
    measures=MEASURES,
    more_figures=more_figures,
    parameters=MotionParameters,
    places=frozenset({"scene"}),
    quick_seeds=10,
    inputs=inputs,
    pairs=(("ours", "ompl_pybullet"),),
    compared=("success", "median_ms", "mean_ms"),
)
