"""Goals in open words: `on("red mug", "dining table")` names nodes by what a language map knows of them."""

from __future__ import annotations

import re
from collections.abc import Mapping

from scenewright.schemas.contact_graph import ContactGraphFile, GraphNode
from scenewright.schemas.errors import BadInput, UsageError
from scenewright.schemas.language_map import LanguageMap
from scenewright.stages.kit.open_words.embedded import EmbeddedEncoder
from scenewright.stages.kit.open_words.encoder import check_width, checked_text
from scenewright.stages.kit.open_words.finding import Finder, heard
from scenewright.stages.plan.domain import DOMAIN

LEAST_PROBABILITY = 0.5
"""A node is not taken for what a goal names when it is less likely."""
_QUOTED = re.compile(r'"([^"]*)"')


def has_words(literals: tuple[str, ...]) -> bool:
    """Whether a goal names anything in quotes."""
    return any('"' in literal for literal in literals)


def named_goal(
    literals: tuple[str, ...], objects: Mapping[str, str], graph: ContactGraphFile, language: LanguageMap | None
) -> tuple[str, ...]:
    """Return the literals with the likeliest fitting node in place of every quoted text.

    Of the nodes those count that may stand there: only an item can be on something; and where a text ends in the class
    of any of them or a synonym ("desk", "white mug"), those of that class. A class alone needs no probability.

    Raises UsageError without a language map, for a text that is none, and where no node is likely enough; BadInput for
    a map of other things.
    """
    if not has_words(literals):
        return literals
    if language is None:
        raise UsageError(
            f"goal {next(each for each in literals if chr(34) in each)!r:.120} is in open words",
            hint="give --language, made by scenewright splat label, or name the nodes",
        )
    encoder = EmbeddedEncoder()
    check_width(encoder, language.info.width, language.info.encoder, str(language.root))
    finder = Finder(language, encoder)
    nodes = {node.instance: node for node in graph.nodes if node.instance and node.id in objects}
    if not any(region.instance in nodes for region in language.info.regions):
        raise BadInput(f"{language.root}: none of its places is in the scene", hint="label the map of this scene")
    return tuple(_replace_quoted(literal, objects, nodes, finder) for literal in literals)


def _replace_quoted(literal: str, objects: Mapping[str, str], nodes: Mapping[int, GraphNode], finder: Finder) -> str:
    predicate = literal.split("(")[0].strip()
    kinds = DOMAIN.predicates.get(predicate, ())

    def node_of(match: re.Match[str]) -> str:
        argument = re.sub(_QUOTED, "", literal[: match.start()]).count(",")
        kind = kinds[argument] if argument < len(kinds) else None
        return _likeliest(checked_text(match[1]), kind, objects, nodes, finder)

    return _QUOTED.sub(node_of, literal)


def _likeliest(
    text: str, kind: str | None, objects: Mapping[str, str], nodes: Mapping[int, GraphNode], finder: Finder
) -> str:
    fits = finder.fits(text)
    candidates = [
        (k, nodes[region.instance]) for k, region in enumerate(finder.info.regions) if region.instance in nodes
    ]
    candidates = [(k, node) for k, node in candidates if kind is None or DOMAIN.is_a(objects[node.id], kind)]
    words = text.lower().split()
    names = {k: node.class_name.split("_") for k, node in candidates}
    longest = max((len(name) for name in names.values() if words[-len(name) :] == name), default=0)
    if longest:
        candidates = [(k, node) for k, node in candidates if len(names[k]) == longest and words[-longest:] == names[k]]
        alone = longest == len(words)
    else:
        phrase = heard(text)
        of_class = [(k, node) for k, node in candidates if phrase is not None and node.class_name in phrase.classes()]
        candidates = of_class or candidates
        alone = bool(of_class) and phrase is not None and phrase.thing() == " or ".join(phrase.nouns)
    best = max(((float(fits.probabilities[k]), node.id) for k, node in candidates), default=(0.0, "nothing"))
    if best[0] < LEAST_PROBABILITY and not alone:
        raise UsageError(
            f"goal: {_lacking(text, finder)}: {best[1]} is the likeliest, with probability {best[0]:.2f}",
            hint="name the node, or say it in other words",
        )
    return best[1]


def _lacking(text: str, finder: Finder) -> str:
    """Return that the scene lacks what a text names, or why nobody knows whether it does."""
    if not finder.cannot_tell(text):
        return f"the scene has no {text!r}"
    unread = ", ".join(map(repr, finder.encoder.unread(text)))
    why = f"the encoder has never read {unread}" if unread else "the encoder has learned no images like these"
    return f"whether the scene has {text!r} is unknown, for {why}"
