"""Whether a condition holds in the room after execution, with its numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scenewright.schemas.plan import Check
from scenewright.stages.kit.geometry.transforms import apply
from scenewright.stages.kit.simulation.shapes import link_shapes
from scenewright.stages.kit.simulation.world import PhysicsWorld

AT_REST = 0.02
"""Largest speed of something that lies still [m/s]."""
CLOSED_ANGLE, CLOSED_SLIDE = 0.1, 0.02
"""A door counts as shut below this [rad], a drawer below this [m]."""
CONTACT_HEIGHT = 0.02
"""Largest distance of an item's lowest point from the height at which it touches its support [m]."""


@dataclass(frozen=True)
class GoalInRoom:
    """A literal of the goal, with what its names are in the room of execution."""

    world: PhysicsWorld
    literal: str
    bodies: tuple[str, ...]
    """For each argument its body, or the body whose joint it is."""
    joints: tuple[str, ...]
    """The joint that the first argument is, or all joints of the body that it is."""
    held: str | None
    """What the hand holds."""


def check_on(world: PhysicsWorld, literal: str, item: str, support: str) -> Check:
    """Whether an item rests on a support: in contact with it from above, within its outline, at rest."""
    item_id, support_id = world.bodies[item].body_id, world.bodies[support].body_id
    contacts = [contact for contact in world.contacts(item_id, support_id) if contact.depth > -0.002]
    low, high = world.bounds(item)
    below = [contact for contact in contacts if abs(contact.normal[2]) > 0.7]
    height = float(np.mean([contact.point[2] for contact in below])) if below else float("nan")
    lowest = _lowest_point(world, item)
    gap = lowest - height if below else None
    speed, turning = world.velocity(item)
    support_low, support_high = world.bounds(support)
    center = (low + high)[:2] / 2
    inside = bool(np.all(center > support_low[:2]) and np.all(center < support_high[:2]))
    numbers = {"contacts": float(len(below)), "speed": round(speed, 6), "angular_speed": round(turning, 6)}
    if gap is not None:
        numbers |= {"height": round(height, 6), "gap": round(gap, 6)}
    holds = gap is not None and abs(gap) < CONTACT_HEIGHT and inside and speed < AT_REST
    edge = float(np.minimum(center - support_low[:2], support_high[:2] - center).min())
    slack = None
    if gap is not None:
        slack = min(1.0 - abs(gap) / CONTACT_HEIGHT, edge / CONTACT_HEIGHT, 1.0 - speed / AT_REST)
    if gap is None:
        detail = f"{item} does not touch {support} from above (its lowest point is at {lowest:.3f} m)"
    else:
        detail = f"{item} rests at {height:.3f} m on {support}, speed {speed:.3f} m/s"
        if not inside:
            detail += ", outside its outline"
    return Check(condition=literal, holds=holds, detail=detail, numbers=numbers, slack=slack)


def _lowest_point(world: PhysicsWorld, item: str) -> float:
    """Return the height [m] of the lowest point of a body's collision shapes: bounds of what lies aslant are wider."""
    shapes = link_shapes(world.bodies[item].text)
    return min(
        float(apply(world.link_pose(item, link), mesh.vertices)[:, 2].min())
        for link, meshes in shapes.items()
        for mesh in meshes
    )


def check_joints(world: PhysicsWorld, literal: str, body: str, joints: Sequence[str], shut: bool) -> Check:
    """Whether all the joints of a body stand shut (or, `shut` false, open)."""
    values = {joint: world.joint_value(body, joint) for joint in joints}
    kinds = {joint.name: joint for joint in world.bodies[body].record.joints}
    limits = {name: CLOSED_ANGLE if kinds[name].type == "revolute" else CLOSED_SLIDE for name in values}
    half = {name: 0.5 * kinds[name].upper for name in values}
    if shut:
        slacks = [1.0 - value / limits[name] for name, value in values.items()]
        wrong = [name for name, value in values.items() if value > limits[name]]
    else:
        slacks = [value / half[name] - 1.0 for name, value in values.items() if half[name] > 0.0]
        wrong = [name for name, value in values.items() if value < half[name]]
    detail = ", ".join(
        f"{name} at {value:.3f} {'rad' if kinds[name].type == 'revolute' else 'm'}" for name, value in values.items()
    )
    numbers = {name: round(value, 6) for name, value in values.items()}
    slack = min(slacks, default=None)
    return Check(condition=literal, holds=not wrong, detail=detail, numbers=numbers, slack=slack)


def check_in(world: PhysicsWorld, literal: str, item: str, container: str) -> Check:
    """Whether an item's centre lies within a container's bounds and it touches the container, at rest."""
    low, high = world.bounds(item)
    container_low, container_high = world.bounds(container)
    center = (low + high) / 2
    outside = float(np.maximum(container_low - center, center - container_high).max())
    touching = any(
        contact.depth > -0.002
        for contact in world.contacts(world.bodies[item].body_id, world.bodies[container].body_id)
    )
    speed, _ = world.velocity(item)
    return Check(
        condition=literal,
        holds=outside < 0 and touching and speed < AT_REST,
        detail=f"{item} is {abs(outside):.3f} m {'inside' if outside < 0 else 'outside'} {container}'s bounds, "
        f"{'touching' if touching else 'not touching'} it",
        numbers={"outside": round(outside, 6), "speed": round(speed, 6)},
        slack=min(-outside / CONTACT_HEIGHT, 1.0 - speed / AT_REST) if touching else None,
    )
