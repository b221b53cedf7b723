"""What the physical robot does to the physics of what it holds and lets go."""

from __future__ import annotations

from types import SimpleNamespace

import pytest
from scenewright.stages.kit.motion.physical_robot import PhysicalRobot
from scenewright.stages.kit.simulation.robot_description import load_robot


@pytest.fixture
def anchored() -> list[bool]:
    """What the world was told of friction, one after the other."""
    return []


@pytest.fixture
def robot(anchored: list[bool], monkeypatch: pytest.MonkeyPatch) -> PhysicalRobot:
    robot = PhysicalRobot.__new__(PhysicalRobot)
    robot.world = SimpleNamespace(anchor_friction=lambda on=True: anchored.append(on))  # type: ignore[assignment]
    robot.robot = SimpleNamespace(grasps=lambda item: True, finger_force=0.0)  # type: ignore[assignment]
    robot.description, robot.held = load_robot("panda"), None
    monkeypatch.setattr(robot, "wait", lambda seconds: None)
    monkeypatch.setattr(robot, "held_pose", lambda: None)
    return robot


@pytest.mark.parametrize(("firm", "told"), [(True, [True, False]), (False, [False])])
def test_friction_is_anchored_while_a_load_is_carried(
    robot: PhysicalRobot, anchored: list[bool], firm: bool, told: list[bool]
) -> None:
    """A finger that opens would take along what is anchored to it."""
    robot.grasp("cup_5", firm=firm)
    robot.release()
    assert anchored == told and robot.held is None
