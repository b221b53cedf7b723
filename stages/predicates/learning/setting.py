"""What a learner is given of the world that it learns in: perceptions, relations, what words may point at."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal

from scenewright.stages.kit.predicates.expressions import Predicate, Tree, read
from scenewright.stages.kit.predicates.room import ROOM_WORDS, RoomState
from scenewright.stages.kit.predicates.vocabulary import Perceived, Vocabulary
from scenewright.stages.predicates.state import KITCHEN_WORDS, TOLERANCE, State
from scenewright.stages.predicates.world.actions import ARITY

OWN_TOLERANCE, OWN_NUMBER = 2.5, 3.0
"""Costs of numbers that the phrase does not say: of the worked example, and of others."""


@dataclass(frozen=True)
class Measure:
    """A perception call that thresholds are sought for."""

    uses: frozenset[str]
    """Concepts that it is about."""
    number: tuple[float, float] | None
    """A threshold that is tried when nobody says one, and its cost."""
    bound: tuple[str, frozenset[str]] | None = None
    """A perception of the whole that it may be compared with, and the concepts of that."""


@dataclass(frozen=True)
class Setting:
    """A kind of world."""

    name: Literal["kitchen", "room"]
    words: Vocabulary
    given: Mapping[str, Predicate]
    """Predicates that every learner starts with."""
    uses: Mapping[str, frozenset[str]]
    """Concepts of each of them."""
    held: str
    """Of these, the one that plans are always made with."""
    measures: Mapping[str, Measure]
    of_whole: Mapping[str, Measure]
    categories: tuple[str, ...]
    arity: Mapping[str, int]
    """Actions -> objects that they take."""
    facts: Callable[[Perceived, str], tuple[str, ...]]
    """What matters of one object for an action, as far as one can see."""
    boxes: bool
    """Whether pairs of comparisons of two boxes' edges are tried."""
    compared: tuple[tuple[str, Tree, frozenset[str]], ...] = ()
    """(relation of two, truth about ?x, concepts): `some ?x to which a is so related, of which that holds` is tried."""
    tells_apart: bool = False
    """Whether operators of one action with different effects are told apart by what held before them."""


def _predicates(texts: Mapping[str, tuple[int, str]]) -> dict[str, Predicate]:
    return {name: Predicate(name, count, read(text, name)) for name, (count, text) in texts.items()}


def _kitchen_facts(state: Perceived, name: str) -> tuple[str, ...]:
    from scenewright.stages.kit.predicates.evaluating import Evaluator

    assert isinstance(state, State)
    evaluator = Evaluator(state, KITCHEN.given)
    others = [neighbour for neighbour in state.names if neighbour != name]
    facts = (
        evaluator.holds(("in_gripper", name)),
        any(evaluator.holds(("rests_on", neighbour, name)) for neighbour in others),
        any(evaluator.holds(("within", name, neighbour)) for neighbour in others),
        any(evaluator.holds(("within", neighbour, name)) for neighbour in others),
        state.objects[name].water > 0,
    )
    return (f"{state.category(name)}:{''.join('01'[fact] for fact in facts)}",)


def _room_facts(state: Perceived, name: str) -> tuple[str, ...]:
    """Return what a thing is like for a hand: its class says little, as rooms have dozens."""
    assert isinstance(state, RoomState)
    body = state.bodies[name]
    facts = (
        state.held == name,
        name in state.supported.values(),
        body.doors > 0,
        body.openness > 0.5,
        body.width < state.hand_opening,
        body.surface > 0.01,
        name in state.contained and state.bodies[state.contained[name]].doors > 0,
        body.along(2, -1.0) < state.reach[1],
    )
    return ("".join("01"[fact] for fact in facts),)


