"""PDDL text as nested lists, and the one-line errors for text that is none."""

from __future__ import annotations

import re

from scenewright.schemas.errors import BadInput

Expression = str | list["Expression"]
DEEPEST = 200
"""Brackets nested deeper than this are refused."""
_WORD = re.compile(r"[a-z0-9_@:?][a-z0-9_\-.@:]*|-|=")
HINT = "typed STRIPS with negative preconditions is read (docs/PLANNING.md)"


def refuse(message: str) -> BadInput:
    """Return the error for text that is no PDDL, or PDDL that is not read."""
    return BadInput(f"PDDL: {message}", hint=HINT)


def parse_expression(text: str) -> list[Expression]:
    """Return the one bracketed expression of a text, words in lower case, comments left out. Raises BadInput."""
    tokens = re.findall(r"[()]|[^\s()]+", re.sub(r";[^\n]*", "", text).lower())
    stack: list[list[Expression]] = [[]]
    for token in tokens:
        if token == "(":
            if len(stack) > DEEPEST:
                raise refuse(f"brackets are nested deeper than {DEEPEST}")
            stack.append([])
        elif token == ")":
            if len(stack) < 2:
                raise refuse("a closing bracket too many")
            closed = stack.pop()
            stack[-1].append(closed)
        elif _WORD.fullmatch(token) is None:
            raise refuse(f"{token[:30]!r} is not a name")
        else:
            stack[-1].append(token)
    if len(stack) != 1 or len(stack[0]) != 1 or not isinstance(stack[0][0], list):
        raise refuse("brackets do not match, or there is more than one expression")
    return stack[0][0]


def word(expression: Expression, what: str) -> str:
    """Return an expression that has to be a single word. Raises BadInput."""
    if not isinstance(expression, str):
        raise refuse(f"{what} is a list, expected a name")
    return expression


def entries(expression: Expression, what: str) -> list[Expression]:
    """Return an expression that has to be a list. Raises BadInput."""
    if isinstance(expression, str):
        raise refuse(f"{what} is {expression[:30]!r}, expected a list in brackets")
    return expression


def typed_names(terms: list[Expression], what: str) -> list[tuple[str, str]]:
    """Read `a b - kind c` as (name, type) pairs; what has no type, or `object`, has "". Raises BadInput, also for a
    name that occurs twice."""
    pairs: list[tuple[str, str]] = []
    waiting: list[str] = []
    words = [word(term, f"an entry of {what}") for term in terms]
    position = 0
    while position < len(words):
        if words[position] != "-":
            waiting.append(words[position])
            position += 1
            continue
        if position + 1 >= len(words) or words[position + 1] == "-" or not waiting:
            raise refuse(f"a dash in {what} is not between names and a type")
        kind = "" if words[position + 1] == "object" else words[position + 1]
        pairs += [(name, kind) for name in waiting]
        waiting, position = [], position + 2
    pairs += [(name, "") for name in waiting]
    names = [name for name, _ in pairs]
    for name in names:
        if names.count(name) > 1:
            raise refuse(f"{name!r} occurs twice in {what}")
    return pairs
