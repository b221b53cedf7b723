"""Balanced accuracy of predicates over drawn states, half of them near the boundary of what the teacher means.

States need not be such as physics leaves behind: sizes, places, heights and water are drawn freely, so that a meaning
that is right only of tidy kitchens is found out.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache

import numpy as np
from scenewright.stages.kit.predicates.evaluating import Evaluator
from scenewright.stages.kit.predicates.expressions import Predicate, Tree
from scenewright.stages.predicates.learning.memory import Memory
from scenewright.stages.predicates.learning.setting import KITCHEN_GIVEN
from scenewright.stages.predicates.state import Seen, State
from scenewright.stages.predicates.truth import true_predicates, truth_of
from scenewright.stages.predicates.world.catalogue import DomainSetup, kitchen_file

HALVINGS = 7
"""Halvings of the way between a state where a predicate holds and one where it does not; by eye."""
DRAWS = 30
"""Draws of a state on the other side of a predicate; by eye."""
Case = tuple[State, tuple[str, ...], bool]
"""A state, objects, and whether the teacher's predicate holds of them."""


def drawn_state(setup: DomainSetup, random: np.random.Generator) -> State:
    """Return a state of a domain's objects, things on, in and beside each other more often than chance would have."""
    kinds = kitchen_file().objects

    def either(usual: float, low: float, high: float) -> float:
        return usual if random.random() < 0.5 else low + (high - low) * random.random()

    objects: dict[str, Seen] = {}
    for name in (*setup.objects, *setup.more):
        kind = kinds[name]
        width, height = kind.width * either(1.0, 0.3, 4.0), kind.height * either(1.0, 0.2, 2.0)
        x, y = -45.0 + 75.0 * random.random(), either(0.0, -1.0, 25.0)
        others = list(objects.values())
        if others and random.random() < 0.5:
            under = others[int(random.random() * len(others))]
            x = under.x + (1.4 * random.random() - 0.7) * under.width
            y = under.y + (under.height if random.random() < 0.6 else random.random())
        water = either(0.0, 0.0, 1.0) if kind.shape == "container" else 0.0
        objects[name] = Seen(x, y, width, height, kind.category, water)
    if random.random() < 0.5:
        return State(objects, -40.0 + 70.0 * random.random(), 25.0, 5.0 * random.random(), 0.0)
    held_object = objects[list(objects)[int(random.random() * len(objects))]]
    tips = held_object.y + held_object.height - min(2.0, held_object.height)
    return State(objects, held_object.x, tips, held_object.width, 0.1 + 0.9 * random.random())


def between(one: State, two: State, share: float) -> State:
    """Return a state on the straight way from `one` (0) to `two` (1)."""

    def mix(a: float, b: float) -> float:
        return a + share * (b - a)

    objects = {
        name: Seen(
            mix(a.x, b.x),
            mix(a.y, b.y),
            mix(a.width, b.width),
            mix(a.height, b.height),
            a.category,
            mix(a.water, b.water),
        )
        for (name, a), b in zip(one.objects.items(), two.objects.values(), strict=True)
    }
    return State(
        objects,
        mix(one.gripper_x, two.gripper_x),
        mix(one.gripper_y, two.gripper_y),
        mix(one.opening, two.opening),
        mix(one.mass, two.mass),
    )


@cache
def drawn_states(domain: str, count: int, seed: int) -> tuple[State, ...]:
    """Return states of a domain, drawn once: all of its predicates are judged on them."""
    random = np.random.default_rng([seed, 3])
    return tuple(drawn_state(kitchen_file().domains[domain], random) for _ in range(count))


def cases_of(name: str, domain: str, count: int, seed: int) -> list[Case]:
    """Return `count` cases of a predicate of the teacher, every second one near its boundary where it has one: on the
    way from a drawn state to another in which it is otherwise."""
    random = np.random.default_rng([seed, sorted(true_predicates()).index(name)])
    states = drawn_states(domain, count, seed)
    cases: list[Case] = []
    for number, state in enumerate(states):
        names = list(state.objects)
        chosen = random.permutation(len(names))[: true_predicates()[name].arguments]
        objects = tuple(names[index] for index in chosen.tolist())
        holds = _holds(name, state, objects)
        for _ in range(DRAWS if number % 2 else 0):
            other_state = states[int(random.random() * count)]
            if _holds(name, other_state, objects) != holds:
                low, high = 0.0, 1.0
                for _ in range(HALVINGS):
                    middle = (low + high) / 2
                    same = _holds(name, between(state, other_state, middle), objects) == holds
                    low, high = (middle, high) if same else (low, middle)
                state = between(state, other_state, low if random.random() < 0.5 else high)
                break
        cases.append((state, objects, _holds(name, state, objects)))
    return cases


def _holds(name: str, state: State, objects: tuple[str, ...]) -> bool:
    return Evaluator(state, true_predicates()).holds((name, *objects))


def balanced_accuracy(cases: Sequence[Case], means: Tree, given: Mapping[str, Predicate]) -> float:
    """Return the mean of the shares, of what holds and of what does not, that an expression tells rightly."""
    right: dict[bool, list[bool]] = {True: [], False: []}
    for state, objects, holds in cases:
        binding = dict(zip(("?a", "?b"), objects, strict=False))
        right[holds].append(Evaluator(state, given).truth(means, binding) == holds)
    shares = [float(np.mean(each)) for each in right.values() if each]
    return float(np.mean(shares))


def accuracies(memory: Memory, domain: str, count: int, seed: int) -> dict[str, float]:
    """Return, by the teacher's predicate, how right the worst meaning of a phrase about it is."""
    lowest: dict[str, float] = {}
    for phrase, means in memory.meanings.items():
        name = truth_of(domain).meant_by(phrase.text)
        if name is not None:
            value = balanced_accuracy(drawn_cases(name, domain, count, seed), means, KITCHEN_GIVEN)
            lowest[name] = min(value, lowest.get(name, 1.0))
    return dict(sorted(lowest.items()))


@cache
def drawn_cases(name: str, domain: str, count: int, seed: int) -> tuple[Case, ...]:
    """Return `cases_of`, drawn once."""
    return tuple(cases_of(name, domain, count, seed))
