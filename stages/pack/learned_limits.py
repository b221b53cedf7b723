"""What failures teach: how far the arm reaches, how high obstacles are, what must be picked first, what not to repeat.

Read anew from the whole trace at each call, so that nothing is remembered that no feedback said.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import hypot, inf

from scenewright.stages.pack.hand import hand_blocks, place_tool_pose
from scenewright.stages.pack.hand_shape import HandShape
from scenewright.stages.pack.records import Action, Attempt, BoxState, Observation, Rectangle
from scenewright.stages.pack.solids import block_over, flat_depth

REACH_MARGIN = 0.001
"""Distance by which reach is set below what failed [m]; by eye."""
REFUSED_SIDE = 0.012
"""Half side [m] of the square of placements that are not tried again when no cause was understood."""


@dataclass
class LearnedLimits:
    """Limits that no observation shows."""

    reach: float = inf
    """Largest distance of a box's centre from the robot's axis [m]."""
    tops: dict[str, float] = field(default_factory=dict)
    """Obstacle -> height [m] that it has at least."""
    before: set[tuple[str, str]] = field(default_factory=set)
    """(first, second): the first is picked and placed before the second."""
    refused: list[tuple[str, float, float, float, float]] = field(default_factory=list)
    """(box, x, y, yaw, half side [m])."""
    wider: float = 0.0
    """Added to the gap between boxes [m]."""
    inward: float = 0.0
    """How much farther inside the basket boxes go [m]."""
    culprit: str | None = None
    """The box whose place the last failure blames, when it is not that of the failed action."""


def learn(observation: Observation, trace: Sequence[Attempt], reasons: bool) -> LearnedLimits:
    """Return what all failures of the trace say; without reasons, that a placement or a pick did not work."""
    limits = LearnedLimits()
    boxes = {box.name: box for box in observation.boxes}
    for attempt in trace:
        limits.culprit = None
        failed = attempt.feedback[-1] if attempt.feedback else None
        if failed is not None and failed.failure is not None and failed.action.box in boxes:
            action, kind = failed.action, failed.failure.kind
            if not reasons or kind in ("no_path", "joint_limit"):
                _refuse(limits, action, _placed_boxes(attempt), failed.failure.objects if reasons else (), boxes)
            elif kind == "no_inverse_kinematics" and action.name == "place":
                numbers = failed.failure.numbers
                limits.reach = min(limits.reach, hypot(numbers["nearest_x"], numbers["nearest_y"]) - REACH_MARGIN)
            elif kind == "goal_in_collision":
                _collision(limits, action, failed.failure.objects, failed.failure.numbers["depth"], observation)
        if attempt.task is not None and attempt.actions:
            limits.inward += 0.004
            for action in attempt.actions:
                if action.name == "place" and action.box in attempt.task.objects:
                    _refuse(limits, action, (), (), boxes)
    return limits


def _placed_boxes(attempt: Attempt) -> tuple[str, ...]:
    return tuple(step.action.box for step in attempt.feedback[:-1] if step.action.name == "place")


def _refuse(
    limits: LearnedLimits, action: Action, placed: tuple[str, ...], blamed: tuple[str, ...], boxes: dict[str, BoxState]
) -> None:
    """A place is not repeated; a pick waits until what blocks it, or the next box, is gone."""
    if action.name == "place" and action.x is not None and action.y is not None and action.yaw is not None:
        times_refused = sum(entry[0] == action.box for entry in limits.refused)
        limits.refused.append((action.box, action.x, action.y, action.yaw, REFUSED_SIDE * (1 + 0.5 * times_refused)))
        limits.culprit = next((name for name in blamed if name in placed), None)
        return
    waiting = [name for name in boxes if name != action.box and name not in placed]
    first = next((name for name in blamed if name in waiting), waiting[0] if waiting else None)
    if first is not None and (action.box, first) not in limits.before:
        limits.before.add((first, action.box))


def _collision(
    limits: LearnedLimits, action: Action, objects: tuple[str, ...], depth: float, observation: Observation
) -> None:
    boxes = {box.name: box for box in observation.boxes}
    obstacles = {obstacle.name: obstacle for obstacle in observation.obstacles}
    offender = objects[0]
    by_hand = "hand" in objects[1:]
    if action.name == "pick":
        if offender in boxes:
            limits.before.add((offender, action.box))
        return
    if by_hand and offender in obstacles:
        bottom = _lowest_part_over(boxes[action.box], action, obstacles[offender], observation.hand)
        if bottom is not None and bottom + 1e-6 > limits.tops.get(offender, 0.0):
            limits.tops[offender] = bottom + 1e-6
            return
    if not by_hand and limits.wider < 0.004:
        limits.wider += min(depth + 0.0005, 0.002)
    _refuse(limits, action, (), (), boxes)
    limits.culprit = offender if offender in boxes else None


def _lowest_part_over(box: BoxState, action: Action, obstacle: Rectangle, hand: HandShape) -> float | None:
    """Return the lowest bottom [m] of the parts of the hand over an obstacle: it is higher than that."""
    under = block_over(obstacle.low, obstacle.high, 0.0, 0.0)
    pose = place_tool_pose(box, action.x or 0.0, action.y or 0.0, action.yaw or 0.0)
    bottoms = [part.bottom for part in hand_blocks(pose, hand) if flat_depth(part, under) > 0]
    return min(bottoms, default=None)
