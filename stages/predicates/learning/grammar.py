"""What a phrase could mean: expressions of the grammar, each with what it costs.

An expression costs its words, and more for every perception that it uses and the phrase does not speak of, for every
one that the phrase speaks of and it leaves out, and for standing on the wrong side of the phrase's negation. Cheap
meanings are tried first; labels decide.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations

from scenewright.stages.kit.predicates.expressions import Tree, size_of
from scenewright.stages.predicates.learning.phrases import Phrase
from scenewright.stages.predicates.learning.setting import KITCHEN, OWN_NUMBER, Measure, Setting

BOTH_SAID = 2.0
"""Discount of a relation with a condition, whose words are many: it costs little where a phrase speaks of both."""
UNMENTIONED, LEFT_OUT, OTHER_SIDE = 3.0, 4.0, 7.0
"""Costs: of a perception that is not spoken of, of one that is and is not used, of the wrong side."""


def candidates(
    phrase: Phrase, margins: Mapping[str, Sequence[float]], setting: Setting = KITCHEN
) -> list[tuple[float, Tree]]:
    """Return meanings (cost, expression), cheapest first; `margins` are thresholds that the labels suggest."""
    cost_of_tree: dict[Tree, float] = {}
    for tree, uses, extra, side in _propose(phrase, margins, setting):
        cost = size_of(tree) + extra + _mismatch(phrase, uses) + (OTHER_SIDE if side < 0 else 0.0)
        cost_of_tree[tree] = min(cost, cost_of_tree.get(tree, cost))
    return sorted(((cost, tree) for tree, cost in cost_of_tree.items()), key=lambda entry: (entry[0], str(entry[1])))


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


def _propose(phrase: Phrase, margins: Mapping[str, Sequence[float]], setting: Setting) -> Proposed:
    sided = 1 if phrase.denies else -1
    for tree, uses in _relations(phrase.arguments, setting):
        yield tree, uses, 0.0, sided
        yield ("not", tree), uses, 0.0, -sided
    for name, truth, concepts in setting.compared if phrase.arguments == 1 else ():
        tree = ("some", "?x", ("and", (name, "?a", "?x"), truth))
        yield tree, set(concepts), -BOTH_SAID, sided
        yield ("not", tree), set(concepts), -BOTH_SAID, -sided
    if phrase.arguments == 0:
        for name, measure in setting.of_whole.items():
            for tree, uses, extra in _comparisons(name, (name,), measure, phrase, margins):
                yield tree, uses, extra, 1
        return
    for variable in ("?a", "?b")[: phrase.arguments]:
        unspoken = 0.0 if phrase.arguments == 1 else OWN_NUMBER
        for name, measure in setting.measures.items():
            for tree, used, extra in _comparisons(name, (name, variable), measure, phrase, margins):
                yield tree, used, extra + unspoken, _side(tree, phrase, setting)
        categories = [f"category:{name}" for name in setting.categories if f"category:{name}" in phrase.concepts]
        for name in setting.categories:
            tree = ("is", ("category", variable), name)
            yield tree, {f"category:{name}"}, unspoken, sided
            yield ("not", tree), {f"category:{name}"}, unspoken, -sided
        if len(categories) > 1:
            memberships = tuple(("is", ("category", variable), name.removeprefix("category:")) for name in categories)
            # A list that was said costs its length, not all its words.
            discount = size_of(("or", *memberships)) - 2.0 - len(categories)
            yield ("or", *memberships), set(categories), unspoken - discount, sided
            yield ("not", ("or", *memberships)), set(categories), unspoken - discount, -sided


def _side(tree: Tree, phrase: Phrase, setting: Setting) -> int:
    """Whether a comparison stands on the side that the phrase's words of size ask for."""
    if phrase.direction == 0:
        return 1
    below = isinstance(tree[1], tuple) and tree[1][0] in setting.measures
    return 1 if below == (phrase.direction > 0) else -1


def _comparisons(
    name: str, call: Tree, measure: Measure, phrase: Phrase, margins: Mapping[str, Sequence[float]]
) -> Iterator[tuple[Tree, set[str], float]]:
    """Yield comparisons of one measure with numbers that are said, with the setting's number and its perception of the
    whole (the gripper's largest opening), and with what the labels suggest."""
    bounds: list[tuple[Tree | float, frozenset[str], float]] = [
        (number, frozenset({f"{number:g}"}), 0.0) for number in phrase.numbers
    ]
    if measure.number is not None:
        bounds.append((measure.number[0], frozenset(), measure.number[1]))
    if measure.bound is not None:
        bounds.append(((measure.bound[0],), measure.bound[1], 0.0))
    bounds += [(value, frozenset(), OWN_NUMBER) for value in margins.get(name, ())]
    preference = 0.0 if name != "height" else 0.25  # of two measures that fit as well, the fingers' own comes first
    for bound, uses_of_bound, extra in bounds:
        yield ("less", call, bound), set(measure.uses | uses_of_bound), extra + preference
        yield ("at_most", bound, call), set(measure.uses | uses_of_bound), extra + preference


def _relations(arguments: int, setting: Setting) -> Iterator[tuple[Tree, set[str]]]:
    """Yield what the given relations say of so many objects, alone or with a quantifier over others."""
    if arguments == 0:
        for name, predicate in setting.given.items():
            if predicate.arguments == 1:
                yield ("some", "?x", (name, "?x")), set(setting.uses[name])
        return
    names = ("?a", "?b")[:arguments]
    for name, predicate in setting.given.items():
        uses = set(setting.uses[name])
        if predicate.arguments == arguments:
            yield (name, *names), uses
            if arguments == 2:
                yield (name, "?b", "?a"), uses
        if predicate.arguments == 1 and arguments == 2:
            yield (name, "?a"), uses
        if predicate.arguments == 2 and arguments == 1:
            yield ("some", "?x", (name, "?x", "?a")), uses | {"other"}
            yield ("some", "?x", (name, "?a", "?x")), uses | {"other"}
    if arguments == 2 and setting.boxes:
        for first, second in combinations(
            (
                ("near", ("bottom", "?a"), ("top", "?b")),
                ("less", ("left", "?a"), ("right", "?b")),
                ("less", ("left", "?b"), ("right", "?a")),
                ("less", ("width", "?a"), ("width", "?b")),
                ("at_most", ("bottom", "?b"), ("bottom", "?a")),
            ),
            2,
        ):
            yield ("and", first, second), {"place"}
