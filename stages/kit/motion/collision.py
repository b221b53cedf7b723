"""Collision checks of a mobile arm, and of what it carries, with the bodies of a pybullet world.

Two checkers of one meaning: pybullet's on the meshes, and a compiled one that says free only where the first does.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
from scenewright.stages.kit.geometry.transforms import inverse
from scenewright.stages.kit.motion.compiled_arrays import RobotArrays, SceneArrays
from scenewright.stages.kit.motion.compiled_check import FREE, find_collision
from scenewright.stages.kit.motion.compiled_model import CompiledModel
from scenewright.stages.kit.simulation.engine import engine
from scenewright.stages.kit.simulation.robot import Robot
from scenewright.stages.kit.simulation.robot_description import PEDESTAL_LINK
from scenewright.stages.kit.simulation.world import Contact, PhysicsWorld

_SCENE, _ROBOT, _CARRIED = 1, 2, 4
"""Bits of Bullet's collision groups."""
RESTING_DEPTH = 0.008
"""A carried item may sink this far into what it stands on: reconstructed surfaces are that uncertain."""


@dataclass(frozen=True)
class Collision:
    """The deepest of the contacts that are not allowed."""

    part: str
    """Link of the robot, or name of the carried body."""
    other: str
    """Link of a scene body (`fridge_2__door`), or of the robot itself."""
    depth: float
    """Penetration [m]; negative when only the clearance is missed."""


