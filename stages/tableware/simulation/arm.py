"""An arm with its hand in a physics world: trajectories with contact, and quick ones above everything without.

Tool poses are world_from_tool (4, 4): origin between the fingertips, z out of the hand, y along which the fingers
close. An arm built like the UR5 keeps to one branch of its kinematics (elbow up, hand down), in which it reaches the
whole table and the bin from where it stands; any other takes the answer that moves its joints least.
"""

from __future__ import annotations

from math import asin, atan2, hypot, pi

import numpy as np
from scenewright.stages.kit.motion.cartesian import follow, straight_poses
from scenewright.stages.kit.motion.failures import MotionFailed
from scenewright.stages.kit.motion.kinematics import ArmChain, arm_chain, forward, inverse_kinematics, random_starts
from scenewright.stages.kit.motion.timing import sample_times, time_path
from scenewright.stages.kit.simulation.bodies import couple_fingers, links_and_joints
from scenewright.stages.kit.simulation.engine import engine
from scenewright.stages.kit.simulation.robot_description import RobotDescription
from scenewright.stages.kit.simulation.urdf_split import read_urdf, with_absolute_meshes, without_visuals
from scenewright.stages.kit.simulation.world import PhysicsWorld
from scipy.spatial.transform import Rotation

BASE = np.array([0.0, -0.46, 0.15])
"""Place of the arm [m], higher than the table top: else the upper arm sweeps dishes off it when it reaches far."""
PAD_FRICTION, BACK_FRICTION = 1.6, 0.3
"""Friction of rubber pads, and of the bare metal that pushes a dish from inside; Bullet multiplies the two of a
contact. By eye."""
PAD_STIFFNESS, PAD_DAMPING = 4.0e4, 2.0e2
"""Give of the rubber [N/m, N s/m]: 2.5 MPa over a patch of 22 by 3 mm, 4 mm thick. Rigid pads would hold one of two
utensils that lie on each other, the one wider by a tenth of a millimetre."""
CLOSING_SPEED = 0.06
"""Speed of each finger [m/s]."""
PAUSE = 0.15
"""Wait before and after each movement of the fingers [s]; by eye."""
STEP = 0.02
"""Distance between two poses of the tool on a straight way [m]; by eye."""
ROOM_TO_TURN = pi
"""The last joint turns two half turns either way from its middle; an empty hand begins within one of them [rad]."""
STARTS = 12
"""Random starts of inverse kinematics for an arm of another build."""
ARM = "ur5_bench"
"""The arm of the thesis."""


