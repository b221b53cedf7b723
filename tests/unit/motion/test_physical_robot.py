"""What the physical robot does to the physics of what it holds and lets go."""

from __future__ import annotations

from types import SimpleNamespace

import pytest
from scenewright.stages.kit.motion.physical_robot import PhysicalRobot
from scenewright.stages.kit.simulation.robot_description import load_robot


@pytest.mark.parametrize("anchored", [True, False])
def test_what_is_let_go_is_loosened_and_anchored_again_before_the_next_grasp(
    monkeypatch: pytest.MonkeyPatch, anchored: bool
) -> None:
    """A finger that opens would take along what is anchored to it; where nothing is anchored nothing becomes so."""
    told: list[str] = []
    robot = PhysicalRobot.__new__(PhysicalRobot)
    robot.world = SimpleNamespace(  # type: ignore[assignment]
        anchored=anchored, anchor_friction=lambda: told.append("anchor"), loosen=lambda name: told.append(name)
    )
    robot.robot = SimpleNamespace(grasps=lambda item: True, finger_force=0.0)  # type: ignore[assignment]
    robot.description, robot.held = load_robot("panda"), None
    monkeypatch.setattr(robot, "wait", lambda seconds: told.append("wait"))
    monkeypatch.setattr(robot, "held_pose", lambda: None)
    robot.grasp("cup_5")
    robot.release()
    robot.release()  # nothing is held any more
    assert told == [*(["anchor"] if anchored else []), "wait", "cup_5", "wait", "wait"] and robot.held is None
