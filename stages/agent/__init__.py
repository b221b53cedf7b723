"""The steps `agent run`, `replay` and `evaluate`: a mobile manipulator told in words (Han 2024, chapter 3)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from scenewright.stages.kit.exports import exported

if TYPE_CHECKING:
    from scenewright.stages.agent.arms.registry import ARMS
    from scenewright.stages.agent.judging import CAUSES, Score, score
    from scenewright.stages.agent.tasks import TASKS, THESIS_TASKS, make_apartment
    from scenewright.stages.agent.trials import Setting, run_trial
    from scenewright.stages.agent.world.failures import TABLE_3_4, Rates
    from scenewright.stages.agent.world.floor import Floor

_MODULES = {
    "ARMS": "scenewright.stages.agent.arms.registry",
    "CAUSES": "scenewright.stages.agent.judging",
    "Score": "scenewright.stages.agent.judging",
    "score": "scenewright.stages.agent.judging",
    "TASKS": "scenewright.stages.agent.tasks",
    "THESIS_TASKS": "scenewright.stages.agent.tasks",
    "make_apartment": "scenewright.stages.agent.tasks",
    "Setting": "scenewright.stages.agent.trials",
    "run_trial": "scenewright.stages.agent.trials",
    "Rates": "scenewright.stages.agent.world.failures",
    "TABLE_3_4": "scenewright.stages.agent.world.failures",
    "Floor": "scenewright.stages.agent.world.floor",
}

__getattr__ = exported(__name__, _MODULES)
