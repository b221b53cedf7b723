"""Rules for supports that Han 2024, section 2.6.5, leaves out: hung from the ceiling, across two carriers, leaning."""

from __future__ import annotations

from itertools import combinations

import numpy as np
from scenewright.stages.kit.geometry.boxes import box_from_bounds, clip_polygon, convex_hull, footprint, polygon_area
from scenewright.stages.kit.geometry.transforms import apply, inverse, transform_from_yaw
from scenewright.stages.synthesize.furniture import Furnishing, plane_in_world
from scenewright.stages.synthesize.placement import Further, PlacedObject, Pose
from scenewright.stages.synthesize.recipes import Place
from scenewright.stages.synthesize.shell import Room

CEILING_GAP = 1e-3
"""Gap between a canopy and the ceiling [m]."""
LEANING_GAP = 1e-3
"""Gap between the upper edge of what leans and what it leans on [m]."""
STANDING_HEIGHT = 1.2
"""Free height below a lamp that hangs over nothing [m]."""
OVER_TABLE = 0.6
"""Free height between a lamp and the top of what it hangs above [m]."""
LEAST_PART = 0.12
"""Either of two carriers is under this share of what lies across them, at least."""
LEAST_DIFFERENCE = 0.08
"""Share by which one of two carriers carries more than the other, so that the parent is no matter of taste."""
OVERHANG = 0.1
"""An end may stick out over its carrier by this much [m]."""
SAME_PLACE = 0.02
"""Carriers stand in one line and at one height within this [m]."""


def from_ceiling(
    room: Room, objects: list[PlacedObject], furnishing: Furnishing, place: Place, random: np.random.Generator
) -> Pose | None:
    """Return a pose under the ceiling: over one of `of`, or anywhere where nobody stands in its way."""
    ceiling = next((k for k, entry in enumerate(room.layouts, start=1) if entry.class_name == "ceiling"), None)
    if ceiling is None:
        return None
    bottom = float(room.size[2]) - furnishing.closed_size[2] - CEILING_GAP
    targets = [thing for thing in objects if thing.class_name in place.of]
    if place.of and not targets:
        return None
    if targets:
        target = targets[int(random.integers(len(targets)))]
        local = 0.25 * random.uniform(-1.0, 1.0, 2) * target.furnishing.closed_size[:2]
        middle = apply(target.world_from_model, np.array([*local, 0.0]))[:2]
        yaw = float(np.arctan2(target.world_from_model[1, 0], target.world_from_model[0, 0]))
        least = float(target.world_from_model[2, 3]) + target.furnishing.closed_size[2] + OVER_TABLE
    else:
        spare = room.size[:2] / 2 - 0.5 - furnishing.closed_size[:2].max() / 2
        if np.any(spare <= 0):
            return None
        middle = random.uniform(-spare, spare)
        yaw = float(random.integers(4)) * np.pi / 2
        least = STANDING_HEIGHT
    if bottom < least:
        return None
    pose = transform_from_yaw(yaw, np.array([*middle, bottom]))
    return Pose(pose, f"ceiling_{ceiling}", "hangs_from", 0)


def beside_its_like(
    objects: list[PlacedObject], furnishing: Furnishing, place: Place, random: np.random.Generator
) -> Pose | None:
    """Return a pose to the left or right of another one of the same shape, turned the same way: one more carrier."""
    targets = [
        thing
        for thing in objects
        if thing.class_name in place.of and thing.furnishing is furnishing and thing.parent == "floor_1"
    ]
    if not targets:
        return None
    target = targets[int(random.integers(len(targets)))]
    side = -1.0 if random.random() < 0.5 else 1.0
    reach = furnishing.closed_size[0] + random.uniform(*place.gap)
    shift = transform_from_yaw(0.0, np.array([side * reach, 0.0, 0.0]))
    return Pose(target.world_from_model @ shift, "floor_1")


def top_plane(thing: PlacedObject) -> int | None:
    """Return the index of the horizontal plane at the top of an object; None when it has none there."""
    top = float(np.asarray(thing.furnishing.mesh.vertices)[:, 2].max())
    level = [
        k
        for k, plane in enumerate(thing.furnishing.planes)
        if plane.horizontal and abs(-plane.offset / plane.normal[2] - top) < 2e-3 and len(plane.corners) == 4
    ]
    return max(level, key=lambda k: thing.furnishing.planes[k].area, default=None)


