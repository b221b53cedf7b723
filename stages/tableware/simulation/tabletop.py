"""Tableware as bodies on a table in physics, and the table read back from where the bodies are."""

from __future__ import annotations

import os
import tempfile
from dataclasses import replace
from math import atan2, hypot, sqrt
from pathlib import Path

import numpy as np
from scenewright.stages.kit.geometry.transforms import quaternion_of, transform_from_quaternion, transform_from_yaw
from scenewright.stages.kit.simulation.engine import engine, native_output_to_stderr
from scenewright.stages.kit.simulation.world import GRAVITY, PhysicsWorld
from scenewright.stages.tableware.simulation.pieces import Solid, obj_text, solid, urdf_text
from scenewright.stages.tableware.world.items import TABLE_SIDES, Item, Table

TABLE_FRICTION, ITEM_FRICTION = 0.7, 0.5
"""Bullet multiplies the two of a contact: 0.35 on the table, 0.25 dish on dish, 0.8 under rubber."""
FRICTION_ERP = 0.2
"""Share of a step's drift of a contact that sticks that the next step takes back (friction anchors). Without it a cup
that was pressed ten times as hard as its weight asks for crept out of a grasp at 40 mm/s."""
TIPPED = 0.5
"""A dish on the table that leans more than this [rad] has fallen over."""
FELL = -0.05
"""What lies lower than this [m] has left the table."""
BIN_CENTER, BIN_SIDE = (0.63, -0.22), 0.42
"""The bin's opening beside the table, at the height of its top [m]."""
REST_SPEED = 0.01
"""What is slower [m/s] is at rest."""


