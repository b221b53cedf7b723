"""What plans cuts, one at a time, and the loop that carries them out."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np
from scenewright.schemas.plan import Failure
from scenewright.stages.cutting.world.body import Body, Plane
from scenewright.stages.cutting.world.knife import Knife, Refused, cut

MOST_REFUSALS = 20
"""One after the other, after which nothing more is tried."""
GAP = 0.005
"""Distance by which fragments are pushed apart [m]; by eye."""


@dataclass(frozen=True)
class Goal:
    """Fragments that are wanted, as they lie."""

    fragments: tuple[Body, ...]


@dataclass(frozen=True)
class Action:
    """A plane through one piece, in the world frame."""

    piece: int
    plane: Plane
    said: str = ""
    """What it is for, and how sure the policy is."""
    likeness: float | None = None
    """About the overlap that fragments are expected to reach with what is wanted."""
    also: tuple[int, ...] = ()
    """Further pieces that the same stroke passes through where they lie."""


@dataclass(frozen=True)
class Stop:
    """Nothing more is cut: done, or why not."""

    failure: Failure | None = None


class Policy(Protocol):
    """Decides cuts for one goal. Pieces keep their numbers; results of a cut get new ones."""

    def decide(self, board: Mapping[int, Body]) -> Action | Stop:
        """Return the next cut of what lies on the board."""
        ...

    def done(self, action: Action, results: Mapping[int, Body], above: frozenset[int]) -> None:
        """Hear what came of a cut, where it lies now, and which of it was on the side of the plane's normal."""
        ...

    def refused(self, action: Action, failure: Failure) -> None:
        """Hear why the knife did not cut."""
        ...


@dataclass(frozen=True)
class Step:
    """A cut that was made, with the numbers of what came of it."""

    action: Action
    results: tuple[int, ...]
    stroke: int = 0


@dataclass
class Carving:
    """What came of a policy."""

    board: dict[int, Body]
    """What lies there in the end, by number."""
    pieces: dict[int, Body]
    """Everything that ever lay there."""
    steps: list[Step] = field(default_factory=list)
    refusals: list[Failure] = field(default_factory=list)
    stopped: Failure | None = None
    strokes: int = 0
    """Times that the knife went down; one stroke may cut several pieces."""
    seconds: float = 0.0
    """CPU time of the policy."""

    @property
    def fragments(self) -> list[Body]:
        """What lies there in the end."""
        return list(self.board.values())


def carry_out(
    policy: Policy,
    objects: Sequence[Body],
    *,
    most: int,
    knife: Knife | None = None,
    lie: Callable[[dict[int, Body]], None] | None = None,
) -> Carving:
    """Cut until the policy stops or `most` fragments lie there, deciding each cut from what is there.

    `lie` lets the fragments come to rest, in place; without it they are pushed apart along the plane's normal.
    """
    knife = knife or Knife()
    board = dict(enumerate(objects))
    carving = Carving(board, dict(board))
    in_a_row = 0
    while len(board) < most:
        began = time.process_time()
        action = policy.decide(board)
        carving.seconds += time.process_time() - began
        if isinstance(action, Stop):
            carving.stopped = action.failure
            break
        before = len(carving.steps)
        for piece in (action.piece, *action.also):
            _make(replace(action, piece=piece, also=()), policy, carving, knife, lie)
        in_a_row = 0 if len(carving.steps) > before else in_a_row + 1
        carving.strokes += len(carving.steps) > before
        if in_a_row == MOST_REFUSALS:
            carving.stopped = carving.refusals[-1]
            break
    return carving


def _make(
    action: Action, policy: Policy, carving: Carving, knife: Knife, lie: Callable[[dict[int, Body]], None] | None
) -> None:
    """Cut one piece, and tell the policy what came of it."""
    board = carving.board
    try:
        bodies = cut(board[action.piece], action.plane, knife)
    except Refused as refused:
        carving.refusals.append(refused.failure)
        policy.refused(action, refused.failure)
        return
    del board[action.piece]
    first = len(carving.pieces)
    sides = action.plane.height(np.array([body.moments[0] for body in bodies])) > 0
    for number, (body, up) in enumerate(zip(bodies, sides, strict=True), start=first):
        board[number] = body.shifted((0.5 if up else -0.5) * GAP * action.plane.normal)
    if lie is not None:
        lie(board)
    results = {number: board[number] for number in range(first, first + len(bodies))}
    carving.pieces |= results
    carving.steps.append(Step(action, tuple(results), carving.strokes))
    policy.done(action, results, frozenset(n for n, up in zip(results, sides, strict=True) if up))
