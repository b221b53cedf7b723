"""Goals in sentences, read as what is wanted where, and said again in the phrases that a learner was taught.

"Pour water into cup on the table" wants water in the cup, and the cup on the table. Whether a learner knows what that
means depends on the phrases that were explained to it, which are read by the same rules.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass

from scenewright.stages.kit.predicates.goal_tokens import TABLE, WATER, Clause, Unread, clauses_of
from scenewright.stages.kit.predicates.goal_words import Part, goal_phrases

Relation = tuple[str, str, str]
"""What, `on` or `in`, and where: names of objects, TABLE or WATER."""


@dataclass(frozen=True)
class Reading:
    """A goal in the phrases that were taught, or what keeps it from being read."""

    parts: tuple[Part, ...] = ()
    lacking: str = ""
    """Empty: it was read."""


def read_goal(sentence: str, names: Iterable[str], known: Collection[str]) -> Reading:
    """Read a goal about objects `names`, given the phrases that were explained (`known`, with <1>, <2> for objects).

    What is said in those very phrases is taken so; else the sentence is read as relations; else each part that `and`
    joins is taken by itself.
    """
    names = tuple(names)
    parts = goal_phrases(sentence, names)
    if all(part in known for part, _ in parts):
        return Reading(tuple(parts))
    whole = _in_known_phrases(sentence, names, known)
    if not whole.lacking or len(parts) == 1:
        return whole
    read: list[Part] = []
    rest: list[str] = []
    for text, part in zip(_split(sentence), parts, strict=True):
        if part[0] in known:
            read.append(part)
        else:
            rest.append(text)
    if not read:
        return whole
    remainder = _in_known_phrases(" and ".join(rest), names, known)
    return remainder if remainder.lacking else Reading((*read, *remainder.parts))


def _split(sentence: str) -> list[str]:
    return " ".join(sentence.lower().rstrip(".").split()).split(" and ")


def _in_known_phrases(sentence: str, names: tuple[str, ...], known: Collection[str]) -> Reading:
    """Return the relations of a sentence in the phrases that say the like."""
    try:
        relations = relations_of(sentence, names)
    except Unread as unread:
        return Reading(lacking=str(unread))
    said = _phrases_by_kind(known)
    parts: list[Part] = []
    for relation in relations:
        kind, objects = _kind_of(relation, names)
        if kind not in said:
            raw = goal_phrases(sentence, names)
            text = raw[0][0] if len(raw) == 1 and len(relations) == 1 else " ".join(kind)
            return Reading(lacking=f"nobody has said what {text!r} means")
        phrase, slots = said[kind]
        parts.append((phrase, tuple(objects[slots.index(number)] for number in range(len(slots)))))
    return Reading(tuple(parts))


def _kind_of(relation: Relation, names: Collection[str]) -> tuple[Relation, tuple[str, ...]]:
    """Return a relation with <1>, <2> in place of its objects, and these."""
    objects = tuple(word for word in (relation[0], relation[2]) if word in names)
    what, where = (f"<{objects.index(word) + 1}>" if word in names else word for word in (relation[0], relation[2]))
    return (what, relation[1], where), objects


def _phrases_by_kind(known: Collection[str]) -> dict[Relation, tuple[str, tuple[int, ...]]]:
    """Return relations -> the phrase that says just that, and which of its slots stand first and second in it."""
    slots = ("<1>", "<2>")
    said: dict[Relation, tuple[str, tuple[int, ...]]] = {}
    for phrase in sorted(known):
        try:
            relations = relations_of(phrase, slots)
        except Unread:
            continue
        if len(relations) == 1:
            kind, objects = _kind_of(relations[0], slots)
            if {slot for slot in slots if slot in phrase} == set(objects):
                said.setdefault(kind, (phrase, tuple(slots.index(slot) for slot in objects)))
    return said


def relations_of(sentence: str, names: Iterable[str]) -> list[Relation]:
    """Return what a sentence wants where, in its order and once each. Raises Unread, which says what it lacks."""
    relations: list[Relation] = []
    before: tuple[str, str] | None = None
    """`on shelf` said before what goes there."""
    for clause in clauses_of(sentence, tuple(names)):
        if before is not None and not clause.places and clause.first:
            clause.places.append((before[0], [before[1]]))
            before = None
        if clause.places and not clause.first and before is None and len(clause.places) == 1:
            where = clause.places[0][1]
            if len(where) > 1:  # "on shelf, coaster": what goes there follows at once
                clause.first, clause.places = where[1:], [(clause.places[0][0], where[:1])]
            elif where:
                before = (clause.places[0][0], where[0])
                continue
        relations += _relations(clause)
    if before is not None:
        raise Unread(f"{before[0]} {before[1]}: what?")
    if not relations:
        raise Unread("it does not say what is wanted where")
    return list(dict.fromkeys(relations))


def _relations(clause: Clause) -> list[Relation]:
    """Return what one clause wants: `bread, candybar on plate on placemat`."""
    relations: list[Relation] = [(WATER, "in", name) for name in clause.with_water]
    things = clause.first
    if not clause.places:
        if clause.ordered and len(things) > 1:
            return relations + _pile(things, clause.downward)
        if clause.first and not (clause.with_water and set(clause.first) <= set(clause.with_water)):
            raise Unread(f"{', '.join(things)}: on or in what?")
        return relations
    for number, (relation, where) in enumerate(clause.places):
        if not things:
            raise Unread(f"{relation} {where[0] if where else ''}: what?".replace(" :", ":"))
        if not where:
            raise Unread(f"{', '.join(things)}: {relation} what?")
        following = clause.places[number + 1 :]
        poured = things == [WATER] and (not following or (following[0][1][:1] == [TABLE]))
        receivers = where if poured else where[:1]
        for receiver in receivers:
            if WATER in things and (relation != "in" or receiver == TABLE) or receiver == WATER:
                raise Unread(f"water {relation} {receiver}: water is wanted in things")
            piled = relation == "on" and len(things) > 1 and (clause.piling or (clause.ordered and receiver != TABLE))
            if piled:
                pile = things[::-1] if clause.downward else things
                relations += [(pile[0], relation, receiver), *_pile(pile, False)]
            else:
                relations += [(thing, relation, receiver) for thing in things]
        left = where[len(receivers) :]
        if left and not following:
            raise Unread(f"{', '.join(left)}: on or in what?")
        things = left or receivers
    if any(thing == where for thing, _, where in relations):
        raise Unread("a thing on or in itself")
    return relations


def _pile(things: list[str], downward: bool) -> list[Relation]:
    """Return things on each other, the first at the bottom, or at the top."""
    pile = things[::-1] if downward else things
    return [(upper, "on", lower) for lower, upper in zip(pile, pile[1:], strict=False)]
