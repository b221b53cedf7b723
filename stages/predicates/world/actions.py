"""The seven actions of the kitchen, with the ways in which each fails.

An action returns why it failed, or nothing. It fails before it moves where its rule says so (a full hand, an empty one,
no way down, no free place); whether what was done is what was wanted is for the caller to see.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scenewright.stages.kit.tasks.strips import Atom
from scenewright.stages.predicates.state import LARGEST_OPENING, TABLE_LEFT, TABLE_RIGHT
from scenewright.stages.predicates.world.kitchen import (
    FAUCET_HEIGHT,
    FINGER,
    MARGIN,
    PUSH_SPEED,
    SINK_X,
    Kitchen,
    Thing,
)

CLEARANCE = 2.0
"""Gap between things on the table [units]; by eye."""
TRIES = 5
"""Tries to find a free place on a thing; by eye."""
SAMPLES = 400
"""Places on the table that are drawn before there is said to be none; by eye."""
EPSILON = 0.1
"""Gap between what is let go and what it falls on [units]; by eye."""
FAUCET_SECONDS, FAUCET_RATE = 6.0, 0.2
"""Time that the faucet runs [s], and its drops a step on average; by eye."""
ENOUGH_DROPS = 5
"""Drops with which a container counts as filled; by eye."""
POURED_INTO = ("cup", "pot")
ARITY = {
    "pick_up": 1,
    "place_on_table": 1,
    "place_first_on_second": 2,
    "push_plate_on_object": 2,
    "place_first_in_second": 2,
    "get_water_from_faucet": 1,
    "pour_water_from_first_to_second": 2,
}
"""Action -> number of its objects."""


def pick_up(kitchen: Kitchen, a: Thing) -> str:
    """Close the fingers on the sides of `a` and lift it."""
    if kitchen.held is not None:
        return "the hand is full"
    left, bottom, right, top = a.box()
    if right - left + 2 * MARGIN > LARGEST_OPENING or a.kind.shape == "mat":
        return f"{a.name} does not fit between the fingers"
    tips = top - kitchen.grip_depth(a)
    outer = (left - FINGER - MARGIN, tips, right + FINGER + MARGIN, 100.0)
    blocking = next(
        (neighbour for neighbour in kitchen.things.values() if neighbour is not a and _touches(neighbour, outer)), None
    )
    if blocking is not None:
        return f"{blocking.name} is in the way of the fingers"
    kitchen.open_to(right - left + 2 * MARGIN)
    kitchen.travel((left + right) / 2, tips)
    kitchen.hold(a)
    kitchen.home()
    kitchen.wait(0.2)
    return ""


def place_on_table(kitchen: Kitchen, a: Thing) -> str:
    """Put `a` down on a free place of the table."""
    if kitchen.held is not a:
        return f"{a.name} is not in the hand"
    occupied = [
        (box[0], box[2]) for box in (neighbour.box() for neighbour in kitchen.things.values() if neighbour is not a)
    ]
    try:
        x = free_place(kitchen.random, a.kind.width / 2, occupied)
    except ValueError as error:
        return str(error)
    return _let_go(kitchen, a, x, 0.0)


def place_first_on_second(kitchen: Kitchen, a: Thing, b: Thing) -> str:
    """Put `a` down on top of `b`."""
    if kitchen.held is not a:
        return f"{a.name} is not in the hand"
    left, _, right, top = b.box()
    half = a.kind.width / 2
    for _ in range(TRIES):
        slack = min(0.2, abs(right - left - a.kind.width) / 4 + 0.02)
        x = (left + right) / 2 + float(kitchen.random.uniform(-slack, slack))
        region = (x - half, top + 0.01, x + half, 100.0)
        if not any(_touches(neighbour, region) for neighbour in kitchen.things.values() if neighbour not in (a, b)):
            return _let_go(kitchen, a, x, top)
    return f"no free place on {b.name} in {TRIES} tries"


def place_first_in_second(kitchen: Kitchen, a: Thing, b: Thing) -> str:
    """Let `a` fall into `b`, between its walls, as low as the fingers get above them."""
    if kitchen.held is not a:
        return f"{a.name} is not in the hand"
    left, _, right, top = b.box()
    half, wall = a.kind.width / 2, b.kind.wall if b.kind.shape == "container" else 0.0
    low, high = left + wall + half + EPSILON, right - wall - half - EPSILON
    if low > high:
        return f"{a.name} does not fit into {b.name}"
    inside = [neighbour.box() for neighbour in kitchen.things.values() if neighbour not in (a, b)]
    best, x = -1.0, (low + high) / 2
    for _ in range(TRIES):
        tried = float(kitchen.random.uniform(low, high))
        spaces = [max(box[0] - tried - half, tried - half - box[2]) for box in inside if box[3] <= top + 20]
        room = min([space for space in spaces if space > -2 * half - 6], default=10.0)
        if room > best or best < 0:
            best, x = max(room, 0.0), tried
    depth = a.kind.height - kitchen.grip_depth(a)
    return _let_go(kitchen, a, x, top - depth + EPSILON)


def get_water_from_faucet(kitchen: Kitchen, a: Thing) -> str:
    """Hold `a` under the faucet while it runs."""
    if kitchen.held is not a:
        return f"{a.name} is not in the hand"
    kitchen.travel(SINK_X, FAUCET_HEIGHT - 4.0 - kitchen.grip_depth(a))
    kitchen.run_faucet(FAUCET_SECONDS, FAUCET_RATE)
    kitchen.wait(1.5)
    kitchen.drain()
    kitchen.home()
    return ""


def pour_water_from_first_to_second(kitchen: Kitchen, a: Thing, b: Thing) -> str:
    """Turn `a` above the middle of `b` until its water has left."""
    if kitchen.held is not a:
        return f"{a.name} is not in the hand"
    if kitchen.drops_in(a) < ENOUGH_DROPS:
        return f"there is too little water in {a.name}"
    if b.kind.category not in POURED_INTO:
        return f"nothing is poured into a {b.kind.category}"
    left, _, right, top = b.box()
    x, side = (left + right) / 2, 1
    lip = (x - 0.6 * side, top + 1.0)
    half = a.kind.width / 2
    kitchen.travel(lip[0] - side * half, lip[1] + a.kind.height - kitchen.grip_depth(a))
    kitchen.pour_over(*lip, side)
    kitchen.wait(1.0)
    kitchen.drain()
    kitchen.home()
    return ""


def push_plate_on_object(kitchen: Kitchen, a: Thing, b: Thing) -> str:
    """Push `a` along the table with closed fingers until its middle is above that of `b`."""
    if kitchen.held is not None:
        return "the hand is full"
    if a.kind.shape == "mat":
        return f"{a.name} does not move"
    left, bottom, right, _ = a.box()
    target = (b.box()[0] + b.box()[2]) / 2
    side = 1 if (left + right) / 2 < target else -1
    start = left - FINGER - EPSILON if side > 0 else right + FINGER + EPSILON
    height = bottom + b.kind.height + EPSILON
    region = (start - FINGER, height, start + FINGER, 100.0)
    blocking = next(
        (neighbour for neighbour in kitchen.things.values() if neighbour is not a and _touches(neighbour, region)), None
    )
    if blocking is not None:
        return f"{blocking.name} is in the way of the fingers"
    kitchen.open_to(0.0)
    kitchen.travel(start, height)
    kitchen.move(target - side * (a.kind.width / 2 + FINGER), height, PUSH_SPEED)
    kitchen.wait(0.3)
    kitchen.move(kitchen.x - side * 0.5, height)
    kitchen.home()
    kitchen.wait(0.5)
    kitchen.open_to(LARGEST_OPENING)
    return ""


ACTIONS: dict[str, Callable[..., str]] = {
    "pick_up": pick_up,
    "place_on_table": place_on_table,
    "place_first_on_second": place_first_on_second,
    "push_plate_on_object": push_plate_on_object,
    "place_first_in_second": place_first_in_second,
    "get_water_from_faucet": get_water_from_faucet,
    "pour_water_from_first_to_second": pour_water_from_first_to_second,
}


def act(kitchen: Kitchen, action: Atom) -> str:
    """Do an action, (name, object, ...). Returns why it failed, or nothing."""
    return ACTIONS[action[0]](kitchen, *(kitchen.things[name] for name in action[1:]))


def _let_go(kitchen: Kitchen, a: Thing, x: float, height: float) -> str:
    tips = height + EPSILON + a.kind.height - kitchen.grip_depth(a)
    kitchen.travel(x, tips)
    kitchen.release()
    return ""


def _touches(thing: Thing, region: tuple[float, float, float, float]) -> bool:
    left, bottom, right, top = region
    for shape in thing.shapes:
        box = shape.cache_bb()
        if box.left < right and left < box.right and box.bottom < top and bottom < box.top:
            return True
    return False


def free_place(random: np.random.Generator, half: float, taken: list[tuple[float, float]]) -> float:
    """Return the middle of a free stretch of the table, `half` to either side, CLEARANCE from what is taken (left,
    right). Raises ValueError when none is found."""
    for _ in range(SAMPLES):
        x = float(random.uniform(TABLE_LEFT + half + 1, TABLE_RIGHT - half - 1))
        if all(x + half + CLEARANCE <= left or x - half - CLEARANCE >= right for left, right in taken):
            return x
    raise ValueError("the objects don't fit on the table")