class Tabletop:
    """Bodies by item name. `binned` and `lost` are those that have left, in order."""

    def __init__(self, world: PhysicsWorld, table: Table) -> None:
        self.world = world
        engine.setPhysicsEngineParameter(
            numSolverIterations=100,
            contactBreakingThreshold=0.002,
            contactERP=0.8,
            frictionERP=FRICTION_ERP,
            physicsClientId=world.client,
        )
        shape = engine.createCollisionShape(
            engine.GEOM_BOX, halfExtents=[TABLE_SIDES[0] / 2, TABLE_SIDES[1] / 2, 0.02], physicsClientId=world.client
        )
        self.board = engine.createMultiBody(
            0, shape, basePosition=[0, 0, -0.02], useMaximalCoordinates=1, physicsClientId=world.client
        )
        engine.changeDynamics(self.board, -1, lateralFriction=TABLE_FRICTION, physicsClientId=world.client)
        self.items = {item.name: item for item in table.items}
        self.bodies: dict[str, int] = {}
        self.binned: list[str] = []
        self.lost: list[str] = []
        with tempfile.TemporaryDirectory() as folder:
            for kind, measures in sorted({item.kind: item.measures for item in table.items}.items()):
                path = os.path.join(folder, f"{kind}.obj")
                Path(path).write_text(obj_text(solid(kind, measures)), encoding="utf-8")
                text = urdf_text(kind, measures, path)
                Path(folder, f"{kind}.urdf").write_text(text, encoding="utf-8")
            for item in table.items:
                self.bodies[item.name] = self._load(os.path.join(folder, f"{item.kind}.urdf"))
                self.place(item.name, transform_from_yaw(item.yaw, np.array(item.position) + [0.0, 0.0, 0.0005]))

    def _load(self, path: str) -> int:
        with native_output_to_stderr():
            body = engine.loadURDF(
                path,
                flags=engine.URDF_USE_INERTIA_FROM_FILE | engine.URDF_ENABLE_SLEEPING,
                useMaximalCoordinates=1,
                physicsClientId=self.world.client,
            )
        engine.changeDynamics(
            body,
            -1,
            lateralFriction=ITEM_FRICTION,
            spinningFriction=0.0005,
            rollingFriction=0.0,
            linearDamping=0.02,
            angularDamping=0.05,
            frictionAnchor=1,
            physicsClientId=self.world.client,
        )
        return int(body)

    # --- poses ------------------------------------------------------------------------------------------------

    def place(self, name: str, world_from_item: np.ndarray) -> None:
        """Put an item's frame (foot centre, or middle of the underside) at a pose (4, 4), at rest."""
        center = world_from_item[:3, :3] @ self._solid(name).center + world_from_item[:3, 3]
        engine.resetBasePositionAndOrientation(
            self.bodies[name],
            center.tolist(),
            quaternion_of(world_from_item).tolist(),
            physicsClientId=self.world.client,
        )

    def pose(self, name: str) -> np.ndarray:
        """Return world_from_item (4, 4)."""
        position, quaternion = engine.getBasePositionAndOrientation(
            self.bodies[name], physicsClientId=self.world.client
        )
        pose = transform_from_quaternion(np.array(quaternion), np.array(position))
        pose[:3, 3] -= pose[:3, :3] @ self._solid(name).center
        return pose

    def _solid(self, name: str) -> Solid:
        item = self.items[name]
        return solid(item.kind, item.measures)

    def speed(self, name: str) -> float:
        """Return the linear speed [m/s], with a tenth of the angular one [rad/s]."""
        linear, angular = engine.getBaseVelocity(self.bodies[name], physicsClientId=self.world.client)
        return float(np.linalg.norm(linear) + 0.1 * np.linalg.norm(angular))

    # --- time -------------------------------------------------------------------------------------------------

    def rest(self, longest: float) -> float:
        """Let everything come to rest, for at most `longest` seconds, then put it to sleep; return the time taken."""
        passed = 0.0
        while passed < longest:
            self.world.step(12)
            passed += 12 * self.world.time_step
            self.sweep()
            if all(self.speed(name) < REST_SPEED for name in self.bodies):
                break
        self.sleep()
        return passed

    def sleep(self) -> None:
        """Put everything that is slow to sleep: it wakes when something that moves touches it. A table awake would keep
        looking for contacts with what sleeps on it."""
        self._activate(self.board, engine.ACTIVATION_STATE_SLEEP)
        for name, body in self.bodies.items():
            if self.speed(name) < REST_SPEED:
                self._activate(body, engine.ACTIVATION_STATE_SLEEP)

    def wake_near(self, points: list[np.ndarray], reach: float) -> None:
        """Wake what lies within `reach` [m] of any of some points (2,), seen from above: what sleeps does not notice
        that its support was taken away."""
        for name, body in self.bodies.items():
            middle = self.pose(name)[:2, 3]
            if any(float(np.linalg.norm(middle - point)) < reach for point in points):
                self._activate(body, engine.ACTIVATION_STATE_WAKE_UP)

    def _activate(self, body: int, state: int) -> None:
        engine.changeDynamics(body, -1, activationState=state, physicsClientId=self.world.client)

    def sweep(self) -> None:
        """Take away what has fallen: into the bin when its middle passed the bin's opening, else it is lost."""
        for name in list(self.bodies):
            center = (self.pose(name) @ np.append(self._solid(name).center, 1.0))[:3]
            if center[2] > FELL:
                continue
            velocity, _ = engine.getBaseVelocity(self.bodies[name], physicsClientId=self.world.client)
            x, y = where_it_passed(center, np.array(velocity))
            over = abs(x - BIN_CENTER[0]) < BIN_SIDE / 2 and abs(y - BIN_CENTER[1]) < BIN_SIDE / 2
            (self.binned if over else self.lost).append(name)
            engine.removeBody(self.bodies.pop(name), physicsClientId=self.world.client)

    # --- reading ----------------------------------------------------------------------------------------------

    def lean(self, name: str) -> float:
        """Return the angle [rad] of an item's axis against the vertical."""
        return float(np.arccos(np.clip(self.pose(name)[2, 2], -1.0, 1.0)))

    def read(self, everything: bool = False) -> Table:
        """Return the table as it is: what is on it, lower things first, and what stands on what. What fell over is left
        out, with what leans on it, unless `everything`."""
        poses = {name: self.pose(name) for name in self.bodies}
        order = sorted(poses, key=lambda name: (round(self._middle(name, poses[name])[2], 4), name))
        items: list[Item] = []
        for name in order:
            pose = poses[name]
            position = tuple(float(value) for value in pose[:3, 3])
            yaw = atan2(pose[1, 0], pose[0, 0]) if not self.items[name].is_dish else 0.0
            x, y, z = position
            item = replace(self.items[name], position=(x, y, z), yaw=yaw, on=None)
            below = [lower for lower in items if self._carries(lower, item, poses)]
            if below:
                item = replace(item, on=_highest(below).name)
            elif z < 0.004:
                item = replace(item, position=(x, y, 0.0))
            items.append(item)
        table = Table(tuple(items))
        if everything:
            return table
        fallen = {item.name for item in items if item.is_dish and item.on is None and self.lean(item.name) > TIPPED}
        gone = {name for fall in fallen for name in (fall, *(load.name for load in table.load(fall)))}
        return Table(tuple(item for item in items if item.name not in gone))

    def _middle(self, name: str, pose: np.ndarray) -> np.ndarray:
        return np.asarray((pose @ np.append(self._solid(name).center, 1.0))[:3])

    def _carries(self, lower: Item, upper: Item, poses: dict[str, np.ndarray]) -> bool:
        """Whether `upper` lies within what `lower` covers, higher than its foot."""
        upper_middle = self._middle(upper.name, poses[upper.name])
        if upper_middle[2] < lower.position[2] + 0.002 or upper.position[2] < 0.0015:
            return False
        apart = hypot(upper_middle[0] - lower.position[0], upper_middle[1] - lower.position[1])
        if lower.is_dish:
            return apart < lower.measures.rim_radius
        return not upper.is_dish and apart < 0.06 and upper.position[2] > lower.position[2] + 0.0015


def where_it_passed(center: np.ndarray, velocity: np.ndarray) -> tuple[float, float]:
    """Return x, y [m] where a falling thing at `center` (3,) with `velocity` (3,) passed the height of the table top,
    which is that of the bin's opening: below it a bin has walls."""
    down = max(0.0, -float(velocity[2]))
    at_the_top = sqrt(max(0.0, down**2 + 2.0 * GRAVITY * min(0.0, float(center[2]))))
    since = (down - at_the_top) / GRAVITY
    return float(center[0] - velocity[0] * since), float(center[1] - velocity[1] * since)


def _highest(items: list[Item]) -> Item:
    return max(items, key=lambda item: item.position[2])
