"""Write and read the part of PDDL that typed STRIPS needs (requirements :strips :typing)."""

from __future__ import annotations

import re

from schemas.errors import BadInput
from stages.kit.tasks.strips import Atom, Domain, Problem, Schema

Expression = str | list["Expression"]


def _typed(pairs: list[tuple[str, str]]) -> str:
    return " ".join(f"{name} - {kind}" if kind else name for name, kind in pairs)


def _conjunction(atoms: list[Atom], negated: list[Atom] | None = None) -> str:
    parts = [f"({' '.join(atom)})" for atom in atoms] + [f"(not ({' '.join(atom)}))" for atom in negated or []]
    return f"(and {' '.join(parts)})"


def domain_text(domain: Domain) -> str:
    """Return the PDDL text of a domain."""
    lines = [f"(define (domain {domain.name})", "  (:requirements :strips :typing)"]
    types = [(name, parent or "object") for name, parent in domain.types.items()]
    lines.append(f"  (:types {_typed(types)})")
    lines.append("  (:predicates")
    for name, kinds in domain.predicates.items():
        arguments = _typed([(f"?{chr(97 + place)}", kind) for place, kind in enumerate(kinds)])
        lines.append(f"    ({name} {arguments})" if arguments else f"    ({name})")
    lines.append("  )")
    for schema in domain.schemas:
        lines += [
            f"  (:action {schema.name}",
            f"    :parameters ({_typed(list(schema.parameters))})",
            f"    :precondition {_conjunction(list(schema.preconditions))}",
            f"    :effect {_conjunction(list(schema.add), list(schema.delete))})",
        ]
    return "\n".join([*lines, ")", ""])


def problem_text(problem: Problem, domain_name: str) -> str:
    """Return the PDDL text of a problem, objects and atoms sorted."""
    initial = "\n".join(f"    ({' '.join(atom)})" for atom in sorted(problem.initial))
    return (
        f"(define (problem {problem.name})\n  (:domain {domain_name})\n"
        f"  (:objects {_typed(sorted(problem.objects.items()))})\n"
        f"  (:init\n{initial})\n"
        f"  (:goal {_conjunction(sorted(problem.goal))}))\n"
    )


def _parse(text: str) -> Expression:
    tokens = re.findall(r"[()]|[^\s()]+", re.sub(r";[^\n]*", "", text).lower())
    stack: list[list[Expression]] = [[]]
    for token in tokens:
        if token == "(":
            stack.append([])
        elif token == ")":
            if len(stack) < 2:
                raise BadInput("PDDL: a closing bracket too many")
            closed = stack.pop()
            stack[-1].append(closed)
        else:
            stack[-1].append(token)
    if len(stack) != 1 or len(stack[0]) != 1:
        raise BadInput("PDDL: brackets do not match")
    return stack[0][0]


def _pairs(terms: list[Expression], default: str = "") -> list[tuple[str, str]]:
    """Read `a b - kind c - other d` as (name, type) pairs."""
    pairs: list[tuple[str, str]] = []
    waiting: list[str] = []
    words = [str(term) for term in terms]
    place = 0
    while place < len(words):
        if words[place] == "-":
            pairs += [(name, words[place + 1]) for name in waiting]
            waiting, place = [], place + 2
        else:
            waiting.append(words[place])
            place += 1
    return pairs + [(name, default) for name in waiting]


def _literals(expression: Expression) -> tuple[tuple[Atom, ...], tuple[Atom, ...]]:
    """Return the positive and the negated atoms of a conjunction."""
    items = expression[1:] if expression and expression[0] == "and" else [expression]
    positive: list[Atom] = []
    negative: list[Atom] = []
    for item in items:
        if not isinstance(item, list):
            raise BadInput(f"PDDL: expected an atom, found {item!r}")
        if item and item[0] == "not":
            negative.append(tuple(str(term) for term in item[1]))
        else:
            positive.append(tuple(str(term) for term in item))
    return tuple(positive), tuple(negative)


def _sections(expression: Expression) -> dict[str, list[Expression]]:
    if not isinstance(expression, list) or not expression or expression[0] != "define":
        raise BadInput("PDDL: the text does not begin with (define")
    return {str(part[0]): part[1:] for part in expression[1:] if isinstance(part, list) and part[0] != ":action"}


def parse_domain(text: str) -> Domain:
    """Read a domain of typed STRIPS. Raises BadInput."""
    expression = _parse(text)
    sections = _sections(expression)
    types = {name: "" if parent in ("object", "") else parent for name, parent in _pairs(sections.get(":types", []))}
    predicates = {
        str(entry[0]): tuple(kind for _, kind in _pairs(list(entry[1:]), "object")) for entry in sections[":predicates"]
    }
    schemas = []
    for part in expression[1:]:
        if isinstance(part, list) and part[0] == ":action":
            fields = {str(part[i]): part[i + 1] for i in range(2, len(part), 2)}
            preconditions, negated = _literals(fields[":precondition"])
            if negated:
                raise BadInput(f"PDDL: action {part[1]} has a negative precondition, which :strips does not know")
            add, delete = _literals(fields[":effect"])
            parameters = tuple(_pairs(list(fields[":parameters"]), "object"))
            schemas.append(Schema(str(part[1]), parameters, preconditions, add, delete))
    return Domain(str(sections["domain"][0]), types, predicates, tuple(schemas))


def parse_problem(text: str) -> Problem:
    """Read a problem of typed STRIPS. Raises BadInput."""
    sections = _sections(_parse(text))
    initial = frozenset(tuple(str(term) for term in atom) for atom in sections[":init"])
    goal, negated = _literals(sections[":goal"][0])
    if negated:
        raise BadInput("PDDL: the goal has a negated atom, which :strips does not know")
    return Problem(str(sections["problem"][0]), dict(_pairs(sections[":objects"])), initial, frozenset(goal))
