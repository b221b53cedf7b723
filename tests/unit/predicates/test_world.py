"""The planar kitchen: the same bytes every run, its actions' rules, and the ceiling that physics sets."""

from __future__ import annotations

import pytest
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.predicates.evaluating import Evaluator
from scenewright.stages.kit.predicates.expressions import Predicate, check, read, text_of
from scenewright.stages.predicates.execution import oracle
from scenewright.stages.predicates.language.saying import say
from scenewright.stages.predicates.state import KITCHEN_WORDS, Seen, State
from scenewright.stages.predicates.tasks import SETS, open_kitchen, tasks_of, true_atoms
from scenewright.stages.predicates.truth import true_domain, true_predicates
from scenewright.stages.predicates.world.actions import act
from scenewright.stages.predicates.world.catalogue import DOMAINS, kitchen_file
from scenewright.stages.predicates.world.kitchen import Kitchen


def kitchen(*things: tuple[str, float, float], seed: int = 0) -> Kitchen:
    kinds = kitchen_file().objects
    return Kitchen([(name, kinds[name], x, y) for name, x, y in things], seed)


def test_the_same_actions_give_the_same_numbers() -> None:
    def run() -> list[State]:
        there = kitchen(("pot", -5, 0), ("cup", 10, 0), seed=3)
        states = []
        for action in (("pick_up", "cup"), ("get_water_from_faucet", "cup")):
            assert act(there, action) == ""
            states.append(there.state())
        return states

    assert run() == run()


def test_water_is_caught_and_poured() -> None:
    there = kitchen(("pot", -5, 0), ("cup", 10, 0))
    assert "too little water" in (
        act(there, ("pick_up", "cup")) or act(there, ("pour_water_from_first_to_second", "cup", "pot"))
    )
    assert act(there, ("get_water_from_faucet", "cup")) == ""
    full = there.state().objects["cup"].water
    assert act(there, ("pour_water_from_first_to_second", "cup", "pot")) == ""
    objects = there.state().objects
    assert full > 8 and objects["pot"].water > 0.9 * full and objects["cup"].water <= 0.2


def test_a_plate_is_pushed_onto_the_placemat_and_carries_bread() -> None:
    there = kitchen(("placemat", -5, 0), ("plate", 3.2, 0), ("bread", 15, 0))
    for action in (
        ("push_plate_on_object", "plate", "placemat"),
        ("pick_up", "bread"),
        ("place_first_on_second", "bread", "plate"),
    ):
        assert act(there, action) == ""
    atoms = true_atoms(there.state(), "set_table")
    assert {("on", "plate", "placemat"), ("on", "bread", "plate"), ("gripper_empty",)} <= atoms


def test_actions_fail_by_their_rules() -> None:
    there = kitchen(("shelf", -5, 0), ("coaster", -5, 4), ("fruitcan", 15, 0))
    assert "does not fit" in act(there, ("pick_up", "shelf"))
    assert "not in the hand" in act(there, ("place_on_table", "fruitcan"))
    assert act(there, ("pick_up", "fruitcan")) == ""
    assert act(there, ("pick_up", "coaster")) == "the hand is full"
    assert act(there, ("place_first_on_second", "fruitcan", "coaster")) == ""
    assert "in the way" in act(there, ("pick_up", "coaster"))


@pytest.mark.parametrize("domain", DOMAINS)
@pytest.mark.slow
def test_the_teachers_own_operators_reach_the_hardest_goals(domain: str) -> None:
    for task in tasks_of(domain, "combined", 2, 0):
        result = oracle(task, domain)
        assert result.success, result.steps


@pytest.mark.parametrize("domain", DOMAINS)
def test_goals_of_a_set_are_wanted_and_differ(domain: str) -> None:
    for which in ("train", *SETS):
        tasks = tasks_of(domain, which, 4, 1)
        assert tasks == tasks_of(domain, which, 4, 1)
        for task in tasks:
            assert not set(task.goal) <= true_atoms(open_kitchen(task).state(), domain)
        if which == "hundred_goals":
            assert len({task.goal for task in tasks}) == 4


def test_the_teachers_words_are_checked_and_said() -> None:
    for name in DOMAINS:
        assert set(true_domain(name).predicates) <= set(true_predicates())
    assert say(true_predicates()["is_graspable"]) == "is_graspable (a): the width of a is less than 5."
    for predicate in true_predicates().values():
        assert read(text_of(predicate.means), "again") == predicate.means


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("(less (width ?a))", "takes number, number"),
        ("(less (width ?b) 1)", "not bound"),
        ("(and (width ?a))", "takes truth"),
        ("(wide ?a)", "no `wide`"),
        ("(plus (width ?a) 1)", "a truth is wanted"),
        ("(p ?a)", "defined by itself"),
        ("(not (some ?a (p ?a)))", "bound twice"),
        ("(less (width ?a) 1e99999)", "too large"),
    ],
)
def test_what_is_no_predicate_is_refused_in_one_line(text: str, message: str) -> None:
    with pytest.raises(BadInput, match=message):
        check({"p": Predicate("p", 1, read(text, "predicate p"))}, KITCHEN_WORDS)


def test_dividing_by_zero_and_endless_quantifiers_end_in_one_line() -> None:
    state = State({f"o{k}": Seen(k, 0.0, 1.0, 1.0, "can") for k in range(30)})
    nested = "(every ?b (every ?c (every ?d (every ?e (less (plus (width ?b) (width ?e)) 9)))))"
    found = {
        "p": Predicate("p", 1, read("(less (over 1 (minus (width ?a) 1)) 2)", "p")),
        "q": Predicate("q", 0, read(nested, "q")),
    }
    check(found, KITCHEN_WORDS)
    with pytest.raises(BadInput, match="divides by zero"):
        Evaluator(state, found).holds(("p", "o0"))
    with pytest.raises(BadInput, match="steps"):
        Evaluator(state, found).holds(("q",))
    assert Evaluator(State({}), found).holds(("q",))  # nothing is in the way of an empty scene
