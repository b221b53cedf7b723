"""Where an item can be put down: upright poses on the regions of a body."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scenewright.stages.kit.geometry.transforms import apply, inverse, transform_from_yaw
from scenewright.stages.plan.regions import CELL, NEAR_LEVEL, Region
from scenewright.stages.plan.world_model import WorldModel

PUT_DOWN_HEIGHT = 0.006
"""Items are let go this far over the surface [m]."""
PLACES = 48
"""Drawn in each region."""
TURNS = 8
"""Yaws of a thing that are tried at a place."""
EDGE = 0.8
"""Surface is wanted under a circle of this share of the item's radius, and under its middle."""
COMFORT = 0.9
"""Places near this height come first: the arm likes them [m]."""


@dataclass(frozen=True)
class Placement:
    """An upright pose a hair above a surface."""

    world_from_item: np.ndarray
    covered: bool
    """Whether something above it makes the hand come from the side."""
    in_drawer: bool
    roomy: bool = True
    """Whether the whole foot has surface under it, a cell to spare: walls and edges are that far."""


def place_regions(model: WorldModel, item: str, target: str, door: str | None) -> list[Region]:
    """Return the regions of `target` with room for `item`: behind `door` (it, at least, is open), or behind none."""
    radius, height = model.footprint(item)
    regions = []
    for region in model.regions(target):
        if not region.takes(radius, height) or (door not in region.doors if door else region.doors):
            continue
        regions.append(region)
    return regions


def sample_placements(
    model: WorldModel, item: str, target: str, door: str | None, random: np.random.Generator, count: int = PLACES
) -> list[Placement]:
    """Return up to `count` placements a region, those of regions at a comfortable height first, taking turns; tight
    ones come last.

    A place counts where the region has surface under the foot and room above it, taken or not (`untaken`).
    """
    radius, height = model.footprint(item)
    bottom = model.foot(item)
    regions = place_regions(model, item, target, door)
    turns: list[list[Placement]] = []
    for region in sorted(regions, key=lambda region: abs(model.height_of(region) - COMFORT)):
        world_from_closed = model.world_from_region(region)
        low, high = region.low + 0.9 * radius, region.high - 0.9 * radius
        places = []
        drawer = region.joint is not None
        for _ in range(count):
            spot = np.array([*random.uniform(np.minimum(low, high), np.maximum(low, high)), region.level])
            yaw = float(random.uniform(-np.pi, np.pi))
            if not region.carries(spot[:2], EDGE * radius, height):
                continue
            position = apply(world_from_closed, spot)
            position[2] += PUT_DOWN_HEIGHT - bottom
            roomy = region.carries(spot[:2], radius + CELL / 2, height)
            places.append(Placement(transform_from_yaw(yaw, position), region.covered, drawer, roomy))
        turns.append(places)
    longest = max((len(places) for places in turns), default=0)
    mixed = [places[turn] for turn in range(longest) for places in turns if turn < len(places)]
    return sorted(mixed, key=lambda place: not place.roomy)


def untaken(model: WorldModel, item: str, target: str, places: list[Placement]) -> list[Placement]:
    """Return the places on which an item does not meet anything but `target`, turned about the vertical one way or
    another; the yaw of the first way that is free is theirs."""
    links, free = set(model.links(target)), []
    for place in places:
        for turn in 2 * np.pi * np.arange(TURNS) / TURNS:
            pose = place.world_from_item @ transform_from_yaw(turn, np.zeros(3))
            with model.world.posed(item, pose @ model.standing(item)):
                taken = set(model.checker.overlaps(item)) - links
            if not taken:
                free.append(replace(place, world_from_item=pose))
                break
    return free


def placement_style(
    model: WorldModel, item: str, target: str, door: str | None
) -> Literal["any", "rather_level", "level", "steep"]:
    """Return the grasp style with which an item can be put there.

    `level` when all its places are under a cover, `rather_level` when some are, `steep` when all are in drawers, `any`
    otherwise.
    """
    regions = place_regions(model, item, target, door)
    if regions and all(region.covered for region in regions):
        return "level"
    if regions and all(region.joint is not None for region in regions):
        return "steep"
    if any(region.covered for region in regions):
        return "rather_level"
    return "any"


def nearest_level(model: WorldModel, body: str, place: np.ndarray, height: float) -> float:
    """Return the height [m] of the region of a body over which a place (2,) lies that is nearest to `height`; `height`
    itself when there is none."""
    levels = [height + 1.0]
    for region in model.regions(body):
        world_from_closed = model.world_from_region(region)
        spot = apply(inverse(world_from_closed), np.array([*place, height]))
        if np.all(spot[:2] > region.low) and np.all(spot[:2] < region.high):
            levels.append(height + region.level - float(spot[2]))
    best = min(levels, key=lambda level: abs(level - height))
    return best if abs(best - height) < NEAR_LEVEL else height
