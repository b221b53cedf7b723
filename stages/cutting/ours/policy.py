"""Our policy: share the wanted fragments among the pieces, foresee trees, cut the middle of the best, look again."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scenewright.schemas.plan import Failure
from scenewright.stages.cutting.ours.allocation import allocate
from scenewright.stages.cutting.ours.cells import Cloud, Split, cloud_of, leaves
from scenewright.stages.cutting.ours.grammar import Grammar
from scenewright.stages.cutting.ours.items import Item
from scenewright.stages.cutting.ours.structures import Foreseen, best_trees
from scenewright.stages.cutting.policy import Action, Stop
from scenewright.stages.cutting.world.body import Body, Plane
from scenewright.stages.cutting.world.knife import Knife, face_edges

DOUBT = 0.02
"""Share of what is there that a goal may ask for beyond it, or leave over without that being a fragment of its own; by
eye."""
TILT, ASIDE = 0.12, 0.12
"""Angle [rad] and distance, as a share of a part's thickness, by which one cut through several pieces may miss the
planes that each would get alone: about what the scripted cutter misses."""


@dataclass(frozen=True)
class _Planned:
    """A cut, and which items the pieces below and above the plane are to become."""

    action: Action
    below: tuple[Item, ...]
    above: tuple[Item, ...]
    thickness: float
    """Of the parts that the tree makes along the plane's normal, their mean [m]."""


