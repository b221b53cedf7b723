"""Symbols from a scene, geometry of actions, and the typed reasons when there is none."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scenewright.schemas.contact_graph import SCENE_NODE, ContactGraphFile
from scenewright.schemas.errors import UsageError
from scenewright.stages.kit.geometry.transforms import transform_from_yaw
from scenewright.stages.kit.motion.failures import MotionFailed
from scenewright.stages.kit.motion.rrt_connect import densify
from scenewright.stages.kit.simulation.robot_description import load_robot
from scenewright.stages.kit.tasks.strips import positive_task
from scenewright.stages.plan.action import MotionRequest
from scenewright.stages.plan.door_motion import plan_close
from scenewright.stages.plan.goals import default_goals
from scenewright.stages.plan.pick_place import Budgets, plan_pick
from scenewright.stages.plan.refinement import SearchSettings, plan_and_refine, refine_action
from scenewright.stages.plan.symbols import DOMAIN, parse_goal, symbolic_state, task_problem
from scenewright.stages.plan.world_model import RobotState, WorldModel, as_held

from tests.unit.simulation.handmade_scene import HandmadeBody, kitchen, write_scene

PANDA = load_robot("panda")
BUDGETS = Budgets(bases=200, pairs=800, path_samples=400, paths=4)
START = RobotState(np.zeros(3), PANDA.carry)


def model_of(root: Path, bodies: list[HandmadeBody]) -> tuple[WorldModel, ContactGraphFile]:
    write_scene(root, bodies)
    graph = ContactGraphFile.read(root / "graph.json")
    return WorldModel(root, graph, PANDA, 0.004), graph


@pytest.fixture
def kitchen_model(tmp_path: Path) -> Iterator[tuple[WorldModel, ContactGraphFile]]:
    model, graph = model_of(tmp_path, kitchen())
    yield model, graph
    model.close()


def test_symbols_of_the_kitchen(kitchen_model: tuple[WorldModel, ContactGraphFile]) -> None:
    model, graph = kitchen_model
    objects, atoms = symbolic_state(model, graph)
    assert objects["fridge_2"] == "container" and objects["table_3"] == "surface" and objects["cup_5"] == "item"
    assert {
        ("in", "bottle_7", "fridge_2"),
        ("behind", "bottle_7", "fridge_2__hinge"),
        ("open", "fridge_2__hinge"),
        ("on", "cup_5", "table_3"),
    } <= atoms
    assert ("closed", "fridge_2__hinge") not in atoms
    assert default_goals(model, atoms, 0.08) == [("on(bottle_7, table_3)", "closed(fridge_2)")]
    assert default_goals(model, frozenset(atom for atom in atoms if atom[0] != "in"), 0.08) == []


def test_a_table_that_could_be_pushed_is_no_item(tmp_path: Path) -> None:
    """Free furniture is laden, stood on and left where it is: the plan is that of a table that is fixed."""
    bodies = [replace(body, movable=True, furniture=True) if body.name == "table_3" else body for body in kitchen()]
    found = []
    for number, scene in enumerate((kitchen(), bodies)):
        model, graph = model_of(tmp_path / str(number), scene)
        objects, atoms = symbolic_state(model, graph)
        found.append((objects, atoms, default_goals(model, atoms, 0.08)))
        model.close()
    assert found[0] == found[1] and found[1][0]["table_3"] == "surface"


def test_nothing_is_put_on_what_nothing_is_known_to_carry(tmp_path: Path) -> None:
    unsure = [
        replace(body, parent=SCENE_NODE, relation="unknown") if body.name == "table_3" else body for body in kitchen()
    ]
    model, graph = model_of(tmp_path, unsure)
    objects, atoms = symbolic_state(model, graph)
    model.close()
    assert objects["table_3"] == "thing" and not any(
        atom[0] in ("flat", "fits") and "table_3" in atom for atom in atoms
    )
    with pytest.raises(UsageError, match="table_3 is a thing"):
        parse_goal(("on(bottle_7, table_3)",), objects)


def test_what_the_fingers_cannot_hold_is_not_graspable(tmp_path: Path) -> None:
    heavy = [replace(body, mass=30.0) if body.name == "cup_5" else body for body in kitchen()]
    model, graph = model_of(tmp_path, heavy)
    _, atoms = symbolic_state(model, graph)
    model.close()
    assert ("graspable", "cup_5") not in atoms and ("graspable", "bottle_7") in atoms


def test_goal_literals(kitchen_model: tuple[WorldModel, ContactGraphFile]) -> None:
    objects, _ = symbolic_state(*kitchen_model)
    atoms, literals = parse_goal(("on(bottle_7,table_3)", " closed( fridge_2 )"), objects)
    assert atoms == {("on", "bottle_7", "table_3"), ("closed", "fridge_2__hinge")}
    assert literals == ("on(bottle_7, table_3)", "closed(fridge_2)")
    for text, reason in (
        ("on(bottle_8, table_3)", "no 'bottle_8'"),
        ("on(bottle_7, cup_9)", "no 'cup_9'"),
        ("on(table_3, bottle_7)", "needs a item"),
        ("upon(bottle_7, table_3)", "no predicate"),
        ("on(bottle_7)", "2 arguments"),
        ("put it there", "not a literal"),
    ):
        with pytest.raises(UsageError, match=reason):
            parse_goal((text,), objects)


def test_every_motion_of_a_refined_plan_is_free_of_collision(
    kitchen_model: tuple[WorldModel, ContactGraphFile],
) -> None:
    """The drives and the free motions are replayed densely against the checker, holding what is held."""
    model, graph = kitchen_model
    objects, initial = symbolic_state(model, graph)
    goal, _ = parse_goal(("on(bottle_7, table_3)",), objects)
    attempt = plan_and_refine(
        model,
        START,
        positive_task(DOMAIN, task_problem(objects, initial, goal)),
        BUDGETS,
        np.random.default_rng(0),
        SearchSettings("add", task_attempts=2, refinement_attempts=3),
    )
    assert attempt.steps is not None
    assert [step.name for step in attempt.steps] == ["drive", "pick", "drive", "place"]
    pick = attempt.steps[1].manipulation
    assert pick is not None and pick.tool_from_item is not None
    resolution = np.concatenate([[0.01, 0.01, 0.02], np.full(7, 0.02)])
    held = RobotState(pick.base, PANDA.carry, "bottle_7", pick.tool_from_item)
    checked = 0
    end = np.concatenate([START.base, START.arm])
    for step in attempt.steps:
        for segment in step.segments:
            np.testing.assert_allclose(segment.path[0], end, atol=1e-6)  # the pieces join
            end = segment.path[-1]
        segments = [segment for segment in step.segments if segment.pace > 0.5]
        for segment in segments:
            checker = model.checker.under(as_held(model, held if segment.item == "bottle_7" else START))
            if segment.item != "bottle_7" and step.name == "place":
                model.world.set_pose("bottle_7", attempt.steps[3].manipulation.item_pose)  # type: ignore[union-attr,arg-type]
            for row in densify(segment.path, resolution):
                collision = checker.check(row)
                assert collision is None or collision.depth < 0.002, (step.text, collision)
                checked += 1
    assert checked > 300


def test_too_wide_for_the_gripper(tmp_path: Path) -> None:
    wide = HandmadeBody(
        "box_9",
        "box",
        transform_from_yaw(0.0, np.array([-1.3, -1.0, 0.75])),
        [((0, 0, 0.1), (0.15, 0.14, 0.2))],
        "table_3",
        movable=True,
        mass=0.3,
    )
    model, _ = model_of(tmp_path, [*kitchen(), wide])
    try:
        with pytest.raises(MotionFailed) as raised:
            plan_pick(model, START, "box_9", "table_3", BUDGETS, np.random.default_rng(0))
    finally:
        model.close()
    failure = raised.value.failure
    assert failure.kind == "no_grasp"
    assert failure.objects == ("box_9",)
    assert failure.numbers["width"] == pytest.approx(0.14, abs=0.003)


def test_out_of_reach(tmp_path: Path) -> None:
    bodies = kitchen()
    next(body for body in bodies if body.name == "bottle_7").world_from_body[2, 3] = 2.4
    model, _ = model_of(tmp_path, bodies)
    try:
        with pytest.raises(MotionFailed) as raised:
            plan_pick(model, START, "bottle_7", "fridge_2", BUDGETS, np.random.default_rng(0))
    finally:
        model.close()
    failure = raised.value.failure
    assert failure.kind == "no_inverse_kinematics"
    assert failure.numbers["unreachable"] == failure.numbers["tried"] > 100
    assert 0.2 < failure.numbers["nearest_distance"] < 1.2


def test_behind_a_shut_door_the_door_is_named(tmp_path: Path) -> None:
    model, _ = model_of(tmp_path, kitchen(door_value=0.0))
    before = model.pose("bottle_7")
    try:
        with pytest.raises(MotionFailed) as raised:
            plan_pick(model, START, "bottle_7", "fridge_2", BUDGETS, np.random.default_rng(0))
        np.testing.assert_array_equal(model.pose("bottle_7"), before)
    finally:
        model.close()
    failure = raised.value.failure
    assert failure.kind == "goal_in_collision"
    assert set(failure.objects) & {"fridge_2__door", "fridge_2"}
    assert failure.numbers["depth"] > 0


def test_a_robot_walled_in_cannot_drive(tmp_path: Path) -> None:
    cage = HandmadeBody(
        "cabinet_8",
        "cabinet",
        np.eye(4),
        [
            ((x, y, 0.5), (0.1 + 1.4 * (x == 0), 0.1 + 1.4 * (y == 0), 1.0))
            for x, y in ((0.7, 0), (-0.7, 0), (0, 0.7), (0, -0.7))
        ],
        "floor_1",
    )
    model, _ = model_of(tmp_path, [*kitchen(), cage])
    try:
        with pytest.raises(MotionFailed) as raised:
            refine_action(
                model,
                START,
                "pick",
                MotionRequest(("bottle_7", "fridge_2"), BUDGETS, np.random.default_rng(0)),
                "start",
            )
    finally:
        model.close()
    failure = raised.value.failure
    assert failure.kind == "no_path"
    assert failure.objects == ("cabinet_8",)
    assert failure.message.startswith("driving")


def test_a_door_that_something_blocks_cannot_be_shut(tmp_path: Path) -> None:
    """A crate stands where the arm would have to be on the whole outside of the door."""
    blocks = [((0.2, 0.6, 0.8), (0.9, 1.6, 1.6)), ((1.2, -0.2, 0.8), (3, 1.2, 1.6)), ((1.9, 1.0, 0.8), (1.1, 1.6, 1.6))]
    crate = HandmadeBody("box_8", "box", np.eye(4), blocks, "floor_1")
    model, _ = model_of(tmp_path, [*kitchen(), crate])
    try:
        with pytest.raises(MotionFailed) as raised:
            plan_close(
                model, START, "fridge_2", "fridge_2__hinge", MotionRequest((), BUDGETS, np.random.default_rng(0))
            )
    finally:
        model.close()
    failure = raised.value.failure
    assert failure.kind in ("goal_in_collision", "no_inverse_kinematics", "no_path")
    assert "fridge_2__hinge" in failure.objects


def test_what_the_hand_cannot_take_is_known_before_any_geometry(tmp_path: Path) -> None:
    wide = HandmadeBody(
        "box_9",
        "box",
        transform_from_yaw(0.0, np.array([-1.3, -1.0, 0.75])),
        [((0, 0, 0.1), (0.15, 0.14, 0.2))],
        "table_3",
        movable=True,
        mass=0.3,
    )
    bodies = [*kitchen(), wide]
    model, graph = model_of(tmp_path, bodies)
    try:
        objects, initial = symbolic_state(model, graph)
        goal, _ = parse_goal(("holding(box_9)",), objects)
        attempt = plan_and_refine(
            model,
            START,
            positive_task(DOMAIN, task_problem(objects, initial, goal)),
            BUDGETS,
            np.random.default_rng(0),
            SearchSettings("add", task_attempts=3, refinement_attempts=2),
        )
    finally:
        model.close()
    assert attempt.steps is None
    assert [failure.kind for failure in attempt.failures] == ["goal_unsatisfiable"]
    assert "box_9 is not graspable" in attempt.failures[0].message
