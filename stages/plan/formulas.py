"""Goals as formulas: classes, quantifiers and negation over the predicates of a domain.

    (forall (?b - bottle) (exists (?t - table) (on ?b ?t)))      (and (closed fridge_2) (not (in cup_3 fridge_2)))

A formula is turned into alternatives, each a set of atoms that have to hold or must not. `on(bottle,any table)` is the
same in the short form: `any CLASS`, `every CLASS`, and `not` before a literal.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from itertools import product

from scenewright.schemas.errors import UsageError
from scenewright.stages.kit.tasks.pddl_expressions import Expression, entries, parse_expression, typed_names, word
from scenewright.stages.kit.tasks.strips import Atom

MOST_INSTANCES, MOST_ALTERNATIVES, DEEPEST = 20_000, 512, 12
"""Most bindings of a goal's quantifiers in all, most alternatives of a goal, and most nested parts."""
Literal = tuple[Atom, bool]
Alternative = frozenset[Literal]
TRUE: tuple[Alternative, ...] = (frozenset(),)
"""What always holds: one alternative without atoms. Without alternatives nothing holds."""
HINT = "docs/PLANNING.md, Goals"
_SHORT = re.compile(r"^\s*(not\s+)?(\w[\w-]*)\s*\(\s*([^()]*?)\s*\)\s*$")


@dataclass(frozen=True)
class Names:
    """What a goal may speak of."""

    objects: Mapping[str, str]
    """Object -> its class."""
    ground: Callable[[Atom, str, bool], frozenset[Atom] | None]
    """Checks an atom (with the goal's text, for messages, and whether a quantifier chose its objects) and returns what
    it stands for; None for what can't be of things of this kind. Raises UsageError."""


class _Reader:
    def __init__(self, names: Names, text: str) -> None:
        self.names, self.text = names, text
        self.left = MOST_INSTANCES

    def refuse(self, message: str) -> UsageError:
        return UsageError(f"goal {self.text[:120]!r}: {message}", hint=HINT)

    def read(self, part: Expression, binding: dict[str, str], holds: bool, depth: int = 0) -> tuple[Alternative, ...]:
        """Return the alternatives under which a part is true (`holds`) or false."""
        listed = entries(part, "a part of the goal")
        self.left -= 1
        if self.left < 0:
            raise self.refuse(f"more than {MOST_INSTANCES} cases to look at; quantify over fewer things")
        if depth > DEEPEST:
            raise self.refuse(f"nested deeper than {DEEPEST}")
        if not listed:
            raise self.refuse("a part of it is empty")
        head = word(listed[0], "the beginning of a part of the goal")
        if head == "not":
            self._count(listed, 2, "`not` takes one part")
            return self.read(listed[1], binding, not holds, depth + 1)
        if head == "imply":
            self._count(listed, 3, "`imply` takes two parts")
            either: Expression = ["or", ["not", listed[1]], listed[2]]
            return self.read(either, binding, holds, depth + 1)
        if head in ("and", "or"):
            branches = (self.read(each, binding, holds, depth + 1) for each in listed[1:])
            return self._combine(branches, (head == "and") == holds)
        if head in ("forall", "exists"):
            self._count(listed, 3, f"`{head}` takes variables and a part")
            branches = (self.read(listed[2], inner, holds, depth + 1) for inner in self._bindings(listed[1], binding))
            return self._combine(branches, (head == "forall") == holds)
        terms = [word(each, "a term of the goal") for each in listed[1:]]
        for term in terms:
            if term.startswith("?") and term not in binding:
                raise self.refuse(f"{term} is not bound")
        atom = (head, *(binding.get(term, term) for term in terms))
        if head == "=":
            self._count(listed, 3, "`=` takes two objects")
            return TRUE if (atom[1] == atom[2]) == holds else ()
        atoms = self.names.ground(atom, self.text, any(term.startswith("?") for term in terms))
        if atoms is None:
            return () if holds else TRUE
        if holds:
            return (frozenset((each, True) for each in atoms),)
        return tuple(frozenset({(each, False)}) for each in sorted(atoms))

    def _count(self, listed: list[Expression], length: int, message: str) -> None:
        if len(listed) != length:
            raise self.refuse(message)

    def _bindings(self, variables: Expression, binding: dict[str, str]) -> Iterator[dict[str, str]]:
        pairs = typed_names(entries(variables, "the variables of the goal"), "the variables of the goal")
        for name, kind in pairs:
            if not name.startswith("?") or name in binding:
                raise self.refuse(f"{name} is not a variable, or bound twice")
            if kind and kind not in self.names.objects.values():
                kinds = ", ".join(sorted(set(self.names.objects.values()))[:12])
                raise self.refuse(f"the scene has no {kind!r}; it has {kinds}")
        choices = [
            [each for each, object_kind in self.names.objects.items() if not kind or object_kind == kind]
            for _, kind in pairs
        ]
        for values in product(*choices):
            self.left -= 1
            if self.left < 0:
                raise self.refuse(f"more than {MOST_INSTANCES} cases to look at; quantify over fewer things")
            yield {**binding, **dict(zip((name for name, _ in pairs), values, strict=True))}

    def _combine(self, branches: Iterator[tuple[Alternative, ...]], together: bool) -> tuple[Alternative, ...]:
        if not together:
            all_found = tuple(dict.fromkeys(alternative for part in branches for alternative in part))
            return self._check_count(_least(all_found))
        result = TRUE
        for part in branches:
            merged = (first | two for first in result for two in part)
            result = self._check_count(_least(tuple(dict.fromkeys(each for each in merged if _sound(each)))))
        return result

    def _check_count(self, options: tuple[Alternative, ...]) -> tuple[Alternative, ...]:
        if len(options) > MOST_ALTERNATIVES:
            raise self.refuse(f"more than {MOST_ALTERNATIVES} ways to reach it; name some of the things")
        return options


