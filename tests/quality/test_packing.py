"""Boxes packed by our proposer on seeded instances of the harder suites."""

from __future__ import annotations

import pytest
from scenewright.stages.pack.environment import PackingWorld
from scenewright.stages.pack.hard_suites import hard_instance
from scenewright.stages.pack.loop import Budget, run_loop
from scenewright.stages.pack.motion import MotionPlanner
from scenewright.stages.pack.own_proposer import OwnProposer

from tests.quality.limits import misses

pytestmark = pytest.mark.slow

CELLS = ("fill", "unreachable", "obstacles", "mixed_heights", "boxes_8")
SEEDS = range(7000, 7004)

AT_LEAST = {"packed": 20}
AT_MOST = {"proposer_calls": 25, "motion_calls": 226, "mesh_calls": 3}
"""One call of the proposer more is a box placed anew, and 8 motions."""


def figures() -> dict[str, float]:
    """Return what the packings came to together."""
    planner = MotionPlanner()
    runs = []
    for cell in CELLS:
        for seed in SEEDS:
            with PackingWorld(hard_instance(cell, seed), planner=planner) as world:
                runs.append(run_loop(world, OwnProposer(seed), Budget(iterations=20)))
    planner.close()
    return {
        "packed": sum(run.success for run in runs),
        "proposer_calls": sum(run.proposer_calls for run in runs),
        "motion_calls": sum(run.motion_calls for run in runs),
        "mesh_calls": sum(run.mesh_calls for run in runs),
    }


def test_boxes_are_packed_with_few_calls() -> None:
    assert not misses(figures(), AT_LEAST, AT_MOST)
