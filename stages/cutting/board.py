"""A board on which fragments fall and roll: pybullet, each fragment by the convex hull of its outermost points."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scenewright.stages.cutting.world.body import Body
from scenewright.stages.kit.geometry.substances import FRICTION_OF_LIKE, ROLLING_FRICTION, SPINNING_FRICTION
from scenewright.stages.kit.geometry.transforms import transform_from_quaternion
from scenewright.stages.kit.simulation.bodies import box_body
from scenewright.stages.kit.simulation.engine import engine

SIZE = (1.2, 0.6)
"""Length and width of the board [m]; its top is at z = 0, the floor far below."""
DENSITY = 900.0
"""[kg/m^3]."""
TIME_STEP, SECONDS = 1 / 480, 0.75
"""Time step of the physics and time that fragments get to come to rest [s]; by eye."""
LIFT = 0.001
"""Height from which fragments fall [m]; by eye."""
DIRECTIONS = 96
"""Directions in which a fragment's outermost points are sought; by eye."""


class Board:
    """Close it after use."""

    def __init__(self) -> None:
        self.client = engine.connect(engine.DIRECT)
        engine.setGravity(0, 0, -9.81, physicsClientId=self.client)
        engine.setPhysicsEngineParameter(
            fixedTimeStep=TIME_STEP, deterministicOverlappingPairs=1, physicsClientId=self.client
        )
        self._board = box_body(self.client, (0.5 * SIZE[0], 0.5 * SIZE[1], 0.01), (0, 0, -0.01))
        self._rub(self._board)
        self.turned: list[float] = []
        """Angles through which fragments turned [rad]."""
        self.fallen: set[int] = set()

    def close(self) -> None:
        """Disconnect."""
        engine.disconnect(physicsClientId=self.client)

    def rest(self, board: dict[int, Body]) -> None:
        """Let what lies there come to rest, in place. What falls off the board stays where it went over the edge."""
        on_board = {number: body for number, body in board.items() if number not in self.fallen}
        bodies = {number: self._add(body) for number, body in on_board.items()}
        for _ in range(round(SECONDS / TIME_STEP)):
            engine.stepSimulation(physicsClientId=self.client)
        for number, added in bodies.items():
            position, quaternion = engine.getBasePositionAndOrientation(added, physicsClientId=self.client)
            pose = transform_from_quaternion(np.array(quaternion), np.array(position))
            engine.removeBody(added, physicsClientId=self.client)
            if position[2] < 0.0:
                self.fallen.add(number)
                continue
            pose[:3, 3] -= pose[:3, :3] @ on_board[number].moments[0]
            board[number] = on_board[number].moved(pose)
            self.turned.append(float(np.arccos(np.clip((np.trace(pose[:3, :3]) - 1.0) / 2.0, -1.0, 1.0))))

    def _add(self, body: Body) -> int:
        center = body.moments[0]
        points = outermost(body.vertices - center)
        shape = engine.createCollisionShape(engine.GEOM_MESH, vertices=points.tolist(), physicsClientId=self.client)
        above = max(0.0, LIFT - body.extent_along(np.array([0.0, 0.0, 1.0]))[0])
        position = (center + np.array([0.0, 0.0, above])).tolist()
        added = int(engine.createMultiBody(DENSITY * body.volume, shape, -1, position, physicsClientId=self.client))
        self._rub(added)
        return added

    def _rub(self, body: int) -> None:
        engine.changeDynamics(
            body,
            -1,
            lateralFriction=float(np.sqrt(FRICTION_OF_LIKE["wood"])),
            rollingFriction=ROLLING_FRICTION,
            spinningFriction=SPINNING_FRICTION,
            physicsClientId=self.client,
        )


def outermost(points: np.ndarray) -> np.ndarray:
    """Return the points (N, 3) that are outermost in some of many even directions."""
    k = np.arange(DIRECTIONS) + 0.5
    polar, around = np.arccos(1 - 2 * k / DIRECTIONS), np.pi * (1 + np.sqrt(5)) * k
    directions = np.column_stack([np.cos(around) * np.sin(polar), np.sin(around) * np.sin(polar), np.cos(polar)])
    return np.asarray(points[np.unique((points @ directions.T).argmax(axis=0))])


def laid_out(objects: Sequence[Body]) -> list[Body]:
    """Return objects lying on the board, their middle over its middle."""
    middle = np.mean([body.moments[0] for body in objects], axis=0)
    laid = []
    for body in objects:
        low = body.extent_along(np.array([0.0, 0.0, 1.0]))[0]
        laid.append(body.shifted(np.array([-middle[0], -middle[1], LIFT - low])))
    return laid