def _sound(alternative: Alternative) -> bool:
    return not any((atom, not holds) in alternative for atom, holds in alternative)


def _least(options: tuple[Alternative, ...]) -> tuple[Alternative, ...]:
    """Leave out alternatives that ask for more than another one (few are compared: the rest stays)."""
    if len(options) > 200:
        return options
    return tuple(each for each in options if not any(alternative < each for alternative in options))


def alternatives(text: str, names: Names) -> tuple[Alternative, ...]:
    """Return the ways in which a goal, a formula or a short literal, can hold; none where it never can.

    Raises UsageError, and BadInput for what is no formula at all.
    """
    reader = _Reader(names, text)
    if text.lstrip().startswith("("):
        return reader.read(parse_expression(text), {}, True)
    return reader.read(_long_form(text, reader), {}, True)


def _long_form(text: str, reader: _Reader) -> Expression:
    """Return `not on(every bottle, any table)` as a formula; `every` reaches further than `any`."""
    match = _SHORT.match(text)
    if match is None:
        raise UsageError(
            f"goal {text!r} is not a literal", hint="write it like on(bottle_7, table_3), or as a formula in brackets"
        )
    terms: list[Expression] = []
    bound: dict[str, list[tuple[str, str]]] = {"every": [], "any": []}
    for number, part in enumerate(each.strip() for each in match[3].split(",") if match[3]):
        words = part.split()
        if len(words) == 2 and words[0] in bound:
            variable = f"?{number}"
            bound[words[0]].append((variable, words[1]))
            terms.append(variable)
        else:
            terms.append(part)
    formula: Expression = [match[2], *terms]
    for quantifier, head in (("any", "exists"), ("every", "forall")):
        for variable, kind in bound[quantifier]:
            formula = [head, [variable, "-", kind], formula]
    return ["not", formula] if match[1] else formula


def together(parts: list[tuple[Alternative, ...]], text: str) -> tuple[Alternative, ...]:
    """Return the alternatives of several goals that all have to hold. Raises UsageError for too many."""
    reader = _Reader(Names({}, lambda atom, where, quantified: None), text)
    return reader._combine(iter(parts), True)


def literal_text(literal: Literal) -> str:
    """Return a literal as people write it."""
    atom, holds = literal
    text = f"{atom[0]}({', '.join(atom[1:])})"
    return text if holds else f"not {text}"
