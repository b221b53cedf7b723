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

_MODULES = {
    "Board": "scenewright.stages.cutting.board",
    "CELLS": "scenewright.stages.cutting.demonstrations.recipes",
    "make_trial": "scenewright.stages.cutting.demonstrations.trials",
    "attempt": "scenewright.stages.cutting.evaluate_stage",
    "score": "scenewright.stages.cutting.measure.scores",
    "Learned": "scenewright.stages.cutting.methods",
    "learn_methods": "scenewright.stages.cutting.methods",
    "imagine": "scenewright.stages.cutting.ours.imagining",
    "carry_out": "scenewright.stages.cutting.policy",
    "Hand": "scenewright.stages.cutting.sight.laying",
    "see": "scenewright.stages.cutting.sight.seeing",
    "look": "scenewright.stages.cutting.sight.views",
    "goal_trial": "scenewright.stages.cutting.trying",
    "Body": "scenewright.stages.cutting.world.body",
    "make_food": "scenewright.stages.cutting.world.foods",
}

__getattr__ = exported(__name__, _MODULES)
