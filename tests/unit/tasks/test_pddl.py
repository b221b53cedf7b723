"""PDDL: what is written reads back, negative preconditions mean what they say, and bad text is one line."""

from __future__ import annotations

import itertools

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.tasks.pddl import domain_text, parse_domain, parse_problem, problem_text
from scenewright.stages.kit.tasks.strips import Atom, Domain, Problem, Schema, ground, positive_task
from scenewright.stages.kit.tasks.task_planner import plan_task
from scenewright.stages.plan.domain import DOMAIN

LIGHTS = """; lamps in a row: only a lamp that is off can be switched on, and only when its neighbour is on
(define (domain lights) (:requirements :strips :typing :negative-preconditions)
  (:types lamp - object)
  (:predicates (lit ?l - lamp) (beside ?a ?b - lamp))
  (:action switch_on :parameters (?l ?n - lamp)
    :precondition (and (beside ?l ?n) (lit ?n) (not (lit ?l))) :effect (lit ?l))
  (:action switch_off :parameters (?l - lamp) :precondition (lit ?l) :effect (and (not (lit ?l)))))
"""
ROW = """(define (problem row) (:domain lights) (:objects a b c d - lamp)
  (:init (lit a) (beside b a) (beside c b) (beside d c)) (:goal (and (lit d) (not (lit b)) (not (lit a)))))"""


def test_negative_preconditions_agree_with_breadth_first_search_on_sets() -> None:
    domain = parse_domain(LIGHTS)
    problem = parse_problem(ROW, domain)
    with pytest.raises(ValueError, match="positive_task"):
        ground(domain, problem)
    found = plan_task(*positive_task(domain, problem), heuristic="max")
    assert found.actions is not None
    # a second implementation: states are sets of lamps that are on
    frontier, seen, depth = {frozenset("a")}, {frozenset("a")}, 0
    while not any("d" in on and "a" not in on and "b" not in on for on in frontier):
        depth += 1
        after = set()
        for on in frontier:
            after |= {on - {lamp} for lamp in on}
            after |= {on | {lamp} for lamp, beside in ("ba", "cb", "dc") if beside in on and lamp not in on}
        frontier = after - seen
        seen |= after
    assert len(found.actions) == depth
    greedy = plan_task(*positive_task(domain, problem))
    assert greedy.actions is not None
    state = {"a"}
    for action in greedy.actions:
        lamp = action.arguments[0]
        assert (lamp in state) == (action.name == "switch_off")
        state ^= {lamp}
    assert state & {"a", "b", "d"} == {"d"}


def test_text_of_both_domains_reads_back() -> None:
    for domain in (DOMAIN, parse_domain(LIGHTS)):
        assert parse_domain(domain_text(domain)) == domain
    problem = parse_problem(ROW)
    assert parse_problem(problem_text(problem, "lights")) == problem


NAMES = st.sampled_from(("p", "q", "r_1", "long-name"))


@st.composite
def domains(draw: st.DrawFn) -> Domain:
    predicates = draw(
        st.dictionaries(NAMES, st.sampled_from(((), ("k",), ("k", ""), ("", "k"))), min_size=1, max_size=4)
    )
    variables = ("?x", "?y")

    def atoms() -> tuple[Atom, ...]:
        chosen = draw(st.lists(st.sampled_from(sorted(predicates)), max_size=3, unique=True))
        return tuple((name, *(draw(st.sampled_from(variables)) for _ in predicates[name])) for name in chosen)

    schemas = tuple(
        Schema(f"act{number}", (("?x", "k"), ("?y", "")), atoms(), atoms(), atoms(), atoms())
        for number in range(draw(st.integers(0, 3)))
    )
    return Domain("drawn", {"k": "", "l": "k"}, predicates, schemas)


def test_an_object_of_no_type_beside_a_typed_one_reads_back_and_is_checked() -> None:
    domain = Domain("d", {"k": ""}, {"p": ("k",), "q": ("", "k")}, ())
    atoms = frozenset({("p", "b"), ("q", "a", "b")})
    problem = Problem("mixed", {"a": "", "b": "k"}, atoms, frozenset({("q", "b", "b")}))
    text = problem_text(problem, "d")
    assert parse_problem(text, domain) == problem
    with pytest.raises(BadInput, match="a in p a is a object, not a k"):
        parse_problem(text.replace("(p b)", "(p a)"), domain)


@settings(max_examples=60, deadline=None)
@given(domains())
def test_any_domain_reads_back(domain: Domain) -> None:
    assert parse_domain(domain_text(domain)) == domain


@settings(max_examples=150, deadline=None)
@given(st.data())
def test_damaged_text_is_refused_in_one_line_or_read(data: st.DataObject) -> None:
    text = data.draw(st.sampled_from((LIGHTS, ROW)))
    tokens = text.replace("(", " ( ").replace(")", " ) ").split()
    for _ in range(data.draw(st.integers(1, 4))):
        place = data.draw(st.integers(0, len(tokens) - 1))
        word = data.draw(st.sampled_from(("", "(", ")", "-", "not", "?l", ":action", "lit", "and", "\u00e9", "( )")))
        tokens[place : place + data.draw(st.integers(0, 2))] = [word]
    for parse in (parse_domain, parse_problem):
        try:
            parse(" ".join(tokens))
        except BadInput as error:
            assert "\n" not in str(error)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (("(lit ?n)", "(lit ?z)"), "'\\?z' is not a parameter"),
        (("(lit ?n)", "(bright ?n)"), "'bright' is not declared"),
        (("(lit ?n)", "(lit ?n ?l)"), "takes 1 arguments, not 2"),
        (("(lit ?n)", "(forall (?x) (lit ?x))"), "`forall`|list"),
        ((":typing", ":fluents"), ":fluents is not met"),
        (("lamp - object", "lamp - thing"), "'thing' is not declared"),
        (("lamp - object", "a - b b - a"), "below itself|not declared"),
        (("?l ?n - lamp", "?l ?l - lamp"), "occurs twice"),
        ((":effect (lit ?l)", ":effect"), "lacks its name, or one of its fields"),
        (("(define (domain", "(define (problem"), "defines no domain"),
        (("(lit ?l - lamp)", "(lit ?l - lamp) (lit ?l)"), "predicate lit is declared twice"),
        (("switch_off", "switch_on"), "action switch_on occurs twice"),
        ((":effect (lit ?l)", ":effect (lit ?l) :effect (lit ?n)"), "a field occurs twice"),
    ],
)
def test_reasons(change: tuple[str, str], reason: str) -> None:
    assert change[0] in LIGHTS
    with pytest.raises(BadInput, match=reason):
        parse_domain(LIGHTS.replace(*change))


def test_a_problem_is_checked_against_its_domain() -> None:
    domain = parse_domain(LIGHTS)
    for old, new, reason in (
        ("(lit a)", "(lit z)", "'z' is not declared"),
        ("a b c d - lamp", "a b c d", "not a lamp"),
    ):
        with pytest.raises(BadInput, match=reason):
            parse_problem(ROW.replace(old, new), domain)
    assert isinstance(parse_problem(ROW.replace("(lit a)", "(lit z)")), Problem)


def test_deep_brackets_end_in_an_error() -> None:
    with pytest.raises(BadInput, match="deeper"):
        parse_domain("".join(itertools.repeat("(", 5000)))
