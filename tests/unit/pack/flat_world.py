"""A flat stand-in for the packing environment: rectangles that may not overlap, a basket, an arm with a reach."""

from __future__ import annotations

import math
from collections.abc import Sequence

from scenewright.schemas.plan import Failure
from scenewright.stages.pack.records import Action, Attempt, BoxState, Observation, Proposer, Rectangle, StepFeedback

BASKET = Rectangle("basket", (0.54, -0.105), (0.76, 0.105))
SIZES = {"red_box": (0.07, 0.07), "blue_box": (0.07, 0.07), "green_box": (0.105, 0.035), "tan_box": (0.035, 0.035)}


def observation(sizes: dict[str, tuple[float, float]] = SIZES, basket: Rectangle = BASKET) -> Observation:
    """Return boxes in a row beside the basket."""
    boxes = tuple(
        BoxState(name, width, length, 0.07, 0.39, -0.45 + 0.3 * k, 0.0, False)
        for k, (name, (width, length)) in enumerate(sizes.items())
    )
    return Observation(boxes, basket)


def tried(observed: Observation, actions: Sequence[Action], reach: float = 2.0) -> Attempt:
    """Return what becomes of a plan: names, overlap with what was placed before, reach, and who is outside."""
    sizes = {box.name: (box.width, box.length) for box in observed.boxes}
    placed: dict[str, tuple[float, float, float, float]] = {}
    feedback: list[StepFeedback] = []
    for action in actions:
        failure = None
        if action.box not in sizes:
            failure = Failure(kind="unknown_object", message="unknown", objects=(action.box,))
        elif action.name == "place":
            extent = _extent(action, *sizes[action.box])
            hit = [name for name, other in placed.items() if _overlap(extent, other)]
            if math.hypot(action.x or 0.0, action.y or 0.0) > reach:
                failure = Failure(kind="no_inverse_kinematics", message="too far", numbers={"distance": 0.1})
            elif hit:
                failure = Failure(kind="goal_in_collision", message="hit", objects=(hit[0],), numbers={"depth": 0.01})
            placed[action.box] = extent
        feedback.append(StepFeedback(action, failure))
        if failure is not None:
            return Attempt(tuple(actions), tuple(feedback))
    outside = tuple(name for name in sizes if name not in placed or not _inside(placed[name], observed.basket))
    task = Failure(kind="not_in_basket", message="outside", objects=outside) if outside else None
    return Attempt(tuple(actions), tuple(feedback), task)


def solved(attempt: Attempt) -> bool:
    """Whether a plan reached the goal."""
    return attempt.task is None and all(step.failure is None for step in attempt.feedback) and bool(attempt.actions)


def packed(proposer: Proposer, observed: Observation, cap: int = 200, reach: float = 2.0) -> list[Attempt]:
    """Return the attempts of the loop, the last of which is solved unless the cap was reached."""
    trace: list[Attempt] = []
    while len(trace) < cap and not (trace and solved(trace[-1])):
        trace.append(tried(observed, proposer.propose(observed, tuple(trace)), reach))
    return trace


def _extent(action: Action, width: float, length: float) -> tuple[float, float, float, float]:
    assert action.x is not None and action.y is not None and action.yaw is not None
    if abs(math.sin(action.yaw)) > 0.7:
        width, length = length, width
    return (action.x - width / 2, action.x + width / 2, action.y - length / 2, action.y + length / 2)


def _overlap(one: tuple[float, float, float, float], other: tuple[float, float, float, float]) -> bool:
    return one[0] < other[1] and other[0] < one[1] and one[2] < other[3] and other[2] < one[3]


def _inside(extent: tuple[float, float, float, float], basket: Rectangle, margin: float = 0.015) -> bool:
    low, high = basket.low, basket.high
    return (
        low[0] - margin <= extent[0]
        and extent[1] <= high[0] + margin
        and low[1] - margin <= extent[2]
        and extent[3] <= high[1] + margin
    )
