"""Write and read PDDL: STRIPS, types, negative preconditions (McDermott et al. 1998; requirements of PDDL 1.2)."""

from __future__ import annotations

from scenewright.stages.kit.tasks.pddl_expressions import (
    Expression,
    entries,
    parse_expression,
    refuse,
    typed_names,
    word,
)
from scenewright.stages.kit.tasks.strips import Atom, Domain, Problem, Schema

REQUIREMENTS = (":strips", ":typing", ":negative-preconditions")
Literals = tuple[tuple[Atom, ...], tuple[Atom, ...]]
"""Positive atoms and negated ones."""


def _typed_list(pairs: list[tuple[str, str]], types: bool = True) -> str:
    # Every name gets its type: a bare one before `b - kind` would read back as a kind.
    if not types:
        return " ".join(name for name, _ in pairs)
    return " ".join(f"{name} - {kind or 'object'}" for name, kind in pairs)


def _conjunction(atoms: list[Atom], negated: list[Atom] | None = None) -> str:
    literals = [f"({' '.join(atom)})" for atom in atoms] + [f"(not ({' '.join(atom)}))" for atom in negated or []]
    return f"(and {' '.join(literals)})"


def domain_text(domain: Domain) -> str:
    """Return the PDDL text of a domain; one without types asks for none, as some parsers know no `object` then."""
    used_features = (True, bool(domain.types), any(schema.negative for schema in domain.schemas))
    requirements = [word for word, needed in zip(REQUIREMENTS, used_features, strict=True) if needed]
    lines = [f"(define (domain {domain.name})", f"  (:requirements {' '.join(requirements)})"]
    if domain.types:
        lines.append(f"  (:types {_typed_list(list(domain.types.items()))})")
    lines.append("  (:predicates")
    for name, kinds in domain.predicates.items():
        arguments = _typed_list(
            [(f"?{chr(97 + number)}", kind) for number, kind in enumerate(kinds)], bool(domain.types)
        )
        lines.append(f"    ({name} {arguments})" if arguments else f"    ({name})")
    lines.append("  )")
    for schema in domain.schemas:
        lines += [
            f"  (:action {schema.name}",
            f"    :parameters ({_typed_list(list(schema.parameters), bool(domain.types))})",
            f"    :precondition {_conjunction(list(schema.preconditions), list(schema.negative))}",
            f"    :effect {_conjunction(list(schema.add), list(schema.delete))})",
        ]
    return "\n".join([*lines, ")", ""])


def problem_text(problem: Problem, domain_name: str) -> str:
    """Return the PDDL text of a problem, objects and atoms sorted."""
    initial = "\n".join(f"    ({' '.join(atom)})" for atom in sorted(problem.initial))
    return (
        f"(define (problem {problem.name})\n  (:domain {domain_name})\n"
        f"  (:objects {_typed_list(sorted(problem.objects.items()), any(problem.objects.values()))})\n"
        f"  (:init\n{initial})\n"
        f"  (:goal {_conjunction(sorted(problem.goal), sorted(problem.negative_goal))}))\n"
    )


def _literals(expression: Expression, subject: str) -> Literals:
    """Return the positive and the negated atoms of a conjunction."""
    listed = entries(expression, subject)
    items = listed[1:] if listed and listed[0] == "and" else [listed] if listed else []
    positive: list[Atom] = []
    negative: list[Atom] = []
    for item in items:
        inner = entries(item, f"a literal of {subject}")
        if inner and inner[0] == "not":
            if len(inner) != 2:
                raise refuse(f"`not` in {subject} takes one atom")
            negative.append(_atom(inner[1], subject))
        else:
            positive.append(_atom(inner, subject))
    return tuple(positive), tuple(negative)


def _atom(expression: Expression, subject: str) -> Atom:
    terms = entries(expression, f"an atom of {subject}")
    if not terms:
        raise refuse(f"an atom of {subject} is empty")
    if terms[0] in ("and", "or", "not", "imply", "forall", "exists", "when", "=", "increase", "either"):
        raise refuse(f"{subject} has `{terms[0]}`, which typed STRIPS does not know")
    return tuple(word(term, f"a term of {subject}") for term in terms)


def _sections(text: str, kind: str) -> tuple[str, dict[str, list[Expression]], list[list[Expression]]]:
    """Return name, sections and actions of `(define (<kind> name) ...)`."""
    expression = parse_expression(text)
    if len(expression) < 2 or expression[0] != "define":
        raise refuse("the text does not begin with (define")
    head = entries(expression[1], "the head")
    if len(head) != 2 or head[0] != kind:
        raise refuse(f"the text defines no {kind}")
    sections: dict[str, list[Expression]] = {}
    actions = []
    for part in expression[2:]:
        listed = entries(part, "a section")
        if not listed:
            raise refuse("a section is empty")
        name = word(listed[0], "the name of a section")
        if name == ":action":
            actions.append(listed)
        elif name in sections:
            raise refuse(f"section {name} occurs twice")
        else:
            sections[name] = listed[1:]
    return word(head[1], f"the name of the {kind}"), sections, actions


