"""Ways of the base: with room to spare, out of what it is believed to stand in, to another base if one is shut in."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scenewright.schemas.contact_graph import ContactGraphFile
from scenewright.stages.kit.motion.failures import MotionFailed
from scenewright.stages.kit.simulation.robot_description import load_robot
from scenewright.stages.plan import refinement
from scenewright.stages.plan.action import MotionRequest
from scenewright.stages.plan.driving import ROOM, drive_way
from scenewright.stages.plan.pick_place import Budgets
from scenewright.stages.plan.refinement import refine_action
from scenewright.stages.plan.world_model import RobotState, WorldModel

from tests.unit.simulation.handmade_scene import HandmadeBody, floor, kitchen, write_scene

PANDA = load_robot("panda")
GOAL = np.array([2.0, 0.0, 0.0])


def model_of(root: Path, bodies: list[HandmadeBody]) -> WorldModel:
    write_scene(root, bodies)
    return WorldModel(root, ContactGraphFile.read(root / "graph.json"), PANDA, 0.004)


def post(x: float, y: float) -> HandmadeBody:
    return HandmadeBody("box_9", "box", np.eye(4), [((x, y, 0.25), (0.1, 0.1, 0.5))], "floor_1")


def test_a_way_keeps_room_where_there_is_room(tmp_path: Path) -> None:
    model = model_of(tmp_path, [floor(), post(1.0, 0.0)])
    try:
        way = drive_way(model, RobotState(np.zeros(3), PANDA.carry), GOAL, np.random.default_rng(0), 800)
        with model.checker.keeping(0.9 * ROOM):  # the ways between the checked places come a little nearer
            assert all(model.checker.check(np.concatenate([base, PANDA.carry])) is None for base in way)
    finally:
        model.close()


def test_a_base_believed_to_stand_in_something_steps_aside(tmp_path: Path) -> None:
    """The pedestal stands a centimetre deep in the post."""
    model = model_of(tmp_path, [floor(), post(0.0, 0.0)])
    try:
        inside = next(
            np.array([x, 0.0, 0.0])
            for x in np.arange(-0.6, 0.0, 0.005)
            if model.checker.check(np.array([x + 0.01, 0.0, 0.0, *PANDA.carry])) is not None
        ) + np.array([0.02, 0.0, 0.0])
        state = RobotState(inside, PANDA.carry)
        assert model.checker.check(np.concatenate([inside, PANDA.carry])) is not None
        way = drive_way(model, state, GOAL, np.random.default_rng(0), 800)
        assert way[0] == pytest.approx(inside)
        assert all(model.checker.check(np.concatenate([base, PANDA.carry])) is None for base in way[1:])
        with pytest.raises(MotionFailed):
            drive_way(
                model, RobotState(np.zeros(3), PANDA.carry), GOAL, np.random.default_rng(0), 100
            )  # in the middle of it
    finally:
        model.close()


def test_an_action_leaves_a_base_that_is_shut_in_for_another(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    model, tried = model_of(tmp_path, kitchen()), []
    way = refinement.drive_way

    def blocked_once(model, state, goal, random, samples):  # type: ignore[no-untyped-def]
        tried.append(goal)
        if len(tried) == 1:
            raise MotionFailed("no_path", "driving: shut in", ())
        return way(model, state, goal, random, samples)

    monkeypatch.setattr(refinement, "drive_way", blocked_once)
    budgets = Budgets(bases=200, pairs=800, path_samples=400, paths=4)
    try:
        request = MotionRequest(("cup_5", "table_3"), budgets, np.random.default_rng(0))
        steps, _ = refine_action(model, RobotState(np.zeros(3), PANDA.carry), "pick", request, "start")
    finally:
        model.close()
    assert [step.name for step in steps] == ["drive", "pick"]
    assert len(tried) == 2 and not np.allclose(tried[0], tried[1])
