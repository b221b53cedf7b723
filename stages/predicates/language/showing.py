"""A learned domain as text: predicates with the sentences and examples behind them, operators, goals, doubts."""

from __future__ import annotations

from collections.abc import Iterator

from scenewright.schemas.errors import UsageError
from scenewright.schemas.learned_domain import HeardPhrase, LabelledExample, LearnedDomainFile, LearnedPredicate
from scenewright.stages.kit.tasks.strips import Domain, Schema, atom_text


def domain_lines(file: LearnedDomainFile, operators: Domain) -> Iterator[str]:
    """Yield what was learned, a line for each thing."""
    yield f"{file.domain}, taught by {file.teacher}, learned by {file.learner}: {file.statement}"
    yield ""
    yield "Predicates"
    for predicate in file.predicates:
        yield from _predicate_lines(file, predicate)
    yield ""
    yield "Operators"
    for schema in operators.schemas:
        yield from _operator_lines(schema)
    yield ""
    yield "Goals"
    for goal in file.goals:
        phrase = file.phrases[goal.phrase]
        places_text = ", ".join(f"<{index + 1}>" for index in goal.places)
        yield f"  {goal.text!r} wants {phrase.predicate}({places_text})"
    if file.disbelieved:
        yield ""
        yield "No longer believed"
        yield from (f"  {sentence}" for sentence in file.disbelieved)


def example_lines(file: LearnedDomainFile, name: str) -> Iterator[str]:
    """Yield a predicate and every labelled example behind it. Raises UsageError when there is none of that name."""
    of_name = [each for each in file.predicates if each.name == name]
    if not of_name:
        names = ", ".join(each.name for each in file.predicates)
        raise UsageError(f"there is no predicate {name!r}", hint=f"choose one of {names}")
    yield from _predicate_lines(file, of_name[0])
    yield f"    {of_name[0].means}"
    for phrase in _phrases_of(file, of_name[0]):
        for example in phrase.examples:
            of = f" of {', '.join(example.objects)}" if example.objects else ""
            yield f"    {'holds' if example.holds else 'fails'}{of} in state {example.state}: {_reason(file, example)}"


def _reason(file: LearnedDomainFile, example: LabelledExample) -> str:
    in_dialogue = example.source in ("sentence", "answer") and example.turn < len(file.dialogue)
    return f"{example.source}, {file.dialogue[example.turn].text!r}" if in_dialogue else example.source


def _phrases_of(file: LearnedDomainFile, predicate: LearnedPredicate) -> list[HeardPhrase]:
    return [phrase for phrase in file.phrases if phrase.predicate == predicate.name]


def _predicate_lines(file: LearnedDomainFile, predicate: LearnedPredicate) -> Iterator[str]:
    yield f"  {predicate.said}"
    phrases = _phrases_of(file, predicate)
    if not phrases:
        yield "    given"
    for phrase in phrases:
        holds = sum(example.holds for example in phrase.examples)
        yield f"    heard: {phrase.text!r}; examples: {holds} for, {len(phrase.examples) - holds} against"


def _operator_lines(schema: Schema) -> Iterator[str]:
    yield f"  {schema.name}({', '.join(name for name, _ in schema.parameters)})"
    for title, atoms in (("needs", schema.preconditions), ("makes true", schema.add), ("ends", schema.delete)):
        if atoms:
            yield f"    {title} {', '.join(map(atom_text, atoms))}"
