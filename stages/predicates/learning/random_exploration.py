"""A learner that does whatever comes to it: any action on any objects, with no plan and no aim. All else is ours."""

from __future__ import annotations

import itertools

from scenewright.stages.kit.predicates.vocabulary import Perceived
from scenewright.stages.kit.tasks.strips import Atom
from scenewright.stages.predicates.learning.ours import OursLearner


class RandomLearner(OursLearner):
    """Explores by chance."""

    label = "random"
    plans = False

    def explore(self, state: Perceived) -> Atom | None:
        """Return any action."""
        actions = [
            (name, *objects)
            for name in self.actions
            for objects in itertools.permutations(state.names, self.setting.arity[name])
        ]
        return actions[int(self.random.integers(len(actions)))] if actions else None

    def curious(self, state: Perceived) -> bool:
        """It is not: a goal that happens to hold is claimed."""
        return False
