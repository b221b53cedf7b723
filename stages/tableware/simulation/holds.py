"""Where the hand goes to hold things: tool poses, openings, and whether open jaws fit between what stands around.

A dish is pinched by the wall. The hand leans by the wall's slant, so that the flat pads lie flat on it, and reaches as
far below the lowest lip as the palm and what stands beneath allow. Of the points of a rim the one nearest to the wanted
angle is taken at which the open jaws touch nothing.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import atan2, cos, pi, sin

import numpy as np
from scenewright.stages.tableware.simulation.pieces import solid
from scenewright.stages.tableware.world.footprints import Footprint, footprint, gap
from scenewright.stages.tableware.world.items import Item, Table
from scenewright.stages.tableware.world.setting import Gripper

JAW_HEIGHT, PAD, PAD_WIDTH, KNUCKLE = 0.045, 0.007, 0.022, 0.014
"""Height of the fingertips, their thickness and width, thickness of the knuckles above them [m]; see ur5.urdf."""
DEPTH = 0.020
"""How far the pads reach below the lowest lip where they can [m]."""
PAIR_DEPTHS, PAIR_ROOMS, PAIR_FREE = (0.030, 0.022, 0.014), (0.007, 0.004), 0.001
"""For two dishes that are pressed together: how far the pads reach below the lowest lip, how far open ones keep from
the walls, the best first, and what they keep from all else there [m]; by eye."""
FLAT_DEPTH, MOST_LEAN = 0.008, 0.5
"""The first for a plate, whose rim is nearer to the table; the most that the hand leans [rad]: plates slant by more."""
ROOM = 0.007
"""Room between an open pad and the wall on each side [m]; by eye."""
PALM_ROOM = 0.003
"""Room between the palm and the highest lip [m]; by eye."""
PAIR_SHIFTS = (0.0, 0.01, -0.01, 0.02, -0.02)
"""Places at which two utensils side by side are taken, from the middle between them along them [m], the best first."""
FREE = 0.003
"""What open jaws keep from others [m]."""
ABOVE = 0.0005
"""Height of the fingertips over the table when they take a utensil [m]; by eye."""
HAND = Gripper()
"""The standard one, whose measures the constants above are."""


@dataclass(frozen=True)
class Hold:
    """A tool pose at which the fingers close from an opening [m], and how far they come with it."""

    pose: np.ndarray
    opening: float
    clearance: float
    """Least distance [m] of the open jaws from others."""


def tool_pose(point: np.ndarray, closing: float, lean: float = 0.0) -> np.ndarray:
    """Return world_from_tool (4, 4): fingertips at a point (3,), closing along an angle [rad], the hand leaning towards
    it by `lean` [rad]."""
    radial, up = np.array([cos(closing), sin(closing), 0.0]), np.array([0.0, 0.0, 1.0])
    pose = np.eye(4)
    pose[:3, 2] = -sin(lean) * radial - cos(lean) * up
    pose[:3, 1] = cos(lean) * radial - sin(lean) * up
    pose[:3, 0] = np.cross(pose[:3, 1], pose[:3, 2])
    pose[:3, 3] = point
    return pose


def walls(table: Table, name: str) -> list[Item]:
    """Return the dishes of a pile from `name` upwards whose walls lie in one another; what stands free in them is not
    held between the fingers."""
    family = [table.by_name[name]]
    for item in table.load(name):
        base = family[-1]
        if not item.is_dish:
            break
        rise = item.position[2] - base.position[2]
        if item.kind != base.kind or rise > 0.6 * base.measures.height:
            break
        family.append(item)
    return family


def cargo(table: Table, name: str) -> list[Item]:
    """Return what a pile carries from `name` upwards beside `walls`."""
    gripped = {item.name for item in walls(table, name)}
    return [item for item in table.load(name) if item.name not in gripped]


def reach_below(family: list[Item], most: float = DEPTH) -> float:
    """Return how far [m] the pads go below the lowest lip of some nested dishes."""
    lips = [item.lip for item in family]
    room = JAW_HEIGHT - PALM_ROOM - (max(lips) - min(lips))
    return max(0.003, min(most, room))


def rim_hold(
    table: Table, name: str, wanted: float, most: float = DEPTH, center: tuple[float, float] | None = None
) -> Hold:
    """Return how a pile is held by the rim from `name` upwards, as near to the angle `wanted` [rad] as jaws fit, else
    where they come nearest to fitting. `center` [m] is where the pile is, by default where the table says."""
    family = walls(table, name)
    base = family[0]
    x, y = center or (base.position[0], base.position[1])
    low_lip = min(item.lip for item in family)
    if base.on is not None and table.by_name[base.on].is_dish:  # the fingers must not close on what it stands in
        most = min(most, max(0.006, low_lip - table.by_name[base.on].lip - 0.002))
    depth = reach_below(family, min(most, FLAT_DEPTH) if base.kind == "plate" else most)
    tip = low_lip - depth
    slant = atan2(base.measures.rim_radius - base.measures.foot_radius, base.measures.height)
    lean = min(slant, MOST_LEAN)
    outer = max(item.measures.outer_radius(tip - item.position[2]) for item in family)
    inner = min(item.measures.inner_radius(tip - item.position[2]) for item in family)
    middle, opening = (outer + inner) / 2, (outer - inner) * cos(lean) + 2 * ROOM
    if slant > lean:  # a flat rim rises outwards between the pads
        opening += depth / cos(slant) * sin(slant - lean)
    others = [item for pile in table.stacks for item in pile if base.name not in {member.name for member in pile}]
    own_cargo = cargo(table, name)
    best: Hold | None = None
    for turn in sorted(np.linspace(-pi, pi, 36, endpoint=False), key=abs):
        angle = wanted + float(turn)
        point = np.array([x + middle * cos(angle), y + middle * sin(angle), tip])
        pose = tool_pose(point, angle, lean)
        clearance = jaw_clearance(pose, opening, others, own_cargo)
        if best is None or clearance > best.clearance:
            best = Hold(pose, opening, min(clearance, FREE))
        if clearance >= FREE:
            break
    assert best is not None
    return best


def jaw_clearance(pose: np.ndarray, opening: float, others: list[Item], own: list[Item], hand: Gripper = HAND) -> float:
    """Return the least distance [m] between open jaws and other things, seen from above at the height of each thing's
    upper edge; of the own pile's cargo the inner pad only has to keep clear. A utensil in a dish counts however low its
    middle is: one that slid from the rim leans there, an end of it above the rim."""
    least = 1.0
    tip = pose[2, 3]
    for number, item in enumerate([*own, *others]):
        if item.lip < tip - 0.002 and (item.is_dish or number >= len(own)):
            continue
        top = max(tip, min(item.lip, tip + 0.10))
        knuckles = item.lip > tip + hand.jaw_height
        thickness = KNUCKLE if knuckles else PAD
        backwards = (top - tip) / max(-pose[2, 2], 0.5)
        print_of_item = footprint(item)
        for side in (-1.0, 1.0):
            for back in (0.0, backwards):
                middle = pose[:3, 3] - back * pose[:3, 2] + side * (opening / 2 + thickness / 2) * pose[:3, 1]
                half = hand.finger - thickness / 2
                across = half * pose[:3, 0]
                print_ = Footprint(
                    (float(middle[0] - across[0]), float(middle[1] - across[1])),
                    (float(middle[0] + across[0]), float(middle[1] + across[1])),
                    thickness / 2,
                )
                least = min(least, gap(print_, print_of_item))
    return least


def pair_hold(table: Table, first: str, second: str, point: tuple[float, float, float], closing: float) -> Hold:
    """Return how two piles side by side are taken by the walls that face each other, or two utensils across."""
    base, beside = table.by_name[first], table.by_name[second]
    others = [i for p in table.stacks for i in p if not {first, second} & {o.name for o in p}]
    if not base.is_dish:
        turned = (beside.yaw - base.yaw + pi / 2) % pi - pi / 2
        yaw = base.yaw + turned / 2
        across = np.array([-sin(yaw), cos(yaw)])
        apart = abs(float(across @ (np.array(beside.position[:2]) - np.array(base.position[:2]))))
        opening = min(HAND.opening, apart + base.measures.width + 0.014)
        tip = min(base.position[2], beside.position[2]) + ABOVE
        best: Hold | None = None
        for along in PAIR_SHIFTS:  # held away from their middles they would hang and swing
            tool_point = np.array([point[0] + along * cos(yaw), point[1] + along * sin(yaw), tip])
            pose = tool_pose(tool_point, yaw + pi / 2)
            clearance = jaw_clearance(pose, opening, others, [])
            if best is None or clearance > best.clearance:
                best = Hold(pose, opening, min(clearance, FREE))
            if clearance >= FREE:
                break
        assert best is not None
        return best
    best = None
    for depth in PAIR_DEPTHS:
        for room in PAIR_ROOMS:
            hold = _dish_pair(table, (first, second), point, closing, depth, room, others)
            if best is None or hold.clearance > best.clearance + 1e-6:
                best = hold
            if hold.clearance >= PAIR_FREE:
                return hold
    assert best is not None
    return best


def _dish_pair(
    table: Table,
    names: tuple[str, str],
    point: tuple[float, float, float],
    closing: float,
    depth: float,
    room: float,
    others: list[Item],
) -> Hold:
    """Return how two dishes are taken at most `depth` [m] below the lower lip, with `room` [m] between open pads and
    walls."""
    families = [walls(table, name) for name in names]
    lips = [item.lip for family in families for item in family]
    tip = min(lips) - max(0.003, min(depth, JAW_HEIGHT - PALM_ROOM - (max(lips) - min(lips))))
    pose = tool_pose(np.array([point[0], point[1], tip]), closing)
    ahead = np.array([cos(closing), sin(closing)])
    reach = 0.0
    for name, family in zip(names, families, strict=True):
        base = table.by_name[name]
        inner = min(item.measures.inner_radius(tip - item.position[2]) for item in family)
        middle = abs(float(ahead @ (np.array(base.position[:2]) - np.array(point[:2]))))
        reach = max(reach, middle - inner)
    own_cargo = [item for name in names for item in cargo(table, name)]
    opening = min(HAND.opening, 2.0 * (reach + room))
    return Hold(pose, opening, jaw_clearance(pose, opening, others, own_cargo))


def half_width(item: Item, along: float) -> float:
    """Return half the width [m] of a utensil at a distance from its middle towards the head, 0 beyond its ends."""
    for corners in solid(item.kind, item.measures).pieces:
        if corners[:, 0].min() - 0.0015 <= along <= corners[:, 0].max() + 0.0015:
            return float(np.abs(corners[:, 1]).max())
    return 0.0


def bar_hold(table: Table, name: str, opening: float = 0.032) -> Hold:
    """Return how a utensil, or a pile of utensils, is taken across its middle; a pile where all are equally wide, else
    the pads close on the widest only."""
    item = table.by_name[name]
    others = [i for p in table.stacks for i in p if name not in {o.name for o in p}]
    pile = [item, *table.load(name)]
    shifts = sorted(np.arange(-0.045, 0.0451, 0.005), key=abs)
    if len(pile) > 1:
        shifts = sorted(shifts, key=lambda shift: (round(unevenness(pile, float(shift)), 4), abs(shift)))
    best: Hold | None = None
    for shift in shifts:
        x = item.position[0] + shift * cos(item.yaw)
        y = item.position[1] + shift * sin(item.yaw)
        tip = item.position[2] + (ABOVE if item.position[2] < 0.001 else -0.0005 if item.on is None else ABOVE)
        pose = tool_pose(np.array([x, y, tip]), item.yaw + pi / 2)
        clearance = jaw_clearance(pose, opening, others, [])
        if best is None or clearance > best.clearance + 1e-6:
            best = Hold(pose, opening, min(clearance, FREE))
        if clearance >= FREE:
            break
    assert best is not None
    return best


def unevenness(pile: list[Item], shift: float) -> float:
    """Return by how much [m] the half widths of utensils that lie on each other differ under pads at `shift` [m] from
    the lowest one's middle towards its head."""
    base = pile[0]
    axis = np.array([cos(base.yaw), sin(base.yaw)])
    widths = []
    for item in pile:
        forwards = 1.0 if cos(item.yaw - base.yaw) >= 0.0 else -1.0
        offset = float(axis @ (np.array(item.position[:2]) - np.array(base.position[:2])))
        reach = PAD_WIDTH / 2 + 0.001
        widths += [half_width(item, forwards * (shift + along - offset)) for along in np.linspace(-reach, reach, 7)]
    return max(widths) - min(widths)
