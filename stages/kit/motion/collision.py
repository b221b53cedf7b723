"""Collision checks of a mobile arm, and of what it carries, with the bodies of a pybullet world.

Two checkers of one meaning: pybullet's on the meshes, and a compiled one that says free only where the first does.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from copy import copy
from dataclasses import dataclass

import numpy as np
from scenewright.stages.kit.acting.query import NOTHING, CollisionQuery
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


@dataclass
class _Shared:
    """What a checker and its copies under queries share."""

    clearance: float
    checks: int = 0
    carried: str | None = None
    """The body that Bullet sees as carried."""


class CollisionChecker:
    """Asks whether configurations (3 + J,) of base and arm are free.

    `clearance` [m] is kept to everything, itself excepted. `under` a query it says what is free with something in the
    hand, or where something may be touched. No check moves what is believed of the scene.
    """

    def __init__(self, world: PhysicsWorld, robot: Robot, clearance: float = 0.004) -> None:
        self.world = world
        self.robot = robot
        self.query = NOTHING
        self.compiled = CompiledModel(world, robot, clearance)
        self._shared = _Shared(clearance)
        self._touching = frozenset({robot.hand, *robot.fingers})
        for name in world.bodies:
            self.add_body(name)
        for index in (-1, *robot.links.values()):
            self._group(robot.body_id, index, _ROBOT, _SCENE | _ROBOT | _CARRIED)

    def under(self, query: CollisionQuery) -> CollisionChecker:
        """Return this checker as it answers under a query: the same world, robot and counts."""
        bound = copy(self)
        bound.query = query
        return bound

    @property
    def clearance(self) -> float:
        """What is kept to everything [m]."""
        return self._shared.clearance

    @property
    def checks(self) -> int:
        """Checks of the meshes so far."""
        return self._shared.checks

    def _group(self, body_id: int, link: int, group: int, mask: int) -> None:
        engine.setCollisionFilterGroupMask(body_id, link, group, mask, physicsClientId=self.world.client)

    def _group_body(self, name: str, group: int, mask: int) -> None:
        body = self.world.bodies[name]
        for index in body.links.values():
            self._group(body.body_id, index, group, mask)

    def add_body(self, name: str) -> None:
        """Make a scene body an obstacle (those in the world at construction are). Floors do not stop the pedestal."""
        body = self.world.bodies[name]
        self._group_body(name, _SCENE, _ROBOT | _CARRIED)
        if self._shared.carried == name:
            self._shared.carried = None
        for index in body.links.values():
            if body.record.class_name == "floor":
                engine.setCollisionFilterPair(
                    self.robot.body_id,
                    body.body_id,
                    self.robot.links[PEDESTAL_LINK],
                    index,
                    0,
                    physicsClientId=self.world.client,
                )

    def _carry(self, name: str | None) -> None:
        """Let Bullet see a body as carried, and what was carried before as an obstacle again."""
        before = self._shared.carried
        if name == before:
            return
        if before is not None and before in self.world.bodies:
            self._group_body(before, _SCENE, _ROBOT | _CARRIED)
        if name is not None:
            self._group_body(name, _CARRIED, _SCENE | _ROBOT)
        self._shared.carried = name

    def overlaps(self, name: str) -> dict[str, float]:
        """Return the links that touch a scene body where it is now, with the deepest penetration [m] of each.

        The robot and scene bodies do not count; clearances up to that of the checker do.
        """
        body = self.world.bodies[name]
        self._carry(None)
        self._group_body(name, _CARRIED, _SCENE)
        engine.performCollisionDetection(physicsClientId=self.world.client)
        depths: dict[str, float] = {}
        for contact in self.world.contacts(body.body_id):
            if contact.other_body not in (body.body_id, self.robot.body_id) and contact.depth > -self.clearance:
                other_link = self.world.link_name(contact.other_body, contact.other_link)
                depths[other_link] = max(contact.depth, depths.get(other_link, -np.inf))
        self._group_body(name, _SCENE, _ROBOT | _CARRIED)
        return depths

    @contextmanager
    def keeping(self, clearance: float) -> Iterator[None]:
        """Keep another clearance [m] meanwhile."""
        before, self._shared.clearance = self.clearance, clearance
        self.compiled.keep(clearance)
        try:
            yield
        finally:
            self._shared.clearance = before
            self.compiled.keep(before)

    # --- queries ----------------------------------------------------------------------------------------------

    def arrays(self) -> tuple[RobotArrays, SceneArrays]:
        """Return what the compiled checks read, as the world, the hand and the query are now."""
        self.compiled.update(self.query)
        return self.compiled.arm, self.compiled.scene

    def other_name(self, index: int) -> str:
        """Return the scene link or robot link behind what a compiled check says the collision is with."""
        return self.compiled.other_name(index, self.query.carried)

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
        self._shared.checks += 1
        self.robot.set_body(body)
        carried = self.query.carried
        self._carry(carried)
        if carried is None:
            return self._worst_contact()
        with self.world.posed(carried, self.robot.tool_pose() @ self.query.tool_from_carried):
            return self._worst_contact()

    def _worst_contact(self) -> Collision | None:
        engine.performCollisionDetection(physicsClientId=self.world.client)
        collisions = [self._of_robot(contact) for contact in self.world.contacts(self.robot.body_id)]
        if self.query.carried is not None:
            carried = self.world.bodies[self.query.carried].body_id
            collisions += [self._of_carried(contact) for contact in self.world.contacts(carried)]
        return max((entry for entry in collisions if entry is not None), key=lambda entry: entry.depth, default=None)

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
            name = self.query.carried
            carried = name is not None and contact.other_body == self.world.bodies[name].body_id
            if carried or other_link in self.query.may_touch:
                return None
        return Collision(own_link, other_link, contact.depth)

    def _of_carried(self, contact: Contact) -> Collision | None:
        if contact.other_body == self.robot.body_id:
            return None  # seen from the robot's side
        if contact.depth <= -self.clearance:
            return None
        other_link = self.world.link_name(contact.other_body, contact.other_link)
        if contact.depth < self.query.rests_on.get(other_link, -np.inf):
            return None
        return Collision(self.query.carried or "", other_link, contact.depth)


def tool_from_body(world_from_tool: np.ndarray, world_from_body: np.ndarray) -> np.ndarray:
    """Return tool_from_body (4, 4) of a grasp."""
    return inverse(world_from_tool) @ world_from_body