def across_two(
    objects: list[PlacedObject], furnishing: Furnishing, place: Place, random: np.random.Generator
) -> Pose | None:
    """Return a pose on two carriers of one model that stand in a line; the one that carries more is the parent."""
    carriers = [thing for thing in objects if thing.class_name in place.of and top_plane(thing) is not None]
    pairs = [(a, b) for a, b in combinations(carriers, 2) if _in_line(a, b)]
    if not pairs:
        return None
    first, second = pairs[int(random.integers(len(pairs)))]
    if random.random() < 0.5:
        first, second = second, first
    line = second.world_from_model[:3, 3] - first.world_from_model[:3, 3]
    distance = float(np.linalg.norm(line))
    width, length = first.furnishing.closed_size[0], furnishing.closed_size[0]
    # The middle along the line, from the first carrier's: both ends lie on a carrier, or a little beyond it.
    low = max(0.5 * (length - width) - OVERHANG, distance - 0.5 * (width + length))
    high = min(0.5 * (length + width), distance + 0.5 * (width - length) + OVERHANG)
    if low > high or length <= distance - width:
        return None
    along = float(random.uniform(low, high))
    top = float(np.asarray(first.world_mesh().vertices)[:, 2].max())
    across = 0.5 * (first.furnishing.closed_size[1] - furnishing.closed_size[1])
    side = float(random.uniform(-across, across)) if across > 0 else 0.0
    unit = line / distance
    middle = first.world_from_model[:3, 3] + along * unit + side * np.array([-unit[1], unit[0], 0.0])
    yaw = float(np.arctan2(unit[1], unit[0]))
    pose = transform_from_yaw(yaw, np.array([middle[0], middle[1], top]))
    shares = {thing.name: carried_share(thing, furnishing, pose) for thing in (first, second)}
    most, least = sorted((first, second), key=lambda thing: -shares[thing.name])
    if shares[least.name] < LEAST_PART or shares[most.name] - shares[least.name] < LEAST_DIFFERENCE:
        return None
    return Pose(
        pose, most.name, plane=top_plane(most), further=(Further(least.name, "also_supports", top_plane(least)),)
    )


def _in_line(a: PlacedObject, b: PlacedObject) -> bool:
    """Whether two objects of one model stand side by side, turned the same way and at one height."""
    if a.furnishing is not b.furnishing:
        return False
    relative = inverse(a.world_from_model) @ b.world_from_model
    return bool(relative[0, 0] > 0.999 and np.abs(relative[1:3, 3]).max() < SAME_PLACE)


def carried_share(carrier: PlacedObject, furnishing: Furnishing, world_from_model: np.ndarray) -> float:
    """Return the share of a lying object's footprint that is over the top plane of a carrier."""
    index = top_plane(carrier)
    if index is None:
        return 0.0
    plane = plane_in_world(carrier.furnishing.planes[index], carrier.world_from_model)
    half = 0.5 * furnishing.closed_size[:2]
    footprint_box = box_from_bounds((-half[0], -half[1], 0.0), (half[0], half[1], 0.01))
    corners = np.column_stack([footprint(footprint_box), np.zeros(4)])
    foot = apply(world_from_model, corners)[:, :2]
    shared = clip_polygon(foot, convex_hull(np.asarray(plane.corners)[:, :2]))
    return float(polygon_area(shared) / polygon_area(foot))


def leaning(
    room: Room, objects: list[PlacedObject], furnishing: Furnishing, place: Place, random: np.random.Generator
) -> Pose | None:
    """Return a pose on the floor whose back edge touches a wall, or a side of one of `of` that is higher than it.

    The model is drawn leaning towards +y, so that turning it about z is all that it takes.
    """
    half = 0.5 * furnishing.closed_size
    if not place.of:
        k = int(random.integers(4))
        inward = room.walls[k].inward[:2]
        along = np.array([-inward[1], inward[0]])
        half_room = room.size[:2] / 2
        free = float(abs(along) @ half_room) - half[0] - 0.05
        if free <= 0:
            return None
        depth = float(abs(inward) @ half_room) - half[1] - LEANING_GAP
        middle = along * random.uniform(-free, free) - inward * depth
        yaw = float(np.arctan2(inward[1], inward[0]) + np.pi / 2)
        pose = transform_from_yaw(yaw, np.array([*middle, 0.0]))
        return Pose(pose, "floor_1", further=(Further(f"wall_{2 + k}", "leans_on", 0),))
    targets = [
        thing
        for thing in objects
        if thing.class_name in place.of
        and thing.parent == "floor_1"
        and thing.furnishing.closed_size[2] > furnishing.closed_size[2] + 0.02
    ]
    if not targets:
        return None
    target = targets[int(random.integers(len(targets)))]
    side = -1.0 if random.random() < 0.5 else 1.0
    size = target.furnishing.closed_size
    slack = max(0.0, 0.5 * size[1] - half[0])
    local = np.array([side * (0.5 * size[0] + half[1] + LEANING_GAP), random.uniform(-slack, slack), 0.0])
    facing = target.world_from_model[:3, :3] @ np.array([side, 0.0, 0.0])
    yaw = float(np.arctan2(facing[1], facing[0]) + np.pi / 2)
    middle = apply(target.world_from_model, local)
    pose = transform_from_yaw(yaw, np.array([middle[0], middle[1], 0.0]))
    return Pose(pose, "floor_1", at=target.name, further=(Further(target.name, "leans_on"),))
