"""Where the robot starts: free, roomy, and, where the log is given, where its camera was."""

from __future__ import annotations

import numpy as np
import pytest
from scenewright.stages.kit.motion.failures import MotionFailed
from scenewright.stages.plan.start_pose import SHELL, start_base
from scenewright.stages.plan.world_model import WorldModel


def start(model: WorldModel, cameras: np.ndarray | None = None) -> np.ndarray:
    return start_base(model, model.description.carry, np.random.default_rng(0), cameras=cameras)


def is_free(model: WorldModel, base: np.ndarray) -> bool:
    return model.checker.check(np.concatenate([base, model.description.carry])) is None


def test_the_start_is_free(model: WorldModel) -> None:
    assert is_free(model, start(model))


def test_the_start_is_where_the_camera_was(model: WorldModel) -> None:
    roomiest = start(model)[:2]
    cupboard = next(model.pose(name)[:2, 3] for name, entry in model.records.items() if entry.class_name == "fridge")
    cameras = np.array([[*cupboard, 1.4], [*(roomiest + [0.3, 0.1]), 1.5]])
    base = start(model, cameras)
    assert base[:2] == pytest.approx(cameras[1, :2]) and is_free(model, base)


def test_the_robot_looks_at_the_middle_of_what_stands_about(model: WorldModel) -> None:
    base = start(model, np.array([[*start(model)[:2], 1.5]]))
    boxes = [model.world.bounds(name) for name, e in model.records.items() if e.class_name not in SHELL]
    middle = np.mean([(low[:2] + high[:2]) / 2 for low, high in boxes if low[2] < 1.0], axis=0)
    ahead = middle - base[:2]
    assert np.array([np.cos(base[2]), np.sin(base[2])]) == pytest.approx(ahead / np.linalg.norm(ahead), abs=1e-6)


def test_no_place_under_the_camera_is_free(model: WorldModel) -> None:
    cupboard = next(model.pose(name)[:2, 3] for name, entry in model.records.items() if entry.class_name == "fridge")
    with pytest.raises(MotionFailed, match="none of 1 places"):
        start(model, np.array([[*cupboard, 1.4]]))


def test_without_a_path_of_the_camera_it_is_the_roomiest(model: WorldModel) -> None:
    assert start(model, np.zeros((0, 3))) == pytest.approx(start(model))
