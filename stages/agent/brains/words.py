"""From the words of a task to goals, by patterns: what the `rules` brain understands of English, and no more."""

from __future__ import annotations

import re

from scenewright.stages.agent.goals import (
    CATEGORIES,
    FURNITURE,
    THINGS,
    Among,
    Description,
    Gather,
    Goal,
    Move,
    Shut,
    kind,
)
from scenewright.stages.kit.open_words.reading.names import singulars

LONGEST = 2_000
"""Characters of a task."""
COLORS = ("red", "blue", "green", "white", "yellow", "black")
CLAUSES = re.compile(r"[.;!?]|,? and then |,? then |,? and (?=\w+ing )?")
MOVE = re.compile(
    r"(?:(?:put|place|move|bring|take|get|carry|transfer)\s+)?(?P<what>.+?)\s+"
    r"(?:(?:out of|from|on|off)\s+(?:the\s+|all\s+)*(?P<start>\w+(?: \w+)??)\s+)??"
    r"(?P<how>onto|on|to|into|in|inside)\s+(?P<onto>(?:the|a|an|my)\s+.+|\w+)"
)
TAKE_OUT = re.compile(r"(?:take|get)\s+(?P<what>.+?)\s+(?:out of|from)\s+(?:the\s+)?(?P<start>\w+(?: \w+)?)")
AMONG = re.compile(r"(?:put|place)\s+(?P<what>.+?)\s+in(?:to)? the middle of\s+(?P<around>.+)")
GATHER = re.compile(r"(?:put|place|gather)\s+(?P<what>.+?)\s+(?:onto|on) the same\s+(?P<onto>\w+)")
SHUT = re.compile(r"(?P<how>close|shut|open)\s+(?:the\s+)?(?P<what>\w+(?: \w+)??)(?: again)?")
TIDY = re.compile(r"\b(?:tidy|clean|clear)(?:ing)? (?:up )?(?:the |my )?(?:table|desk)")
ARTICLES = ("the", "a", "an", "my")
LITERAL = re.compile(r"(?P<name>on|in|closed|open)\(\s*(?P<first>[\w ]+?)\s*(?:,\s*(?P<second>[\w ]+?)\s*)?\)")
TIDIED = tuple(Move(kind(word), kind(f"{word} box"), every=True) for word in CATEGORIES)


class NotUnderstood(Exception):
    """Words that name nothing: the message says which."""


def understood(words: str) -> tuple[Goal, ...]:
    """Return the goals of a task. Raises NotUnderstood."""
    text = " ".join(words.lower().split())
    if len(text) > LONGEST:
        raise NotUnderstood(f"the task has {len(text)} characters, more than {LONGEST}")
    literals = list(LITERAL.finditer(text))
    if literals:
        return tuple(_literal(match) for match in literals)
    if TIDY.search(text):
        return TIDIED
    clean = "pour" in text or "drink" in text
    goals: list[Goal] = []
    move_before: Move | None = None
    for clause in filter(None, (part.strip() for part in CLAUSES.split(text.split(", i ")[0]))):
        match = TAKE_OUT.fullmatch(clause)
        if match:
            what, every = _things(match["what"], clean)
            move_before = Move(what, what, every, _furniture(match["start"]))
            continue
        goal = _clause(clause, clean, move_before)
        goals.append(goal)
    if not goals:
        raise NotUnderstood(f"I do not know what to do: {words[:80]!r}")
    return tuple(goals)


def _clause(clause: str, clean: bool, taken: Move | None) -> Goal:
    if found := GATHER.fullmatch(clause):
        return Gather(_things(found["what"], clean)[0], kind(_furniture(found["onto"])))
    if found := AMONG.fullmatch(clause):
        return Among(_things(found["what"], clean)[0], _things(found["around"], False)[0])
    if found := SHUT.fullmatch(clause):
        return Shut(kind(_furniture(found["what"])), found["how"] == "open")
    if found := MOVE.fullmatch(clause):
        onto, inside = _carrier(found["onto"]), found["how"].startswith("in")
        if taken is not None and re.search(r"\bit\b", found["what"]):
            return Move(taken.what, onto, taken.every, taken.start, inside)
        what, every = _things(found["what"], clean)
        return Move(what, onto, every, _furniture(found["start"]) if found["start"] else "", inside)
    raise NotUnderstood(f"I do not understand {clause[:80]!r}")


def _literal(found: re.Match[str]) -> Goal:
    first, second = found["first"], found["second"]
    if found["name"] in ("closed", "open"):
        return Shut(kind(_furniture(first)), found["name"] == "open")
    return Move(_things(first, False)[0], _carrier(second or ""), inside=found["name"] == "in")


def _things(phrase: str, clean: bool) -> tuple[Description, bool]:
    """Return what a phrase names, and whether it means every one of them."""
    words = [w for w in re.findall(r"[a-z]+", phrase) if w not in ("the", "a", "an", "of", "on", "please", "my")]
    every = bool({"all", "every", "each"} & set(words))
    words = [w for w in words if w not in ("all", "every", "each")]
    color = next((w for w in words if w in COLORS), "")
    name = " ".join(w for w in words if w not in COLORS and w not in ("clean", "unused"))
    for candidate in singulars(name):
        if candidate in CATEGORIES or candidate in THINGS:
            return kind(candidate, color=color, clean=clean or "clean" in words), every
    raise NotUnderstood(f"I know nothing called {name[:60]!r}")


def _furniture(word: str) -> str:
    for candidate in (*singulars(word.strip()), {"drawer": "dresser"}.get(word.strip(), "")):
        if candidate in FURNITURE:
            return candidate
    raise NotUnderstood(f"I know no furniture called {word[:60]!r}")


def _carrier(phrase: str) -> Description:
    words = [word for word in phrase.split() if word not in ARTICLES]
    for count in (2, 1):  # a drawer unit, or a dining table
        try:
            return kind(_furniture(" ".join(words[-count:])))
        except NotUnderstood:
            continue
    return _things(phrase, False)[0]
