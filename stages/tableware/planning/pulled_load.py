"""What a pulled dish may carry: the fingers must find room beside the load, and the pile must not tip over.

The hand meets a pile at its own speed. Met above its centre of mass the pile begins to lean forward, like a rocking
block (Housner 1963, planar), while friction under its foot and the hand that goes on pushing lever it further: it tips
when the lever that its foot leaves is shorter than what the lean needs. Utensils ride along; they slide off when two
dishes are lifted, not before (`Chances.spills`).
"""

from __future__ import annotations

from functools import lru_cache
from math import cos, pi, sin, sqrt
from typing import Literal

import numpy as np
from scenewright.stages.tableware.simulation.push_place import PULL_SPEED, Push, push_place
from scenewright.stages.tableware.world.items import DishSizes, Kind, Measures, Table, make_item, stand_height
from scenewright.stages.tableware.world.setting import Setting

FRICTION = 0.5
"""Coefficient of friction between a foot and a table that is reckoned with: plastic and china on wood have 0.2 to 0.5;
on cloth it may be more."""
GRAVITY = 9.81
"""Acceleration of gravity [m/s^2]."""
HEADINGS = 8
"""Directions of a pull that are tried: fingers that go in beside a utensil do not in every one."""

NotPulled = Literal["no_room", "tips"]


@lru_cache(maxsize=4096)
def why_not_pulled(kinds: tuple[Kind, ...], setting: Setting) -> NotPulled | None:
    """Return why a dish with its load (kinds, lower first) cannot be pulled; None where it can."""
    pile = _pile(kinds, setting.sizes)
    turns = (2.0 * pi * number / HEADINGS for number in range(HEADINGS))
    pushes = [push_place(pile, "0", np.array([cos(turn), sin(turn)]), setting.gripper) for turn in turns]
    known_pushes = [push for push in pushes if push is not None]
    if len(known_pushes) < len(pushes):
        return "no_room"
    return "tips" if _tips(pile, known_pushes) else None


def _tips(pile: Table, pushes: list[Push]) -> bool:
    """Whether a pile rocks over the edge of its foot. The lever that is left there, radius of the foot less friction
    times height of the push, must be longer than the lean asks for: with it as barrier, g lever^2 / (2 centre), against
    the energy with which the hand's speed makes the pile turn."""
    lowest, top = pile.items[0].measures, max(item.lip for item in pile.items)
    high, centre = max(push.tip for push in pushes), centre_height(pile)
    above = max(0.0, high - centre)
    gyration = ((lowest.foot_radius + lowest.rim_radius) / 2) ** 2 / 2 + top**2 / 12  # squared, as of a thin tube
    spin = PULL_SPEED * above / (gyration + above**2)
    lean = spin * sqrt(centre * (gyration + lowest.foot_radius**2 + centre**2) / GRAVITY)
    return FRICTION * high + lean > lowest.foot_radius


def _pile(kinds: tuple[Kind, ...], sizes: DishSizes) -> Table:
    """Return the things standing on one another, called by their numbers from below."""
    table = Table(())
    for number, kind in enumerate(kinds):
        below = str(number - 1) if number else None
        item = make_item(str(number), kind, 0.0, 0.0, sizes=sizes, on=below)
        height = stand_height(table, item, below) if below is not None else 0.0
        table = Table((*table.items, make_item(str(number), kind, 0.0, 0.0, z=height, sizes=sizes, on=below)))
    return table


def centre_height(pile: Table) -> float:
    """Return the height [m] of the centre of mass of a pile's dishes, all of one stuff."""
    volumes = [(item.position[2], *_volume(item.measures)) for item in pile.items if item.is_dish]
    return sum(volume * (foot + height) for foot, volume, height in volumes) / sum(volume for _, volume, _ in volumes)


def _volume(dish: Measures) -> tuple[float, float]:
    """Return volume [m^3] of a dish's wall and floor, and height [m] of its centre over the foot."""
    outer, outer_height = _frustum(dish.foot_radius, dish.rim_radius, dish.height)
    deep = dish.height - dish.wall
    hollow, hollow_height = _frustum(dish.inner_radius(dish.wall), dish.inner_radius(dish.height), deep)
    volume = outer - hollow
    return volume, (outer * outer_height - hollow * (dish.wall + hollow_height)) / volume


def _frustum(low: float, high: float, height: float) -> tuple[float, float]:
    """Return volume [m^3] of a cone's frustum, and height [m] of its centre over its lower face."""
    squares = low**2 + low * high + high**2
    return pi * height * squares / 3.0, height * (low**2 + 2.0 * low * high + 3.0 * high**2) / (4.0 * squares)
