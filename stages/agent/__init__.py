"""The steps `agent run`, `replay` and `evaluate`: a mobile manipulator told in words (Han 2024, chapter 3)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from scenewright.stages.kit.exports import exported

if TYPE_CHECKING:
    from scenewright.stages.agent.arms.registry import ARMS
    from scenewright.stages.agent.judging import CAUSES, Score, score
    from scenewright.stages.agent.tasks import TASKS, THESIS_TASKS, make_apartment
    from scenewright.stages.agent.trials import Setting, run_trial
    from scenewright.stages.agent.world.failures import TABLE_3_4, PrintedEyes, Rates
    from scenewright.stages.agent.world.floor import Floor

__getattr__ = exported(__name__)
