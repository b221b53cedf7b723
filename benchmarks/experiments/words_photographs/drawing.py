"""`python -m benchmarks.experiments.words_photographs.drawing`: draw the phrases that recorded rooms are asked.

Drawn by this program and SEED from the annotations and WordNet, before anything was measured; the list is
benchmarks/expectations/words_photographs.json. There: of each annotated thing its noun, two synonyms and a hypernym by
WordNet, and a phrase with a colour of its annotated name or with what carries it. Absent: sisters in WordNet of what is
there, classes of the vocabulary that are not there and their sisters, and a thing that is there on another carrier. Of
each log as many are drawn as PRESENT says, fewer where it has fewer. What a phrase is true of, and may be, is by noun,
class and WordNet: a kind of what is there may be meant (an armchair), so that it is never taken for absent.
"""

from __future__ import annotations

import json
import tomllib
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from scenewright.schemas.vocabulary import UNNAMED, load_vocabulary
from scenewright.stages.kit.open_words.reading.matching import is_layout
from scenewright.stages.kit.open_words.reading.meaning import relation_of, senses_of
from scenewright.stages.kit.open_words.reading.names import class_named, senses_named
from scenewright.stages.kit.open_words.reading.nouns import Nouns, nouns
from scenewright.stages.truth import SupportAnnotation, read_support_annotation

from benchmarks.board.real.logs import ANNOTATED, ANNOTATIONS

NOUNS = Path(__file__).with_name("nouns.toml")
LIST = Path(__file__).resolve().parents[2] / "expectations" / "words_photographs.json"
SEED = 58
PRESENT = {"kitchen": 24, "office": 24, "livingroom": 12}
"""Phrases for things that are there, at most; as many are drawn that are not."""
WORDS = {"supports": "on the", "contains": "in the", "carries_on_wall": "on the"}


@dataclass(frozen=True)
class Asked:
    """A phrase, and the annotated things that it is true of; none where the log has none."""

    text: str
    kind: str
    """`noun`, `synonym`, `hypernym`, `colour`, `relation`; of absent ones `sister`, `other`, `relation`."""
    right: tuple[str, ...] = ()
    maybe: tuple[str, ...] = ()
    """Things of which it may be true: an answer there is right, and nobody has to find them."""


@dataclass(frozen=True)
class Annotated:
    """A thing with its noun, the senses of that, and the colour that its annotator names."""

    name: str
    class_name: str
    optional: bool
    noun: str
    senses: frozenset[int]
    color: str


@cache
def table() -> Nouns:
    """The table of nouns."""
    found = nouns()
    assert found is not None
    return found


@cache
def named() -> dict[str, dict[str, Any]]:
    """nouns.toml: beginning of a thing's name -> its noun, senses and colour."""
    return dict(tomllib.loads(NOUNS.read_text(encoding="utf-8"))["things"])


def things_of(told: SupportAnnotation) -> list[Annotated]:
    """Return what is annotated of a log and has a noun, but for what bounds the room."""
    things = []
    for node in told.nodes:
        if is_layout(node.class_name):
            continue
        row = named()[max((key for key in named() if node.name.startswith(key)), key=len)]
        senses = frozenset(s for written in row["senses"] for s in table().anchored(written))
        if row["noun"]:
            color = row.get("color", "")
            things.append(Annotated(node.name, node.class_name, node.optional, row["noun"], senses, color))
    return things


def truth(noun: str, thing: Annotated) -> str:
    """Return `true`, `maybe` or `false` of a noun and a thing."""
    if noun in (thing.noun, thing.class_name.replace("_", " ")):
        return "true"
    asked = senses_named(noun)
    if asked & thing.senses or asked & _above(thing.senses):
        return "true"
    may_be = class_named(noun) == thing.class_name != UNNAMED or bool(_above(asked) & thing.senses)
    if thing.class_name != UNNAMED:
        may_be = may_be or relation_of(table(), noun, thing.class_name) in ("same", "kind", "broader")
    return "maybe" if may_be else "false"


def _above(senses: frozenset[int]) -> set[int]:
    return {above for sense in senses for above in table().above(sense)}


def present_of(told: SupportAnnotation, random: np.random.Generator) -> list[Asked]:
    """Return every phrase for a thing that is there, each text once."""
    things = things_of(told)
    found: dict[str, Asked] = {}

    def add(text: str, kind: str, right: tuple[str, ...], maybe: tuple[str, ...]) -> None:
        seen = [thing for thing in things if thing.name in right and not thing.optional]
        if text not in found and seen:
            found[text] = Asked(text, kind, right, maybe)

    for thing in things:
        add(thing.noun, "noun", *true_of(thing.noun, things))
        senses = sorted(thing.senses)
        synonyms = sorted({m for s in senses for m in table().members[s] if m.lower() != thing.noun and m.islower()})
        for k in random.permutation(len(synonyms))[:2]:
            add(synonyms[k], "synonym", *true_of(synonyms[k], things))
        above = sorted({h for s in senses for h in table().hypernyms[s] if not table().is_general(h)})
        if above:
            word = table().members[above[int(random.integers(len(above)))]][0]
            add(word, "hypernym", *true_of(word, things))
        for text, kind, right in phrases_of(thing, things, told):
            add(
                text,
                kind,
                right,
                tuple(t.name for t in things if truth(thing.noun, t) != "false" and t.name not in right),
            )
    return list(found.values())


