"""The language of predicates: typed expressions over the perception calls, read from text and checked before use.

    (and (near (bottom ?a) (top ?b)) (less (left ?a) (right ?b)) (less (left ?b) (right ?a)))

An expression is a tree of tuples. Numbers come of perception and arithmetic, truth of comparisons, `and`, `or`,
`not`, `some` and `every` over the other objects, and of predicates by name. Nothing of it is ever run as code.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.predicates.vocabulary import Vocabulary
from scenewright.stages.kit.tasks.pddl_expressions import Expression as Listed
from scenewright.stages.kit.tasks.pddl_expressions import parse_expression

Tree = tuple["Tree | str | float", ...]
ARITHMETIC = {"plus": 2, "minus": 2, "times": 2, "over": 2, "abs": 1}
"""Arithmetic by its word, and how many numbers each takes."""
COMPARISONS = ("less", "at_most", "near")
CONNECTIVES = ("and", "or")
QUANTIFIERS = ("some", "every")
WORDS = {*ARITHMETIC, *COMPARISONS, *CONNECTIVES, *QUANTIFIERS, "not", "is", "category"}
"""Words that every vocabulary has."""
DEEPEST = 24
"""Deepest nesting of an expression; a bound against damaged files."""
LARGEST = 400
"""Most words of one expression."""
HINT = "docs/INTERPRET.md has the language of predicates"


@dataclass(frozen=True)
class Predicate:
    """A predicate: name, how many objects it is about (?a, ?b, ...) and what it means."""

    name: str
    arguments: int
    means: Tree

    @property
    def variables(self) -> tuple[str, ...]:
        """`?a`, `?b`, ..."""
        return variables_of(self.arguments)


def variables_of(arguments: int) -> tuple[str, ...]:
    """Return the names of so many arguments."""
    return tuple(f"?{chr(97 + number)}" for number in range(arguments))


def text_of(tree: Tree | str | float) -> str:
    """Return an expression as text that `read` reads back."""
    if isinstance(tree, tuple):
        return f"({' '.join(text_of(part) for part in tree)})"
    return tree if isinstance(tree, str) else f"{tree:.12g}"


def read(text: str, where: str) -> Tree:
    """Return an expression. Raises BadInput naming `where` for text that is none; names and types are not looked at."""
    try:
        listed = parse_expression(text)
    except BadInput as error:
        raise refuse(where, str(error).removeprefix("PDDL: ")) from None
    return _tree(listed, where, 0)


def refuse(where: str, message: str) -> BadInput:
    """Return the error for an expression that can't be used."""
    return BadInput(f"{where}: {message}", hint=HINT)


def _tree(listed: list[Listed], where: str, depth: int) -> Tree:
    if depth > DEEPEST:
        raise refuse(where, f"nested deeper than {DEEPEST}")
    branches: list[Tree | str | float] = []
    for part in listed:
        if not isinstance(part, str):
            branches.append(_tree(part, where, depth + 1))
        elif part[0].isdigit():
            try:
                number = float(part)
            except ValueError:
                raise refuse(where, f"{part[:30]!r} is not a number") from None
            if not math.isfinite(number) or abs(number) > 1e9:
                raise refuse(where, f"{part[:30]!r} is too large")
            branches.append(number)
        else:
            branches.append(part)
    return tuple(branches)


def check(predicates: Mapping[str, Predicate], vocabulary: Vocabulary) -> None:
    """Raise BadInput for an expression of wrong types, with free variables or unknown names, and for predicates that
    are defined by each other."""
    words = _words_of(vocabulary)
    words |= {name: (["object"] * each.arguments, "truth") for name, each in predicates.items() if name not in words}
    for predicate in predicates.values():
        where = f"predicate {predicate.name}"
        if predicate.name in WORDS | {*vocabulary.of_object, *vocabulary.of_scene, *vocabulary.relations}:
            raise refuse(where, "the name is a word of the language")
        if _words(predicate.means) > LARGEST:
            raise refuse(where, f"more than {LARGEST} words")
        kind = _type_of(predicate.means, frozenset(predicate.variables), words, where)
        if kind != "truth":
            raise refuse(where, f"is a {kind}, a truth is wanted")
    _check_circles(predicates)


def _check_circles(predicates: Mapping[str, Predicate]) -> None:
    done: set[str] = set()
    for start in predicates:
        path: list[tuple[str, list[str]]] = [(start, sorted(used_in(predicates[start].means, predicates)))]
        while path:
            name, waiting = path[-1]
            if name in done or not waiting:
                done.add(name)
                path.pop()
                continue
            following = waiting.pop()
            if following in [each for each, _ in path]:
                circle = " -> ".join([*(each for each, _ in path), following])
                raise refuse(f"predicate {following}", f"is defined by itself: {circle}")
            path.append((following, sorted(used_in(predicates[following].means, predicates))))


def used_in(tree: Tree, predicates: Mapping[str, Predicate]) -> set[str]:
    """Return the predicates that an expression names."""
    names = {str(tree[0])} & set(predicates) if tree else set()
    for part in tree[1:]:
        if isinstance(part, tuple):
            names |= used_in(part, predicates)
    return names


def size_of(tree: Tree | str | float) -> int:
    """Return how many words an expression has."""
    return _words(tree) if isinstance(tree, tuple) else 1


def _words(tree: Tree) -> int:
    return sum(_words(part) if isinstance(part, tuple) else 1 for part in tree)


Words = dict[str, tuple[list[str], str]]
"""Word -> types of what it takes, type of what it gives."""


def _words_of(vocabulary: Vocabulary) -> Words:
    words: Words = {name: (["object"], "number") for name in vocabulary.of_object}
    words |= {name: ([], "number") for name in vocabulary.of_scene}
    words |= {name: (["object"] * count, "truth") for name, count in vocabulary.relations.items()}
    words |= {name: (["number"] * count, "number") for name, count in ARITHMETIC.items()}
    words |= {name: (["number"] * 2, "truth") for name in COMPARISONS}
    words |= {"not": (["truth"], "truth"), "category": (["object"], "word"), "is": (["word", "word"], "truth")}
    return words


def _type_of(tree: Tree | str | float, bound: frozenset[str], words: Words, where: str) -> str:
    """Return `number`, `truth`, `object` or `word`."""
    if isinstance(tree, float):
        return "number"
    if isinstance(tree, str):
        if not tree.startswith("?"):
            return "word"
        if tree not in bound:
            raise refuse(where, f"{tree} is not bound")
        return "object"
    if not tree or not isinstance(tree[0], str):
        raise refuse(where, "an expression begins with a word")
    head, operands = tree[0], tree[1:]
    if head in QUANTIFIERS:
        if len(operands) != 2 or not isinstance(operands[0], str) or not operands[0].startswith("?"):
            raise refuse(where, f"`{head}` takes a variable and a truth")
        if operands[0] in bound:
            raise refuse(where, f"{operands[0]} is bound twice")
        if _type_of(operands[1], bound | {operands[0]}, words, where) != "truth":
            raise refuse(where, f"`{head}` takes a variable and a truth")
        return "truth"
    kinds = [_type_of(part, bound, words, where) for part in operands]
    if head in CONNECTIVES:
        expected, result = ["truth"] * max(1, len(operands)), "truth"
    elif head in words:
        expected, result = words[head]
    else:
        raise refuse(where, f"there is no `{head[:40]}`")
    if kinds != expected:
        raise refuse(where, f"`{head}` takes {', '.join(expected) or 'nothing'}, not {', '.join(kinds) or 'nothing'}")
    return result
