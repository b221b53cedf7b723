"""Query sets of the motion benchmark: scenes around a Panda, and seeded pairs of start and goal that are free.

free: four boxes at arm's length. shelf: from one compartment of a shelf to another. drawer: down into an open drawer.
reconstructed_room: from the folded arm to before a grasp of an item, anywhere in a room that came out of a map.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scenewright.schemas.base import as_transform
from scenewright.schemas.interactive_scene import SceneBody
from scenewright.schemas.scene_parts import Box
from scenewright.stages.kit.acting.hand.sampled_grasps import sample_grasps
from scenewright.stages.kit.motion.base_placement import in_arm_frame, sample_bases
from scenewright.stages.kit.motion.collision import CollisionChecker
from scenewright.stages.kit.motion.kinematics import arm_chain, inverse_kinematics, random_starts
from scenewright.stages.kit.simulation.robot import Configuration, Robot
from scenewright.stages.kit.simulation.robot_description import load_robot
from scenewright.stages.kit.simulation.shapes import link_shapes, surface_points
from scenewright.stages.kit.simulation.world import PhysicsWorld, load_scene

PANDA = load_robot("panda")
CHAIN = arm_chain(PANDA)
ORIGIN = np.zeros(3)
ATTEMPTS = 400
"""Draws for one query before the set is given up as wrongly built."""
Plate = tuple[tuple[float, float, float], tuple[float, float, float]]
"""Centre and size of a box [m], world frame."""


@dataclass(frozen=True)
class MotionQuery:
    """A pair of arm values, free at both ends by the mesh checker."""

    base: np.ndarray
    start: np.ndarray
    goal: np.ndarray


@dataclass(frozen=True)
class QuerySet:
    """A world with the robot in it, and how to draw a query of it."""

    world: PhysicsWorld
    checker: CollisionChecker
    draw: Callable[[np.random.Generator], MotionQuery | None]

    def query(self, seed: int) -> MotionQuery:
        """Return the query of a seed. Raises RuntimeError when none of ATTEMPTS draws is free at both ends."""
        random = np.random.default_rng(seed)
        for _ in range(ATTEMPTS):
            found = self.draw(random)
            if found is not None and all(self._free(found.base, arm) for arm in (found.start, found.goal)):
                return found
        raise RuntimeError(f"no query for seed {seed}")

    def _free(self, base: np.ndarray, arm: np.ndarray) -> bool:
        return self.checker.check_meshes(np.concatenate([base, arm])) is None


def plates_world(plates: dict[str, list[Plate]]) -> PhysicsWorld:
    """Return a world of fixed bodies made of boxes."""
    world = PhysicsWorld()
    inertia = '<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>'
    for name, entries in plates.items():
        record = SceneBody(
            name=name,
            class_name="furniture",
            movable=False,
            world_from_body=as_transform(np.eye(4)),
            mass=1.0,
            world_from_reconstructed=None,
            box=Box(center=entries[0][0], size=entries[0][1]),
        )
        shapes = "".join(
            f'<collision><origin xyz="{c[0]} {c[1]} {c[2]}"/><geometry><box size="{s[0]} {s[1]} {s[2]}"/></geometry>'
            "</collision>"
            for c, s in entries
        )
        link = f'<link name="{name}"><inertial><mass value="1"/>{inertia}</inertial>{shapes}</link>'
        world.add_body(record, f'<robot name="{name}">{link}</robot>')
    return world


def _set(world: PhysicsWorld, draw: Callable[[np.random.Generator], MotionQuery | None]) -> QuerySet:
    robot = Robot(world, PANDA)
    robot.set(Configuration(ORIGIN, PANDA.carry, PANDA.opening))
    return QuerySet(world, CollisionChecker(world, robot), draw)


def free_set() -> QuerySet:
    """Four boxes around the robot; random arm values at both ends."""
    boxes: dict[str, list[Plate]] = {}
    for number, angle in enumerate(np.pi / 4 + np.pi / 2 * np.arange(4)):
        center = (0.65 * float(np.cos(angle)), 0.65 * float(np.sin(angle)), 0.75)
        boxes[f"box_{number}"] = [(center, (0.2, 0.2, 0.5))]

    def draw(random: np.random.Generator) -> MotionQuery:
        start, goal = random_starts(CHAIN, 2, random)
        return MotionQuery(ORIGIN, start, goal)

    return _set(plates_world(boxes), draw)


def _tool_pose(position: np.ndarray, approach: np.ndarray, turn: float) -> np.ndarray:
    """Return world_from_tool (4, 4) with z along `approach`, turned about it [rad]."""
    side = np.cross(approach, [0.0, 0.0, 1.0] if abs(approach[2]) < 0.9 else [1.0, 0.0, 0.0])
    side /= np.linalg.norm(side)
    third = np.cross(approach, side)
    pose = np.eye(4)
    pose[:3, 0] = np.cos(turn) * side + np.sin(turn) * third
    pose[:3, 1] = np.cross(approach, pose[:3, 0])
    pose[:3, 2] = approach
    pose[:3, 3] = position
    return pose


def _reach(base: np.ndarray, world_from_tool: np.ndarray, random: np.random.Generator) -> np.ndarray | None:
    target = in_arm_frame(base, world_from_tool, PANDA)
    solution = inverse_kinematics(CHAIN, target, random_starts(CHAIN, 6, random))
    return solution.arm if solution.found else None


def shelf_set() -> QuerySet:
    """A shelf of 2 x 3 compartments 0.34 m high and 0.42 m wide, 0.55 m before the robot; tool in two of them."""
    plates: list[Plate] = [((0.72, 0.0, 0.4 + 0.34 * board), (0.3, 0.88, 0.02)) for board in range(4)]
    plates += [((0.72, 0.43 * side, 0.91), (0.3, 0.02, 1.04)) for side in (-1, 0, 1)]
    plates += [((0.88, 0.0, 0.91), (0.02, 0.88, 1.04))]

    def inside(random: np.random.Generator, row: int, column: int) -> np.ndarray | None:
        low = np.array([0.62, -0.33 + 0.43 * column, 0.48 + 0.34 * row])
        position = random.uniform(low, low + np.array([0.1, 0.23, 0.18]))
        pitch, heading = random.uniform(-0.3, 0.3), random.uniform(-0.3, 0.3)
        approach = np.array([np.cos(heading) * np.cos(pitch), np.sin(heading), -np.sin(pitch)])
        pose = _tool_pose(position, approach / np.linalg.norm(approach), random.uniform(-np.pi, np.pi))
        return _reach(ORIGIN, pose, random)

    def draw(random: np.random.Generator) -> MotionQuery | None:
        first, second = random.permutation(6)[:2].tolist()
        start, goal = inside(random, first // 2, first % 2), inside(random, second // 2, second % 2)
        return None if start is None or goal is None else MotionQuery(ORIGIN, start, goal)

    return _set(plates_world({"shelf": plates}), draw)


def drawer_set() -> QuerySet:
    """A drawer of 0.36 x 0.4 m, pulled out of a cabinet; from beside or above it down into it."""
    drawer: list[Plate] = [
        ((0.55, 0.0, 0.5), (0.36, 0.4, 0.02)),
        ((0.37, 0.0, 0.6), (0.02, 0.4, 0.2)),
        ((0.73, 0.0, 0.6), (0.02, 0.4, 0.2)),
        ((0.55, 0.2, 0.6), (0.36, 0.02, 0.2)),
        ((0.55, -0.2, 0.6), (0.36, 0.02, 0.2)),
    ]
    cabinet: list[Plate] = [((0.9, 0.0, 0.45), (0.3, 0.6, 0.9))]

    def draw(random: np.random.Generator) -> MotionQuery | None:
        position = random.uniform([0.46, -0.1, 0.56], [0.64, 0.1, 0.62])
        approach = np.array([random.uniform(-0.2, 0.2), random.uniform(-0.2, 0.2), -1.0])
        pose = _tool_pose(position, approach / np.linalg.norm(approach), random.uniform(-np.pi, np.pi))
        goal = _reach(ORIGIN, pose, random)
        start = random_starts(CHAIN, 1, random)[0]
        return None if goal is None else MotionQuery(ORIGIN, start, goal)

    return _set(plates_world({"drawer": drawer, "cabinet": cabinet}), draw)


def room_set(scene: Path) -> QuerySet:
    """An interactive scene; from the folded arm at a random base to 0.1 m before a grasp of a movable item."""
    world = load_scene(scene)
    items = sorted(name for name, body in world.bodies.items() if body.record.movable)
    room = tuple(np.array([world.bounds(name)[end][:2] for name in world.bodies]) for end in (0, 1))
    low, high = room[0].min(axis=0), room[1].max(axis=0)
    surfaces = {
        name: surface_points(
            [mesh for meshes in link_shapes(world.bodies[name].text).values() for mesh in meshes],
            3000,
            np.random.default_rng(0),
        )
        for name in items
    }

    def draw(random: np.random.Generator) -> MotionQuery | None:
        item = items[int(random.integers(len(items)))]
        pose = world.pose(item)
        grasps = sample_grasps(*surfaces[item], pose, opening=PANDA.opening + 0.02, random=random)
        bases = sample_bases(pose[:3, 3], (low, high), 4, random)
        if not grasps or not len(bases):
            return None
        before = pose @ grasps[0].body_from_tool
        before[:3, 3] -= 0.1 * before[:3, 2]
        goal = _reach(bases[0], before, random)
        return None if goal is None else MotionQuery(bases[0], PANDA.carry, goal)

    return _set(world, draw)
