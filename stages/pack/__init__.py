"""The step `pack`: boxes into a basket, by proposals and what motion planning says to them (LLM3)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from scenewright.stages.kit.exports import exported

if TYPE_CHECKING:
    from scenewright.stages.pack.backtracking import Backtracking, CornerBacktracking
    from scenewright.stages.pack.environment import PackingWorld
    from scenewright.stages.pack.hard_suites import HARD_CELLS, hard_instance
    from scenewright.stages.pack.instances import PUBLISHED_CELLS, Instance, published_instance
    from scenewright.stages.pack.language_proposer import LanguageProposer, SymbolicProposer
    from scenewright.stages.pack.language_scripted import scripted_chat
    from scenewright.stages.pack.loop import Budget, run_loop
    from scenewright.stages.pack.motion import MotionPlanner
    from scenewright.stages.pack.own_proposer import OwnProposer, placement_solver
    from scenewright.stages.pack.records import Proposer
    from scenewright.stages.pack.sampling import FixedLayout, RandomRestarts, RandomSampler

_MODULES = {
    "Backtracking": "scenewright.stages.pack.backtracking",
    "CornerBacktracking": "scenewright.stages.pack.backtracking",
    "PackingWorld": "scenewright.stages.pack.environment",
    "HARD_CELLS": "scenewright.stages.pack.hard_suites",
    "hard_instance": "scenewright.stages.pack.hard_suites",
    "Instance": "scenewright.stages.pack.instances",
    "PUBLISHED_CELLS": "scenewright.stages.pack.instances",
    "published_instance": "scenewright.stages.pack.instances",
    "LanguageProposer": "scenewright.stages.pack.language_proposer",
    "SymbolicProposer": "scenewright.stages.pack.language_proposer",
    "scripted_chat": "scenewright.stages.pack.language_scripted",
    "Budget": "scenewright.stages.pack.loop",
    "run_loop": "scenewright.stages.pack.loop",
    "MotionPlanner": "scenewright.stages.pack.motion",
    "OwnProposer": "scenewright.stages.pack.own_proposer",
    "placement_solver": "scenewright.stages.pack.own_proposer",
    "Proposer": "scenewright.stages.pack.records",
    "FixedLayout": "scenewright.stages.pack.sampling",
    "RandomRestarts": "scenewright.stages.pack.sampling",
    "RandomSampler": "scenewright.stages.pack.sampling",
}

__getattr__ = exported(__name__, _MODULES)
