"""Mesh collision checks of the bolted-down arm with upright blocks, in pybullet: where closed forms do not decide."""

from __future__ import annotations

import numpy as np
from scenewright.schemas.packing import TABLE_TOP
from scenewright.stages.kit.motion.collision import Collision
from scenewright.stages.kit.simulation.bodies import box_body, links_and_joints
from scenewright.stages.kit.simulation.engine import engine, native_output_to_stderr
from scenewright.stages.pack.arm import FixedArm
from scenewright.stages.pack.hand import Named
from scenewright.stages.pack.solids import Block
from scenewright.stages.pack.solved_arm import SolvedArm

TOUCH = 1e-4
"""Penetration that counts as touching [m]: what is held may slide along what it stands beside."""


class ArmScene:
    """The arm, the table and blocks. Blocks stand; one of them may be held. Close it after use."""

    def __init__(self, arm: FixedArm | SolvedArm) -> None:
        self.client = engine.connect(engine.DIRECT)
        description = arm.description
        with native_output_to_stderr():
            self._robot = engine.loadURDF(
                str(description.urdf),
                useFixedBase=True,
                physicsClientId=self.client,
                flags=engine.URDF_USE_SELF_COLLISION | engine.URDF_USE_INERTIA_FROM_FILE,
            )
        links, names = links_and_joints(self._robot, self.client)
        self._links = {-1: description.arm_base} | {index: name for name, index in links.items()}
        self._joints = [names[name] for name in description.arm_joints]
        for name in description.finger_joints:
            engine.resetJointState(self._robot, names[name], description.opening / 2, physicsClientId=self.client)
        self._choose_self_collisions(names, description.arm_joints)
        self._bodies: list[tuple[int, str]] = []
        self._held: tuple[int, np.ndarray] | None = None
        self._tool = next(index for index, name in self._links.items() if name == description.tool_link)
        self._table = box_body(self.client, (1.5, 1.5, 0.005), (0.0, 0.0, TABLE_TOP - 0.005))
        for link in (-1, self._joints[0]):  # what turns about the vertical in its place
            engine.setCollisionFilterPair(self._robot, self._table, link, -1, 0, physicsClientId=self.client)

    def close(self) -> None:
        """Disconnect; the scene cannot be used afterwards."""
        engine.disconnect(physicsClientId=self.client)

    def _choose_self_collisions(self, joints: dict[str, int], arm_joints: tuple[str, ...]) -> None:
        """Switch off pairs that are near along the chain, and those of the wrist: their meshes overlap by design."""
        order = [-1, *(joints[name] for name in arm_joints)]
        rank = {index: rank_of_link for rank_of_link, index in enumerate(order)}
        for first in self._links:
            for second in self._links:
                last = len(arm_joints)
                a, b = rank.get(first, last), rank.get(second, last)
                if first < second and (abs(a - b) <= 2 or min(a, b) >= last - 2):
                    engine.setCollisionFilterPair(
                        self._robot, self._robot, first, second, 0, physicsClientId=self.client
                    )

    def _stand(self, block: Block) -> int:
        half = (block.half_width, block.half_length, (block.top - block.bottom) / 2)
        return box_body(self.client, half, (block.x, block.y, (block.top + block.bottom) / 2), yaw=block.yaw)

    def arrange(self, others: tuple[Named, ...], held: tuple[str, Block, float] | None) -> None:
        """Put blocks into the scene in place of those of the last time.

        `held`: its name, a block whose extents count, and how far the tool is above its centre [m].
        """
        for body, _ in self._bodies:
            engine.removeBody(body, physicsClientId=self.client)
        self._bodies = [(self._stand(solid.block), solid.name) for solid in others]
        self._held = None
        if held is not None:
            name, block, above = held
            body = self._stand(block)
            self._bodies.append((body, name))
            self._held = (body, np.array([0.0, 0.0, above]))

    def check(self, arm: np.ndarray) -> Collision | None:
        """Return the worst collision of joint values (J,), None when they are free."""
        client = self.client
        for index, value in zip(self._joints, arm.tolist(), strict=True):
            engine.resetJointState(self._robot, index, value, physicsClientId=client)
        bodies = [self._robot]
        if self._held is not None:
            body, offset = self._held
            state = engine.getLinkState(self._robot, self._tool, computeForwardKinematics=1, physicsClientId=client)
            position, turn = engine.multiplyTransforms(state[4], state[5], offset.tolist(), [0, 0, 0, 1])
            # The tool's z axis points down, the box's up.
            turn = engine.multiplyTransforms([0, 0, 0], turn, [0, 0, 0], [1, 0, 0, 0])[1]
            engine.resetBasePositionAndOrientation(body, position, turn, physicsClientId=client)
            bodies.append(body)
        engine.performCollisionDetection(physicsClientId=client)
        worst: Collision | None = None
        for own_body in bodies:
            for entry in engine.getContactPoints(bodyA=own_body, physicsClientId=client):
                collision = self._collision(own_body, entry)
                if collision is not None and (worst is None or collision.depth > worst.depth):
                    worst = collision
        return worst

    def _collision(self, own: int, entry: tuple) -> Collision | None:
        touched, depth = entry[2], -entry[8]
        held_body = self._held[0] if self._held is not None else None
        if depth <= TOUCH or {own, touched} == {self._robot, held_body}:
            return None
        names = dict(self._bodies) | {self._table: "table"}
        part = self._links[entry[3]] if own == self._robot else names[own]
        return Collision(part, self._links[entry[4]] if touched == self._robot else names[touched], depth)
