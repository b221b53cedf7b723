"""What failures teach, tree states, bodies joined for lifting, and named priors, without any search for motions."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scenewright.schemas.contact_graph import ContactGraphFile
from scenewright.schemas.errors import UsageError
from scenewright.schemas.plan import BodyMatch, Failure
from scenewright.stages.kit.geometry.transforms import inverse, transform_from_yaw
from scenewright.stages.kit.motion.segments import Manipulation
from scenewright.stages.kit.simulation.carriers import HAND
from scenewright.stages.kit.tasks.strips import GroundAction, ground
from scenewright.stages.kit.tasks.task_planner import plan_task
from scenewright.stages.plan.assumptions import believe, match_beliefs, parse_priors
from scenewright.stages.plan.domain import DOMAIN
from scenewright.stages.plan.joined_bodies import _roll_pitch_yaw
from scenewright.stages.plan.learning import Lessons
from scenewright.stages.plan.refinement import Step
from scenewright.stages.plan.symbols import parse_goal, symbolic_state, task_problem
from scenewright.stages.plan.tree_state import after_step, start_state
from scenewright.stages.plan.world_model import WorldModel
from scipy.spatial.transform import Rotation


def action(name: str, *arguments: str, pre: tuple = (), add: tuple = ()) -> GroundAction:
    return GroundAction(name, arguments, frozenset(pre), frozenset(add), frozenset())


def failure(kind: str, *objects: str, **numbers: float) -> Failure:
    return Failure(kind=kind, message="x", objects=objects, numbers=numbers)


PICK_CUP = action("pick", "cup", "table")
PICK_CAN = action("pick", "can", "table", add=(("holding", "can"),))
OPEN = action("open", "fridge__door_hinge", add=(("open", "fridge__door_hinge"),))
CLOSE = action("close", "fridge__door_hinge", add=(("closed", "fridge__door_hinge"),))
ALL = [PICK_CUP, PICK_CAN, action("take_out", "cup", "fridge", "fridge__door_hinge"), OPEN, CLOSE]


def test_what_stands_in_the_way_is_moved_first_and_only_then_given_up() -> None:
    lessons = Lessons()
    lessons.learn(PICK_CUP, failure("goal_in_collision", "cup", "table", "can"), ALL, frozenset())
    after = {entry.text: entry for entry in lessons.apply(ALL)}
    assert ("moved", "can") in after["pick(cup, table)"].preconditions
    assert ("moved", "can") in after["pick(can, table)"].add
    lessons.learn(PICK_CUP, failure("goal_in_collision", "cup", "table", "can"), ALL, frozenset())
    assert "pick(cup, table)" not in {entry.text for entry in lessons.apply(ALL)}
    assert len(lessons.words) == 2


def test_a_door_in_the_way_is_asked_to_be_the_other_way() -> None:
    for state, wanted in ((("closed",), "open"), (("open",), "closed")):
        lessons = Lessons()
        atoms = frozenset((word, "fridge__door_hinge") for word in state)
        lessons.learn(PICK_CUP, failure("no_path", "cup", "fridge__door"), ALL, atoms)
        after = {entry.text: entry for entry in lessons.apply(ALL)}
        assert (wanted, "fridge__door_hinge") in after["pick(cup, table)"].preconditions


def test_too_wide_is_too_wide_everywhere() -> None:
    lessons = Lessons()
    lessons.learn(PICK_CUP, failure("no_grasp", "cup"), ALL, frozenset())
    left = {entry.text for entry in lessons.apply(ALL)}
    assert left == {"pick(can, table)", OPEN.text, CLOSE.text}
    lessons = Lessons()
    lessons.learn(PICK_CUP, failure("no_inverse_kinematics", "cup", tried=9, unreachable=9), ALL, frozenset())
    assert "take_out(cup, fridge, fridge__door_hinge)" in {entry.text for entry in lessons.apply(ALL)}


def test_angles_of_urdf_agree_with_scipy() -> None:
    for rotation in Rotation.random(20, random_state=3):
        pose = np.eye(4)
        pose[:3, :3] = rotation.as_matrix()
        again = Rotation.from_euler("xyz", _roll_pitch_yaw(pose))
        assert (again * rotation.inv()).magnitude() < 1e-6


def test_a_load_is_lifted_as_one_body_and_set_down_where_it_went(model: WorldModel) -> None:
    cup = model.pose("cup_5")
    model.put_on("cup_5", "bottle_7")  # whatever stands on it: the bottle is the carrier here
    bottle = model.pose("bottle_7")
    model.take_aboard("bottle_7")
    assert model.laden("bottle_7") and "cup_5" not in model.world.bodies
    np.testing.assert_allclose(model.pose("cup_5"), cup, atol=1e-6)
    there = transform_from_yaw(0.7, np.array([0.3, -0.2, 1.1]))
    model.world.set_pose("bottle_7", there)
    assert "cup_5" not in model.links("bottle_7")
    model.set_down()
    assert not model.laden("bottle_7")
    np.testing.assert_allclose(model.pose("cup_5"), there @ inverse(bottle) @ cup, atol=1e-6)


def test_tree_states_follow_the_actions(model: WorldModel) -> None:
    start = start_state(model)
    assert start.parents["bottle_7"] == "fridge_2" and start.parents["cup_5"] == "table_3"
    pick = Step("pick", ("bottle_7", "fridge_2"), (), Manipulation(np.zeros(3), ()))
    held = after_step(start, pick)
    assert held.parents["bottle_7"] == HAND and held.held == "bottle_7"
    there = transform_from_yaw(0.0, np.array([-1.3, -1.0, 0.76]))
    put = Manipulation(np.zeros(3), (), item_pose=there)
    placed = after_step(held, Step("place", ("bottle_7", "table_3"), (), put))
    assert placed.parents["bottle_7"] == "table_3" and placed.held is None
    np.testing.assert_allclose(placed.poses["bottle_7"], there)
    shut = after_step(
        placed,
        Step("close", ("fridge_2__hinge",), (), Manipulation(np.zeros(3), (), joint_values={"fridge_2__hinge": 0.0})),
    )
    assert shut.joints["fridge_2__hinge"] == 0.0 and start.joints["fridge_2__hinge"] > 0.5


def test_a_named_prior_makes_a_task_possible(model: WorldModel, scene: Path) -> None:
    graph = ContactGraphFile.read(scene / "graph.json")
    beliefs = parse_priors(("in(can, fridge_2)",), model)
    graph = believe(model, graph, beliefs)
    name = beliefs[0].name
    objects, initial = symbolic_state(model, graph)
    assert ("in", name, "fridge_2") in initial and ("graspable", name) in initial
    goal, _ = parse_goal((f"on({name}, table_3)",), objects)
    problem = task_problem(objects, initial, goal)
    found = plan_task(problem, ground(DOMAIN, problem))
    assert found.actions is not None and found.actions[-1].name == "place"
    matches = {"fridge_2": BodyMatch(body="fridge_2", matched="fridge_2")}
    room = {"fridge_2": model.records["fridge_2"], "bottle_7": model.records["bottle_7"]}
    assert match_beliefs(beliefs, matches, room)[name].matched is None  # a bottle is no can
    room["bottle_7"] = room["bottle_7"].model_copy(update={"class_name": "can"})
    assert match_beliefs(beliefs, matches, room)[name].matched == "bottle_7"


@pytest.mark.parametrize("prior", ["in(bottle)", "in(sofa, fridge_2)", "in(bottle, cup_5)", "in(bottle, nowhere_1)"])
def test_bad_priors(prior: str, model: WorldModel) -> None:
    with pytest.raises(UsageError):
        parse_priors((prior,), model)


PUT = action("place", "cup", "table", pre=(("holding", "cup"), ("near", "table"), ("flat", "table")))


@pytest.mark.parametrize("kind", ["goal_in_collision", "no_path", "start_in_collision"])
def test_what_was_held_at_first_is_put_down_and_taken_otherwise_once(kind: str) -> None:
    lessons = Lessons(held="cup")
    lessons.learn(PUT, failure(kind, "cup", "table"), [*ALL, PUT], frozenset())
    after = {entry.text: entry for entry in lessons.apply([*ALL, PUT])}
    assert after["place(cup, table)"].preconditions == PUT.preconditions | {("moved", "cup")}
    assert ("moved", "cup") in after["pick(cup, table)"].add
    assert ("moved", "cup") in after["take_out(cup, fridge, fridge__door_hinge)"].add
    assert ("moved", "cup") not in after["pick(can, table)"].add
    assert lessons.blocked == set()
    lessons.learn(PUT, failure(kind, "cup", "table"), [*ALL, PUT], frozenset())
    assert "place(cup, table)" not in {entry.text for entry in lessons.apply([*ALL, PUT])}
    assert len(lessons.words) == 2


def test_only_what_was_held_at_first_has_to_be_taken_otherwise() -> None:
    """A thing that the plan itself picked up was taken by a grasp of its choice; so was anything when nothing was held.
    What cannot be put down for want of room cannot by another grasp either."""
    in_the_way = failure("goal_in_collision", "cup", "table")
    for lessons, reason in (
        (Lessons(), in_the_way),
        (Lessons(held="can"), in_the_way),
        (Lessons(held="cup"), failure("no_placement", "cup", "table")),
    ):
        lessons.learn(PUT, reason, [*ALL, PUT], frozenset())
        assert lessons.needs == {} and lessons.blocked == {("place", ("cup", "table"))}


def test_what_can_be_moved_out_of_the_way_is_moved_before_another_grasp_is_tried() -> None:
    lessons = Lessons(held="cup")
    lessons.learn(PUT, failure("goal_in_collision", "cup", "table", "can"), [*ALL, PUT], frozenset())
    assert lessons.needs == {("place", ("cup", "table")): frozenset({("moved", "can")})}
    lessons.learn(PUT, failure("goal_in_collision", "cup", "table"), [*ALL, PUT], frozenset())
    assert lessons.needs[("place", ("cup", "table"))] == {("moved", "can"), ("moved", "cup")}


def test_the_task_search_finds_the_way_round_with_a_held_thing() -> None:
    """Held, it cannot be put on the table: it is put on the shelf, taken again and then put on the table."""
    objects = {"start": "spot", "cup": "item", "table": "surface", "shelf": "surface"}
    initial = {("near", "start"), ("holding", "cup"), ("graspable", "cup")}
    initial |= {(word, name) for name in ("cup", "table", "shelf") for word in ("reachable", "flat")}
    initial |= {("fits", "cup", name) for name in ("table", "shelf")} | {("clear", "cup")}
    problem = task_problem(objects, frozenset(initial), frozenset({("on", "cup", "table")}))
    actions = ground(DOMAIN, problem)
    direct = plan_task(problem, actions).actions
    assert direct is not None and [entry.name for entry in direct] == ["drive", "place"]
    lessons = Lessons(held="cup")
    lessons.learn(direct[1], failure("no_path", "table"), actions, problem.initial)
    around = plan_task(problem, lessons.apply(actions)).actions
    assert around is not None
    assert [entry.text for entry in around if entry.name != "drive"] == [
        "place(cup, shelf)",
        "pick(cup, shelf)",
        "place(cup, table)",
    ]