def parse_domain(text: str) -> Domain:
    """Read a domain. Raises BadInput for what is no PDDL, uses more than STRIPS, types and negative preconditions,
    names types, predicates or variables that are not declared, or declares one of them, or an action, twice."""
    name, sections, actions = _sections(text, "domain")
    for unknown in set(sections) - {":requirements", ":types", ":predicates"}:
        raise refuse(f"section {unknown} is not read")
    for requirement in sections.get(":requirements", []):
        if requirement not in REQUIREMENTS:
            raise refuse(f"requirement {requirement} is not met")
    types = {kind: parent for kind, parent in typed_names(sections.get(":types", []), ":types") if kind != "object"}
    for kind in types:
        _check_ancestors(kind, types)
    predicates: dict[str, tuple[str, ...]] = {}
    for entry in sections.get(":predicates", []):
        listed = entries(entry, "a predicate")
        if not listed:
            raise refuse("a predicate has no name")
        predicate = word(listed[0], "a predicate's name")
        if predicate in predicates:
            raise refuse(f"predicate {predicate} is declared twice")
        kinds = [kind for _, kind in typed_names(listed[1:], f"predicate {predicate}")]
        predicates[predicate] = tuple(_check_type(kind, types, f"predicate {predicate}") for kind in kinds)
    schemas = tuple(_schema(part, types, predicates) for part in actions)
    for schema in schemas:
        if sum(each.name == schema.name for each in schemas) > 1:
            raise refuse(f"action {schema.name} occurs twice")
    return Domain(name, types, predicates, schemas)


def _check_ancestors(kind: str, types: dict[str, str]) -> None:
    passed = {kind}
    while types[kind]:
        kind = types[kind]
        if kind not in types:
            raise refuse(f"type {kind!r} is not declared")
        if kind in passed:
            raise refuse(f"type {kind!r} is below itself")
        passed.add(kind)


def _check_type(kind: str, types: dict[str, str], subject: str) -> str:
    if kind and kind not in types:
        raise refuse(f"{subject}: type {kind!r} is not declared")
    return kind


def _schema(part: list[Expression], types: dict[str, str], predicates: dict[str, tuple[str, ...]]) -> Schema:
    if len(part) < 2 or len(part) % 2:
        raise refuse("an action lacks its name, or one of its fields has no value")
    name = word(part[1], "the name of an action")
    subject = f"action {name}"
    fields = {word(part[position], f"a field of {subject}"): part[position + 1] for position in range(2, len(part), 2)}
    if len(fields) != (len(part) - 2) // 2:
        raise refuse(f"{subject}: a field occurs twice")
    for unknown in set(fields) - {":parameters", ":precondition", ":effect"}:
        raise refuse(f"{subject}: field {unknown} is not read")
    parameters = tuple(
        (variable, _check_type(kind, types, subject))
        for variable, kind in typed_names(entries(fields.get(":parameters", []), f"{subject}: parameters"), subject)
    )
    for variable, _ in parameters:
        if not variable.startswith("?"):
            raise refuse(f"{subject}: parameter {variable!r} does not begin with ?")
    positive, negative = _literals(fields.get(":precondition", []), f"{subject}: precondition")
    add, delete = _literals(fields.get(":effect", []), f"{subject}: effect")
    variables = {variable for variable, _ in parameters}
    for atom in (*positive, *negative, *add, *delete):
        _check_atom(atom, predicates, subject)
        for term in atom[1:]:
            if term not in variables:
                raise refuse(f"{subject}: {term!r} is not a parameter of it")
    return Schema(name, parameters, positive, add, delete, negative)


def _check_atom(atom: Atom, predicates: dict[str, tuple[str, ...]], subject: str) -> None:
    if atom[0] not in predicates:
        raise refuse(f"{subject}: predicate {atom[0]!r} is not declared")
    if len(predicates[atom[0]]) != len(atom) - 1:
        raise refuse(f"{subject}: {atom[0]} takes {len(predicates[atom[0]])} arguments, not {len(atom) - 1}")


def parse_problem(text: str, domain: Domain | None = None) -> Problem:
    """Read a problem; with `domain`, its objects and atoms are checked against that. Raises BadInput."""
    name, sections, actions = _sections(text, "problem")
    if actions:
        raise refuse("a problem has no actions")
    for unknown in set(sections) - {":domain", ":requirements", ":objects", ":init", ":goal"}:
        raise refuse(f"section {unknown} is not read")
    if len(sections.get(":goal", [])) != 1:
        raise refuse("a problem has one goal")
    objects = dict(typed_names(sections.get(":objects", []), ":objects"))
    initial = frozenset(_atom(entry, ":init") for entry in sections.get(":init", []))
    goal, negated = _literals(sections[":goal"][0], ":goal")
    problem = Problem(name, objects, initial, frozenset(goal), frozenset(negated))
    if domain is not None:
        check_problem(domain, problem)
    return problem


def check_problem(domain: Domain, problem: Problem) -> None:
    """Raises BadInput when a problem names types, predicates or objects that there are not, or of a wrong type."""
    for name, kind in problem.objects.items():
        _check_type(kind, domain.types, f"object {name}")
    for atom in sorted(problem.initial | problem.goal | problem.negative_goal):
        _check_atom(atom, domain.predicates, "the problem")
        for term, kind in zip(atom[1:], domain.predicates[atom[0]], strict=True):
            if term not in problem.objects:
                raise refuse(f"object {term!r} is not declared")
            if not domain.is_a(problem.objects[term], kind):
                raise refuse(f"{term} in {' '.join(atom)} is a {problem.objects[term] or 'object'}, not a {kind}")