class OursPolicy:
    """Plans for items that are wanted. `doubt` is by which share volumes may be off; with `together` one cut passes
    through all pieces that would be cut nearly there anyway, as far as the blade reaches."""

    def __init__(
        self,
        grammar: Grammar,
        items: Sequence[Item],
        knife: Knife | None = None,
        *,
        doubt: float = DOUBT,
        together: bool = False,
    ) -> None:
        self._grammar, self._items, self._knife = grammar, list(items), knife or Knife()
        self._doubt, self._together = doubt, together
        self._jobs: dict[int, list[Item]] | None = None
        self._plans: dict[int, list[_Planned]] = {}
        """Of pieces that are still to be cut: what may come next, best first."""

    def decide(self, board: Mapping[int, Body]) -> Action | Stop:
        """Return the next cut: of the largest piece that is still to become several fragments."""
        if self._jobs is None:
            failure = self._impossible(board)
            if failure is not None:
                return Stop(failure)
            clouds = [cloud_of(body) for body in board.values()]
            shared = allocate(clouds, self._with_rest(board), self._grammar)
            self._jobs = dict(zip(board, shared, strict=True))
        waiting = [number for number, items in self._jobs.items() if len(items) > 1]
        if not waiting:
            return Stop()
        waiting.sort(key=lambda number: -board[number].volume)
        for number in waiting if self._together else waiting[:1]:
            if number not in self._plans:
                cloud = cloud_of(board[number])
                self._plans[number] = _cuts(number, cloud, best_trees(cloud, self._jobs[number], self._grammar))
        action = self._plans[waiting[0]][0].action
        return replace(action, also=self._beside(action, waiting[1:], board)) if self._together else action

    def _beside(self, action: Action, others: Sequence[int], board: Mapping[int, Body]) -> tuple[int, ...]:
        """Return the pieces through whose own planes a cut goes as well, as far as the blade reaches."""
        chosen, face = [], board[action.piece].section(action.plane)
        for number in others:
            planned = self._plans[number][0]
            planned_plane, center = planned.action.plane, board[number].moments[0]
            cosine = float(action.plane.normal @ planned_plane.normal)
            on_planned_plane = center - planned_plane.height(center) * planned_plane.normal
            if abs(cosine) < np.cos(TILT) or abs(action.plane.height(on_planned_plane)) > ASIDE * planned.thickness:
                continue
            both_faces = np.concatenate([face, board[number].section(action.plane)])
            if face_edges(both_faces)[0] > self._knife.length:
                continue
            chosen.append(number)
            face = both_faces
            if cosine < 0:
                self._plans[number][0] = replace(planned, below=planned.above, above=planned.below)
        return tuple(chosen)

    def done(self, action: Action, results: Mapping[int, Body], above: frozenset[int]) -> None:
        """Hand the items on: to the larger piece on each side of the plane."""
        assert self._jobs is not None
        planned = self._plans.pop(action.piece)[0]
        del self._jobs[action.piece]
        sides: dict[bool, list[int]] = {False: [], True: []}
        for number in results:
            sides[number in above].append(number)
            self._jobs[number] = []
        for side, items in ((False, planned.below), (True, planned.above)):
            if sides[side]:
                self._jobs[max(sides[side], key=lambda number: results[number].volume)] = list(items)

    def refused(self, action: Action, failure: Failure) -> None:
        """Try the next best; where none is left, leave the piece."""
        assert self._jobs is not None
        del self._plans[action.piece][0]
        if not self._plans[action.piece]:
            self._jobs[action.piece] = self._jobs[action.piece][:1]

    def _impossible(self, board: Mapping[int, Body]) -> Failure | None:
        board_volume, goal_volume = (
            sum(body.volume for body in board.values()),
            sum(item.volume for item in self._items),
        )
        thinnest = min(item.edges[0] for item in self._items)
        if goal_volume > (1.0 + self._doubt) * board_volume:
            return Failure(
                kind="too_much_volume",
                message=f"the goal holds {1e6 * goal_volume:.1f} cm3, there are {1e6 * board_volume:.1f} cm3",
                numbers={"asked": goal_volume, "there": board_volume},
            )
        if len(self._items) < len(board):
            return Failure(
                kind="too_few_fragments",
                message=f"{len(board)} pieces lie there, the goal has {len(self._items)} fragments: cuts make more",
                numbers={"there": len(board), "asked": len(self._items)},
            )
        if thinnest < self._knife.thinnest:
            return Failure(
                kind="too_thin",
                message=f"a wanted fragment is {1e3 * thinnest:.2f} mm thin, the thinnest that can be cut is "
                f"{1e3 * self._knife.thinnest:.1f} mm",
                numbers={"asked": thinnest, "thinnest": self._knife.thinnest},
            )
        return None

    def _with_rest(self, board: Mapping[int, Body]) -> list[Item]:
        """Return the items, with what is left over as one more, of any shape; where that is within the doubt, the
        items' volumes, made to add up to what is there."""
        board_volume, goal_volume = (
            sum(body.volume for body in board.values()),
            sum(item.volume for item in self._items),
        )
        if board_volume - goal_volume < self._doubt * board_volume:
            return [replace(item, volume=item.volume * board_volume / goal_volume) for item in self._items]
        return [*self._items, Item(len(self._items), (np.nan, np.nan, np.nan), board_volume - goal_volume)]


def _cuts(piece: int, cloud: Cloud, trees: Sequence[Foreseen]) -> list[_Planned]:
    """Return the middle cut of each tree, best tree first."""
    ahead = trees[1].bits - trees[0].bits if len(trees) > 1 else 0.0
    return [_middle_cut(piece, cloud, tree, ahead) for tree in trees]


def _middle_cut(piece: int, cloud: Cloud, foreseen: Foreseen, ahead: float) -> _Planned:
    tree = foreseen.tree
    assert isinstance(tree, Split)
    half = len(tree.parts) // 2
    count = sum(leaves(part) for part in tree.parts[:half])
    below, above = foreseen.items[:count], foreseen.items[count:]
    share = sum(item.volume for item in below) / sum(item.volume for item in foreseen.items)
    normal = np.eye(3)[tree.axis]
    cut_position = float(np.quantile(cloud.points[:, tree.axis], share))
    plane = Plane(normal, -cut_position).moved(cloud.frame)
    reason = (
        f"{len(foreseen.items)} fragments: {len(below)} below, {len(above)} above, {ahead:.0f} bits ahead of the next"
    )
    thickness = float(np.ptp(cloud.points[:, tree.axis])) / len(tree.parts)
    return _Planned(Action(piece, plane, reason, foreseen.likeness), below, above, thickness)
