"""The way of the base from where it stands to where an action is done: with room to spare where there is room."""

from __future__ import annotations

import numpy as np
from scenewright.stages.kit.motion.base_placement import plan_drive
from scenewright.stages.kit.motion.collision import CollisionChecker
from scenewright.stages.kit.motion.failures import MotionFailed
from scenewright.stages.kit.motion.robot_errors import LOCALISATION
from scenewright.stages.plan.world_model import RobotState, WorldModel, as_held

ROOM = 2.5 * LOCALISATION
"""Kept to everything on the way, where that is possible [m]: so far beside its way may the base be."""
ASIDE, DIRECTIONS = (0.02, 0.04, 0.07, 0.1), 16
"""A base that is believed to stand in something, as a door was seen otherwise since, leaves it so far [m]."""


def drive_way(
    model: WorldModel, state: RobotState, goal: np.ndarray, random: np.random.Generator, samples: int
) -> np.ndarray:
    """Return a free path (N, 3) of the base to `goal`, x, y [m], yaw [rad], the arm held still.

    The yaw of the last point may differ from the goal's by whole turns. Raises MotionFailed as `plan_drive` does.
    """
    checker = model.checker.under(as_held(model, state))

    def way(start: np.ndarray) -> np.ndarray:
        return plan_drive(start, goal, state.arm, checker, model.room, random, samples=samples)

    try:
        with checker.keeping(max(ROOM, checker.clearance)):
            return way(state.base)
    except MotionFailed:
        pass
    try:
        return way(state.base)
    except MotionFailed as failed:
        aside = _free_beside(checker, state) if failed.failure.kind == "start_in_collision" else None
        if aside is None:
            raise
        return np.concatenate([state.base[None], way(aside)])


def _free_beside(checker: CollisionChecker, state: RobotState) -> np.ndarray | None:
    """Return the nearest free base (3,) beside the robot, None where there is none so near."""
    for away in ASIDE:
        for angle in 2 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS:
            base = state.base + away * np.array([np.cos(angle), np.sin(angle), 0.0])
            if checker.check(np.concatenate([base, state.arm])) is None:
                return base
    return None
