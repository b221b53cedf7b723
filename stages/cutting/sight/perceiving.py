"""A policy that knows of the pieces what two depth cameras see, and the hand that lays them down for it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.optimize import linear_sum_assignment

from schemas.plan import Failure
from stages.cutting.board import LIFT, Board
from stages.cutting.ours.grammar import Grammar
from stages.cutting.ours.items import Item
from stages.cutting.ours.policy import OursPolicy
from stages.cutting.policy import Action, Stop
from stages.cutting.sight.seeing import see
from stages.cutting.sight.views import look
from stages.cutting.world.body import Body
from stages.cutting.world.canonical import canonical
from stages.kit.geometry.transforms import transform_from

BETWEEN = 0.05
"""Gap between pieces that are laid down beside each other [m]."""
DOUBT = 0.15
"""By which share of volume what is seen may be off: more than that which is wanted and that which is there differ by
where nothing is left over."""


class Hand:
    """Lays new pieces flat on the free middle of a board, longest edge across the row, and lets them come to rest.
    What has lain there is put away as it is."""

    def __init__(self) -> None:
        self._known: set[int] = set()
        self._board = Board()

    def close(self) -> None:
        """Let go of the board."""
        self._board.close()

    def lay(self, board: dict[int, Body]) -> None:
        """Lay down the pieces that were not there before, in place."""
        new = [number for number in board if number not in self._known]
        self._known |= set(new)
        laid = {number: _flat(board[number]) for number in new}
        widths = [float(np.ptp(body.vertices[:, 0])) for body in laid.values()]
        ends = np.cumsum([0.0] + [width + BETWEEN for width in widths])
        for number, start in zip(new, ends[:-1] - 0.5 * (ends[-1] - BETWEEN), strict=True):
            laid[number] = laid[number].shifted(np.array([start - laid[number].vertices[:, 0].min(), 0.0, 0.0]))
        self._board.rest(laid)
        for number, body in laid.items():  # physics keeps a margin under hulls
            board[number] = body.shifted(np.array([0.0, 0.0, -body.extent_along(np.array([0.0, 0.0, 1.0]))[0]]))


def _flat(body: Body) -> Body:
    """Return a body with its shortest axis up and its longest along y, just over the board's middle."""
    axes = canonical(body).world_from_fragment[:3, :3]
    turned = body.moved(transform_from(axes[:, [1, 2, 0]].T, np.zeros(3)))
    low, high = turned.vertices.min(axis=0), turned.vertices.max(axis=0)
    return turned.shifted(np.array([0.0, -0.5 * (low[1] + high[1]), LIFT - low[2]]))


class PerceivingPolicy:
    """Ours, on bodies as they were seen when they were laid down."""

    def __init__(self, grammar: Grammar, items: Sequence[Item], seed: int) -> None:
        self._ours = OursPolicy(grammar, items, doubt=DOUBT)
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
        there = {number: self._seen[number] for number in board if number in self._seen}
        return self._ours.decide(there)

    def done(self, action: Action, results: Mapping[int, Body], above: frozenset[int]) -> None:
        """Look at what came of a cut."""
        self._look(results)
        seen = {number: self._seen[number] for number in results if number in self._seen}
        self._ours.done(action, seen, above)

    def refused(self, action: Action, failure: Failure) -> None:
        """Hear why the knife did not cut."""
        self._ours.refused(action, failure)

    def _look(self, bodies: Mapping[int, Body]) -> None:
        """See bodies; which is which is known by where each was laid down."""
        found = see(look(list(bodies.values()), self._random))
        numbers = list(bodies)
        if found:
            places = np.array([body.moments[0] for body in bodies.values()])
            off = np.linalg.norm(places[:, None] - np.array([body.moments[0] for body in found])[None], axis=2)
            for row, column in zip(*linear_sum_assignment(off), strict=True):
                if off[row, column] < BETWEEN:
                    self._seen[numbers[row]] = found[column]
        self.missed += sum(number not in self._seen for number in numbers)
