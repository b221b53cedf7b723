"""Ground literals of a goal as text: `on(cup_5, table_3)`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence


def parts(literal: str) -> tuple[str, tuple[str, ...]]:
    """Return predicate and names of a literal."""
    predicate, inner = literal.rstrip(")").split("(")
    return predicate, tuple(name.strip() for name in inner.split(","))


def names_of(literals: Sequence[str]) -> tuple[str, ...]:
    """Return the names in literals, each once, in their order."""
    return tuple(dict.fromkeys(name for literal in literals for name in parts(literal)[1]))


def renamed(literal: str, names: Mapping[str, str]) -> str:
    """Return a literal with other names, written as the command line takes it. Raises KeyError without a name."""
    predicate, own = parts(literal)
    return f"{predicate}({','.join(names[name] for name in own)})"
