"""Bodies of a pybullet world that no scene has: boxes, and the links, joints and fingers of a loaded robot."""

from __future__ import annotations

from collections.abc import Sequence

from scenewright.stages.kit.simulation.engine import engine


def box_body(client: int, half: Sequence[float], centre: Sequence[float], mass: float = 0.0, yaw: float = 0.0) -> int:
    """Add a box of half sides and a middle (3,) [m], turned by a yaw [rad]; mass 0: it never moves. Return its id."""
    shape = engine.createCollisionShape(engine.GEOM_BOX, halfExtents=[*map(float, half)], physicsClientId=client)
    turn = engine.getQuaternionFromEuler([0, 0, yaw])
    return int(engine.createMultiBody(mass, shape, -1, [*map(float, centre)], turn, physicsClientId=client))


def links_and_joints(body: int, client: int) -> tuple[dict[str, int], dict[str, int]]:
    """Return the indices of a body's links, the base's aside, and of its joints, fixed ones included, by name."""
    indices = range(engine.getNumJoints(body, physicsClientId=client))
    rows = [engine.getJointInfo(body, index, physicsClientId=client) for index in indices]
    return {row[12].decode(): row[0] for row in rows}, {row[1].decode(): row[0] for row in rows}


def couple_fingers(body: int, fingers: Sequence[int], client: int) -> None:
    """Let one of two finger joints move as far as the other, as equal forces alone leave open where both stand."""
    places = ([0, 1, 0], [0, 0, 0], [0, 0, 0])
    first, second = fingers
    gear = engine.createConstraint(body, first, body, second, engine.JOINT_GEAR, *places, physicsClientId=client)
    engine.changeConstraint(gear, gearRatio=-1, erp=0.2, maxForce=500, physicsClientId=client)