class Arm:
    """Moves; counts its time in `seconds`."""

    def __init__(self, world: PhysicsWorld, robot: RobotDescription) -> None:
        self.world = world
        self.description = robot
        self.chain = arm_chain(robot)
        self._aside = plane_offset(self.chain)
        self._random_starts = random_starts(self.chain, STARTS, np.random.default_rng(7))
        self.seconds = 0.0
        urdf = self.description.urdf
        text = without_visuals(with_absolute_meshes(read_urdf(urdf), urdf.parent))
        self.body_id = world.load_urdf_text(text, fixed=True)
        client = world.client
        # pybullet's base pose is that of the centre of mass, not of the link frame.
        center = BASE + np.array(engine.getDynamicsInfo(self.body_id, -1, physicsClientId=client)[3])
        engine.resetBasePositionAndOrientation(self.body_id, center.tolist(), [0, 0, 0, 1], physicsClientId=client)
        _, joints = links_and_joints(self.body_id, client)
        self.joints = [joints[name] for name in self.description.arm_joints]
        self.fingers = [joints[name] for name in self.description.finger_joints]
        for index in self.fingers:
            engine.changeDynamics(
                self.body_id, index, contactStiffness=PAD_STIFFNESS, contactDamping=PAD_DAMPING, physicsClientId=client
            )
        self.touch_with(PAD_FRICTION)
        couple_fingers(self.body_id, self.fingers, client)
        self.opening = self.description.opening
        self.target = self.description.carry.copy()
        self.put(self.target)
        self._set_fingers(self.opening)

    # --- state ------------------------------------------------------------------------------------------------

    def values(self) -> np.ndarray:
        """Return the arm's joint values (J,)."""
        states = engine.getJointStates(self.body_id, self.joints, physicsClientId=self.world.client)
        return np.array([state[0] for state in states])

    def finger_gap(self) -> float:
        """Return the distance between the fingers [m]."""
        states = engine.getJointStates(self.body_id, self.fingers, physicsClientId=self.world.client)
        return float(sum(state[0] for state in states))

    def tool_pose(self) -> np.ndarray:
        """Return world_from_tool (4, 4)."""
        return self.pose_of(self.values())

    def pose_of(self, arm: np.ndarray) -> np.ndarray:
        """Return world_from_tool (4, 4) of joint values (J,)."""
        pose = forward(self.chain, arm)
        pose[:3, 3] += BASE
        return pose

    def put(self, arm: np.ndarray) -> None:
        """Set the joints, at rest."""
        for index, value in zip(self.joints, arm, strict=True):
            engine.resetJointState(self.body_id, index, float(value), physicsClientId=self.world.client)
        self.target = np.array(arm, dtype=float)
        self._command(self.target, np.zeros(len(self.joints)))

    def _set_fingers(self, opening: float) -> None:
        for index in self.fingers:
            engine.resetJointState(self.body_id, index, opening / 2, physicsClientId=self.world.client)
        self.hold_open(opening)

    # --- kinematics -------------------------------------------------------------------------------------------

    def solve(self, pose: np.ndarray, *, held: bool = False) -> np.ndarray | None:
        """Return joint values (J,) for a tool pose, None where it is not reached. With nothing held the one turned by
        half a turn will do as well, as the fingers are alike: the answer that moves the joints least is taken, of those
        that leave the last joint room for half a turn either way."""
        present_joints = self.target
        solutions = []
        for half_turn in (False,) if held else (False, True):
            wrist_pose = pose.copy()
            if half_turn:
                wrist_pose[:3, :2] *= -1.0
            wrist_pose[:3, 3] -= BASE
            solution = self._answer(wrist_pose)
            if solution is not None:
                for turns in (-2 * pi, 0.0, 2 * pi):
                    arm = solution.copy()
                    arm[-1] += turns
                    if self.chain.lower[-1] <= arm[-1] <= self.chain.upper[-1]:
                        solutions.append(arm)
        if not solutions:
            return None
        return min(
            solutions,
            key=lambda arm: (not held and abs(arm[-1]) > ROOM_TO_TURN, float(np.abs(arm - present_joints).max())),
        )

    def _answer(self, pose: np.ndarray) -> np.ndarray | None:
        """Return joint values (J,) for a tool pose in the arm's frame, None where there are none."""
        if self._aside is None:
            here = inverse_kinematics(self.chain, pose, self.target[None])
            if here.found:
                return here.arm
            starts = np.concatenate([self.description.carry[None], self._random_starts])
            answers = (inverse_kinematics(self.chain, pose, start[None]) for start in starts)
            return min(
                (answer.arm for answer in answers if answer.found),
                key=lambda arm: float(np.abs(arm - self.target).max()),
                default=None,
            )
        radius = hypot(pose[0, 3], pose[1, 3])
        if radius < self._aside:
            return None
        first = atan2(pose[1, 3], pose[0, 3]) - pi - asin(self._aside / radius)
        first = first + 2 * pi * round((self.description.carry[0] - first) / (2 * pi))
        starts = np.array([[first, -1.4, 1.6, -1.77, -pi / 2, last] for last in (self.target[5], 0.0, 2.0, 4.0)])
        solution = inverse_kinematics(self.chain, pose, starts)
        return solution.arm if solution.found and solution.arm[2] > 0.0 else None

    # --- motion -----------------------------------------------------------------------------------------------

    def move_line(self, end: np.ndarray, speed: float) -> None:
        """Lead the tool along a straight line to a pose at `speed` [m/s]. Raises MotionFailed."""
        self.move_through([end], speed)

    def move_through(self, ends: list[np.ndarray], speed: float) -> None:
        """Lead the tool along straight lines through poses, slower where joints cannot follow. Raises MotionFailed."""
        try:
            path, length = self._path(ends, STEP)
        except MotionFailed:  # near a singular pose the joints turn far within a step
            path, length = self._path(ends, STEP / 5.0)
        if length < 1e-5:
            return
        times, points = time_path(path, *self._limits(1.0))
        if times[-1] <= 0.0:  # so short a way that the joints' values do not change
            return
        times = times * max(1.0, length / speed / float(times[-1]))
        self._follow(times, points)

    def _path(self, ends: list[np.ndarray], step: float) -> tuple[np.ndarray, float]:
        """Return joint values (K, J) along straight lines through poses, a pose each `step` [m], and their length [m].
        Raises MotionFailed."""
        poses, start, length = [], self.pose_of(self.target), 0.0
        for end in ends:
            if end[:3, 1] @ start[:3, 1] < 0.0:
                end = end.copy()
                end[:3, :2] *= -1.0
            poses.extend(straight_poses(start, end, step=step))
            length += float(np.linalg.norm(end[:3, 3] - start[:3, 3]))
            start = end
        in_base = []
        for pose in poses:
            pose = pose.copy()
            pose[:3, 3] -= BASE
            in_base.append(pose)
        return np.vstack([self.target, follow(self.chain, in_base, self.target)]), length

    def move_joints(self, end: np.ndarray, share: float) -> None:
        """Move all joints to `end` (J,) at a share of the arm's speed and acceleration, with physics."""
        times, points = time_path(np.array([self.target, end]), *self._limits(share))
        self._follow(times, points)

    def jump(self, end: np.ndarray) -> None:
        """Move the empty hand above everything to `end` (J,): nothing is met, so that only the time is counted."""
        times, _ = time_path(np.array([self.target, end]), *self._limits(1.0))
        self.seconds += float(times[-1])
        self.put(end)

    def lowest(self, end: np.ndarray) -> float:
        """Return the least height [m] of the tool on the way to `end` (J,) in joint space."""
        shares = np.linspace(0.0, 1.0, 12)[:, None]
        return min(float(self.pose_of(row)[2, 3]) for row in self.target + shares * (end - self.target))

    def wait(self, seconds: float) -> None:
        """Hold still for a time [s]."""
        count = max(1, round(seconds / self.world.time_step))
        self._command(self.target, np.zeros(len(self.joints)))
        self.world.step(count)
        self.seconds += count * self.world.time_step

    # --- hand -------------------------------------------------------------------------------------------------

    def touch_with(self, friction: float) -> None:
        """Set the friction of the fingers: of their pads, or of their bare backs."""
        for index in self.fingers:
            engine.changeDynamics(
                self.body_id, index, lateralFriction=friction, spinningFriction=0.0, physicsClientId=self.world.client
            )

    def open_to(self, opening: float) -> None:
        """Open or close the fingers to a distance [m], and wait until they are there."""
        change = abs(opening - self.finger_gap())
        self.hold_open(opening)
        self.wait(PAUSE + change / 2 / CLOSING_SPEED)

    def hold_open(self, opening: float) -> None:
        """Set the fingers' target distance [m]."""
        self.opening = opening
        for index in self.fingers:
            engine.setJointMotorControl2(
                self.body_id,
                index,
                engine.POSITION_CONTROL,
                targetPosition=opening / 2,
                force=200.0,
                maxVelocity=1.5 * CLOSING_SPEED,
                positionGain=0.3,
                velocityGain=1.0,
                physicsClientId=self.world.client,
            )

    def close(self, force: float) -> None:
        """Close the fingers with a force [N] each until they stand still; they go on pressing."""
        for index in self.fingers:
            engine.setJointMotorControl2(
                self.body_id,
                index,
                engine.VELOCITY_CONTROL,
                targetVelocity=-CLOSING_SPEED,
                force=force,
                physicsClientId=self.world.client,
            )
        still, before = 0, self.finger_gap()
        for _ in range(60):
            self.wait(5 * self.world.time_step)
            now = self.finger_gap()
            still = still + 1 if abs(now - before) < 2e-4 else 0
            before = now
            if still >= 3:
                break
        self.wait(PAUSE)

    # --- inside -----------------------------------------------------------------------------------------------

    def _limits(self, share: float) -> tuple[np.ndarray, np.ndarray]:
        count, robot = len(self.joints), self.description
        return np.full(count, robot.arm_speed * share), np.full(count, robot.arm_acceleration * share)

    def _follow(self, times: np.ndarray, points: np.ndarray) -> None:
        if len(times) < 2:
            return
        step = self.world.time_step
        before = self.target
        for row in sample_times(times, points, step):
            self._command(row, (row - before) / step)
            before = row
            self.world.step()
            self.seconds += step
        self.target = points[-1].copy()

    def _command(self, arm: np.ndarray, velocity: np.ndarray) -> None:
        engine.setJointMotorControlArray(
            self.body_id,
            self.joints,
            engine.POSITION_CONTROL,
            targetPositions=arm.tolist(),
            targetVelocities=velocity.tolist(),
            positionGains=[0.3] * len(self.joints),
            velocityGains=[1.0] * len(self.joints),
            forces=self.description.arm_forces.tolist(),
            physicsClientId=self.world.client,
        )


def plane_offset(chain: ArmChain) -> float | None:
    """Return how far the arm's plane is from its first joint's axis [m], for an arm built like the UR5 (joints 2 to
    4 parallel, the last three with offsets); None for another build."""
    if len(chain.fixed) != 6:
        return None
    turns = [Rotation.from_matrix(fixed[:3, :3]).as_rotvec() for fixed in chain.fixed]
    quarter = pi / 2
    expected = [[0.0] * 3, [quarter, 0.0, 0.0], [0.0] * 3, [0.0] * 3, [quarter, 0.0, 0.0], [-quarter, 0.0, 0.0]]
    alike = np.abs(np.array(turns) - expected).max() < 1e-6 and chain.fixed[2, 0, 3] < 0.0
    return float(chain.fixed[4, 2, 3]) if alike else None


__all__ = ["BASE", "Arm", "MotionFailed"]
