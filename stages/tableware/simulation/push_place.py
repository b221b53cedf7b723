"""Where the hand goes into a dish to pull it, beside what the dish carries."""

from __future__ import annotations

from dataclasses import dataclass
from math import atan2, pi

import numpy as np
from scenewright.stages.tableware.simulation.holds import HAND, PAD, cargo, jaw_clearance, tool_pose, walls
from scenewright.stages.tableware.world.items import Table
from scenewright.stages.tableware.world.setting import Gripper

SPREAD = 0.72
"""Share of a dish's inner radius to which the fingers open when they pull it from inside."""
HIGH = 0.025
"""Height of the fingertips over the floor of an empty dish [m]; by eye."""
HEIGHTS = (0.02, 0.03, 0.04)
"""Heights of the fingertips over the floor of a dish that carries something [m], the best first."""
PULL_SPEED = 0.15
"""Speed of the hand [m/s]; by eye."""
CLEAR = 0.002
"""What the fingers keep from a load [m]."""


@dataclass(frozen=True)
class Push:
    """Where fingers push a dish from inside, from its middle along the pull [m]."""

    start: float
    reach: float
    tip: float
    closing: float
    opening: float
    spread: bool = False
    """Whether the fingers go down closed and open inside."""


def push_place(seen: Table, name: str, direction: np.ndarray, hand: Gripper = HAND) -> Push | None:
    """Return where the fingers go into the top of a pile that is pulled along `direction` (2,), or None where its load
    leaves no room. In an empty dish they open across the pull, so that both push the wall ahead and the dish comes to
    lie right behind them; beside a load they go in closed near the wall, or astride of a utensil."""
    family = walls(seen, name)
    dish, load = family[-1], cargo(seen, name)
    angle = atan2(direction[1], direction[0])
    if not load:
        inner = dish.measures.inner_radius(dish.measures.wall + HIGH)
        aside = min(hand.opening / 2 + PAD, SPREAD * inner)
        ahead = float(np.sqrt(inner**2 - aside**2)) - hand.finger
        tip = dish.position[2] + dish.measures.wall + HIGH
        return Push(0.0, ahead, tip, angle + pi / 2, 2.0 * (aside - PAD), True)
    center = np.array(dish.position[:2])
    for least in HEIGHTS:
        height = max(least, dish.measures.height - hand.jaw_height + 0.002)
        tip = dish.position[2] + dish.measures.wall + height
        inner = dish.measures.inner_radius(dish.measures.wall + height)
        shapes = [(angle, 0.0, PAD, hand.finger), (angle + pi / 2, 0.036, hand.finger, 0.018 + PAD)]
        for closing, opening, ahead, aside in shapes:
            if aside >= inner - 0.004:
                continue
            reach = float(np.sqrt(inner**2 - aside**2)) - ahead
            if reach < 0.003:
                continue
            for start in (reach * 0.5, reach - 0.006, reach - 0.003):
                point = np.append(center + start * direction, tip)
                clearance = jaw_clearance(tool_pose(point, closing), opening, [], load, hand)
                if clearance > CLEAR:
                    return Push(start, reach, tip, closing, opening)
    return None
