"""From "this thing there" to steps, by the task planner of the kit: drives, doors and an empty hand in between."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

from scenewright.stages.kit.tasks.strips import Domain, Problem, Schema, ground
from scenewright.stages.kit.tasks.task_planner import plan_task

IT, BEFORE, AFTER, NOWHERE = "it", "before", "after", "nowhere"
"""The thing, the spot where it is and the spot where it belongs; furniture before which nobody stands."""


def _door(name: str, now: str, then: str) -> Schema:
    needs = (("at", "?p"), (now, "?p"), ("door", "?p"), ("free",))
    return Schema(name, (("?p", "furniture"),), needs, ((then, "?p"),), ((now, "?p"),))


DOMAIN = Domain(
    "errands",
    {"furniture": "", "spot": "", "thing": ""},
    {
        **dict.fromkeys(("at", "ajar", "shut", "door"), ("furniture",)),
        "free": (),
        "holding": ("thing",),
        "lies": ("thing", "spot"),
        "located": ("spot", "furniture"),
    },
    (
        Schema(
            "navigate", (("?a", "furniture"), ("?b", "furniture")), (("at", "?a"),), (("at", "?b"),), (("at", "?a"),)
        ),
        _door("open", "shut", "ajar"),
        _door("close", "ajar", "shut"),
        Schema(
            "grasp",
            (("?x", "thing"), ("?s", "spot"), ("?p", "furniture")),
            (("at", "?p"), ("located", "?s", "?p"), ("lies", "?x", "?s"), ("ajar", "?p"), ("free",)),
            (("holding", "?x"),),
            (("lies", "?x", "?s"), ("free",)),
        ),
        Schema(
            "place",
            (("?x", "thing"), ("?s", "spot"), ("?p", "furniture")),
            (("at", "?p"), ("located", "?s", "?p"), ("holding", "?x"), ("ajar", "?p")),
            (("lies", "?x", "?s"), ("free",)),
            (("holding", "?x"),),
        ),
    ),
)


@dataclass(frozen=True)
class Step:
    """`navigate`, `open` and `close` say at which furniture; `grasp` and `place` are of the thing."""

    name: str
    furniture: str = ""


@lru_cache(maxsize=4096)
def steps_to(at: str, source: str, target: str, shut: frozenset[str], doors: frozenset[str]) -> tuple[Step, ...]:
    """Return the steps that bring a thing from furniture `source` (empty: it is in the hand) to furniture `target`.

    `at`: where the robot stands; `doors`: what has a door, of which `shut` are closed. Empty where there is no plan.
    """
    places = sorted({at or NOWHERE, target} | ({source} if source else set()))
    objects = {**dict.fromkeys(places, "furniture"), IT: "thing", BEFORE: "spot", AFTER: "spot"}
    initial = {("at", at or NOWHERE), ("located", AFTER, target)}
    initial |= {("shut" if p in shut else "ajar", p) for p in places} | {("door", p) for p in places if p in doors}
    initial |= {("free",), ("lies", IT, BEFORE), ("located", BEFORE, source)} if source else {("holding", IT)}
    return _plan(objects, frozenset(initial), frozenset({("lies", IT, AFTER)}))


@lru_cache(maxsize=1024)
def steps_to_door(at: str, furniture: str, *, opened: bool) -> tuple[Step, ...]:
    """Return the steps that open or close a door that is not so already."""
    objects = dict.fromkeys(sorted({at or NOWHERE, furniture}), "furniture")
    initial = {("at", at or NOWHERE), ("shut" if opened else "ajar", furniture), ("door", furniture), ("free",)}
    return _plan(objects, frozenset(initial), frozenset({("ajar" if opened else "shut", furniture)}))


def _plan(objects: dict[str, str], initial: frozenset, goal: frozenset) -> tuple[Step, ...]:  # type: ignore[type-arg]
    problem = Problem("errand", objects, initial, goal)
    actions = plan_task(problem, ground(DOMAIN, problem), heuristic="max").actions or ()
    return tuple(
        Step(a.name, a.arguments[-1]) if a.name in ("navigate", "open", "close") else Step(a.name) for a in actions
    )