def true_of(noun: str, things: list[Annotated]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the names of the things that a noun is true of, and of those that it may be."""
    told = {thing.name: truth(noun, thing) for thing in things}
    return tuple(n for n, t in told.items() if t == "true"), tuple(n for n, t in told.items() if t == "maybe")


def phrases_of(
    thing: Annotated, things: list[Annotated], told: SupportAnnotation
) -> Iterator[tuple[str, str, tuple[str, ...]]]:
    """Yield phrases by template: the colour in a thing's name, else what carries it."""
    if thing.color:
        same = tuple(t.name for t in things if t.noun == thing.noun and t.color == thing.color)
        yield f"{thing.color} {thing.noun}", "colour", same
        return
    nouns_of = {node.name: node.class_name for node in told.nodes} | {t.name: t.noun for t in things}
    carriers = {relation.child: (relation.parent, relation.relation) for relation in told.relations}
    parent, relation = carriers.get(thing.name, ("", ""))
    if parent and nouns_of[parent] != "floor":
        same = tuple(
            t.name
            for t in things
            if t.noun == thing.noun and nouns_of.get(carriers.get(t.name, ("", ""))[0]) == nouns_of[parent]
        )
        yield f"{thing.noun} {WORDS.get(str(relation), 'on the')} {nouns_of[parent]}", "relation", same


def absent_of(told: SupportAnnotation, random: np.random.Generator, count: int) -> list[Asked]:
    """Return phrases that are false of everything in a log, of three kinds in turn."""
    things, told_words = things_of(told), told.model_dump_json().lower()
    classes = [entry.name for entry in load_vocabulary().classes if not entry.is_layout and entry.name != UNNAMED]
    found: dict[str, Asked] = {}
    for turn in range(60 * count):
        if len(found) == count:
            break
        kind = ("sister", "other", "sister", "other", "relation")[turn % 5]
        thing = things[int(random.integers(len(things)))]
        if kind == "relation":
            text = false_relation(thing, things, told, random)
        else:
            name = classes[int(random.integers(len(classes)))]
            senses = thing.senses if kind == "sister" else senses_of(name)
            itself = [name.replace("_", " ")] if kind == "other" and random.random() < 0.5 else []
            text = drawn([*itself] or sisters(senses), random)
        if text and text not in found and (kind == "relation" or is_absent(text, things, told_words)):
            found[text] = Asked(text, kind)
    return list(found.values())


def drawn(words: list[str], random: np.random.Generator) -> str:
    """Return one of the words, "" of none."""
    return words[int(random.integers(len(words)))] if words else ""


def sisters(senses: frozenset[int]) -> list[str]:
    """Return the first nouns of the sisters of senses in WordNet."""
    above = {h for s in senses for h in table().hypernyms[s] if not table().is_general(h)}
    kinds = {k for below in table().kinds_of(above).values() for k in below} - senses
    return sorted({table().members[k][0] for k in kinds if table().members[k][0].islower()})


def is_absent(noun: str, things: list[Annotated], told_words: str) -> bool:
    """Whether a noun is false of everything, layout included, and nowhere in the annotator's words."""
    if any(truth(noun, thing) != "false" for thing in things) or noun in told_words:
        return False
    return all(
        relation_of(table(), noun, name) not in ("same", "kind", "broader") for name in ("floor", "wall", "ceiling")
    )


def false_relation(
    thing: Annotated, things: list[Annotated], told: SupportAnnotation, random: np.random.Generator
) -> str:
    """Return a thing that is there on a carrier that is there, which carries nothing that its noun may be true of."""
    carriers = {relation.child: relation.parent for relation in told.relations}
    by_name = {t.name: t for t in things}
    parents = sorted({p for p in carriers.values() if p in by_name})
    if not parents:
        return ""
    parent = by_name[drawn(parents, random)]
    carried = [
        by_name[c] for c, p in carriers.items() if c in by_name and p in by_name and by_name[p].noun == parent.noun
    ]
    like = any(truth(thing.noun, each) != "false" for each in carried)
    return "" if like or truth(thing.noun, parent) != "false" else f"{thing.noun} on the {parent.noun}"


def main() -> None:
    """Draw and write the list."""
    rows = {}
    for number, log in enumerate(ANNOTATED):
        told, random = read_support_annotation(ANNOTATIONS / f"{log}.json"), np.random.default_rng([SEED, number])
        present = present_of(told, random)
        chosen = sorted(random.permutation(len(present))[: PRESENT[log]].tolist())
        absent = absent_of(told, random, PRESENT[log])
        rows[log] = {"present": [asdict(present[k]) for k in chosen], "absent": [asdict(each) for each in absent]}
    LIST.write_text(json.dumps(rows, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
