"""The words of a goal sentence: objects, places, order, and what adds nothing to what is wanted where."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field

TABLE, WATER = "the table", "water"
"""What a goal may name that is no object."""
LONGEST_NAME = 3
"""Most words that one object's name is written in: `candy bar` is `candybar`."""


def _words_of(text: str) -> frozenset[str]:
    return frozenset(text.split())


PILING = _words_of("stack stacked stacking pile piled piling build tower")
VERBS = PILING | _words_of(
    "put place set lay move bring get transfer keep store load arrange drop add pour fill cook boil push slide shift "
    "serve leave position rest prepare make collect placed stored poured filled moved "
    "putting placing pouring filling moving pushing getting setting adding"
)
"""What is done to bring something about; the goal is where things are in the end."""
PLACES = dict.fromkeys(("on", "onto", "upon", "atop"), "on") | dict.fromkeys(("in", "into", "inside", "within"), "in")
JOINS = _words_of(", ; : . ! & + and then plus also before after afterwards while")
HAVING = _words_of("with has have having contains contain containing holds hold holding")
FILLERS = _words_of(
    "the a an please so that which both now next first second third fourth fifth last lastly finally is are be being "
    "should must shall want i we you robot can could would need needs to of there its some directly carefully up it's "
    "one by sure ensure goal task"
)
"""Words that say nothing of where things are."""
ANYTHING = _words_of("objects things items blocks foods food cans ingredients everything all")
"""Words for things that do not name them."""
_ORDER = (
    r"(?:(?:in|with|by) (?:the |an? )?(?:this |that |following |given )?(?:order|sequence)(?: of)?"
    r"|(?:one )?on(?: top of)? (?:each other|one another|another))"
)
_IDIOMS = (
    (re.compile(r"\b(?:from )?(?:the )?top (?:down )?to (?:the )?bottom\b|\btop[- ]down\b"), " ~down "),
    (
        re.compile(r"\b(?:from )?(?:the )?bottom (?:up )?to (?:the )?top\b|\bbottom[- ]up\b|\b" + _ORDER + r"\b"),
        " ~up ",
    ),
    (re.compile(r"\bon (?:the )?top of\b"), " on "),
    (
        re.compile(
            r"\b(?:set|lay)(?: up)? (?:the |a |my )?(?:dining |breakfast |dinner )?table\b(?= *(?:for|with|[,:.;]|$))"
        ),
        ",",
    ),
    (
        re.compile(
            r"\b(?:make|prepare|cook|serve|set up|set|have)? ?(?:for )?(?:a |the |your |my |our )?"
            r"(?:breakfast|lunch|dinner|supper|brunch|meals?|snack|soup)(?: table)?\b"
        ),
        " ",
    ),
    (re.compile(r"\b(?:from|at|under) (?:the )?(?:faucet|tap|sink)\b"), " "),
    (re.compile(r"\bfollowed by\b"), ","),
    (re.compile(r"\(\s*(~\w+)\s*\)"), r"\1"),
)
"""What is said in several words, and what says nothing of where things are."""
_TOKEN = re.compile(r"~\w+|<\d>|[\w'-]+|\S")

FILLED = ("having", "")
"""Stands before `water` that was taken with what it is in."""


class Unread(Exception):
    """A sentence that is not read; the text says what it lacks."""


@dataclass
class Clause:
    """`stack A, B on C`: what, and where it goes one place after the other."""

    piling: bool = False
    ordered: bool = False
    downward: bool = False
    """The order that is said begins at the top."""
    first: list[str] = field(default_factory=list)
    places: list[tuple[str, list[str]]] = field(default_factory=list)
    listed: list[str] | None = None
    """What was named after words of order."""
    with_water: list[str] = field(default_factory=list)

    @property
    def group(self) -> list[str]:
        """What was named since the last place word."""
        return self.places[-1][1] if self.places else self.first

    @property
    def going(self) -> list[str]:
        """What goes to the last place."""
        return [] if not self.places else self.first if len(self.places) == 1 else self.places[-2][1][1:]


def clauses_of(sentence: str, names: Sequence[str]) -> list[Clause]:
    """Return the clauses of a sentence about objects `names`. Raises Unread for words that are not read."""
    clauses = [Clause()]
    named: list[str] = []
    words = _words(sentence, names)
    for number, (kind, word) in enumerate(words):
        clause = clauses[-1]
        following = words[number + 1] if number + 1 < len(words) else ("", "")
        if kind == "verb":
            said_before = not clause.first and not clause.places  # "from top to bottom, stack ..."
            clauses.append(Clause(word in PILING, clause.ordered and said_before, clause.downward and said_before))
        elif kind == "order":
            clause.ordered, clause.downward, clause.listed = True, word == "~down", clause.listed or []
        elif kind == "place":
            _settle(clause)
            clause.places.append((word, []))
        elif kind == "having":
            _have(clause, words, number)
        elif kind == "object" or kind == "anything":
            if words[number - 1 : number] == [FILLED] and word == WATER:
                continue
            here = clause.group if clause.listed is None else clause.listed
            for name in _meant(word, [each for each in named if each not in clause.going]):
                here.append(name)
                if name not in (TABLE, WATER) and kind == "object" and name not in named:
                    named.append(name)
        elif kind == "join" and word in ".;!" and following[0]:
            clauses.append(Clause())
    return [
        _settled(clause) for clause in clauses if clause.first or clause.places or clause.listed or clause.with_water
    ]


