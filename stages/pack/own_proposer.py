"""Our proposer: no language model. It solves the layout by geometry and repairs it by the causes that feedback names.

What it knows beforehand is the observation and the robot's own hand. What it does not know, it learns from failures
(learned_limits.py). After a failure it keeps as many of the placements that worked as a layout under the new limits
allows, and goes back behind the box that the cause blames.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import hypot, pi

import numpy as np
from scenewright.schemas.packing import BASKET_TOP
from scenewright.schemas.plan import Failure
from scenewright.stages.pack.hand import hand_blocks, place_tool_pose
from scenewright.stages.pack.hand_shape import HandShape
from scenewright.stages.pack.layout_search import LayoutProblem, find_layout
from scenewright.stages.pack.learned_limits import LearnedLimits, learn
from scenewright.stages.pack.records import Action, Attempt, BoxState, Observation
from scenewright.stages.pack.sampling import pick_and_place

QUARTER = pi / 2
"""Quarter turn [rad]."""
RESTARTS = (2, 2, 3, 6, 16, 16, 16)
"""Orders of boxes tried at each spacing: a roomy layout is found soon or not at all."""
SPACING = ((0.02, 0.0), (0.012, 0.0), (0.007, 0.0), (0.004, 0.0), (0.0025, 0.0), (0.0025, 0.006), (0.0015, 0.012))
"""Gap between boxes and how far they may stick out of the basket [m], the roomiest first."""


@dataclass(frozen=True)
class Spot:
    """A box's place: centre [m], 0 or 1 quarter turns."""

    box: str
    x: float
    y: float
    turn: int

    @property
    def actions(self) -> tuple[Action, Action]:
        """The two actions that bring the box there."""
        return pick_and_place(self.box, self.x, self.y, self.turn * QUARTER)


class OwnProposer:
    """Geometry and typed feedback. `reasons=False`: reads only which action failed."""

    def __init__(self, seed: int = 0, reasons: bool = True) -> None:
        self.name = "ours" if reasons else "ours_no_reasons"
        self.calls = 0
        self._seed, self._reasons = seed, reasons

    def propose(self, observation: Observation, trace: Sequence[Attempt]) -> tuple[Action, ...]:
        """Return a full plan; an empty one when no layout was found."""
        self.calls += 1
        limits = learn(observation, trace, self._reasons)
        order = execution_order(observation, limits)
        spots = solve_layout(observation, order, limits, kept_spots(trace, limits), self._seed + len(trace))
        return () if spots is None else tuple(action for spot in spots for action in spot.actions)


def placement_solver(
    observation: Observation, order: tuple[str, ...], trace: Sequence[Attempt]
) -> tuple[Action, ...] | Failure:
    """Fill x, y and yaw of a symbolic plan: the boxes in the order given, the trace read as by `OwnProposer`.

    Returns the pick/place plan, or a Failure (`no_placement`, `unknown_object`) that says why there is none.
    """
    names = {box.name for box in observation.boxes}
    unknown = tuple(name for name in order if name not in names)
    if unknown:
        return Failure(kind="unknown_object", message=f"there is no {unknown[0]}", objects=unknown)
    limits = learn(observation, trace, True)
    ordered = tuple(dict.fromkeys(order))
    spots = solve_layout(observation, ordered, limits, kept_spots(trace, limits), len(trace), reorder=False)
    if spots is None:
        return Failure(
            kind="no_placement", message="no places were found for these boxes in this order", objects=ordered
        )
    return tuple(action for spot in spots for action in spot.actions)


def execution_order(observation: Observation, limits: LearnedLimits) -> tuple[str, ...]:
    """Return the boxes, low ones first (the hand then works above what stands), as `before` allows."""
    waiting = sorted(observation.boxes, key=lambda box: box.height)
    order: list[str] = []
    while waiting:
        names = {box.name for box in waiting}
        ready = [
            box for box in waiting if not any(second == box.name and first in names for first, second in limits.before)
        ]
        box = (ready or waiting)[0]
        waiting.remove(box)
        order.append(box.name)
    return tuple(order)


def kept_spots(trace: Sequence[Attempt], limits: LearnedLimits) -> tuple[Spot, ...]:
    """Return the placements of the last attempt that worked, up to the box that the failure blames."""
    if not trace or trace[-1].task is not None:
        return ()
    spots = []
    for step in trace[-1].feedback:
        action = step.action
        if step.failure is not None or action.box == limits.culprit:
            break
        if action.name == "place" and action.x is not None and action.y is not None and action.yaw is not None:
            spots.append(Spot(action.box, action.x, action.y, round(action.yaw / QUARTER) % 2))
    return tuple(spots)


