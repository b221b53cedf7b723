"""Where a box that is let go comes to rest: pybullet, without the arm, which never touches what it lets go."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scenewright.schemas.packing import BASKET_SLAB, BASKET_TOP, TABLE_TOP
from scenewright.stages.kit.simulation.bodies import box_body
from scenewright.stages.kit.simulation.engine import engine
from scenewright.stages.pack.instances import Instance
from scenewright.stages.pack.records import BoxState

TIME_STEP = 1 / 240
"""Time step of the physics [s], Bullet's own."""
STEPS = 100
"""Physics steps after a place of the published environment."""
MASS = 1.0
"""Mass of a box [kg]; by eye."""


@dataclass(frozen=True)
class Rest:
    """A box as it lies: centre (3,) [m] and quaternion x y z w, world frame."""

    position: tuple[float, float, float]
    quaternion: tuple[float, float, float, float]


class SettlingTable:
    """Table, basket, obstacles and boxes of one instance. Close it after use."""

    def __init__(self, instance: Instance) -> None:
        self.client = engine.connect(engine.DIRECT)
        engine.setGravity(0, 0, -10, physicsClientId=self.client)
        engine.setPhysicsEngineParameter(
            fixedTimeStep=TIME_STEP, deterministicOverlappingPairs=1, physicsClientId=self.client
        )
        box_body(self.client, (1.5, 1.5, 0.005), (0, 0, TABLE_TOP - 0.005))
        low, high = np.array(instance.basket.low), np.array(instance.basket.high)
        middle, half = (low + high) / 2, (high - low) / 2
        centre = (middle[0], middle[1], BASKET_TOP - BASKET_SLAB / 2)
        box_body(self.client, (half[0], half[1], BASKET_SLAB / 2), centre)
        for obstacle in instance.obstacles:
            low, high = np.array(obstacle.rectangle.low), np.array(obstacle.rectangle.high)
            middle, half = (low + high) / 2, (high - low) / 2
            box_body(self.client, (half[0], half[1], obstacle.top / 2), (middle[0], middle[1], obstacle.top / 2))
        self.bodies = {
            box.name: box_body(
                self.client, (box.width / 2, box.length / 2, box.height / 2), (0, 0, -1.0 - number), MASS
            )
            for number, box in enumerate(instance.boxes)
        }

    def close(self) -> None:
        """Disconnect; the table cannot be used afterwards."""
        engine.disconnect(physicsClientId=self.client)

    def settle(self, rests: dict[str, Rest]) -> dict[str, Rest]:
        """Put every box at its pose, at rest, and let physics run; return where they lie."""
        client = self.client
        for name, body in self.bodies.items():
            rest = rests[name]
            engine.resetBasePositionAndOrientation(body, rest.position, rest.quaternion, physicsClientId=client)
            engine.resetBaseVelocity(body, [0, 0, 0], [0, 0, 0], physicsClientId=client)
        for _ in range(STEPS):
            engine.stepSimulation(physicsClientId=client)
        after = {}
        for name, body in self.bodies.items():
            position, quaternion = engine.getBasePositionAndOrientation(body, physicsClientId=client)
            after[name] = Rest(position, quaternion)
        return after


def rest_of(box: BoxState, bottom: float) -> Rest:
    """Return a box that stands upright with its bottom at a world height [m]."""
    return Rest(
        (box.x, box.y, bottom + box.height / 2), (0.0, 0.0, float(np.sin(box.yaw / 2)), float(np.cos(box.yaw / 2)))
    )
