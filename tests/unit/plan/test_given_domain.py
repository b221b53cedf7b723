"""Domains and goals as data: formulas, somebody's own operators, and what is refused in one line."""

from __future__ import annotations

from pathlib import Path

import pytest
from scenewright.schemas.contact_graph import ContactGraphFile
from scenewright.schemas.errors import BadInput, ScenewrightError, UsageError
from scenewright.stages.kit.tasks.strips import Atom, validate
from scenewright.stages.kit.tasks.task_planner import plan_task
from scenewright.stages.plan.formulas import Names, alternatives
from scenewright.stages.plan.given_domain import read_given_domain
from scenewright.stages.plan.reading import Reading
from scenewright.stages.plan.symbols import symbolic_state
from scenewright.stages.plan.world_model import WorldModel

TIDY = """(define (domain tidy)
  (:requirements :strips :typing :negative-preconditions)
  (:types bottle fridge table item support container door)
  (:predicates (on ?a - item ?b - support) (in ?a - item ?b - container) (holding ?a - item) (tidy ?a - item)
    (wet ?a - item) (shut ?d - door))
  (:action take_out :parameters (?a - bottle ?from - fridge)
    :precondition (in ?a ?from) :effect (and (holding ?a) (not (in ?a ?from))))
  (:action place :parameters (?a - item ?b - table)
    :precondition (and (holding ?a) (not (tidy ?a))) :effect (and (on ?a ?b) (tidy ?a) (not (holding ?a))))
  (:action open :parameters (?d - door) :effect (not (shut ?d)))
  (:action close :parameters (?d - door) :effect (shut ?d))
  (:action wash :parameters (?a - item) :precondition (wet ?a) :effect (not (wet ?a))))
"""
OBJECTS = {"cup_1": "cup", "cup_2": "cup", "table_1": "table", "table_2": "table"}
NAMES = Names(OBJECTS, lambda atom, text, quantified: frozenset({atom}))


@pytest.mark.parametrize(
    ("goal", "ways"),
    [
        ("on(cup_1,table_1)", [{"on cup_1 table_1"}]),
        ("not on(cup_1,table_1)", [{"-on cup_1 table_1"}]),
        ("on(cup_1,any table)", [{"on cup_1 table_1"}, {"on cup_1 table_2"}]),
        ("on(every cup,table_1)", [{"on cup_1 table_1", "on cup_2 table_1"}]),
        ("(forall (?c - cup) (not (on ?c table_2)))", [{"-on cup_1 table_2", "-on cup_2 table_2"}]),
        ("(not (exists (?c - cup) (on ?c table_2)))", [{"-on cup_1 table_2", "-on cup_2 table_2"}]),
        ("(imply (wet cup_1) (on cup_1 table_1))", [{"-wet cup_1"}, {"on cup_1 table_1"}]),
        ("(and (wet cup_1) (not (wet cup_1)))", []),
        ("(exists (?a ?b - cup) (and (not (= ?a ?b)) (on ?a ?b)))", [{"on cup_1 cup_2"}, {"on cup_2 cup_1"}]),
    ],
)
def test_a_formula_is_its_alternatives(goal: str, ways: list[set[str]]) -> None:
    found = [{("" if holds else "-") + " ".join(atom) for atom, holds in each} for each in alternatives(goal, NAMES)]
    assert sorted(map(sorted, found)) == sorted(map(sorted, ways))


@pytest.mark.parametrize(
    ("goal", "message"),
    [
        ("on cup_1", "not a literal"),
        ("(forall (?c - spoon) (wet ?c))", "the scene has no 'spoon'"),
        ("(wet ?c)", "not bound"),
        ("(forall (?c - cup))", "takes variables and a part"),
        ("(forall (?c - cup) (forall (?c - cup) (wet ?c)))", "bound twice"),
        ("(forall (?a ?b ?c ?d ?e ?f ?g ?h - cup) (wet ?a))", None),
        ("(and " + " ".join(f"(or (p{n} cup_1) (p{n} cup_2))" for n in range(12)) + ")", "ways to reach it"),
        ("(not " * 20 + "(wet cup_1)" + ")" * 20, "nested deeper"),
        ("(wet cup_1", "brackets"),
        ("(and ())", "empty"),
    ],
)
def test_a_goal_that_is_none_is_refused_in_one_line(goal: str, message: str | None) -> None:
    if message is None:
        assert alternatives(goal, NAMES)
        return
    with pytest.raises(ScenewrightError, match=message) as refused:
        alternatives(goal, NAMES)
    assert "\n" not in str(refused.value)


