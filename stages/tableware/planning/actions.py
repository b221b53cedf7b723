"""Primitives as data (Srinivas 2024, equations 6.1 to 6.5). Points are world [m], angles in the table's plane [rad]:
the direction in which the jaws close."""

from __future__ import annotations

from dataclasses import dataclass
from math import atan2, cos, pi, sin

from stages.tableware.planning.rules import Rules, grasp_centre, pull_end
from stages.tableware.world.items import Item, Table, stand_height

POINT = tuple[float, float, float]
BITE = 0.005
"""How far [m] the fingertips reach below the lowest lip that they hold (ours)."""


@dataclass(frozen=True)
class Grasp:
    """u_G: lift one thing or two with their loads, and take them to the bin."""

    items: tuple[str, ...]
    p_G: POINT
    theta_G: float


@dataclass(frozen=True)
class Pull:
    """u_P: pull `item` over the table to `target`; a dish from inside, a utensil in a cage."""

    item: str
    target: str
    p_S: POINT
    theta_S: float
    p_E: POINT
    theta_E: float


@dataclass(frozen=True)
class PullGrasp:
    """u_PG."""

    u_P: Pull
    u_G: Grasp


@dataclass(frozen=True)
class Stack:
    """u_S: lift `u_G.items[0]` with its load and put it onto `onto`."""

    u_G: Grasp
    onto: str
    p_L: POINT
    theta_L: float


@dataclass(frozen=True)
class StackGrasp:
    """u_SG."""

    u_S: Stack
    u_G: Grasp


Action = Grasp | Pull | PullGrasp | Stack | StackGrasp


def _jaws_close(item: Item, angle: float) -> float:
    return item.yaw + pi / 2 if not item.is_dish else angle


def grasp(table: Table, name: str, angle: float = 0.0) -> Grasp:
    """Return the grasp of one thing with its load: a dish by the rim at `angle` [rad], perpendicular to the tangent; a
    utensil by its middle, across its axis."""
    item = table.by_name[name]
    x, y, z = item.position
    if item.is_dish:
        reach = item.measures.rim_radius - item.measures.wall / 2
        return Grasp((name,), (x + reach * cos(angle), y + reach * sin(angle), item.lip - BITE), angle)
    return Grasp((name,), (x, y, z), _jaws_close(item, angle))


def grasp_two(table: Table, first: str, second: str) -> Grasp:
    """Return the grasp of two things that stand side by side, with their loads."""
    one, other = table.by_name[first], table.by_name[second]
    x, y, angle = grasp_centre(one, other)
    z = min(one.lip, other.lip) - BITE if one.is_dish else 0.0
    return Grasp((first, second), (x, y, z), angle)


def pull(table: Table, item: str, target: str, rules: Rules) -> Pull:
    """Return the pull of a thing to another."""
    one = table.by_name[item]
    x, y, yaw = pull_end(one, table.by_name[target], rules)
    z = one.position[2] + (one.measures.wall + 0.01 if one.is_dish else 0.0)  # a finger's breadth above the floor
    angle = atan2(y - one.position[1], x - one.position[0])
    start, end = (angle, angle) if one.is_dish else (one.yaw + pi / 2, yaw + pi / 2)
    return Pull(item, target, (one.position[0], one.position[1], z), start, (x, y, z), end)


def pull_grasp(table: Table, item: str, target: str, rules: Rules) -> PullGrasp:
    """Return a pull and the grasp of both where they then should be."""
    moved = after_pull(table, pull(table, item, target, rules))
    return PullGrasp(pull(table, item, target, rules), grasp_two(moved, target, item))


def stack(table: Table, item: str, onto: str, angle: float = 0.0) -> Stack:
    """Return the stacking of a thing with its load onto the top of the pile that `onto` stands in."""
    top = top_of(table, onto)
    z = stand_height(table, table.by_name[item], top.name)
    base = top.position
    return Stack(grasp(table, item, angle), top.name, (base[0], base[1], z), _jaws_close(table.by_name[item], angle))


def stack_grasp(table: Table, item: str, onto: str) -> StackGrasp:
    """Return a stacking and the grasp of the pile."""
    put = stack(table, item, onto)
    return StackGrasp(put, grasp(after_stack(table, put), bottom_of(table, onto).name))


def top_of(table: Table, name: str) -> Item:
    """Return the highest thing of the pile that `name` stands in."""
    load = table.load(name)
    return load[-1] if load else table.by_name[name]


def bottom_of(table: Table, name: str) -> Item:
    """Return what the pile that `name` stands in has on the table."""
    item = table.by_name[name]
    while item.on is not None:
        item = table.by_name[item.on]
    return item


def after_pull(table: Table, action: Pull, error: tuple[float, float] = (0.0, 0.0)) -> Table:
    """Return the table after a pull that missed its end by `error` (x, y) [m]."""
    item = table.by_name[action.item]
    yaw = None if item.is_dish else action.theta_E - pi / 2
    return table.moved(action.item, action.p_E[0] + error[0], action.p_E[1] + error[1], yaw=yaw)


def after_stack(table: Table, action: Stack) -> Table:
    """Return the table after a stacking; tapered walls centre a dish (section 6.3)."""
    base = table.by_name[action.onto].position
    return table.moved(action.u_G.items[0], base[0], base[1], on=action.onto)


def taken(table: Table, action: Grasp) -> frozenset[str]:
    """Return the names of everything that a grasp lifts."""
    return frozenset(name for base in action.items for name in (base, *(other.name for other in table.load(base))))
