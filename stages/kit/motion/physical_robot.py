"""Drive the robot along motions in a physics world: position control, a closing gripper, what it holds and hits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scenewright.stages.kit.geometry.transforms import inverse
from scenewright.stages.kit.motion.failures import MotionFailed
from scenewright.stages.kit.motion.recording import Recording
from scenewright.stages.kit.motion.segments import Segment
from scenewright.stages.kit.motion.timing import sample_times, time_path
from scenewright.stages.kit.simulation.engine import engine
from scenewright.stages.kit.simulation.robot import Configuration, Robot
from scenewright.stages.kit.simulation.robot_description import RobotDescription
from scenewright.stages.kit.simulation.world import PhysicsWorld

CONTROL_STEPS = 2
"""Physics steps per control step (120 Hz)."""
GRIP_SECONDS = 0.7
"""Time that the fingers get to close [s]; by eye."""
RELEASE_SECONDS = 0.6
"""Time that the fingers get to open [s]; by eye."""
SLIP = 0.06
"""An item that moved this far relative to the hand while it was carried is lost [m]."""


class PhysicalRobot:
    """A robot in the room where the plan is executed."""

    def __init__(
        self, world: PhysicsWorld, description: RobotDescription, start: Configuration, record_rate: float
    ) -> None:
        self.world = world
        self.description = description
        # a hand's fingers go together: with a motor each, what they hold slides between them by centimetres
        self.robot = Robot(world, replace(description, coupled_fingers=True))
        self.robot.set(start)
        self.recording = Recording(world, self.robot, 1.0 / record_rate)
        self.action = -1
        self.held: str | None = None
        self._tool_from_held = np.eye(4)
        self._target = start.body
        self._opening = start.opening
        self._trail: list[np.ndarray] = [start.body]
        self.bumps: dict[str, float] = {}
        """Bodies that something other than hand and fingers touched -> largest force [N]."""
        self._touched: dict[str, float] = {}
        """The same, since the last motion that failed."""

    def check_start(self) -> None:
        """Raises MotionFailed `start_in_collision` when the robot stands in a body of this room (floors aside)."""
        engine.performCollisionDetection(physicsClientId=self.world.client)
        for contact in self.world.contacts(self.robot.body_id):
            name = self.world.name_of(contact.other_body)
            if name is None or self.world.bodies[name].record.class_name == "floor" or contact.depth < 0.005:
                continue
            raise MotionFailed(
                "start_in_collision",
                f"in this room the robot starts {1000 * contact.depth:.0f} mm deep in {name}, which the planned scene "
                "does not show there",
                (name,),
                {"depth": contact.depth},
            )

    def put(self, configuration: Configuration) -> None:
        """Put the robot at a configuration, at rest; nothing moves on the way there."""
        self.robot.set(configuration)
        self._target, self._opening = configuration.body, configuration.opening
        self._trail = [configuration.body]
        self.robot.command(configuration.body, configuration.opening)

    # --- control ----------------------------------------------------------------------------------------------

    def _control(self, target: np.ndarray, opening: float, velocity: np.ndarray | None = None) -> None:
        if np.abs(target[:3] - self._target[:3]).max() > 1e-9:
            self._trail = []
        self._target, self._opening = target, opening
        self._trail.append(target)
        self.robot.command(target, opening, velocity)
        self.world.step(CONTROL_STEPS)
        self._watch()
        self.recording.observe(self.action)

    def wait(self, seconds: float) -> None:
        """Hold the last targets for some simulated seconds."""
        for _ in range(round(seconds / (CONTROL_STEPS * self.world.time_step))):
            self._control(self._target, self._opening)

    def _watch(self) -> None:
        for contact in self.world.contacts(self.robot.body_id):
            if contact.other_body == self.robot.body_id or contact.force < 1.0:
                continue
            if contact.own_link in (self.robot.hand, *self.robot.fingers):
                continue
            name = self.world.name_of(contact.other_body)
            if name is not None:
                self.bumps[name] = max(contact.force, self.bumps.get(name, 0.0))
                self._touched[name] = max(contact.force, self._touched.get(name, 0.0))

    def follow(self, segment: Segment, item: str | None) -> None:
        """Go along a segment's path, then do its event. `item` is the body's name in this world.

        Raises MotionFailed `grasp_lost` or `path_blocked` with numbers.
        """
        speed, acceleration = self.description.speeds, self.description.accelerations
        opening = 0.0 if self.held is not None else segment.opening
        if abs(opening - self._opening) > 1e-6:
            self._opening = opening
            self.wait(0.5)
        self._follow_rows(segment.path, speed * segment.pace, acceleration * segment.pace, opening)
        if segment.label not in ("push", "pull"):  # pressed against a door, the arm is not where it was sent
            self._check_arrival(segment.path[-1])
        if self.held is not None:
            self.check_hold()
        if segment.event == "grasp" and item is not None:
            self.world.wake()
            self.grasp(item, firm=segment.firm)
            self.recording.keyframe(self.action, "grasp")
        elif segment.event == "release":
            self.release()
            self.recording.keyframe(self.action, "release")
        elif segment.label:
            self.recording.keyframe(self.action, segment.label)

    def _follow_rows(self, path: np.ndarray, speed: np.ndarray, acceleration: np.ndarray, opening: float) -> None:
        start = self._target
        rows = path if np.allclose(start, path[0], atol=1e-9) else np.concatenate([start[None], path])
        times, points = time_path(rows, speed, acceleration)
        period = CONTROL_STEPS * self.world.time_step
        before = rows[0]
        for target in sample_times(times, points, period):
            self._control(target, opening, (target - before) / period)
            before = target
        self._control(rows[-1], opening)
        self.wait(0.15)

    def _check_arrival(self, goal: np.ndarray) -> None:
        """Raises MotionFailed `path_blocked` when the joints are far from where they were sent."""
        off = np.abs(self.robot.configuration().body - goal)
        if off[:2].max() > 0.1 or off[2:].max() > 0.35:
            touched, self._touched = self._touched, {}
            worst = max(touched, key=lambda name: touched[name], default="")
            raise MotionFailed(
                "path_blocked",
                f"the robot stands {off[:2].max():.3f} m and {off[2:].max():.2f} rad from where it was sent"
                + (f"; it touched {worst} with {touched[worst]:.0f} N" if worst else ""),
                (worst,) if worst else (),
                {"base_error": off[:2].max(), "joint_error": off[2:].max()},
            )

    def way_back(self) -> np.ndarray:
        """Return (N, 3 + J) rows that go back along the commanded targets to where the base came to rest."""
        rows = np.array(self._trail[::-1])
        keep = np.concatenate([[True], np.abs(np.diff(rows, axis=0)).max(axis=1) > 1e-9])
        return rows[keep][::4] if keep.sum() > 8 else rows[keep]

    # --- gripper ----------------------------------------------------------------------------------------------

    def grasp(self, item: str, *, firm: bool = False) -> None:
        """Close the fingers on an item. Raises MotionFailed `grasp_lost` when not both of them press on it."""
        description = self.description
        self.robot.finger_force = description.firm_finger_force if firm else description.finger_force
        if self.world.anchored:
            self.world.anchor_friction()
        self._opening = 0.0
        self.wait(GRIP_SECONDS)
        if not self.robot.grasps(item):
            contacts = self.robot.finger_contacts(item)
            touching = sum(bool(entries) for entries in contacts.values())
            raise MotionFailed(
                "grasp_lost",
                f"{touching} of 2 fingers press on {item} after closing (opening "
                f"{self.robot.configuration().opening:.3f} m)",
                (item,),
                {"fingers": touching, "opening": self.robot.configuration().opening},
            )
        self.held = item
        self._tool_from_held = self.held_pose()

    def held_pose(self) -> np.ndarray:
        """Return tool_from_item (4, 4) of the held item."""
        assert self.held is not None
        return inverse(self.robot.tool_pose()) @ self.world.pose(self.held)

    def check_hold(self) -> None:
        """Raises MotionFailed `grasp_lost` when the held item has slipped out of the hand."""
        assert self.held is not None
        slip = float(np.linalg.norm((self.held_pose() - self._tool_from_held)[:3, 3]))
        if slip > SLIP or not self.robot.grasps(self.held):
            item, self.held = self.held, None
            raise MotionFailed("grasp_lost", f"{item} moved {slip:.3f} m in the hand", (item,), {"slip": slip})

    def release(self) -> None:
        """Open the fingers and let the item come to rest."""
        if self.held is not None:
            self.world.loosen(self.held)
        self.held = None
        self.robot.finger_force = self.description.finger_force
        self._opening = self.description.opening
        self.wait(RELEASE_SECONDS)
