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

__getattr__ = exported(__name__)
