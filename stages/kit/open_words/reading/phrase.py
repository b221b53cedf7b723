"""From a phrase to what it asks for: a noun or a want, attributes, a relation, and whether things or places.

"where can I put the red cup on the table?" asks for places for a cup, red, on a table. What is not understood is kept
in `unread`; nothing is passed over silently.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field, replace

from scenewright.schemas.errors import UsageError
from scenewright.stages.kit.open_words.encoder import checked_text
from scenewright.stages.kit.open_words.reading.names import (
    ALWAYS_PLURAL,
    adjectives,
    class_named,
    is_noun,
    senses_named,
    singulars,
    wants,
)
from scenewright.stages.kit.open_words.reading.patterns import (
    RELATION,
    Asks,
    place_for,
    plain,
    question,
    relation_word,
    wanted,
)

DETERMINERS = frozenset(
    "the a an my our your his her their this that these those some any all every each one there other another no "  # noqa: SIM905
    "please me us what which is are old new nice".split()
)
"""Words before a noun that say nothing of the thing."""
OBJECTS = frozenset("thing things object objects something anything stuff one ones item items".split())  # noqa: SIM905
"""Nouns that name nothing."""
MOST_UNREAD = 0.5
"""Where more of the words than this share is not understood, nothing is answered unless our vocabulary has the noun;
by eye."""
EXAMPLE = 'ask in English: "red mug", "the cup on the desk"'
_ASKED = {"where": "{}", "place": "a place for {}", "count": "how many {}", "is_there": "whether there is {}"}


class Contradiction(UsageError):
    """Words that nothing can be true of."""


@dataclass(frozen=True)
class Phrase:
    """What words ask for."""

    text: str
    nouns: tuple[str, ...]
    """Nouns of which any will do; () asks for anything that has the attributes or stands in the relation."""
    want: str = ""
    """What somebody wants to do with it, as data/words/wants.toml calls it."""
    asks: Asks = "where"
    colors: tuple[str, ...] = ()
    sizes: tuple[str, ...] = ()
    materials: tuple[str, ...] = ()
    relation: str = ""
    """How it stands to `other`, one of RELATIONS."""
    other: Phrase | None = None
    unread: tuple[str, ...] = ()
    """Words that were not understood."""

    def classes(self) -> tuple[str, ...]:
        """Return the classes of the vocabulary that its nouns name."""
        return tuple(dict.fromkeys(name for noun in self.nouns if (name := class_named(noun))))

    def all_unread(self) -> tuple[str, ...]:
        """Return what was not understood, of the other thing too."""
        return (*self.unread, *(self.other.all_unread() if self.other is not None else ()))

    def thing(self) -> str:
        """Return the thing without its relation: "red mug"."""
        attributes = ([" and ".join(self.colors)] if self.colors else []) + list(self.sizes)
        return " ".join((*attributes, " or ".join(self.nouns) or "anything"))

    def said(self) -> str:
        """Return in one line what was understood, and what not."""
        parts = [_ASKED[self.asks].format(self.thing())]
        parts += [f"to {self.want}"] if self.want else []
        parts += [f"{self.relation} {self.other.thing()}"] if self.other is not None else []
        ends = [("not judged", self.materials), ("not understood", self.all_unread())]
        return "; ".join((f"understood: {', '.join(parts)}", *(f"{end}: {', '.join(w)}" for end, w in ends if w)))


def read_phrase(text: str) -> Phrase:
    """Return what a phrase asks for.

    Raises UsageError, a line each, for no words, too many, another language, no noun and several; Contradiction.
    """
    given = checked_text(text)
    words = plain(given)
    if any(letter.isalpha() and not letter.isascii() for letter in words):
        raise UsageError(f"{given!r:.80} is not English in the letters a to z", hint=EXAMPLE)
    if what := place_for(words):
        return _related(given, what, "place")
    asks, rest = question(words)
    return _want_of(given, words) or _want_of(given, rest) or _related(given, rest, asks)


def _want_of(given: str, words: str) -> Phrase | None:
    """Return what serves a want, where words say one: "something to drink from", "where can I sit"."""
    said, known = wanted(words).split(), wants()
    for length in range(len(said), 0, -1):
        want = known.get(" ".join(said[:length]))
        if want is None:
            continue
        rest = " ".join(said[length:])
        match = RELATION.match(rest) if rest else None
        relation = relation_word(match["word"]) if match else ""
        other = _thing(given, match["second"]) if match and relation else None
        unread = (rest,) if rest and other is None else ()
        return Phrase(given, want.nouns, want.name, relation=relation, other=other, unread=unread)
    return None


def _related(given: str, words: str, asks: Asks) -> Phrase:
    match = None if is_noun(words) else RELATION.match(words)
    if match is None:
        return _thing(given, words, asks)
    relation = relation_word(match["word"])
    if not relation:
        phrase = _thing(given, match["first"] or words, asks)
        return replace(phrase, unread=(*phrase.unread, f"{match['word']} {match['second']}"))
    phrase = _thing(given, match["first"] or "things", asks, may_be_anything=True)
    other = _thing(given, match["second"], may_be_anything=bool(_bare(match["second"])))
    return replace(phrase, relation=relation, other=other)


@dataclass
class _Heard:
    nouns: list[str] = field(default_factory=list)
    attributes: dict[str, list[str]] = field(default_factory=lambda: {"color": [], "size": [], "material": []})
    unread: list[str] = field(default_factory=list)

    def of(self, kind: str) -> tuple[str, ...]:
        return tuple(dict.fromkeys(self.attributes[kind]))


def _thing(given: str, words: str, asks: Asks = "where", may_be_anything: bool = False) -> Phrase:
    """Return the thing that a noun phrase names, with its attributes."""
    heard = _Heard()
    for part in re.split(r"\s+or\s+|\s*/\s*", words):
        _hear(part, heard)
    _check(given, words, heard, may_be_anything or not OBJECTS.isdisjoint(words.split()))
    return Phrase(
        text=given,
        nouns=tuple(dict.fromkeys(heard.nouns)),
        asks=asks,
        colors=heard.of("color"),
        sizes=heard.of("size"),
        materials=heard.of("material"),
        unread=tuple(heard.unread),
    )


def _hear(part: str, heard: _Heard) -> None:
    """Take in a noun phrase: the longest noun that it ends in, and the adjectives before that."""
    head, _, of_what = part.partition(" of ")
    if of_what and not is_noun(_bare(part)) and is_noun(_bare(head).split(" ")[-1]):
        part = head
        heard.unread.append(f"of {of_what}")
    words, known = _bare(part).split(), adjectives()
    first = 0
    while (
        first < len(words) - 1 and not class_named(" ".join(words)) and (words[first] in known or words[first] == "and")
    ):
        first += 1
    start = next((k for k in range(first, len(words)) if _names_thing(" ".join(words[k:]))), len(words))
    if start == len(words) and words and words[-1].isalpha() and words[-1] not in {*known, *OBJECTS}:
        start = len(words) - 1  # no noun that anybody knows, but where one would stand
    if start < len(words):
        heard.nouns.append(_as_known(" ".join(words[start:])))
    for word in words[:start]:
        if word in known:
            kind, name = known[word]
            heard.attributes[kind].append(name)
        elif word not in OBJECTS and word != "and":
            heard.unread.append(word)


def _names_thing(words: str) -> bool:
    """Whether words are a noun; an adjective alone is one only where it names a thing too ("orange")."""
    if words in OBJECTS or not is_noun(words):
        return False
    return words not in adjectives() or bool(class_named(words))


def _check(given: str, words: str, heard: _Heard, may_be_anything: bool) -> None:
    """Raise UsageError for what names nothing, several things, or contradicts itself."""
    for kind in ("color", "size"):
        several = heard.of(kind)
        if len(several) > 1 and (kind == "size" or not re.search(r"\b(?:and|or)\b", words)):
            raise Contradiction(f"{given!r:.80}: nothing is {' and '.join(several)} at once", hint=f"name one {kind}")
    before = words.split(" and ")[0]
    if before != words and is_noun(_bare(before)) and _bare(before).split()[-1] not in adjectives():
        raise UsageError(f"{given!r:.80} names several things", hint="ask for one at a time")
    understood = any(map(class_named, heard.nouns))
    if not understood and len(heard.unread) > MOST_UNREAD * len(words.split()):
        raise UsageError(f"hardly a word of {given!r:.80} is understood", hint=EXAMPLE)
    if not heard.nouns and not may_be_anything:
        raise UsageError(f"{given!r:.80} names no thing", hint=EXAMPLE)


def _bare(part: str) -> str:
    return " ".join(word for word in part.split() if word not in DETERMINERS)


def _as_known(noun: str) -> str:
    """Return a noun in the form in which it is known, its singular rather than its plural."""
    if noun in ALWAYS_PLURAL:
        return noun
    return next((form for form in singulars(noun)[1:] if class_named(form) or senses_named(form)), noun)
