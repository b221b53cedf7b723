"""What a phrase could mean: expressions of the grammar, each with what it costs.

An expression costs its words, and more for every perception that it uses and the phrase does not speak of, for every
one that the phrase speaks of and it leaves out, and for standing on the wrong side of the phrase's negation. Cheap
meanings are tried first; labels decide.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations

from stages.kit.predicates.expressions import Predicate, Tree, read, size_of
from stages.predicates.learning.phrases import CATEGORIES, Phrase
from stages.predicates.state import TOLERANCE

GIVEN_TEXTS = {
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
"""What every learner starts with: the thesis's worked example (`in_gripper`), and three relations of boxes."""
GIVEN = {name: Predicate(name, count, read(text, name)) for name, (count, text) in GIVEN_TEXTS.items()}
_USES = {"in_gripper": {"gripper"}, "rests_on": {"above"}, "rests_on_table": {"above", "table"}, "within": {"inside"}}
UNMENTIONED, LEFT_OUT, OTHER_SIDE, OWN_NUMBER = 3.0, 4.0, 7.0, 3.0
"""Costs: of a perception that is not spoken of, of one that is and is not used, of the wrong side, of a number that
neither the phrase nor the worked example says."""
OWN_TOLERANCE = 2.5
MEASURES = ("width", "height", "water", "x", "y")
SIDES = {"width": {"width", "size"}, "height": {"height", "size"}, "water": {"water"}, "x": {"place"}, "y": {"place"}}


def candidates(phrase: Phrase, margins: Mapping[str, Sequence[float]]) -> list[tuple[float, Tree]]:
    """Return meanings (cost, expression), cheapest first; `margins` are thresholds that the labels suggest."""
    found: dict[Tree, float] = {}
    for tree, uses, extra, side in _proposed(phrase, margins):
        cost = size_of(tree) + extra + _mismatch(phrase, uses) + (OTHER_SIDE if side < 0 else 0.0)
        found[tree] = min(cost, found.get(tree, cost))
    return sorted(((cost, tree) for tree, cost in found.items()), key=lambda entry: (entry[0], str(entry[1])))


def _mismatch(phrase: Phrase, uses: set[str]) -> float:
    """Return the costs of what the phrase speaks of and an expression does not use, and the other way round."""
    spoken = set(phrase.concepts)
    if "size" in spoken and uses & {"width", "height"}:
        uses = uses | {"size"}
    uses_known = uses - ({"size"} if "size" not in spoken else set())
    alternative = {"width", "height"} if "size" in spoken else set()
    missing = len(spoken - uses) + len({f"{number:g}" for number in phrase.numbers} - uses)
    return LEFT_OUT * missing + UNMENTIONED * len(
        {use for use in uses_known - spoken - alternative if not use[0].isdigit()}
    )


Proposed = Iterator[tuple[Tree, set[str], float, int]]
"""Expression, perceptions it uses, costs of its own, and side: -1 when it contradicts the phrase's negation."""


def _proposed(phrase: Phrase, margins: Mapping[str, Sequence[float]]) -> Proposed:
    sided = 1 if phrase.denies else -1
    for tree, uses in _relations(phrase.arguments):
        yield tree, uses, 0.0, sided
        yield ("not", tree), uses, 0.0, -sided
    if phrase.arguments == 0:
        for tree, uses, extra in _comparisons("gripper_mass", ("gripper_mass",), {"gripper"}, phrase, margins):
            yield tree, uses, extra, 1
        return
    for variable in ("?a", "?b")[: phrase.arguments]:
        unspoken = 0.0 if phrase.arguments == 1 else OWN_NUMBER
        for measure in MEASURES:
            uses = {measure} if measure in ("width", "height", "water") else {"place"}
            for tree, used, extra in _comparisons(measure, (measure, variable), uses, phrase, margins):
                yield tree, used, extra + unspoken, _side(tree, phrase)
        named = [f"category:{name}" for name in CATEGORIES if f"category:{name}" in phrase.concepts]
        for name in CATEGORIES:
            tree = ("is", ("category", variable), name)
            yield tree, {f"category:{name}"}, unspoken, sided
            yield ("not", tree), {f"category:{name}"}, unspoken, -sided
        if len(named) > 1:
            parts = tuple(("is", ("category", variable), name.removeprefix("category:")) for name in named)
            # A list that was said costs its length, not all its words.
            discount = size_of(("or", *parts)) - 2.0 - len(named)
            yield ("or", *parts), set(named), unspoken - discount, sided
            yield ("not", ("or", *parts)), set(named), unspoken - discount, -sided


def _side(tree: Tree, phrase: Phrase) -> int:
    """Whether a comparison stands on the side that the phrase's words of size ask for."""
    if phrase.direction == 0:
        return 1
    below = isinstance(tree[1], tuple) and tree[1][0] in MEASURES
    return 1 if below == (phrase.direction > 0) else -1


def _comparisons(
    measure: str, call: Tree, uses: set[str], phrase: Phrase, margins: Mapping[str, Sequence[float]]
) -> Iterator[tuple[Tree, set[str], float]]:
    """Yield comparisons of one measure with numbers that are said, with the example's tolerance, with the gripper's
    largest opening, and with what the labels suggest."""
    bounds: list[tuple[Tree | float, set[str], float]] = [(number, {f"{number:g}"}, 0.0) for number in phrase.numbers]
    bounds.append((TOLERANCE, set(), OWN_TOLERANCE if measure in ("water", "gripper_mass") else OWN_NUMBER))
    if measure in ("width", "height"):
        bounds.append((("largest_opening",), {"gripper"}, 0.0))
    bounds += [(value, set(), OWN_NUMBER) for value in margins.get(measure, ())]
    preference = 0.0 if measure != "height" else 0.25  # of two measures that fit as well, the fingers' own comes first
    for bound, more, extra in bounds:
        yield ("less", call, bound), uses | more, extra + preference
        yield ("at_most", bound, call), uses | more, extra + preference


def _relations(arguments: int) -> Iterator[tuple[Tree, set[str]]]:
    """Yield what the given relations say of so many objects, alone or with a quantifier over others."""
    if arguments == 0:
        yield ("some", "?x", ("in_gripper", "?x")), {"gripper", "other"} & {"gripper"}
        yield ("some", "?x", ("rests_on_table", "?x")), {"above", "table"}
        return
    names = ("?a", "?b")[:arguments]
    for name, predicate in GIVEN.items():
        uses = _USES[name]
        if predicate.arguments == arguments:
            yield (name, *names), uses
            if arguments == 2:
                yield (name, "?b", "?a"), uses
        if predicate.arguments == 1 and arguments == 2:
            yield (name, "?a"), uses
        if predicate.arguments == 2 and arguments == 1:
            yield ("some", "?x", (name, "?x", "?a")), uses | {"other"}
            yield ("some", "?x", (name, "?a", "?x")), uses | {"other"}
    if arguments == 2:
        for one, two in combinations(
            (
                ("near", ("bottom", "?a"), ("top", "?b")),
                ("less", ("left", "?a"), ("right", "?b")),
                ("less", ("left", "?b"), ("right", "?a")),
                ("less", ("width", "?a"), ("width", "?b")),
                ("at_most", ("bottom", "?b"), ("bottom", "?a")),
            ),
            2,
        ):
            yield ("and", one, two), {"place"}
