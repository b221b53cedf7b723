"""The robot in a physics world: configuration, motors, gripper, grasps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scenewright.stages.kit.geometry.transforms import (
    inverse,
    quaternion_of,
    transform_from_quaternion,
    transform_from_yaw,
)
from scenewright.stages.kit.simulation.bodies import couple_fingers, links_and_joints
from scenewright.stages.kit.simulation.engine import engine
from scenewright.stages.kit.simulation.robot_description import (
    BASE_JOINTS,
    PEDESTAL_LINK,
    RobotDescription,
    mobile_robot_urdf,
)
from scenewright.stages.kit.simulation.world import Contact, PhysicsWorld

FINGER_FRICTION = 1.2
"""Lateral friction coefficient of rubber finger pads. By eye."""
BASE_FORCE = 50000.0
"""Largest force of the base's two sliding joints [N] and torque of its turning one [Nm]: a base that nothing stops."""


@dataclass(frozen=True)
class Configuration:
    """Where all joints of the robot stand."""

    base: np.ndarray
    """(3,) x [m], y [m], yaw [rad]."""
    arm: np.ndarray
    """(J,) [rad]."""
    opening: float
    """Distance between the fingers [m]."""

    @property
    def body(self) -> np.ndarray:
        """Base and arm as one vector (3 + J,)."""
        return np.concatenate([self.base, self.arm])


