"""Pieces that every manipulation is made of: reach a pose, move straight, fold the arm; each checked for collision."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from copy import copy
from dataclasses import dataclass, field
from typing import NoReturn, Protocol

import numpy as np
from scenewright.stages.kit.acting.query import CollisionQuery
from scenewright.stages.kit.geometry.transforms import inverse, transform_from_yaw
from scenewright.stages.kit.motion.base_placement import in_arm_frame, shoulder_distance
from scenewright.stages.kit.motion.cartesian import follow, straight_poses
from scenewright.stages.kit.motion.collision import Collision, CollisionChecker
from scenewright.stages.kit.motion.failures import MotionFailed
from scenewright.stages.kit.motion.kinematics import ArmChain, forward, inverse_kinematics, random_starts, reach
from scenewright.stages.kit.motion.path_query import Query
from scenewright.stages.kit.motion.path_search import find_path
from scenewright.stages.kit.motion.rrt_connect import SearchSpace, densify, first_collision
from scenewright.stages.kit.simulation.robot import base_pose
from scenewright.stages.kit.simulation.robot_description import RobotDescription

WRIST, AS_CARRIED = 3, 1.0
"""Joints that turn the hand alone, and how far those before them are from where the arm carries, at most, in an arm
that is folded [rad]: with its elbow held otherwise it would stand in furniture."""
ARM_RESOLUTION = 0.05
"""Largest step of a joint between two checks [rad]."""


@dataclass
class Tally:
    """Counts of what ended the attempts of one query, for the typed failure at its end."""

    unreachable: int = 0
    nearest: float = np.inf
    tried: int = 0
    blockers: Counter[str] = field(default_factory=Counter)
    depths: dict[str, float] = field(default_factory=dict)
    last: MotionFailed | None = None

    def collided(self, collision: Collision) -> None:
        """Count a collision by the body in the way."""
        self.blockers[collision.other] += 1
        self.depths[collision.other] = max(collision.depth, self.depths.get(collision.other, -np.inf))

    def failed(self, failure: MotionFailed) -> None:
        """Count a failed path query."""
        self.last = failure
        for name in failure.failure.objects[-1:]:
            self.blockers[name] += 1

    def raise_for(self, what: str, objects: tuple[str, ...]) -> NoReturn:
        """Raise MotionFailed with the condition that ended most attempts.

        `no_inverse_kinematics` (nothing was within reach), `goal_in_collision` (a body was in the way most often) or
        the kind of the last path query.
        """
        numbers: dict[str, float] = {"tried": self.tried, "unreachable": self.unreachable}
        if np.isfinite(self.nearest):
            numbers["nearest_distance"] = self.nearest
        if not self.blockers or self.unreachable == self.tried > 0:
            raise MotionFailed(
                "no_inverse_kinematics",
                f"{what}: no joint values reach any of {self.tried} tool poses (nearest {self.nearest:.3f} m)",
                objects,
                numbers,
            )
        name, hits = self.blockers.most_common(1)[0]
        numbers |= {"collisions": self.blockers.total(), "hits": hits}
        if name in self.depths:
            numbers["depth"] = self.depths[name]
        kind = "goal_in_collision" if self.last is None else self.last.failure.kind
        raise MotionFailed(
            kind,
            f"{what}: {self.tried} tool poses tried, {self.unreachable} out of reach; "
            f"{name} was in the way most often ({hits} of {self.blockers.total()} times)",
            (*objects, name),
            numbers,
        )


class ArmModel(Protocol):
    """What is believed of a room, as far as moving an arm in it needs it."""

    description: RobotDescription
    chain: ArmChain
    checker: CollisionChecker


class ArmPlanner:
    """Arm motions from one base pose in a world model."""

    def __init__(self, model: ArmModel, random: np.random.Generator, samples: int) -> None:
        self.model = model
        self.checker = model.checker
        self.random = random
        self.samples = samples
        self.space = SearchSpace(model.chain.lower, model.chain.upper, np.full(len(model.chain.lower), ARM_RESOLUTION))
        self.reach = reach(model.chain)

    def under(self, query: CollisionQuery) -> ArmPlanner:
        """Return this planner with its checks made under a query; both draw from the same generator."""
        bound = copy(self)
        bound.checker = self.model.checker.under(query)
        return bound

    def reachable(
        self, base: np.ndarray, world_from_tool: np.ndarray, tally: Tally, starts: int = 6
    ) -> np.ndarray | None:
        """Return arm values (J,) for a tool pose, or None (counted in the tally)."""
        tally.tried += 1
        distance = shoulder_distance(base, world_from_tool, self.model.description, self.model.chain)
        if distance > self.reach:
            tally.unreachable += 1
            tally.nearest = min(tally.nearest, distance - self.reach)
            return None
        guesses = np.concatenate(
            [self.model.description.carry[None], random_starts(self.model.chain, starts, self.random)]
        )
        target = in_arm_frame(base, world_from_tool, self.model.description)
        solution = inverse_kinematics(self.model.chain, target, guesses)
        if not solution.found:
            tally.unreachable += 1
            tally.nearest = min(tally.nearest, solution.position_error)
            return None
        return solution.arm

    def free(self, base: np.ndarray, arm: np.ndarray, tally: Tally) -> bool:
        """Whether a configuration is free; a collision is counted in the tally."""
        collision = self._check(base, arm)
        if collision is not None:
            tally.collided(collision)
        return collision is None

    def free_at(
        self, base: np.ndarray, world_from_tool: np.ndarray, tally: Tally, starts: int = 6
    ) -> np.ndarray | None:
        """Return arm values (J,) for a tool pose (4, 4) that are free, or None (counted in the tally)."""
        arm = self.reachable(base, world_from_tool, tally, starts)
        return arm if arm is not None and self.free(base, arm, tally) else None

    def straight(
        self, base: np.ndarray, at: np.ndarray, before: np.ndarray, tally: Tally, starts: int = 6
    ) -> np.ndarray | None:
        """Return arm values (K, J) from a tool pose (4, 4) along a straight line to the one before it: backwards, the
        hand's way in. None (counted in the tally) where the one is out of reach, or something is in the way."""
        arm = self.free_at(base, at, tally, starts)
        return None if arm is None else self.line(base, arm, before, tally)

    def line(self, base: np.ndarray, start: np.ndarray, world_from_goal: np.ndarray, tally: Tally) -> np.ndarray | None:
        """Return arm values (K, J) from `start` (J,) included along a straight line of the tool; None if not free."""
        hand_pose = base_pose(base, self.model.description) @ forward(self.model.chain, start)
        return self.along(base, start, straight_poses(hand_pose, world_from_goal), tally)

    def along(
        self, base: np.ndarray, start: np.ndarray, world_from_tools: list[np.ndarray], tally: Tally
    ) -> np.ndarray | None:
        """Return arm values (K + 1, J) from `start` through tool poses; None (tallied) if not free."""
        frame = inverse(base_pose(base, self.model.description))
        try:
            arms = follow(self.model.chain, [frame @ pose for pose in world_from_tools], start)
        except MotionFailed as failed:
            tally.unreachable += 1
            tally.nearest = min(tally.nearest, failed.failure.numbers["distance"])
            return None
        path = np.concatenate([start[None], arms])
        collision_at = first_collision(densify(path, self.space.resolution), lambda arm: self._check(base, arm))
        if collision_at is not None:
            tally.collided(collision_at[1])
            return None
        return path

    def _check(self, base: np.ndarray, arm: np.ndarray) -> Collision | None:
        return self.checker.check(np.concatenate([base, arm]))

    def path(self, base: np.ndarray, start: np.ndarray, goal: np.ndarray) -> np.ndarray:
        """Return a free joint path (N, J). Raises MotionFailed as find_path does."""
        query = Query(np.concatenate([base, start]), np.arange(3, 3 + len(start)), start, goal[None], self.space)
        return find_path(query, self.checker, self.random, samples=self.samples)

    def folded(self, base: np.ndarray, arm: np.ndarray, tally: Tally) -> np.ndarray | None:
        """Return arm values (J,) with the tool drawn in over the pedestal; what is held stays upright."""
        for pose in self._drawn_in(base, arm):
            solution = self.free_at(base, pose, tally)
            if solution is not None:
                return solution
        return None

    def folding(self, base: np.ndarray, arm: np.ndarray, tally: Tally) -> np.ndarray | None:
        """Return arm values (K, J) from `arm` (J,) along a straight line of the tool to where it is `folded`: what is
        held stays upright on the way, too. None where no such line is free, or each leaves the elbow elsewhere."""
        carry = self.model.description.carry
        for pose in self._drawn_in(base, arm):
            line = self.line(base, arm, pose, tally)
            if line is not None and np.abs(line[-1] - carry)[:-WRIST].max() < AS_CARRIED:
                return line
        return None

    def _drawn_in(self, base: np.ndarray, arm: np.ndarray) -> Iterator[np.ndarray]:
        """Yield poses (4, 4) of the tool over the pedestal, turned from where it is about the vertical alone."""
        world_from_tool = base_pose(base, self.model.description) @ forward(self.model.chain, arm)
        approach = world_from_tool[:3, 2]
        heading = np.arctan2(approach[1], approach[0])
        steep = float(np.linalg.norm(approach[:2])) < 0.2
        turns = np.linspace(-np.pi, np.pi, 8, endpoint=False) if steep else np.array([0.0, 0.5, -0.5, 1.0, -1.0])
        direction = np.array([np.cos(base[2]), np.sin(base[2])])
        for turn in turns:
            for forward_distance, height in ((0.38, 0.5), (0.42, 0.35), (0.45, 0.6), (0.35, 0.7)):
                pose = world_from_tool.copy()
                change = turn if steep else float(base[2]) - heading + turn
                pose[:3, :3] = transform_from_yaw(change, np.zeros(3))[:3, :3] @ world_from_tool[:3, :3]
                pose[:2, 3] = base[:2] + forward_distance * direction
                pose[2, 3] = self.model.description.pedestal_height + height
                yield pose
