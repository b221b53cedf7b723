"""The first state and the problem of a plan that is made in the middle of an execution, with a scripted search."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scenewright.schemas.contact_graph import ContactGraphFile
from scenewright.schemas.plan import Failure, TriedPlan
from scenewright.stages.kit.geometry.transforms import transform_from_yaw
from scenewright.stages.kit.motion.failures import MotionFailed
from scenewright.stages.kit.simulation.carriers import HAND, NOTHING
from scenewright.stages.kit.tasks.strips import GroundAction, Problem
from scenewright.stages.plan.believed_tree import TreeState
from scenewright.stages.plan.reading import Reading
from scenewright.stages.plan.refinement import Attempt, Step
from scenewright.stages.plan.replanning import Replanning, in_the_middle
from scenewright.stages.plan.tree_state import start_state
from scenewright.stages.plan.world_model import RobotState, WorldModel

FIRST = frozenset(
    {
        ("hand_empty",),
        ("on", "cup", "tray"),
        ("carried_along", "cup", "tray"),
        ("on", "tray", "desk"),
        ("in", "can", "fridge"),
        ("behind", "can", "hinge"),
        ("clear", "cup"),
        ("near", "start"),
        ("unmoved", "cup"),
        ("unmoved", "tray"),
        ("unmoved", "can"),
    }
)


def tree(**parents: str) -> TreeState:
    return TreeState({"cup": "tray", "tray": "desk", "can": "fridge"} | parents, {}, {})


def test_nothing_has_changed() -> None:
    assert in_the_middle(FIRST, None, tree(), tree()) == FIRST


@pytest.mark.parametrize("there", ["table", HAND, NOTHING, "room:bin_4"])
def test_what_stands_on_something_else_has_been_moved(there: str) -> None:
    """A tray that was carried is no tray that can still be loaded for its journey; what stands on it stays."""
    assert in_the_middle(FIRST, None, tree(), tree(tray=there)) == FIRST - {("unmoved", "tray")}


@pytest.mark.parametrize(
    ("held", "gone"),
    [
        ("cup", {("on", "cup", "tray"), ("carried_along", "cup", "tray"), ("unmoved", "cup")}),
        ("can", {("in", "can", "fridge"), ("behind", "can", "hinge"), ("unmoved", "can")}),
        ("tray", {("on", "tray", "desk"), ("unmoved", "tray")}),  # the cup on it goes along
    ],
)
def test_what_the_hand_holds_stands_nowhere(held: str, gone: set[tuple[str, ...]]) -> None:
    found = in_the_middle(FIRST, held, tree(), tree(**{held: HAND}))
    assert found == (FIRST - gone - {("hand_empty",)}) | {("holding", held)}


# --- in the handmade kitchen ----------------------------------------------------------------------------------


class Script:
    """A search that notes what it is asked and says what it is told to."""

    def __init__(self, *answers: Attempt | MotionFailed) -> None:
        self.answers = list(answers)
        self.asked: list[tuple[RobotState, Problem]] = []

    def __call__(self, state: RobotState, task: tuple[Problem, list[GroundAction]]) -> Attempt:
        self.asked.append((state, task[0]))
        answer = self.answers.pop(0)
        if isinstance(answer, MotionFailed):
            raise answer
        return answer


def replanning(model: WorldModel, scene: Path, script: Script, *literals: str) -> Replanning:
    graph = ContactGraphFile.read(scene / "graph.json")
    return Replanning(model, graph, start_state(model), literals, Reading(), script)


def seen(start: TreeState, name: str, parent: str, pose: np.ndarray, held: str | None = None) -> TreeState:
    return replace(start, parents={**start.parents, name: parent}, poses={**start.poses, name: pose}, held=held)


STEP = Step("pick", ("bottle_7", "table_3"), (), None)


def test_the_search_begins_with_what_a_look_showed(model: WorldModel, scene: Path) -> None:
    """The bottle of the fridge was put on the table, then the plan failed: the new one begins with it there."""
    script = Script(Attempt([], [STEP], [], (TriedPlan(actions=("pick(bottle_7, table_3)",)),), ("a lesson",)))
    anew = replanning(model, scene, script, "in(bottle_7, fridge_2)", "closed(fridge_2)")
    there = transform_from_yaw(0.0, np.array([-1.3, -1.0, 0.75]))
    model.world.set_pose("bottle_7", there)
    state = RobotState(np.array([0.1, 0.2, 0.3]), model.description.carry)
    steps = anew.plan(state, anew.believed, seen(anew.believed, "bottle_7", "table_3", there), 4)
    assert steps == [STEP] and anew.places == [4]
    assert model.records["bottle_7"].parent == "table_3" and "bottle_7" in model.load("table_3")
    ((asked, problem),) = script.asked
    assert asked is state
    assert ("on", "bottle_7", "table_3") in problem.initial and ("hand_empty",) in problem.initial
    assert not {("in", "bottle_7", "fridge_2"), ("behind", "bottle_7", "fridge_2__hinge")} & problem.initial
    assert ("unmoved", "bottle_7") not in problem.initial and ("unmoved", "cup_5") in problem.initial
    assert problem.goal == {("in", "bottle_7", "fridge_2"), ("closed", "fridge_2__hinge")}
    assert [entry.actions for entry in anew.tried] == [("pick(bottle_7, table_3)",)]
    assert anew.learned == ["a lesson"] and anew.failures == []


def test_with_something_in_the_hand(model: WorldModel, scene: Path) -> None:
    script = Script(Attempt([], [], []))
    anew = replanning(model, scene, script, "on(cup_5, table_3)")
    held = seen(anew.believed, "cup_5", HAND, model.pose("cup_5"), held="cup_5")
    assert anew.plan(RobotState(np.zeros(3), model.description.carry, "cup_5"), anew.believed, held, 1) == []
    initial = script.asked[0][1].initial
    assert ("holding", "cup_5") in initial and ("hand_empty",) not in initial
    assert not [atom for atom in initial if atom[0] in ("on", "in", "unmoved") and atom[1] == "cup_5"]
    assert ("in", "bottle_7", "fridge_2") in initial
    assert model.records["cup_5"].parent == "table_3"  # the hand is no body


def test_what_stands_on_what_is_held_goes_along(model: WorldModel, scene: Path) -> None:
    """In every motion that is searched for, though geometry puts the model back after each failure."""
    laden = []

    def search(state: RobotState, task: tuple[Problem, list[GroundAction]]) -> Attempt:
        snapshot = model.snapshot()
        for _ in range(2):
            laden.append(model.laden("bottle_7"))
            model.set_down()
            model.restore(snapshot)
        return Attempt([], [], [])

    start = start_state(model)
    over = model.pose("bottle_7") @ transform_from_yaw(0.0, np.array([0.0, 0.0, 0.2]))
    model.world.set_pose("cup_5", over)
    anew = Replanning(
        model, ContactGraphFile.read(scene / "graph.json"), start, ("on(bottle_7, table_3)",), Reading(), search
    )
    held = seen(seen(start, "cup_5", "bottle_7", over), "bottle_7", HAND, model.pose("bottle_7"), held="bottle_7")
    anew.plan(RobotState(np.zeros(3), model.description.carry, "bottle_7"), start, held, 1)
    assert laden == [True, True] and model.laden("bottle_7")
    np.testing.assert_allclose(model.pose("cup_5"), over, atol=1e-6)


def test_a_door_that_stands_otherwise_is_seen(model: WorldModel, scene: Path) -> None:
    script = Script(Attempt([], [], []))
    anew = replanning(model, scene, script, "holding(cup_5)")
    model.move_joint("fridge_2__hinge", 0.0)
    shut = replace(anew.believed, joints={"fridge_2__hinge": 0.0})
    anew.plan(RobotState(np.zeros(3), model.description.carry), anew.believed, shut, 0)
    initial = script.asked[0][1].initial
    assert ("closed", "fridge_2__hinge") in initial and ("open", "fridge_2__hinge") not in initial


def test_failures_of_every_search_are_kept_and_only_plans_count(model: WorldModel, scene: Path) -> None:
    no_way = Failure(kind="goal_unsatisfiable", message="no way")
    script = Script(
        Attempt(None, None, [no_way], (TriedPlan(actions=("x",)),), ("first",)),
        MotionFailed("start_in_collision", "the robot stands in the table", ("table_3",), {"depth": 0.02}),
        Attempt([], [STEP], [no_way], (), ("second",)),
    )
    anew = replanning(model, scene, script, "holding(cup_5)")
    state = RobotState(np.zeros(3), model.description.carry)
    results = [anew.plan(state, anew.believed, anew.believed, number) for number in (2, 3, 5)]
    assert results == [None, None, [STEP]] and anew.places == [5]
    assert [failure.kind for failure in anew.failures] == [
        "goal_unsatisfiable",
        "start_in_collision",
        "goal_unsatisfiable",
    ]
    assert anew.learned == ["first", "second"] and len(anew.tried) == 1