class Robot:
    """A mobile arm loaded into a world. Kinematic use: `set`; physical use: `command`, then step the world."""

    def __init__(self, world: PhysicsWorld, description: RobotDescription) -> None:
        self.world = world
        self.description = description
        flags = engine.URDF_USE_SELF_COLLISION  # pairs are chosen below
        self.body_id = world.load_urdf_text(mobile_robot_urdf(description), fixed=True, flags=flags)
        client = world.client
        self.links, self.joints = links_and_joints(self.body_id, client)
        self.link_names = {index: name for name, index in self.links.items()}
        arm_links = [self.link_names[self.joints[name]] for name in description.arm_joints]
        self.chain = [PEDESTAL_LINK, description.arm_base, *arm_links]
        """Names of the links from the pedestal to the last that an arm joint moves."""
        self.body_joints = [self.joints[name] for name in (*BASE_JOINTS, *description.arm_joints)]
        self.finger_joints = [self.joints[name] for name in description.finger_joints]
        self.fingers = tuple(self.links[name] for name in description.finger_links)
        self.hand = self.links[description.hand_link]
        self.tool = self.links[description.tool_link]
        self.grip: int | None = None
        self.finger_force = description.finger_force
        for finger in self.fingers:
            engine.changeDynamics(
                self.body_id, finger, lateralFriction=FINGER_FRICTION, spinningFriction=0.02, physicsClientId=client
            )
        if description.coupled_fingers:
            couple_fingers(self.body_id, self.finger_joints, client)
        self._choose_self_collisions()

    def _choose_self_collisions(self) -> None:
        """Switch off pairs of links that are near each other along the chain: their shapes overlap by design."""
        names = list(self.links)
        for number, first in enumerate(names):
            for second in names[number + 1 :]:
                if self.always_near(first, second):
                    engine.setCollisionFilterPair(
                        self.body_id,
                        self.body_id,
                        self.links[first],
                        self.links[second],
                        0,
                        physicsClientId=self.world.client,
                    )

    def always_near(self, first: str, second: str) -> bool:
        """Whether two links, by name, are too near each other along the chain to be checked."""
        hand = {self.description.hand_link, *self.description.finger_links}
        place = {name: position for position, name in enumerate(self.chain)} | dict.fromkeys(hand, len(self.chain))
        near = abs(place.get(first, -99) - place.get(second, 99)) <= 2
        return near or {first, second} <= set(self.chain[-3:]) | hand

    # --- kinematic --------------------------------------------------------------------------------------------

    def set(self, configuration: Configuration) -> None:
        """Put all joints at a configuration, at rest."""
        values = [*configuration.body, configuration.opening / 2, configuration.opening / 2]
        for index, value in zip([*self.body_joints, *self.finger_joints], values, strict=True):
            engine.resetJointState(self.body_id, index, float(value), physicsClientId=self.world.client)

    def set_body(self, body: np.ndarray) -> None:
        """Put base and arm (3 + J,) at values; the fingers stay."""
        values = [[value] for value in body.tolist()]
        engine.resetJointStatesMultiDof(self.body_id, self.body_joints, values, physicsClientId=self.world.client)

    def configuration(self) -> Configuration:
        """Return where the joints stand."""
        indices = [*self.body_joints, *self.finger_joints]
        states = engine.getJointStates(self.body_id, indices, physicsClientId=self.world.client)
        values = np.array([state[0] for state in states])
        return Configuration(values[:3], values[3:-2], float(values[-2] + values[-1]))

    def link_pose(self, index: int) -> np.ndarray:
        """Return world_from_link (4, 4)."""
        state = engine.getLinkState(self.body_id, index, computeForwardKinematics=1, physicsClientId=self.world.client)
        return transform_from_quaternion(np.array(state[5]), np.array(state[4]))

    def tool_pose(self) -> np.ndarray:
        """Return world_from_tool (4, 4): z out of the hand, y along which the fingers close."""
        return self.link_pose(self.tool)

    # --- physical ---------------------------------------------------------------------------------------------

    def command(self, body: np.ndarray, opening: float, velocity: np.ndarray | None = None) -> None:
        """Set position targets of base and arm (3 + J,) and of the fingers [m apart]; forces are limited."""
        client = self.world.client
        forces = np.concatenate([np.full(3, BASE_FORCE), self.description.arm_forces])
        engine.setJointMotorControlArray(
            self.body_id,
            self.body_joints,
            engine.POSITION_CONTROL,
            targetPositions=body.tolist(),
            targetVelocities=(np.zeros(len(body)) if velocity is None else velocity).tolist(),
            positionGains=[0.25] * len(body),
            velocityGains=[1.0] * len(body),
            forces=forces.tolist(),
            physicsClientId=client,
        )
        engine.setJointMotorControlArray(
            self.body_id,
            self.finger_joints,
            engine.POSITION_CONTROL,
            targetPositions=[opening / 2] * 2,
            forces=[self.finger_force] * 2,
            positionGains=[0.1] * 2,
            velocityGains=[1.0] * 2,
            physicsClientId=client,
        )

    def finger_contacts(self, name: str) -> dict[int, list[Contact]]:
        """Return the contacts of each finger with a scene body, as of the last step; only those that press."""
        other = self.world.bodies[name].body_id
        contacts = [contact for contact in self.world.contacts(self.body_id, other) if contact.force > 1e-3]
        return {finger: [contact for contact in contacts if contact.own_link == finger] for finger in self.fingers}

    def grasps(self, name: str) -> bool:
        """Whether both fingers press on a body from opposite sides (a true two-finger contact)."""
        sides = []
        for entries in self.finger_contacts(name).values():
            if not entries:
                return False
            sides.append(np.sum([entry.normal * entry.force for entry in entries], axis=0))
        lengths = [float(np.linalg.norm(side)) for side in sides]
        return min(lengths) > 0 and float(sides[0] @ sides[1]) / (lengths[0] * lengths[1]) < -0.5

    def hold(self, name: str, force: float) -> None:
        """Stiffen an existing grasp: a fixed constraint hand-object of limited force [N] at their present poses.

        Raises ValueError when the fingers do not grasp the body; the constraint never replaces a grasp.
        """
        if not self.grasps(name):
            raise ValueError(f"the fingers do not grasp {name}")
        hand = engine.getLinkState(
            self.body_id, self.hand, computeForwardKinematics=1, physicsClientId=self.world.client
        )
        world_from_hand = transform_from_quaternion(np.array(hand[1]), np.array(hand[0]))
        body_id = self.world.bodies[name].body_id
        position, quaternion = engine.getBasePositionAndOrientation(body_id, physicsClientId=self.world.client)
        hand_from_object = inverse(world_from_hand) @ transform_from_quaternion(
            np.array(quaternion), np.array(position)
        )
        self.grip = engine.createConstraint(
            self.body_id,
            self.hand,
            body_id,
            -1,
            engine.JOINT_FIXED,
            [0, 0, 0],
            hand_from_object[:3, 3].tolist(),
            [0, 0, 0],
            quaternion_of(hand_from_object).tolist(),
            [0, 0, 0, 1],
            physicsClientId=self.world.client,
        )
        engine.changeConstraint(self.grip, maxForce=force, physicsClientId=self.world.client)

    def release(self) -> None:
        """Remove the constraint of `hold`; without one nothing happens."""
        if self.grip is not None:
            engine.removeConstraint(self.grip, physicsClientId=self.world.client)
            self.grip = None


def base_pose(base: np.ndarray, description: RobotDescription) -> np.ndarray:
    """Return world_from_armbase (4, 4) of a base (3,) x, y, yaw: the arm's mounting frame on the pedestal."""
    return transform_from_yaw(float(base[2]), np.array([base[0], base[1], description.pedestal_height]))
