"""Driving along the robot's own map: asked for contacts where the hand is empty, simulated where it holds something."""

from __future__ import annotations

from math import atan2, pi

import numpy as np
from scenewright.stages.agent.obstacle_map import cell_of
from scenewright.stages.agent.senses import Base, Felt, Sweep
from scenewright.stages.agent.world.physics.robot_in_room import RobotInRoom
from scenewright.stages.agent.world.physics.seen import Seen
from scenewright.stages.kit.motion.failures import MotionFailed
from scenewright.stages.kit.motion.robot_errors import stop_error
from scenewright.stages.kit.motion.segments import Segment
from scenewright.stages.kit.simulation.engine import engine
from scenewright.stages.kit.simulation.robot import Configuration

TRIES = 6
"""Ways that are tried on one drive, each around what was touched on those before."""
TOUCHES = 0.001
"""Contacts less deep do not count [m]."""
STEP, BACK_STEPS, TURN_STEP = 0.05, 2, 0.15
"""Distance [m] and turn [rad] between poses of the base at which collisions are looked for, and how many of them it
backs off a touch; by eye."""


class Driving:
    """The base of a robot."""

    def __init__(self, robot: RobotInRoom, seen: Seen) -> None:
        self._robot, self._seen = robot, seen
        self._touched: np.ndarray | None = None
        """Middle (2,), true room, of what it touched last with empty hands."""

    def drive(self, base: Base, toward: str) -> Felt:
        """Drive along the robot's own map; with empty hands it is moved and asked for contacts, not simulated."""
        goal = np.array([base.x, base.y, base.yaw])
        error = stop_error(self._robot.random)
        turns_there = bool(toward) or self._seen.obstacles.at_ease(base.x, base.y)  # its head turns anywhere
        failed: MotionFailed | None = None
        rows: list[np.ndarray] = []
        for number in range(TRIES):
            path = self._seen.obstacles.path(self._robot.base, (base.x, base.y))
            if path is None:
                failed = failed or MotionFailed("no_way", "the obstacle map shows no way there")
                break
            if not np.allclose(self._robot.arm, self._robot.home):
                self._robot.arm_to(self._robot.home)
            points = [np.array([*point, 0.0]) - self._robot.driver.error for point in path[1:-1]]
            ease = [self._seen.obstacles.at_ease(*point) for point in path[1:-1]]
            turns = (ease, [False] * len(ease), [True] * len(ease))[number % 3]
            start = self._robot.true_base()
            rows = _facing_on(start, points, [*turns, turns_there], goal - error)
            failed = self._roll_along(start, rows)
            if failed is None:
                break
            if self._touched is not None and np.abs(self._robot.true_base() - start).max() < STEP / 2:
                self._turn_from(self._touched)  # it does not get away as it stands
            self._robot.believed = self._robot.true_base() + self._robot.driver.error
            if not points and number:
                break  # it is there but for the turn
        self._robot.driver.error = error
        self._robot.believed = (rows[-1] if failed is None else self._robot.true_base()) + error
        self._robot.believed[2] = (self._robot.believed[2] + pi) % (2 * pi) - pi
        if toward:
            self._robot.log.done("drive", f"drive to {toward.rsplit('_', 1)[0]}", failed is None, "navigation", "")
        return Felt(True) if failed is None else Felt(False, "no_way", failed.failure)

    def _roll_along(self, start: np.ndarray, rows: list[np.ndarray]) -> MotionFailed | None:
        arm = self._robot.arm + self._robot.driver.encoders
        if self._robot.hold is not None:
            rows_from_start = np.array([[*base, *arm] for base in (start, *rows)])
            try:
                self._robot.driver.follow_truly(Segment(rows_from_start, 0.0))
            except MotionFailed as failed:
                if failed.failure.kind == "path_blocked":
                    self._robot.metres += float(np.linalg.norm((self._robot.true_base() - start)[:2]))
                    return failed
            self._robot.metres += float(np.linalg.norm(np.diff(rows_from_start[:, :2], axis=0), axis=1).sum())
            return None
        reached = start
        opening = self._robot.driver.robot.configuration().opening
        before = self._touching_depths()  # what it leans on already does not keep it from going away
        for row in rows:
            count = max(1, int(np.ceil(np.abs(row - reached)[:2].max() / STEP)))
            for k in range(1, count + 1):
                at = reached + (row - reached) * k / count
                self._robot.driver.robot.set_body(np.concatenate([at, arm]))
                now = self._touching_depths()
                struck = next((name for name, depth in now.items() if depth > before.get(name, TOUCHES)), None)
                before = now
                if struck is not None:
                    touched = self._touched = self._remember(struck)
                    back = reached + (row - reached) * (k - 1) / count
                    self._robot.driver.put(Configuration(self._back_off(back, arm, touched), arm, opening))
                    class_name = self._robot.room.world.bodies[struck].record.class_name
                    return MotionFailed("path_blocked", f"the base touched {class_name}", (class_name,))
                self._seen.obstacles.driven(*(at + self._robot.driver.error)[:2])
            rolled = float(np.linalg.norm((row - reached)[:2]))
            self._robot.metres += rolled
            self._robot.seconds_aside += rolled / self._robot.description.base_speed
            reached = row
        self._robot.driver.put(Configuration(reached, arm, opening))
        self._robot.seconds_aside += 1.0
        return None

    def _remember(self, struck: str) -> np.ndarray:
        """Enter into the map where the base was felt to touch something that the eyes took for free; return the middle
        (2,) of that, of the true room."""
        contacts = self._robot.room.world.contacts(self._robot.driver.robot.body_id)
        of_it = [c for c in contacts if self._robot.room.world.name_of(c.other_body) == struck and c.depth > TOUCHES]
        cells = {cell_of(*(c.point[:2] + self._robot.driver.error[:2])) for c in of_it}
        self._seen.obstacles.add(Sweep(np.zeros((0, 2), int), np.array(sorted(cells), int).reshape(-1, 2), ()))
        return np.mean([c.point[:2] for c in of_it], axis=0)

    def _back_off(self, base: np.ndarray, arm: np.ndarray, touched: np.ndarray) -> np.ndarray:
        """Return the base pose (3,) farther from where it touched something (2,), as far as nothing is touched more for
        it: leaning on it, no way would lead on."""
        away = base[:2] - touched
        step = np.array([*(away / max(np.linalg.norm(away), 1e-6) * STEP), 0.0])
        self._robot.driver.robot.set_body(np.concatenate([base, arm]))
        before = self._touching_depths()
        for _ in range(BACK_STEPS):
            self._robot.driver.robot.set_body(np.concatenate([base + step, arm]))
            now = self._touching_depths()
            if any(depth > before.get(name, TOUCHES) for name, depth in now.items()):
                break
            base, before = base + step, now
        return base

    def _turn_from(self, touched: np.ndarray) -> None:
        """Turn on the spot until the folded arm points away from what was touched (2,), or as far as that goes, to the
        side that has more room."""
        start = self._robot.true_base()
        away = atan2(start[1] - touched[1], start[0] - touched[0])
        short = (away - start[2] + pi) % (2 * pi) - pi
        turns = [self._room_to_turn(start, turn) for turn in (short, short - np.copysign(2 * pi, short))]
        base = start + (0.0, 0.0, min(turns, key=lambda turn: abs((turn - short + pi) % (2 * pi) - pi)))
        arm, opening = self._robot.arm + self._robot.driver.encoders, self._robot.driver.robot.configuration().opening
        self._robot.driver.put(Configuration(base, arm, opening))
        self._robot.seconds_aside += 1.0

    def _room_to_turn(self, start: np.ndarray, turn: float) -> float:
        """Return how far a base (3,) turns on the spot, at most by an angle [rad], before it touches something."""
        arm = self._robot.arm + self._robot.driver.encoders
        self._robot.driver.robot.set_body(np.concatenate([start, arm]))
        before, free = self._touching_depths(), 0.0
        for yaw in np.linspace(0.0, turn, int(abs(turn) / TURN_STEP) + 2)[1:]:
            self._robot.driver.robot.set_body(np.concatenate([start + (0.0, 0.0, yaw), arm]))
            now = self._touching_depths()
            if any(depth > before.get(name, TOUCHES) for name, depth in now.items()):
                break
            before, free = now, float(yaw)
        return free

    def _touching_depths(self) -> dict[str, float]:
        """Return what the robot stands in, the floor aside, and how deep [m]."""
        world = self._robot.room.world
        engine.performCollisionDetection(physicsClientId=world.client)
        depths: dict[str, float] = {}
        for contact in world.contacts(self._robot.driver.robot.body_id):
            name = world.name_of(contact.other_body)
            if name is not None and world.bodies[name].record.class_name != "floor" and contact.depth > TOUCHES:
                depths[name] = max(contact.depth, depths.get(name, 0.0))
        return depths


def _facing_on(start: np.ndarray, points: list[np.ndarray], turns: list[bool], goal: np.ndarray) -> list[np.ndarray]:
    """Return base poses (3,) through points to a goal pose that turn little from each to the next: along the way at
    points where it `turns`, and as the goal says there if it does, as before at the others, for the base drives to any
    side."""
    poses: list[np.ndarray] = []
    before = start
    for point, turn in zip([*points, goal], turns, strict=True):
        turned = point.copy()
        if not turn:
            turned[2] = before[2]
        elif len(poses) < len(points):
            turned[2] = atan2(point[1] - before[1], point[0] - before[0])
        turned[2] = before[2] + (turned[2] - before[2] + pi) % (2 * pi) - pi
        poses.append(turned)
        before = turned
    return poses
