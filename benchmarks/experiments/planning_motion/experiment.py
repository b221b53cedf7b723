"""Motion queries: four planners on the same seeded queries, one after the other in one process, CPU time each.

A path counts as success when a mesh checker of its own finds it free at a third of our search's resolution, which every
planner is told or looks at itself; one that it does not is counted as rejected. Each query is asked twice, with the
same seed: for the path as the search finds it, and for the one that the planner's own simplification makes of it.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from pydantic import Field
from scenewright.stages.kit.motion.rrt_connect import densify
from scenewright.stages.kit.stage import Parameters

from benchmarks.experiment import Bench, Experiment, Measure, Results, Trial, mean, median, ratio, statistic
from benchmarks.experiments.planning_motion.arms import ARMS, FINE
from benchmarks.experiments.planning_motion.queries import (
    MotionQuery,
    QuerySet,
    drawer_set,
    free_set,
    room_set,
    shelf_set,
)
from benchmarks.tabulation import Figure

QUERIES = 200
TUNING, REPORTING = range(0, QUERIES), range(5000, 5000 + QUERIES)
"""Queries 1000 to 1099 were reported before trees were balanced and OMPL was told the fine resolution."""
SETS: dict[str, Callable[[], QuerySet]] = {"free": free_set, "shelf": shelf_set, "drawer": drawer_set}
ROOM = "reconstructed_room"
RIVALS = ("ompl_compiled", "ompl_pybullet")


class MotionParameters(Parameters):
    """Options of the experiment."""

    scene: tuple[Path, ...] = Field((), description=f"Interactive scenes for the case {ROOM}; queries take turns")


@dataclass(frozen=True)
class Answer:
    """What a planner made of a query."""

    milliseconds: float
    """Of CPU, simplification included."""
    length: float | None
    """Of a path that the mesh checker accepts [rad]."""
    rejected: bool
    """Whether there was one that it does not."""
    raw_milliseconds: float
    """Of CPU, without simplification."""
    raw_length: float | None

    @property
    def success(self) -> float:
        """Whether there is a path [%]."""
        return 100.0 * (self.length is not None)


def inputs(bench: Bench, trial: Trial) -> list[Path]:
    """The scenes."""
    return list(bench.parameters.scene) if trial.case == ROOM else []


def measure(bench: Bench, trials: Sequence[Trial]) -> Iterator[tuple[Trial, Answer]]:
    """Yield the answers to the queries of one set, seed by seed."""
    case = trials[0].case
    makers: list[Callable[[], QuerySet]] = (
        [partial(room_set, scene) for scene in bench.parameters.scene] if case == ROOM else [SETS[case]]
    )
    for number, make in enumerate(makers):
        queries = make()
        for arm in ARMS.values():
            arm(queries.checker, queries.query(TUNING[0]), 0, True)  # compile, build the arrays
        own = [trial for trial in trials if int(trial.seed) % len(makers) == number]
        for trial in sorted(own, key=lambda t: (int(t.seed), list(ARMS).index(t.arm))):
            yield trial, answered(queries, trial.arm, int(trial.seed))
        queries.world.close()


def answered(queries: QuerySet, arm: str, seed: int) -> Answer:
    """Ask one planner."""
    query = queries.query(seed)
    asked = {}
    for simplified in (False, True):
        started = time.process_time()
        path = ARMS[arm](queries.checker, query, seed, simplified)
        asked[simplified] = 1e3 * (time.process_time() - started), path
    (raw_spent, raw), (spent, path) = asked[False], asked[True]
    good = path is not None and _accepted(queries, query, path)
    return Answer(
        milliseconds=spent,
        length=length(path) if path is not None and good else None,
        rejected=path is not None and not good,
        raw_milliseconds=raw_spent,
        raw_length=None if raw is None else length(raw),
    )


def length(path: np.ndarray) -> float:
    """Return the Euclidean length of a path (N, 7) [rad]."""
    return float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())


def _accepted(queries: QuerySet, query: MotionQuery, path: np.ndarray) -> bool:
    points = densify(path, np.full(7, FINE))
    ends = np.allclose(path[0], query.start) and np.allclose(path[-1], query.goal)
    return bool(ends) and all(
        queries.checker.check_meshes(np.concatenate([query.base, point])) is None for point in points
    )


def p95(values: Sequence[float]) -> float:
    """The 95th percentile."""
    return float(np.quantile(values, 0.95))


MEASURES = {
    "success": mean("success", "%"),
    "median time": median("milliseconds", "ms"),
    "p95 time": Measure(statistic("milliseconds", p95), "ms"),
    "mean time": mean("milliseconds", "ms"),
    "path length": mean("length", "rad"),
    "raw median time": median("raw_milliseconds", "ms"),
    "raw path length": mean("raw_length", "rad"),
    "rejected by mesh": Measure(statistic("rejected", np.sum), "count", interval=False),
}


def more_figures(results: Results) -> dict[str, Figure | None]:
    """Rivals over ours, by the queries that both solved: ratios of medians and means of time, and of mean lengths."""
    flat: dict[str, Figure | None] = {}
    for case in results.cases:
        for rival in RIVALS:
            both = [
                (theirs, own)
                for theirs, own in results.pairs(rival, "ours", case)
                if theirs.length is not None and own.length is not None
            ]
            for name, entry, of in (
                ("median time ratio", "milliseconds", np.median),
                ("mean time ratio", "milliseconds", np.mean),
                ("raw median time ratio", "raw_milliseconds", np.median),
                ("length ratio", "length", np.mean),
                ("raw length ratio", "raw_length", np.mean),
            ):
                values = [(getattr(theirs, entry), getattr(own, entry)) for theirs, own in both]
                flat[f"{rival} over ours/{case}/{name}"] = ratio(values, of)
    return flat


EXPERIMENT = Experiment(
    name="planning_motion",
    title="Motion planning beside OMPL",
    simulated="a Panda among exact geometry",
    knows="all geometry",
    does_not_show="Execution, or planning against what a camera sees. OMPL is driven from Python: part of its time are "
    "the calls of checks from C++ into Python, one for each motion on the compiled check.",
    arms={
        "ours": "compiled RRT-Connect",
        "ompl_compiled": "OMPL's RRT-Connect, our compiled checks",
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
    pairs=tuple(("ours", rival) for rival in RIVALS),
    compared=("success", "median time", "mean time", "path length", "raw path length"),
)
