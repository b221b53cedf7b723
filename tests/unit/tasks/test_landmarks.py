"""Landmarks and the greedy search: against their definition, on large Blocksworld, and Fast Downward's plan files."""

from __future__ import annotations

import importlib.util

import numpy as np
import pytest
from scenewright.schemas.errors import BadInput, MissingDependency
from scenewright.stages.kit.tasks import fast_downward
from scenewright.stages.kit.tasks.landmarks import find_landmarks
from scenewright.stages.kit.tasks.relaxed import relax
from scenewright.stages.kit.tasks.strips import Problem, ground, validate
from scenewright.stages.kit.tasks.task_planner import plan_task

from tests.unit.tasks.test_task_planner import BLOCKS, simulate, tower_problem


def piles(random: np.random.Generator, names: list[str]) -> set[tuple[str, ...]]:
    """Atoms of blocks put on random piles one after the other."""
    tops: list[list[str]] = []
    for name in [names[k] for k in random.permutation(len(names))]:
        place = int(random.integers(len(tops) + 1))
        if place == len(tops):
            tops.append([])
        tops[place].append(name)
    atoms: set[tuple[str, ...]] = set()
    for pile in tops:
        atoms |= {("table", pile[0]), ("clear", pile[-1])}
        atoms |= {("on", upper, lower) for lower, upper in zip(pile, pile[1:], strict=False)}
    return atoms


def test_twenty_blocks_are_solved() -> None:
    random = np.random.default_rng(3)
    names = [f"b{number}" for number in range(20)]
    goal = {atom for atom in piles(random, names) if atom[0] == "on"}
    problem = Problem(
        "large", dict.fromkeys(names, "block"), frozenset(piles(random, names) | {("empty",)}), frozenset(goal)
    )
    found = plan_task(problem, ground(BLOCKS, problem), limit=5000)
    assert found.actions is not None and found.expanded < 4000
    validate(problem, found.actions)
    assert simulate(problem, found.actions)
    again = plan_task(problem, ground(BLOCKS, problem), limit=5000)
    assert again.actions == found.actions


def test_a_plan_is_shortened_until_it_fits_within_the_states_allowed() -> None:
    random = np.random.default_rng(2)
    names = [f"b{number}" for number in range(9)]
    goal = frozenset(atom for atom in piles(random, names) if atom[0] == "on")
    problem = Problem("piles", dict.fromkeys(names, "block"), frozenset(piles(random, names) | {("empty",)}), goal)
    actions = ground(BLOCKS, problem)
    plain = plan_task(problem, actions, limit=5000, improvement=5)
    fitting = plan_task(problem, actions, limit=5000, improvement=5, longest=18)
    lengths = [len(each.actions or ()) for each in (plain, fitting)]
    assert lengths == [26, 18] and fitting.expanded < 2000
    validate(problem, fitting.actions or [])
    impossible = plan_task(problem, actions, limit=200, improvement=5, longest=1)
    assert impossible.actions and impossible.expanded < 1000


@pytest.mark.parametrize(("start", "goal"), [("abc", "cba"), ("abcd", "bdac")])
def test_landmarks_are_true_at_some_time_on_every_plan(start: str, goal: str) -> None:
    problem = tower_problem(start, goal)
    actions = ground(BLOCKS, problem)
    task = relax(problem, actions)
    landmarks = find_landmarks(task)
    names = {task.atoms[atom] for atom in landmarks.atoms}
    assert problem.goal <= names and len(names) > len(problem.goal) + 2
    for heuristic in ("add", "ff", "max", "landmarks"):
        found = plan_task(problem, actions, heuristic=heuristic)  # type: ignore[arg-type]
        assert found.actions is not None
        state, ever = problem.initial, set(problem.initial)
        first: dict[tuple[str, ...], int] = dict.fromkeys(problem.initial, 0)
        for number, action in enumerate(found.actions, start=1):
            state = (state - action.delete) | action.add
            ever |= state
            first |= {atom: number for atom in state if atom not in first}
        assert names <= ever
        for k, m in np.argwhere(landmarks.needed).tolist():  # necessary orders hold on every plan
            assert first[task.atoms[landmarks.atoms[m]]] < first[task.atoms[landmarks.atoms[k]]]


def test_a_task_that_is_done_needs_no_action() -> None:
    problem = tower_problem("abc", "abc")
    found = plan_task(problem, ground(BLOCKS, problem))
    assert found.actions == []


def test_plan_files_are_looked_up_and_never_trusted() -> None:
    problem = tower_problem("ab", "ba")
    actions = {f"{action.name} {' '.join(action.arguments)}": action for action in ground(BLOCKS, problem)}
    plan = fast_downward.read_plan("(unstack a b )\n( drop a)\n; cost = 2 (unit cost)\n", actions)
    assert [action.text for action in plan] == ["unstack(a, b)", "drop(a)"]
    for text in ("(unstack a c)", "unstack a b", "(unstack a b", "((unstack a b))", "rm -rf /"):
        with pytest.raises(BadInput, match="line 1"):
            fast_downward.read_plan(text, actions)


def test_without_the_package_the_dependency_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    problem = tower_problem("ab", "ba")
    with pytest.raises(MissingDependency, match="Fast Downward"):
        fast_downward.plan_with_fast_downward(BLOCKS, problem, ground(BLOCKS, problem))


@pytest.mark.skipif(
    importlib.util.find_spec(fast_downward.PACKAGE) is None, reason="the extra planning-gpl is not installed"
)
def test_fast_downward_plans_within_the_actions_given() -> None:
    problem = tower_problem("abcd", "bdac")
    actions = ground(BLOCKS, problem)
    found = fast_downward.plan_with_fast_downward(BLOCKS, problem, actions)
    assert found.actions is not None and simulate(problem, found.actions)
    without = [action for action in actions if action.name != "stack"]
    assert fast_downward.plan_with_fast_downward(BLOCKS, problem, without).actions is None
