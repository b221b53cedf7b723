"""How the true room is in the end, read off the log of an execution, and which literals hold there.

The log has the pose of every movable body and moving part of the true room by its true name, whatever the method made
of it. The room is put into that state and asked by contacts, bounds and joint values; the robot is left out.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from scenewright.schemas.scene_parts import Joint
from scenewright.stages.kit.formats.foxglove import stamp_nanoseconds, transform_matrix
from scenewright.stages.kit.formats.indexed_mcap import IndexedMcap
from scenewright.stages.kit.simulation.engine import engine
from scenewright.stages.kit.simulation.world import PhysicsWorld, load_scene
from scipy.spatial.transform import Rotation

from benchmarks.board.tasks.literals import parts

SHUT_ANGLE, SHUT_SLIDE = 0.1, 0.02
"""A door counts as shut below this [rad], a drawer below this [m]."""
TOUCHING = 0.002
"""Bodies that are closer than this touch [m]."""
UPWARD = 0.7
"""Least upward share of the normal where something is carried."""
AT_REST = 0.02
"""Largest speed of something that lies still [m/s]."""
LATEST = 0.25
"""How long before the end a pose may be logged for its speed to count [s]; the log has ten a second."""


@dataclass(frozen=True)
class Ending:
    """Where things of the true room are in the end; what is not named is where it was at the beginning."""

    poses: Mapping[str, np.ndarray] = field(default_factory=dict)
    """Movable body, or link of a moving part -> world pose (4, 4)."""
    speeds: Mapping[str, float] = field(default_factory=dict)
    """Of what moved in the last moment [m/s]."""


def is_shut(joint: Joint, value: float) -> bool:
    """Whether a door or drawer counts as shut at a joint value [rad] or [m]."""
    return value <= (SHUT_ANGLE if joint.type == "revolute" else SHUT_SLIDE)


def read_ending(log: Path) -> Ending:
    """Return how the room is at the end of a plan's `execution.mcap`. Raises BadInput for a log that is not whole."""
    history: dict[str, list[tuple[float, np.ndarray]]] = {}
    last = 0.0
    with IndexedMcap(log) as file:
        channel = next(number for number, entry in file.channels.items() if entry.topic == "/tf")
        for _, place in file.indexed(channel):
            message = FrameTransforms.FromString(file.fetch(place))
            for entry in message.transforms:
                time = stamp_nanoseconds(entry) / 1e9
                pose = transform_matrix(entry.translation, entry.rotation)
                history.setdefault(entry.child_frame_id, []).append((time, pose))
                last = max(last, time)
    poses = {name: poses_then[-1][1] for name, poses_then in history.items()}
    speeds = {name: _speed(poses_then) for name, poses_then in history.items() if poses_then[-1][0] > last - LATEST}
    return Ending(poses, speeds)


def _speed(poses: Sequence[tuple[float, np.ndarray]]) -> float:
    if len(poses) < 2:
        return 0.0
    (before, start), (after, end) = poses[-2:]
    return float(np.linalg.norm(end[:3, 3] - start[:3, 3])) / max(after - before, 1e-9)


def which_hold(room: Path, ending: Ending, literals: Sequence[str]) -> tuple[bool, ...]:
    """Return for each literal whether it holds in the true room of a folder in its end state.

    `on(A, B)`: A touches B from above, its middle within B's bounds, at rest. `in(A, B)`: A touches B, its middle
    within B's bounds, at rest. `closed(B)`: all doors and drawers of B are shut. Raises KeyError for other predicates
    and names, BadInput for a room that can't be loaded.
    """
    with load_scene(room) as world:
        _put(world, ending)
        return tuple(_holds(world, ending, *parts(literal)) for literal in literals)


def _put(world: PhysicsWorld, ending: Ending) -> None:
    for name, body in world.bodies.items():
        if body.record.movable and name in ending.poses:
            world.set_pose(name, ending.poses[name])
        for joint in sorted(body.record.joints, key=lambda entry: entry.parent is not None):
            if joint.name in body.joints and joint.part in ending.poses:
                world.set_joint(name, joint.name, 0.0)
                world.set_joint(name, joint.name, _joint_value(world, name, joint, ending.poses[joint.part]))


def _joint_value(world: PhysicsWorld, body: str, joint: Joint, part: np.ndarray) -> float:
    """Return the value [rad] or [m] at which the part of a joint, now at 0, is at a world pose (4, 4)."""
    axis = np.array(joint.axis) / np.linalg.norm(joint.axis)
    above = world.pose(body) if joint.parent is None else world.link_pose(body, joint.parent)
    along = above[:3, :3] @ axis
    at_zero = world.link_pose(body, joint.part)
    if joint.type == "prismatic":
        return float(along @ (part[:3, 3] - at_zero[:3, 3]))
    return float(along @ Rotation.from_matrix(part[:3, :3] @ at_zero[:3, :3].T).as_rotvec())


def _holds(world: PhysicsWorld, ending: Ending, predicate: str, names: tuple[str, ...]) -> bool:
    if predicate == "closed":
        body = world.bodies[names[0]]
        return all(is_shut(joint, world.joint_value(names[0], joint.name)) for joint in body.record.joints)
    upward = {"on": UPWARD, "in": -1.0}[predicate]
    item, place = names
    touches = any(normal[2] >= upward for normal in _contact_normals(world, item, place))
    return touches and _middle_within(world, item, place, flat=predicate == "on") and _at_rest(ending, item)


def _contact_normals(world: PhysicsWorld, item: str, place: str) -> list[tuple[float, float, float]]:
    """Return unit normals, towards the item, where two bodies are nearer than `TOUCHING`."""
    ids = world.bodies[item].body_id, world.bodies[place].body_id
    return [entry[7] for entry in engine.getClosestPoints(*ids, TOUCHING, physicsClientId=world.client)]


def _middle_within(world: PhysicsWorld, item: str, place: str, *, flat: bool) -> bool:
    middle = np.mean(world.bounds(item), axis=0)
    low, high = world.bounds(place)
    axes = slice(0, 2 if flat else 3)
    return bool(np.all(middle[axes] > low[axes]) and np.all(middle[axes] < high[axes]))


def _at_rest(ending: Ending, item: str) -> bool:
    return ending.speeds.get(item, 0.0) < AT_REST
