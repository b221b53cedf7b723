"""Our policy: share the wanted fragments among the pieces, foresee trees, cut the middle of the best, look again."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scenewright.schemas.plan import Failure
from scenewright.stages.cutting.ours.allocation import allocate
from scenewright.stages.cutting.ours.cells import Cloud, Split, Tree, cloud_of, leaves
from scenewright.stages.cutting.ours.grammar import Grammar
from scenewright.stages.cutting.ours.imagining import Wish
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
class _Job:
    """What a piece is still to become. `tree`: how, where words say that, along the directions of the first thing."""

    items: tuple[Item, ...] = ()
    tree: Tree = None
    first_from_axes: np.ndarray | None = None


@dataclass(frozen=True)
class _Planned:
    """A cut, and what the pieces below and above the plane are to become."""

    action: Action
    below: _Job
    above: _Job
    thickness: float
    """Of the parts that the tree makes along the plane's normal, their mean [m]."""


class OursPolicy:
    """Plans for items that are wanted, or for words as they are laid out. `doubt` is by which share volumes may be off;
    with `together` one cut passes through all pieces that would be cut nearly there anyway, as far as the blade
    reaches."""

    def __init__(
        self,
        grammar: Grammar,
        wanted: Sequence[Item] | Wish,
        knife: Knife | None = None,
        *,
        doubt: float = DOUBT,
        together: bool = False,
    ) -> None:
        self._wish = wanted if isinstance(wanted, Wish) else None
        self._items = wanted.items if isinstance(wanted, Wish) else list(wanted)
        self._grammar, self._knife = grammar, knife or Knife()
        self._doubt, self._together = doubt, together
        self._jobs: dict[int, _Job] | None = None
        self._plans: dict[int, list[_Planned]] = {}
        """Of pieces that are still to be cut: what may come next, best first."""

    def decide(self, board: Mapping[int, Body]) -> Action | Stop:
        """Return the next cut: of the largest piece that is still to become several fragments."""
        if self._jobs is None:
            failure = self._impossible(board)
            if failure is not None:
                return Stop(failure)
            self._jobs = dict(zip(board, self._first_jobs(board), strict=True))
        waiting = [number for number, job in self._jobs.items() if len(job.items) > 1]
        if not waiting:
            return Stop()
        waiting.sort(key=lambda number: -board[number].volume)
        for number in waiting if self._together else waiting[:1]:
            if number not in self._plans:
                self._plans[number] = self._cuts(number, board[number], self._jobs[number])
        action = self._plans[waiting[0]][0].action
        return replace(action, also=self._beside(action, waiting[1:], board)) if self._together else action

    def _first_jobs(self, board: Mapping[int, Body]) -> list[_Job]:
        if self._wish is not None:
            return [_Job(laid.items, laid.tree, laid.thing.first_from_axes) for laid in self._wish.laid]
        clouds = [cloud_of(body) for body in board.values()]
        return [_Job(tuple(items)) for items in allocate(clouds, self._with_rest(board), self._grammar)]

    def _cuts(self, piece: int, body: Body, job: _Job) -> list[_Planned]:
        """Return what may come next, best first."""
        if job.first_from_axes is not None:
            return [_cut_of_words(piece, cloud_of(body, body.world_from_first @ job.first_from_axes), job)]
        cloud = cloud_of(body)
        trees = best_trees(cloud, job.items, self._grammar)
        ahead = trees[1].bits - trees[0].bits if len(trees) > 1 else 0.0
        return [_middle_cut(piece, cloud, tree, ahead) for tree in trees]

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
            self._jobs[number] = _Job()
        for side, job in ((False, planned.below), (True, planned.above)):
            if sides[side]:
                self._jobs[max(sides[side], key=lambda number: results[number].volume)] = job

    def refused(self, action: Action, failure: Failure) -> None:
        """Try the next best; where none is left, leave the piece."""
        assert self._jobs is not None
        del self._plans[action.piece][0]
        if not self._plans[action.piece]:
            self._jobs[action.piece] = _Job(self._jobs[action.piece].items[:1])

    def _impossible(self, board: Mapping[int, Body]) -> Failure | None:
        board_volume, goal_volume = (
            sum(body.volume for body in board.values()),
            sum(item.volume for item in self._items),
        )
        thinnest = min(item.edges[0] for item in self._items) if self._wish is None else self._wish.thinnest
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
                f"{1e3 * self._knife.thinnest:.1f} mm: ask for fewer",
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
    return _Planned(Action(piece, plane, reason, foreseen.likeness), _Job(below), _Job(above), thickness)


def _cut_of_words(piece: int, cloud: Cloud, job: _Job) -> _Planned:
    """Return the middle cut of a tree: slabs by thickness of what there is, everything else by volume."""
    tree = job.tree
    assert isinstance(tree, Split)
    half = len(tree.parts) // 2
    share = sum(tree.weights[:half]) / sum(tree.weights)
    normal = cloud.frame[:3, tree.axis]
    if tree.slabs:
        low, high = cloud.body.extent_along(normal)
        plane = Plane(normal, -(low + share * (high - low)))
    else:
        at = float(np.quantile(cloud.points[:, tree.axis], share))
        plane = Plane.through(cloud.frame[:3, 3] + at * normal, normal)
    sides = []
    first = 0
    for parts in (slice(None, half), slice(half, None)):
        below = tree.parts[parts]
        part = replace(tree, parts=below, weights=tree.weights[parts]) if len(below) > 1 else below[0]
        sides.append(_Job(job.items[first : first + leaves(part)], part, job.first_from_axes))
        first += leaves(part)
    reason = f"{len(job.items)} fragments: {len(sides[0].items)} below, {len(sides[1].items)} above"
    thickness = float(np.ptp(cloud.points[:, tree.axis])) / len(tree.parts)
    return _Planned(Action(piece, plane, reason), sides[0], sides[1], thickness)
