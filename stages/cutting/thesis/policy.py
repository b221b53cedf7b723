"""The thesis's policy: infer the best parse tree, carry out one of its productions at random, infer anew."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scenewright.schemas.plan import Failure
from scenewright.stages.cutting.corpus import plane_out
from scenewright.stages.cutting.policy import Action, Goal, Stop
from scenewright.stages.cutting.thesis.model import ThesisModel
from scenewright.stages.cutting.thesis.search import Search
from scenewright.stages.cutting.world.body import Body


class ThesisPolicy:
    """Plans for a goal of fragments as they lie."""

    def __init__(self, model: ThesisModel, goal: Goal, seed: int) -> None:
        self._model, self._random = model, np.random.default_rng([seed, 4])
        log_types = model.log_types(model.features.of(goal.fragments))
        positions = np.array([body.moments[0] for body in goal.fragments])
        self._search = Search(model.grammar, log_types, positions, self._random)
        self._known: dict[int, np.ndarray] = {}
        """Features of pieces, by number."""

    def decide(self, board: Mapping[int, Body]) -> Action | Stop:
        """Return a cut of the best parse tree that is found; after a refusal too, with planes drawn anew."""
        new_numbers = [number for number in board if number not in self._known]
        if new_numbers:
            self._known |= dict(zip(new_numbers, self._model.features.of([board[n] for n in new_numbers]), strict=True))
        numbers = list(board)
        tree = self._search.best(np.exp(self._model.log_types(np.array([self._known[n] for n in numbers]))))
        cuts = [(leaf, tree.rules[leaf]) for leaf in range(len(numbers)) if leaf in tree.rules]
        if not cuts:
            message = "no production of the grammar cuts any of the fragments"
            return Stop(Failure(kind="no_production", message=message))
        leaf, rule = cuts[int(self._random.integers(len(cuts)))]
        piece = numbers[leaf]
        values = self._model.planes.draw(self._model.given(rule, self._known[piece]), self._random)
        production = self._model.grammar.productions[rule]
        return Action(
            piece,
            plane_out(board[piece], values),
            f"type {production.left} into {production.right}, {production.chance:.2f}",
        )

    def done(self, action: Action, results: Mapping[int, Body], above: frozenset[int]) -> None:
        """Nothing is carried over: the next tree is inferred from what is there."""

    def refused(self, action: Action, failure: Failure) -> None:
        """Nothing is carried over."""
