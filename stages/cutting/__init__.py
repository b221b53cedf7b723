"""Cutting things into fragments, learned from demonstrations (Han 2024, chapter 6)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from scenewright.stages.kit.exports import exported

if TYPE_CHECKING:
    from scenewright.stages.cutting.board import Board
    from scenewright.stages.cutting.demonstrations.recipes import CELLS
    from scenewright.stages.cutting.demonstrations.trials import make_trial
    from scenewright.stages.cutting.evaluate_stage import attempt
    from scenewright.stages.cutting.measure.scores import score
    from scenewright.stages.cutting.methods import Learned, learn_methods
    from scenewright.stages.cutting.ours.imagining import imagine
    from scenewright.stages.cutting.policy import carry_out
    from scenewright.stages.cutting.sight.laying import Hand
    from scenewright.stages.cutting.sight.seeing import see
    from scenewright.stages.cutting.sight.views import look
    from scenewright.stages.cutting.trying import goal_trial
    from scenewright.stages.cutting.world.body import Body
    from scenewright.stages.cutting.world.foods import make_food

__getattr__ = exported(__name__)
