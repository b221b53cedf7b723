"""What is no domain, no scene and no task ends in one line; what was taught until then is kept."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.predicates.evaluating import Evaluator
from scenewright.stages.kit.predicates.expressions import Predicate, check, read
from scenewright.stages.kit.tasks.pddl import parse_domain
from scenewright.stages.predicates.learning.memory import Memory
from scenewright.stages.predicates.learning.ours import OursLearner
from scenewright.stages.predicates.state import KITCHEN_WORDS, Seen, State
from scenewright.stages.predicates.tasks import layout
from scenewright.stages.predicates.teach_stage import write_predicates
from scenewright.stages.predicates.teacher.simulated import SimulatedTeacher
from scenewright.stages.predicates.truth import true_predicates

TABLE = State({"can": Seen(0.0, 0.0, 3.0, 3.0, "can"), "cup": Seen(9.0, 0.0, 4.0, 4.0, "cup")})


def test_predicates_that_need_each_other_are_refused() -> None:
    circle = {"p": Predicate("p", 1, read("(not (q ?a))", "p")), "q": Predicate("q", 1, read("(p ?a)", "q"))}
    with pytest.raises(BadInput, match="defined by itself") as refused:
        check(circle, KITCHEN_WORDS)
    assert "\n" not in str(refused.value)


def test_a_type_that_is_nowhere_is_refused() -> None:
    text = "(define (domain d) (:types thing) (:predicates (p ?a - wing)))"
    with pytest.raises(BadInput, match="wing") as refused:
        parse_domain(text)
    assert "\n" not in str(refused.value)


def test_an_empty_scene_holds_nothing_and_is_written(tmp_path: Path) -> None:
    empty = State({})
    atoms = Evaluator(empty, true_predicates()).atoms()
    assert atoms == {("gripper_empty",)}
    memory = Memory()
    memory.remember(empty)
    write_predicates(memory, tmp_path)
    assert (tmp_path / "predicates.txt").is_file() and not (tmp_path / "predicates.png").exists()


def test_objects_that_do_not_fit_are_named() -> None:
    names = ("shelf", "pot", *(["basket"] * 12))
    with pytest.raises(BadInput, match="shelf, pot, basket") as refused:
        layout(names, np.random.default_rng(0), 0.0)
    assert "\n" not in str(refused.value)


def test_a_teacher_who_contradicts_herself_is_asked_again() -> None:
    """She says that a can is too wide to grasp, and then lets it be picked up."""
    learner = OursLearner(SimulatedTeacher("store_objects", 0), ("pick_up",), 0)
    learner.refused(TABLE, ("pick_up", "can"), "object can can not be grasped by the gripper as it is too wide")
    learner.allowed(TABLE, ("pick_up", "can"), State(TABLE.objects, 0.0, 2.0, 3.0, 0.4))
    memory = learner.memory
    assert memory.disbelieved == ["object can can not be grasped by the gripper as it is too wide"]
    assert not memory.preconditions().get("pick_up") and len(memory.transitions) == 1
    assert [turn.believed for turn in memory.dialogue if turn.about.startswith("pick_up")] == [False]


def test_an_action_that_her_domain_does_not_know_is_refused_without_a_word() -> None:
    """A learner that comes from another domain tries what was possible there."""
    teacher = SimulatedTeacher("cook_meal", 1)
    action = ("push_plate_on_object", "cup", "can")
    assert not teacher.allows(TABLE, action) and teacher.correct(TABLE, action) == ""