def solve_layout(
    observation: Observation,
    order: tuple[str, ...],
    limits: LearnedLimits,
    kept: tuple[Spot, ...],
    seed: int,
    *,
    reorder: bool = True,
) -> tuple[Spot, ...] | None:
    """Return a spot for each box of `order`, in the order of execution, as many as can be from `kept` first.

    `reorder`: boxes of one height may change places, the farthest first. None when no layout was found.
    """
    boxes = {box.name: box for box in observation.boxes if box.name in order}
    kept = tuple(spot for spot in kept if spot.box in boxes)
    for count in range(len(kept), -1, -1):
        fixed_spots = kept[:count]
        first = tuple(spot.box for spot in fixed_spots)
        sequence = (*first, *(name for name in order if name not in first))
        if any(sequence.index(a) > sequence.index(b) for a, b in limits.before if a in sequence and b in sequence):
            continue
        if not reorder and sequence != order:
            continue
        problem_boxes = [boxes[name] for name in sequence]
        for (gap, out), restarts in zip(SPACING, RESTARTS, strict=True):
            problem = _problem(observation, problem_boxes, limits, fixed_spots, out - limits.inward)
            random = np.random.default_rng([seed, count])
            layout = find_layout(
                problem, gap + limits.wider, random, restarts=min(restarts, 3) if fixed_spots else restarts
            )
            if layout is not None:
                spots = [
                    Spot(box.name, float(row[0]), float(row[1]), int(row[2]))
                    for box, row in zip(problem_boxes, layout, strict=True)
                ]
                return (*fixed_spots, *_far_first(spots[count:], boxes, limits, reorder))
    return None


def _far_first(spots: list[Spot], boxes: dict[str, BoxState], limits: LearnedLimits, reorder: bool) -> tuple[Spot, ...]:
    """Sort boxes of one height by distance: at the rim of its reach the hand comes in from the near side."""
    if not reorder or any(spot.box in pair for spot in spots for pair in limits.before):
        return tuple(spots)
    return tuple(sorted(spots, key=lambda spot: (boxes[spot.box].height, -hypot(spot.x, spot.y))))


def _problem(
    observation: Observation, boxes: list[BoxState], limits: LearnedLimits, held: tuple[Spot, ...], out: float
) -> LayoutProblem:
    """Return the arrays of the search; boxes are in the order of execution."""
    hand, bottoms = _hand_footprints(boxes, observation.hand)
    fixed = np.array([[*o.low, *o.high] for o in observation.obstacles]).reshape(-1, 4)
    tops = np.array([limits.tops.get(o.name, 0.0) for o in observation.obstacles])
    heights = np.array([BASKET_TOP + box.height for box in boxes])
    earlier = np.tri(len(boxes), k=-1, dtype=bool)
    low, high = observation.basket.low, observation.basket.high
    index = {box.name: number for number, box in enumerate(boxes)}
    refused = [
        (index[name], x, y, round(yaw / QUARTER) % 2, side)
        for name, x, y, yaw, side in limits.refused
        if name in index and name not in {spot.box for spot in held}
    ]
    return LayoutProblem(
        extents=np.array([[box.width, box.length] for box in boxes]),
        container=np.array([low[0] - out, low[1] - out, high[0] + out, high[1] + out]),
        fixed=fixed,
        hand=hand,
        over_fixed=tops[None, :, None] > bottoms[:, None, :],
        over_boxes=(heights[None, :, None] > bottoms[:, None, :]) & earlier[:, :, None],
        reach=limits.reach,
        refused=np.array(refused, dtype=float).reshape(-1, 5),
        preset=np.array([(number, spot.x, spot.y, spot.turn) for number, spot in enumerate(held)]).reshape(-1, 4),
    )


def _hand_footprints(boxes: list[BoxState], shape: HandShape) -> tuple[np.ndarray, np.ndarray]:
    """Return (2, K, 4) footprints about the tool at both turns, and (B, K) the world z of their bottoms [m]."""
    footprints = np.array(
        [
            [part.bounds for part in hand_blocks(place_tool_pose(boxes[0], 0.0, 0.0, turn * QUARTER), shape)]
            for turn in (0, 1)
        ]
    )
    bottoms = np.array(
        [[part.bottom for part in hand_blocks(place_tool_pose(box, 0.0, 0.0, 0.0), shape)] for box in boxes]
    )
    return footprints, bottoms
