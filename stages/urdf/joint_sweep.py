"""How far a door or drawer of a scene goes before it meets something: moved alone, without forces."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scenewright.stages.kit.simulation.engine import engine
from scenewright.stages.kit.simulation.world import LoadedBody, PhysicsWorld
from scenewright.stages.urdf.scene_penetration import link_depth

STEPS = 100
"""Positions that the range is divided into."""
START_SHARE = 0.1
"""The start of a motion is the first tenth of the range, beginning where the joint is closed."""
HIT_DEPTH = 0.005
"""A part that lies deeper than this in something [m] has met it; less is contact."""


@dataclass(frozen=True)
class JointRange:
    """What became of one joint. Values in radians or metres."""

    body: str
    joint: str
    closed: float
    """Where the motion starts: 0, or the limit nearest to it."""
    range: float
    """Upper minus lower limit."""
    free_share: float
    """Share of the range that the joint reaches from `closed` before its part meets something, 0 to 1."""
    hit_link: str | None = None
    """Link that the part meets first; None when it goes through the whole range."""
    hit_at: float | None = None
    """Joint value at which it does."""
    hit_depth: float = 0.0
    """How deep the two are in each other there [m]."""
    start_depth: float = 0.0
    """How deep the part lies in anything at the start of the motion, at most [m]."""
    margin: float | None = None
    """How far `start_depth` is from `HIT_DEPTH` (`settle_margins`); None: far."""

    @property
    def free_at_start(self) -> bool:
        """Whether the part meets nothing in the first tenth of the range (`START_SHARE`)."""
        return self.hit_link is None or self.free_share >= START_SHARE


def sweep_joints(world: PhysicsWorld) -> list[JointRange]:
    """Return one entry a moving joint of a scene, in the order of its bodies. The world is left as it was.

    Each joint goes alone from where it is closed to its limits in steps of a hundredth of its range; other joints
    stay at their values. A part meets a neighbour when it lies more than 5 mm in it. Neighbours are all other bodies
    and the links of the own body that the joint does not connect, except what rides along: bodies that the own body
    contains, and what stands on those. Where a part meets a door of its own body at the start of its motion (a rack
    behind the door of a dishwasher), the door is opened first, as a hand would do.
    """
    ranges = []
    for body in world.bodies.values():
        riding = _contents(world, body.name)
        for joint in body.joints:
            ranges.append(_sweep(world, body, joint, riding))
    return ranges


def sweep_joint(world: PhysicsWorld, name: str, joint: str) -> JointRange:
    """Return the entry of one joint of one body, as `sweep_joints` does."""
    return _sweep(world, world.bodies[name], joint, _contents(world, name))


def _contents(world: PhysicsWorld, name: str) -> set[str]:
    """Return the bodies that lie in a body, at any depth, and what stands on them."""
    inside: set[str] = set()
    grown = True
    while grown:
        touching = {
            body.name
            for body in world.bodies.values()
            if body.record.parent in inside or (body.record.parent == name and body.record.relation == "contains")
        }
        grown = not touching <= inside
        inside |= touching
    return inside


def _sweep(world: PhysicsWorld, body: LoadedBody, joint: str, riding: set[str]) -> JointRange:
    before = {name: world.joint_value(body.name, name) for name in body.joints}
    opened: set[str] = set()
    while True:
        joint_range = _sweep_one_joint(world, body, joint, riding)
        door = None if joint_range.free_at_start else _door_of(world, body, joint, joint_range.hit_link)
        if door is None or door in opened:
            break
        opened.add(door)
        world.set_joint(body.name, door, _open_value(world, body, door))
    for name, value in before.items():
        world.set_joint(body.name, name, value)
    return joint_range


def _door_of(world: PhysicsWorld, body: LoadedBody, joint: str, link: str | None) -> str | None:
    """Return the other joint of a body that moves the link, None where it is of another body, or moved by none."""
    index = next((k for k in body.links.values() if world.link_name(body.body_id, k) == link), None)
    moving = _moving_links(world, body, body.joints[joint])
    for name, index_of_joint in body.joints.items():
        if index is not None and index not in moving and index in _moving_links(world, body, index_of_joint):
            # A joint that carries the part too (a tray that hangs on the door) would take it along.
            return None if body.joints[joint] in _moving_links(world, body, index_of_joint) else name
    return None


def _open_value(world: PhysicsWorld, body: LoadedBody, joint: str) -> float:
    """Return the limit of a joint that is farther from where it is closed."""
    lower, upper = _limits(world, body, joint)
    closed = min(max(0.0, lower), upper)
    return upper if upper - closed >= closed - lower else lower


def _limits(world: PhysicsWorld, body: LoadedBody, joint: str) -> tuple[float, float]:
    info = engine.getJointInfo(body.body_id, body.joints[joint], physicsClientId=world.client)
    return (-np.pi, np.pi) if info[9] < info[8] else (info[8], info[9])  # without limits: once around


def _sweep_one_joint(world: PhysicsWorld, body: LoadedBody, joint: str, riding: set[str]) -> JointRange:
    """Sweep a joint with every other one where it is."""
    index = body.joints[joint]
    lower, upper = _limits(world, body, joint)
    closed = min(max(0.0, lower), upper)
    moving = _moving_links(world, body, index)
    parent = engine.getJointInfo(body.body_id, index, physicsClientId=world.client)[16]
    still = [
        (obstacle.body_id, link, np.array(engine.getAABB(obstacle.body_id, link, physicsClientId=world.client)))
        for obstacle in world.bodies.values()
        if obstacle.name not in riding
        for link in sorted(obstacle.links.values())
        if obstacle.name != body.name or (link not in moving and link != parent)
    ]
    step = (upper - lower) / STEPS
    stretches = [_stretch(world, body, joint, closed, limit, step, moving, still) for limit in (upper, lower)]
    free = sum(length for length, _, _ in stretches)
    hit = next((met for _, met, _ in stretches if met is not None), None)
    share = 1.0 if upper == lower else free / (upper - lower)
    found = JointRange(
        body.name, joint, closed, upper - lower, share, start_depth=max(deep for _, _, deep in stretches)
    )
    return found if hit is None else replace(found, hit_link=hit[0], hit_depth=hit[1], hit_at=hit[2])


def _stretch(
    world: PhysicsWorld,
    body: LoadedBody,
    joint: str,
    closed: float,
    limit: float,
    step: float,
    moving: list[int],
    still: list[tuple[int, int, np.ndarray]],
) -> tuple[float, tuple[str, float, float] | None, float]:
    """Return how far a joint goes from where it is closed towards a limit [rad, m] in steps, what it meets (the link,
    how deep [m], at which value), and how deep the part lies in anything at the start of the motion, at most [m]."""
    reached, met, at_start = closed, None, 0.0
    for value in _positions(closed, limit, step):
        starting = abs(value - closed) <= (START_SHARE * STEPS + 1e-6) * step
        if met is not None and not starting:
            break
        world.set_joint(body.name, joint, value)
        link, depth = _deepest(world, body, moving, still)
        if starting:
            at_start = max(at_start, depth)
        if met is None and depth > HIT_DEPTH:
            met = (link, depth, value)
        elif met is None:
            reached = value
    return abs((limit if met is None else reached) - closed), met, at_start


def _positions(start: float, end: float, step: float) -> Iterator[float]:
    """Yield values from start to end, both included; nothing when they are the same."""
    if start == end or step <= 0:
        return
    count = max(1, int(np.ceil(abs(end - start) / step - 1e-9)))
    yield from np.linspace(start, end, count + 1).tolist()


def _moving_links(world: PhysicsWorld, body: LoadedBody, index: int) -> list[int]:
    """Return the link of a joint and all links below it."""
    moving = {index}
    for link in sorted(body.links.values()):  # parents have smaller indices than their children
        if link >= 0 and engine.getJointInfo(body.body_id, link, physicsClientId=world.client)[16] in moving:
            moving.add(link)
    return sorted(moving)


def _deepest(
    world: PhysicsWorld, body: LoadedBody, moving: list[int], still: list[tuple[int, int, np.ndarray]]
) -> tuple[str, float]:
    """Return the link that moving links lie deepest in, and how deep [m]; depth 0 when they lie in none.

    `still`: body id, link index and bounds (2, 3) of all links that stand still.
    """
    deepest = ("", 0.0)
    bounds = np.array([entry[2] for entry in still]).reshape(-1, 2, 3)
    for link in moving:
        low, high = np.array(engine.getAABB(body.body_id, link, physicsClientId=world.client))
        for index in np.flatnonzero(((bounds[:, 0] <= high) & (bounds[:, 1] >= low)).all(axis=1)):
            other_body, other_link = still[index][:2]
            depth = link_depth(world, body.body_id, link, other_body, other_link)
            if depth > deepest[1]:
                deepest = (world.link_name(other_body, other_link), depth)
    return deepest