def _have(clause: Clause, words: list[tuple[str, str]], number: int) -> None:
    """Take `pot with water`, `water with cup`, and `sausage with water in pot`, where both are wanted there. Raises
    Unread where something has anything but water."""
    before, after = clause.group, words[number + 1] if number + 1 < len(words) else ("", "")
    if after == ("object", WATER) and before and words[number + 2 : number + 3] != [("place", "in")]:
        words[number] = FILLED
        filled = [word for word in before if word != WATER]
        clause.with_water.extend(filled if not clause.places else filled[-1:])
    elif before[-1:] == [WATER] and after[0] == "object":
        before.pop()
        clause.with_water.append(after[1])
    elif words[number][1] != "with":
        raise Unread(f"{words[number][1]!r} is read of water alone")


def _settle(clause: Clause) -> None:
    """Put what was listed in order in the place of what was spoken of."""
    listed, clause.listed = clause.listed, None
    if not listed:
        return
    if not clause.first or clause.first[0] in ANYTHING or set(clause.first) == set(listed):
        clause.first = listed
    else:
        clause.group.extend(listed)


def _settled(clause: Clause) -> Clause:
    """Return a clause that names all that it speaks of. Raises Unread for one that does not."""
    _settle(clause)
    for word in (*clause.first, *(name for _, where in clause.places for name in where)):
        if word in ANYTHING:
            raise Unread(f"{word!r} names no object")
    return clause


def _meant(word: str, named: list[str]) -> list[str]:
    """Return the objects that a noun or a pronoun stands for."""
    if word == "it":
        if len(named) != 1:
            raise Unread(f"'it' may be {' or '.join(named) or 'anything'}")
        return named[:]
    if word == "them":
        if len(named) < 2:
            raise Unread("'them' stands for no two objects")
        return named[:]
    return [word]


def _words(sentence: str, names: Sequence[str]) -> list[tuple[str, str]]:
    """Return the words that say something, with their kinds. Raises Unread for others."""
    text = " ".join(sentence.lower().split())
    for pattern, plain in _IDIOMS:
        text = pattern.sub(plain, text)
    tokens = _TOKEN.findall(text)
    by_letters = {name.lower().replace("_", ""): name for name in names}
    words: list[tuple[str, str]] = []
    at = 0
    while at < len(tokens):
        token, length = tokens[at], 1
        for count in range(min(LONGEST_NAME, len(tokens) - at), 0, -1):
            name = by_letters.get("".join(tokens[at : at + count]).replace("_", ""))
            if name is not None:
                words.append(("object", name))
                length = count
                break
        else:
            words += _word(token, tokens[at + 1 :], names)
        at += length
    sources = [k for k, word in enumerate(words) if word == ("from", "from")]
    for number in reversed(sources):  # where it is now is no part of what is wanted
        if words[number + 1 : number + 2] and words[number + 1][0] == "object":
            del words[number : number + 2]
        else:
            raise Unread("'from' says only where a thing is now")
    return words


def _word(token: str, rest: list[str], names: Sequence[str]) -> list[tuple[str, str]]:
    kinds = {"~up": "order", "~down": "order", "from": "from", WATER: "object", "it": "object", "them": "object"}
    if token in ("table", "tabletop"):
        return [("object", TABLE)]
    if token == "to" and [word for word in rest if word not in FILLERS][:1] == ["table"]:
        return [("place", "on")]
    if token in PLACES:
        return [("place", PLACES[token])]
    for kind, listed in (("verb", VERBS), ("join", JOINS), ("having", HAVING), ("anything", ANYTHING)):
        if token in listed:
            return [(kind, token)]
    if token in FILLERS and not (token == "to" and rest and _is_object(rest, names)):
        return []
    if token in kinds:
        return [(kinds[token], token)]
    if token == "to":
        raise Unread("'to' says neither on nor in")
    here = ", ".join(sorted(names))
    raise Unread(f"{token!r} is neither an object here ({here}) nor a word that is read")


def _is_object(rest: list[str], names: Sequence[str]) -> bool:
    following = next((word for word in rest if word not in FILLERS), "")
    return following in {name.lower() for name in names}