def test_endless_quantifiers_are_refused() -> None:
    many = Names({f"cup_{n}": "cup" for n in range(40)}, NAMES.ground)
    with pytest.raises(UsageError, match="quantify over fewer"):
        alternatives("(forall (?a ?b ?c ?d - cup) (on ?a ?b))", many)


def _plan(model: WorldModel, scene: Path, reading: Reading, *goal: str) -> tuple[list[str], tuple[str, ...]]:
    graph = ContactGraphFile.read(scene / "graph.json")
    objects, initial = symbolic_state(model, graph)
    literals = reading.candidates(model, graph, objects, initial, goal)[0]
    problem, actions = reading.task(model, reading.problem(model, graph, objects, initial, literals))
    plan = plan_task(problem, actions)
    assert plan.actions is not None, plan
    validate(problem, plan.actions)
    return [action.text for action in plan.actions], literals


def test_goals_with_classes_and_negation_are_planned_for(model: WorldModel, scene: Path) -> None:
    steps, literals = _plan(model, scene, Reading(), "on(any bottle,any table)", "not in(bottle_7,fridge_2)")
    assert "take_out(bottle_7, fridge_2, fridge_2__hinge)" in steps
    assert set(literals) == {"on(bottle_7, table_3)", "not in(bottle_7, fridge_2)"}


def test_somebodys_own_operators_are_done_by_our_motions(model: WorldModel, scene: Path, tmp_path: Path) -> None:
    path = tmp_path / "tidy.pddl"
    path.write_text(TIDY)
    given = read_given_domain(path)
    steps, literals = _plan(model, scene, Reading(given), "tidy(any bottle)", "(forall (?d - door) (shut ?d))")
    assert literals[-1] == "tidy(bottle_7)"
    named = [text.split("(")[0] for text in steps if not text.startswith("drive")]
    assert named == ["take_out", "place", "close"]
    graph = ContactGraphFile.read(scene / "graph.json")
    objects, _ = symbolic_state(model, graph)
    words = given.ungrounded(objects, {name: each.class_name for name, each in model.records.items()})
    assert words == (
        "operator wash (no motion of that name)",
        "predicate wet of 1 (no operator makes it true, nothing perceived is it)",
    )


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("fridge table", "fridge - table table - fridge"), "below itself"),
        (("?a - bottle ?from", "?a - spaceship ?from"), "not declared"),
        (("(on ?a - item ?b - support)", "(on ?a - item)"), "takes"),
        (("(define (domain tidy)", "(define (domain tidy"), "brackets"),
        ((":precondition (in ?a ?from)", ":precondition (forall (?x) (in ?x ?from))"), "does not know"),
    ],
)
def test_a_domain_file_that_is_none_is_refused_in_one_line(
    tmp_path: Path, change: tuple[str, str], message: str
) -> None:
    path = tmp_path / "odd.pddl"
    assert change[0] in TIDY
    path.write_text(TIDY.replace(*change))
    with pytest.raises(BadInput, match=message) as refused:
        read_given_domain(path)
    assert "\n" not in str(refused.value)


def test_a_domain_of_which_nothing_can_be_done_is_refused(model: WorldModel, scene: Path, tmp_path: Path) -> None:
    path = tmp_path / "fly.pddl"
    path.write_text("(define (domain fly) (:predicates (up ?a)) (:action fly :parameters (?a) :effect (up ?a)))")
    with pytest.raises(BadInput, match="none of its operators"):
        _plan(model, scene, Reading(read_given_domain(path)), "up(bottle_7)")


def test_a_goal_of_a_given_domain_is_checked(model: WorldModel, scene: Path, tmp_path: Path) -> None:
    path = tmp_path / "tidy.pddl"
    path.write_text(TIDY)
    for goal, message in (("tidy(spoon_1)", "the scene has no"), ("tidy(bottle_7,cup_5)", "takes 1 arguments")):
        with pytest.raises(UsageError, match=message):
            _plan(model, scene, Reading(read_given_domain(path)), goal)


def test_atoms_stay_atoms() -> None:
    atom: Atom = ("on", "cup_1", "table_1")
    assert alternatives("(on cup_1 table_1)", NAMES) == (frozenset({(atom, True)}),)
