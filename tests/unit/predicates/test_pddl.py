"""What is exported as PDDL is read back by a parser that is not ours (AI-Planning's `pddl`)."""

from __future__ import annotations

from pathlib import Path

import pddl
import pytest
from pddl.logic.predicates import Predicate
from pddl.logic.terms import Constant
from scenewright.stages.kit.tasks.pddl import domain_text, parse_domain, problem_text
from scenewright.stages.kit.tasks.strips import Domain, Problem, Schema
from scenewright.stages.predicates.tasks import open_kitchen, tasks_of
from scenewright.stages.predicates.truth import truth_of

from tests.unit.predicates.test_learning import taught


def as_read(text: str, tmp_path: Path) -> dict[str, tuple[int, int]]:
    """Return the actions of a domain as the other parser reads them: parameters, literals of the precondition."""
    path = tmp_path / "domain.pddl"
    path.write_text(text)
    found = {}
    for action in pddl.parse_domain(path).actions:
        precondition = action.precondition
        parts = getattr(precondition, "operands", (precondition,))
        found[action.name] = (len(action.parameters), len(parts))
    return found


@pytest.mark.parametrize("name", ["store_objects", "cook_meal"])
def test_a_learned_domain_is_read_back(name: str, tmp_path: Path) -> None:
    domain = taught(name, tasks=4).memory.domain(name)
    read = as_read(domain_text(domain), tmp_path)
    assert read == {each.name: (len(each.parameters), len(each.preconditions)) for each in domain.schemas}


@pytest.mark.parametrize("name", ["store_objects", "set_table", "cook_meal", "room"])
def test_the_teachers_operators_are_read_back(name: str, tmp_path: Path) -> None:
    domain = truth_of(name).operators
    text = domain_text(domain)
    assert parse_domain(text) == domain
    assert set(as_read(text, tmp_path)) == {each.name for each in domain.schemas}


def test_a_problem_is_read_back(tmp_path: Path) -> None:
    (task,) = tasks_of("store_objects", "combined", 1, 3)
    truth = truth_of("store_objects")
    initial = truth.atoms(open_kitchen(task).state())
    path = tmp_path / "problem.pddl"
    problem = Problem("task", dict.fromkeys(task.objects, ""), initial, frozenset(task.goal))
    path.write_text(problem_text(problem, truth.operators.name))
    read = pddl.parse_problem(path)
    assert {str(each) for each in read.objects} == set(task.objects)
    assert Predicate("on", *(Constant(term) for term in sorted(task.goal)[0][1:])) in read.goal.operands
    assert len(read.init) == len(initial)


def test_negative_preconditions_and_types_are_read_back(tmp_path: Path) -> None:
    schema = Schema("wash", (("?a", "cup"),), (("near", "?a"),), (("clean", "?a"),), (), (("clean", "?a"),))
    domain = Domain("d", {"cup": "item", "item": ""}, {"near": ("item",), "clean": ("item",)}, (schema,))
    assert as_read(domain_text(domain), tmp_path) == {"wash": (1, 2)}
