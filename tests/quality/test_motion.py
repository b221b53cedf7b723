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
from tests.quality.limits import misses

pytestmark = pytest.mark.slow

QUERIES = 12
FIRST_SEED = 7000
SETS: dict[str, tuple[Callable[[], QuerySet], dict[str, float]]] = {
    "free": (free_set, {"samples": 248, "mesh_checks": 990, "mean_length": 5.6}),
    "shelf": (shelf_set, {"samples": 1330, "mesh_checks": 1185, "mean_length": 6.3}),
    "drawer": (drawer_set, {"samples": 113, "mesh_checks": 940, "mean_length": 5.35}),
}
"""Queries, and the most that twelve answers may take; lengths in radians. One query's tree may grow otherwise."""
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
    make, at_most = SETS[name]
    queries = make()
    found = figures(queries)
    queries.world.close()
    assert not misses(found, {"solved": QUERIES}, at_most | {"rejected": 0})