_F = frozenset
KITCHEN_GIVEN = _predicates(
    {
        "in_gripper": (
            1,
            "(and (less 0.2 (gripper_mass)) (near (left ?a) (gripper_left)) (near (right ?a) (gripper_right)) "
            "(less (bottom ?a) (gripper_top)) (less (gripper_bottom) (top ?a)))",
        ),
        "rests_on": (2, "(and (near (bottom ?a) (top ?b)) (less (left ?a) (right ?b)) (less (left ?b) (right ?a)))"),
        "rests_on_table": (
            1,
            "(and (near (bottom ?a) (table_height)) (at_most (table_left) (x ?a)) (at_most (x ?a) (table_right)))",
        ),
        "within": (
            2,
            "(and (at_most (left ?b) (left ?a)) (at_most (right ?a) (right ?b)) "
            "(at_most (bottom ?b) (bottom ?a)) (at_most (top ?a) (top ?b)))",
        ),
    }
)
"""The thesis's worked example (`in_gripper`), and three relations of boxes."""
KITCHEN = Setting(
    name="kitchen",
    words=KITCHEN_WORDS,
    given=KITCHEN_GIVEN,
    uses={
        "in_gripper": _F({"gripper"}),
        "rests_on": _F({"above"}),
        "rests_on_table": _F({"above", "table"}),
        "within": _F({"inside"}),
    },
    held="in_gripper",
    measures={
        "width": Measure(_F({"width"}), (TOLERANCE, OWN_NUMBER), ("largest_opening", _F({"gripper"}))),
        "height": Measure(_F({"height"}), (TOLERANCE, OWN_NUMBER), ("largest_opening", _F({"gripper"}))),
        "water": Measure(_F({"water"}), (TOLERANCE, OWN_TOLERANCE)),
        "x": Measure(_F({"place"}), (TOLERANCE, OWN_NUMBER)),
        "y": Measure(_F({"place"}), (TOLERANCE, OWN_NUMBER)),
    },
    of_whole={"gripper_mass": Measure(_F({"gripper"}), (TOLERANCE, OWN_TOLERANCE))},
    categories=("food", "can", "coaster", "shelf", "cup", "pot", "basket", "placemat", "plate"),
    arity=ARITY,
    facts=_kitchen_facts,
    boxes=True,
)
ROOM_GIVEN = _predicates(
    {
        "holds": (1, "(held ?a)"),
        "carried_by": (2, "(supported ?a ?b)"),
        "kept_in": (2, "(contained ?a ?b)"),
        "rests_on": (
            2,
            "(and (near (bottom ?a) (top ?b)) (less (left ?a) (right ?b)) (less (left ?b) (right ?a)) "
            "(less (back ?a) (front ?b)) (less (back ?b) (front ?a)))",
        ),
        "within": (
            2,
            "(and (at_most (left ?b) (left ?a)) (at_most (right ?a) (right ?b)) (at_most (back ?b) (back ?a)) "
            "(at_most (front ?a) (front ?b)) (at_most (bottom ?b) (bottom ?a)) (at_most (top ?a) (top ?b)))",
        ),
    }
)
"""What the hand holds, the links of the contact graph, and two relations of boxes."""
_HALF_OPEN: Tree = ("less", ("openness", "?x"), 0.5)
"""A door is less than half open."""
_NARROW: Tree = ("less", ("width", "?x"), ("hand_opening",))
ROOM = Setting(
    name="room",
    words=ROOM_WORDS,
    given=ROOM_GIVEN,
    uses={
        "holds": _F({"gripper"}),
        "carried_by": _F({"above"}),
        "kept_in": _F({"inside"}),
        "rests_on": _F({"above"}),
        "within": _F({"inside"}),
    },
    held="holds",
    measures={
        "width": Measure(_F({"width"}), None, ("hand_opening", _F({"gripper"}))),
        "depth": Measure(_F({"width"}), None),
        "height": Measure(_F({"height"}), None),
        "bottom": Measure(_F({"reach"}), None, ("reach_high", _F({"reach"}))),
        "top": Measure(_F({"reach"}), None, ("reach_high", _F({"reach"}))),
        "openness": Measure(_F({"open"}), (0.5, OWN_TOLERANCE)),
        "doors": Measure(_F({"door"}), (0.5, OWN_TOLERANCE)),
        "surface": Measure(_F({"level"}), (0.01, OWN_TOLERANCE)),
    },
    of_whole={},
    categories=(),
    arity={"pick": 1, "place": 2, "put_in": 2, "open": 1, "close": 1},
    facts=_room_facts,
    boxes=False,
    compared=(
        ("kept_in", _HALF_OPEN, _F({"inside", "open", "other"})),
        ("carried_by", _NARROW, _F({"above", "gripper", "other", "width"})),
    ),
    tells_apart=True,
)
"""What a learner is given of a room."""
SETTINGS = {setting.name: setting for setting in (KITCHEN, ROOM)}
