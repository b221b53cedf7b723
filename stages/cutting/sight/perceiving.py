"""A policy that knows of the pieces what two depth cameras see."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scenewright.schemas.plan import Failure
from scenewright.stages.cutting.ours.grammar import Grammar
from scenewright.stages.cutting.ours.items import Item
from scenewright.stages.cutting.ours.policy import OursPolicy
from scenewright.stages.cutting.policy import Action, Stop
from scenewright.stages.cutting.sight.laying import BETWEEN
from scenewright.stages.cutting.sight.seeing import DOUBT, see
from scenewright.stages.cutting.sight.views import look
from scenewright.stages.cutting.world.body import Body
from scipy.optimize import linear_sum_assignment


class PerceivingPolicy:
    """Ours, on bodies as they were seen when they were laid down."""

    def __init__(self, grammar: Grammar, items: Sequence[Item], seed: int, *, doubt: float = DOUBT) -> None:
        self._ours = OursPolicy(grammar, items, doubt=doubt)
        self._random = np.random.default_rng([seed, 1])
        self._seen: dict[int, Body] = {}
        self.missed = 0
        """Pieces that no camera saw."""

    @property
    def seen(self) -> Mapping[int, Body]:
        """Bodies as they were seen, by number."""
        return self._seen

    def decide(self, board: Mapping[int, Body]) -> Action | Stop:
        """Return the next cut, planned from what was seen."""
        if not self._seen:
            self._look(board)
        seen_board = {number: self._seen[number] for number in board if number in self._seen}
        return self._ours.decide(seen_board)

    def done(self, action: Action, results: Mapping[int, Body], above: frozenset[int]) -> None:
        """Look at what came of a cut."""
        self._look(results)
        seen_results = {number: self._seen[number] for number in results if number in self._seen}
        self._ours.done(action, seen_results, above)

    def refused(self, action: Action, failure: Failure) -> None:
        """Hear why the knife did not cut."""
        self._ours.refused(action, failure)

    def _look(self, bodies: Mapping[int, Body]) -> None:
        """See bodies; which is which is known by where each was laid down."""
        seen_bodies = see(look(list(bodies.values()), self._random))
        numbers = list(bodies)
        if seen_bodies:
            places = np.array([body.moments[0] for body in bodies.values()])
            off = np.linalg.norm(places[:, None] - np.array([body.moments[0] for body in seen_bodies])[None], axis=2)
            for row, column in zip(*linear_sum_assignment(off), strict=True):
                if off[row, column] < BETWEEN:
                    self._seen[numbers[row]] = seen_bodies[column]
        self.missed += sum(number not in self._seen for number in numbers)
