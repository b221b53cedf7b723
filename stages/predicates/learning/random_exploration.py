"""A learner that does whatever comes to it: any action on any objects, with no plan and no aim. All else is ours."""

from __future__ import annotations

import itertools

from stages.kit.tasks.strips import Atom
from stages.predicates.learning.ours import OursLearner
from stages.predicates.state import State
from stages.predicates.world.actions import ARITY


class RandomLearner(OursLearner):
    """Explores by chance."""

    plans = False

    def explore(self, state: State) -> Atom | None:
        """Return any action."""
        actions = [
            (name, *objects) for name in self.actions for objects in itertools.permutations(state.objects, ARITY[name])
        ]
        return actions[int(self.random.integers(len(actions)))] if actions else None

    def curious(self, state: State) -> bool:
        """It is not: a goal that happens to hold is claimed."""
        return False
