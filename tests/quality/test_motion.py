"""Arm motions among boxes, in a shelf and into a drawer: seeded queries, effort counted in samples and checks."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scenewright.stages.kit.motion.failures import MotionFailed
from scenewright.stages.kit.motion.path_query import Effort, Query
from scenewright.stages.kit.motion.path_search import find_path
from scenewright.stages.kit.motion.rrt_connect import SearchSpace

from benchmarks.experiments.planning_motion.queries import CHAIN, QuerySet, drawer_set, free_set, shelf_set
from tests.quality.bands import Band, outside

QUERIES = 12
FIRST_SEED = 7000
SETS: dict[str, tuple[Callable[[], QuerySet], dict[str, Band]]] = {
    "free": (free_set, {"samples": (204, 248), "mesh_checks": (890, 990), "mean_length": (5.4, 5.6)}),
    "shelf": (shelf_set, {"samples": (1090, 1330), "mesh_checks": (1070, 1185), "mean_length": (6.0, 6.3)}),
    "drawer": (drawer_set, {"samples": (85, 113), "mesh_checks": (850, 940), "mean_length": (5.1, 5.35)}),
}
"""Today samples are 226, 1209 and 99, mesh checks 939, 1126 and 896, lengths 5.504, 6.157 and 5.222 rad; the bands hold
where one query's tree grows otherwise (of the same code one whole run took 88 samples for the drawer; why was not
found)."""
SPACE = SearchSpace(CHAIN.lower, CHAIN.upper, np.full(7, 0.05))


def figures(queries: QuerySet) -> dict[str, float]:
    """Return how many queries were answered, and what the answers took and came to."""
    effort, lengths = Effort(), []
    for seed in range(FIRST_SEED, FIRST_SEED + QUERIES):
        drawn = queries.query(seed)
        query = Query(np.concatenate([drawn.base, drawn.start]), np.arange(3, 10), drawn.start, drawn.goal[None], SPACE)
        try:
            path = find_path(query, queries.checker, np.random.default_rng(seed), samples=20000, effort=effort)
        except MotionFailed:
            continue
        lengths.append(float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum()))
    return {
        "solved": len(lengths),
        "samples": effort.samples,
        "mesh_checks": effort.mesh_checks,
        "rejected": effort.rejected,
        "mean_length": float(np.mean(lengths)),
    }


@pytest.mark.parametrize("name", SETS)
def test_arm_motions(name: str) -> None:
    make, bands = SETS[name]
    queries = make()
    found = figures(queries)
    queries.world.close()
    assert not outside(found, bands | {"solved": (QUERIES, QUERIES), "rejected": (0, 0)})
