"""STRIPS search and PDDL: plans are checked by a second, plainer simulator that shares no code with the planner."""

from __future__ import annotations

from itertools import product

import pytest
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.tasks.pddl import domain_text, parse_domain, parse_problem, problem_text
from scenewright.stages.kit.tasks.strips import Domain, GroundAction, Problem, Schema, ground, validate
from scenewright.stages.kit.tasks.task_planner import plan_task
from scenewright.stages.plan.symbols import DOMAIN

BLOCKS = Domain(
    "blocks",
    {"block": ""},
    {"on": ("block", "block"), "table": ("block",), "clear": ("block",), "holding": ("block",), "empty": ()},
    (
        Schema(
            "pick",
            (("?x", "block"),),
            (("table", "?x"), ("clear", "?x"), ("empty",)),
            (("holding", "?x"),),
            (("table", "?x"), ("clear", "?x"), ("empty",)),
        ),
        Schema(
            "drop",
            (("?x", "block"),),
            (("holding", "?x"),),
            (("table", "?x"), ("clear", "?x"), ("empty",)),
            (("holding", "?x"),),
        ),
        Schema(
            "stack",
            (("?x", "block"), ("?y", "block")),
            (("holding", "?x"), ("clear", "?y")),
            (("on", "?x", "?y"), ("clear", "?x"), ("empty",)),
            (("holding", "?x"), ("clear", "?y")),
        ),
        Schema(
            "unstack",
            (("?x", "block"), ("?y", "block")),
            (("on", "?x", "?y"), ("clear", "?x"), ("empty",)),
            (("holding", "?x"), ("clear", "?y")),
            (("on", "?x", "?y"), ("clear", "?x"), ("empty",)),
        ),
    ),
)


def tower_problem(names: str, goal: str) -> Problem:
    """Blocks in one tower (first on top); the goal is another tower."""

    def tower(order: str) -> set[tuple[str, ...]]:
        return {("on", upper, lower) for upper, lower in zip(order, order[1:], strict=False)}

    initial = tower(names) | {("table", names[-1]), ("clear", names[0]), ("empty",)}
    return Problem("tower", dict.fromkeys(names, "block"), frozenset(initial), frozenset(tower(goal)))


def simulate(problem: Problem, plan: list[GroundAction]) -> bool:
    """Run a blocks plan on lists of piles, by the names of the actions alone."""
    below = {atom[1]: atom[2] for atom in problem.initial if atom[0] == "on"}
    held: str | None = None
    for action in plan:
        block = action.arguments[0]
        covered = block in below.values()
        if action.name in ("pick", "unstack"):
            assert held is None and not covered
            assert (block in below) == (action.name == "unstack")
            if action.name == "unstack":
                assert below.pop(block) == action.arguments[1]
            held = block
        else:
            assert held == block
            if action.name == "stack":
                assert action.arguments[1] not in below.values() and action.arguments[1] != held
                below[block] = action.arguments[1]
            held = None
    return all(below.get(atom[1]) == atom[2] for atom in problem.goal)


@pytest.mark.parametrize(("start", "goal"), [("ab", "ba"), ("abc", "cba"), ("abcd", "bdac"), ("abcde", "edcba")])
def test_plans_work_in_the_second_simulator_and_max_is_shortest(start: str, goal: str) -> None:
    problem = tower_problem(start, goal)
    actions = ground(BLOCKS, problem)
    lengths = {}
    for heuristic in ("add", "ff", "max"):
        found = plan_task(problem, actions, heuristic=heuristic)  # type: ignore[arg-type]
        assert found.actions is not None
        assert simulate(problem, found.actions)
        validate(problem, found.actions)
        lengths[heuristic] = len(found.actions)
    assert lengths["max"] <= min(lengths.values())


def test_optimal_length_agrees_with_breadth_first_search() -> None:
    problem = tower_problem("abcd", "bdac")
    actions = ground(BLOCKS, problem)
    frontier, seen, depth = [problem.initial], {problem.initial}, 0
    while not any(problem.goal <= state for state in frontier):
        depth += 1
        following = []
        for state, action in product(frontier, actions):
            if action.preconditions <= state:
                after = (state - action.delete) | action.add
                if after not in seen:
                    seen.add(after)
                    following.append(after)
        frontier = following
    found = plan_task(problem, actions, heuristic="max")
    assert found.actions is not None
    assert len(found.actions) == depth


def test_a_contradictory_goal_is_told_from_an_unreachable_one() -> None:
    problem = tower_problem("abc", "cba")
    actions = ground(BLOCKS, problem)
    both = Problem("x", problem.objects, problem.initial, frozenset({("on", "a", "b"), ("on", "b", "a")}))
    found = plan_task(both, actions)
    assert found.actions is None and found.exhausted and not found.unreachable
    without = [action for action in actions if action.name != "stack"]
    found = plan_task(problem, without)
    assert found.actions is None
    assert set(found.unreachable) == {("on", "c", "b"), ("on", "b", "a")}


def test_the_limit_is_not_taken_for_a_proof() -> None:
    problem = tower_problem("abcde", "edcba")
    found = plan_task(problem, ground(BLOCKS, problem), limit=3)
    assert found.actions is None and not found.exhausted and found.expanded == 3


def test_validate_names_what_does_not_hold() -> None:
    problem = tower_problem("ab", "ba")
    actions = {action.text: action for action in ground(BLOCKS, problem)}
    with pytest.raises(ValueError, match=r"pick\(b\).*clear\(b\)"):
        validate(problem, [actions["pick(b)"]])
    with pytest.raises(ValueError, match="goal not reached"):
        validate(problem, [actions["unstack(a, b)"]])


def test_pddl_text_parses_back() -> None:
    for domain in (DOMAIN, BLOCKS):
        assert parse_domain(domain_text(domain)) == domain
    problem = tower_problem("abc", "cab")
    assert parse_problem(problem_text(problem, "blocks")) == problem


def test_parsed_pddl_plans_as_the_original() -> None:
    problem = tower_problem("abcd", "dcba")
    domain = parse_domain(domain_text(BLOCKS))
    again = parse_problem(problem_text(problem, "blocks"))
    first = plan_task(problem, ground(BLOCKS, problem)).actions
    second = plan_task(again, ground(domain, again)).actions
    assert first is not None and second is not None
    assert [action.text for action in first] == [action.text for action in second]


def test_broken_pddl_is_refused() -> None:
    with pytest.raises(BadInput, match="brackets"):
        parse_domain("(define (domain x)")
    with pytest.raises(BadInput, match="`or`"):
        parse_problem("(define (problem p) (:domain d) (:objects a) (:init) (:goal (or (on a))))")