class CollisionChecker:
    """Asks whether configurations (3 + J,) of base and arm are free.

    `clearance` [m] is kept to everything, itself excepted. What may be touched is said by `allow`.
    """

    def __init__(self, world: PhysicsWorld, robot: Robot, clearance: float = 0.004) -> None:
        self.world = world
        self.robot = robot
        self.clearance = clearance
        self.checks = 0
        """Checks of the meshes so far."""
        self.compiled = CompiledModel(world, robot, clearance)
        self.carried: str | None = None
        self._tool_from_carried = np.eye(4)
        self._touchable: frozenset[str] = frozenset()
        self._rest_on: dict[str, float] = {}
        self._touching = frozenset({robot.hand, *robot.fingers})
        for name in world.bodies:
            self.add_body(name)
        for index in (-1, *robot.links.values()):
            self._group(robot.body_id, index, _ROBOT, _SCENE | _ROBOT | _CARRIED)

    def _group(self, body_id: int, link: int, group: int, mask: int) -> None:
        engine.setCollisionFilterGroupMask(body_id, link, group, mask, physicsClientId=self.world.client)

    def add_body(self, name: str) -> None:
        """Make a scene body an obstacle (those in the world at construction are). Floors do not stop the pedestal."""
        body = self.world.bodies[name]
        for index in body.links.values():
            self._group(body.body_id, index, _SCENE, _ROBOT | _CARRIED)
            if body.record.class_name == "floor":
                engine.setCollisionFilterPair(
                    self.robot.body_id,
                    body.body_id,
                    self.robot.links[PEDESTAL_LINK],
                    index,
                    0,
                    physicsClientId=self.world.client,
                )

    # --- what is carried, what may be touched -----------------------------------------------------------------

    def carry(self, name: str, tool_from_body: np.ndarray) -> None:
        """From now on the body moves with the tool: world_from_body = world_from_tool @ tool_from_body (4, 4)."""
        self.put_down()
        self.carried, self._tool_from_carried = name, tool_from_body
        body = self.world.bodies[name]
        for index in body.links.values():
            self._group(body.body_id, index, _CARRIED, _SCENE | _ROBOT)

    def put_down(self, world_from_body: np.ndarray | None = None) -> None:
        """The carried body (if any) becomes an obstacle again, at a pose (4, 4) or where it is."""
        if self.carried is None:
            return
        if world_from_body is not None:
            self.world.set_pose(self.carried, world_from_body)
        body = self.world.bodies[self.carried]
        for index in body.links.values():
            self._group(body.body_id, index, _SCENE, _ROBOT | _CARRIED)
        self.carried = None

    def allow(self, touch: Iterable[str] = (), rest_on: Mapping[str, float] | None = None) -> None:
        """Say which links (by name) hand and fingers may touch, and how deep [m] the carried body may be in which."""
        self._touchable, self._rest_on = frozenset(touch), dict(rest_on or {})

    def overlaps(self, name: str) -> dict[str, float]:
        """Return the links that touch a scene body where it is now, with the deepest penetration [m] of each.

        The robot and scene bodies do not count; clearances up to that of the checker do.
        """
        body = self.world.bodies[name]
        for index in body.links.values():
            self._group(body.body_id, index, _CARRIED, _SCENE)
        engine.performCollisionDetection(physicsClientId=self.world.client)
        depths: dict[str, float] = {}
        for contact in self.world.contacts(body.body_id):
            if contact.other_body not in (body.body_id, self.robot.body_id) and contact.depth > -self.clearance:
                other_link = self.world.link_name(contact.other_body, contact.other_link)
                depths[other_link] = max(contact.depth, depths.get(other_link, -np.inf))
        for index in body.links.values():
            self._group(body.body_id, index, _SCENE, _ROBOT | _CARRIED)
        return depths

    @contextmanager
    def keeping(self, clearance: float) -> Iterator[None]:
        """Keep another clearance [m] meanwhile."""
        before, self.clearance = self.clearance, clearance
        self.compiled.keep(clearance)
        try:
            yield
        finally:
            self.clearance = before
            self.compiled.keep(before)

    # --- queries ----------------------------------------------------------------------------------------------

    def arrays(self) -> tuple[RobotArrays, SceneArrays]:
        """Return what the compiled checks read, as the world, the hand and the allowed touches are now."""
        self.compiled.update(self.carried, self._tool_from_carried, self._touchable, self._rest_on)
        return self.compiled.arm, self.compiled.scene

    def other_name(self, index: int) -> str:
        """Return the scene link or robot link behind what a compiled check says the collision is with."""
        return self.compiled.other_name(index, self.carried)

    def check(self, body: np.ndarray) -> Collision | None:
        """Return the worst collision of a configuration (3 + J,), or None when it is free.

        The compiled check answers where it can; whatever it refuses is for the meshes to decide.
        """
        robot, scene = self.arrays()
        if find_collision(robot, scene, np.ascontiguousarray(body, dtype=float), 0)[0] == FREE:
            return None
        return self.check_meshes(body)

    def check_meshes(self, body: np.ndarray) -> Collision | None:
        """Return the worst collision of a configuration (3 + J,) by the meshes alone, or None when it is free."""
        self.checks += 1
        self.robot.set_body(body)
        if self.carried is not None:
            self.world.set_pose(self.carried, self.robot.tool_pose() @ self._tool_from_carried)
        engine.performCollisionDetection(physicsClientId=self.world.client)
        worst: Collision | None = None
        for contact in self.world.contacts(self.robot.body_id):
            collision = self._of_robot(contact)
            if collision is not None and (worst is None or collision.depth > worst.depth):
                worst = collision
        if self.carried is not None:
            for contact in self.world.contacts(self.world.bodies[self.carried].body_id):
                collision = self._of_carried(contact)
                if collision is not None and (worst is None or collision.depth > worst.depth):
                    worst = collision
        return worst

    def _of_robot(self, contact: Contact) -> Collision | None:
        own_link = self.robot.link_names.get(contact.own_link, "anchor")
        if contact.other_body == self.robot.body_id:
            if contact.depth <= 0:
                return None
            return Collision(own_link, self.robot.link_names.get(contact.other_link, "anchor"), contact.depth)
        if contact.depth <= -self.clearance:
            return None
        other_link = self.world.link_name(contact.other_body, contact.other_link)
        if contact.own_link in self._touching:
            carried = self.carried is not None and contact.other_body == self.world.bodies[self.carried].body_id
            if carried or other_link in self._touchable:
                return None
        return Collision(own_link, other_link, contact.depth)

    def _of_carried(self, contact: Contact) -> Collision | None:
        if contact.other_body == self.robot.body_id:
            return None  # seen from the robot's side
        if contact.depth <= -self.clearance:
            return None
        other_link = self.world.link_name(contact.other_body, contact.other_link)
        if contact.depth < self._rest_on.get(other_link, -np.inf):
            return None
        return Collision(self.carried or "", other_link, contact.depth)


def tool_from_body(world_from_tool: np.ndarray, world_from_body: np.ndarray) -> np.ndarray:
    """Return tool_from_body (4, 4) of a grasp."""
    return inverse(world_from_tool) @ world_from_body
