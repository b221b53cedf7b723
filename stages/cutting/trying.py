"""How well a policy reaches the goal of a trial, or the scripted cutter a second time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scenewright.stages.cutting.demonstrations.cutter import Demonstration, follow
from scenewright.stages.cutting.demonstrations.trials import make_trial
from scenewright.stages.cutting.measure.scores import Scores, score
from scenewright.stages.cutting.policy import Policy, carry_out
from scenewright.stages.cutting.world.body import Body

GOALS = 1_000_003
"""Stream of goals: they share nothing with demonstrations."""


@dataclass(frozen=True)
class Reached:
    """Scores, CPU seconds of the decisions, and how often the knife went down; None where nobody counted."""

    scores: Scores
    seconds: float = 0.0
    strokes: int | None = None


def goal_trial(cell: str, seed: int) -> Demonstration:
    """Return the trial whose fragments are the goal of a seed."""
    return make_trial(cell, (GOALS, seed))


def reach(
    policy: Policy, trial: Demonstration, *, most: int, lie: Callable[[dict[int, Body]], None] | None = None
) -> Reached:
    """Return what a policy makes of the objects of a trial; `lie` as in `carry_out`, before the first cut too."""
    objects = dict(enumerate(trial.objects))
    if lie is not None:
        lie(objects)
    carving = carry_out(policy, list(objects.values()), most=most, lie=lie)
    return Reached(score(carving.fragments, trial.fragments), carving.seconds, carving.strokes)


def again(trial: Demonstration, seed: int) -> Reached:
    """Return what the scripted cutter makes, who knows the recipe that the goal was cut after."""
    repeated = follow(trial.cell, trial.families, trial.objects, trial.recipes, np.random.default_rng([GOALS, seed, 1]))
    return Reached(score(repeated.fragments, trial.fragments))
