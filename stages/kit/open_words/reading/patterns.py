"""How questions are put in English: what asks for places, counts or wants, and how two things stand to each other."""

from __future__ import annotations

import re
from typing import Literal

Asks = Literal["where", "place", "count", "is_there"]

RELATIONS = {
    "on": r"on top of|standing on|lying on|sitting on|upon|onto|on",
    "in": r"inside of|inside|within|into|in",
    "under": r"underneath|beneath|below|under",
    "beside": r"next to|near to|near|besides|beside|close to|alongside|by",
}
"""What a map can judge of two things, and how it is said."""
NOT_JUDGED = (
    "in front of|behind|left of|to the left of|right of|to the right of|above|over|between|opposite|across from|from|"
    "with"
)
"""What is said of two things and cannot be judged."""
_LYING = r"(?:(?:is|are|stands?|lies|lie|sits?|standing|lying|hanging|placed)\s+)?"
RELATION = re.compile(
    rf"^(?P<first>.*?)\s*\b(?:(?:that|which|who)\s+)?{_LYING}"
    rf"(?P<word>{NOT_JUDGED}|{'|'.join(RELATIONS.values())})\s+(?P<second>\S.*)$"
)
_WHO = r"(?:i|we|you|one|he|she|they|the robot|someone|somebody)"
_CAN = r"(?:can|could|may|might|should|shall|do|would|to)"
_PUT = r"(?:put|place|set|lay|leave|stand|store|drop|park)"
_PLACE = re.compile(
    rf"^(?:(?:where|on what|in what|what)\s+{_CAN}\s+(?:{_WHO}\s+)?{_PUT}"
    rf"|(?:is there )?(?:a |any |find a )?(?:place|room|space|spot)\s+(?:for|to\s+{_PUT}))"
    r"\s+(?:down\s+)?(?P<what>.+?)(?:\s+(?:down|back|away))?$"
)
_WANT = re.compile(
    r"^(?:something|anything|somewhere|a thing|things|a place|places|a spot|where|what|which thing|i want|we want)\s+"
    rf"(?:(?:that|which|where)\s+)?(?:{_CAN}\s+)?(?:{_WHO}\s+)?(?:{_CAN}\s+)?(?P<what>.+)$"
)
_FIND = (
    r"find|show(?: me)?|look for|search for|point (?:at|to)|give me|bring me|get me|what is|what's|i need|i want|which|"
    r"i am looking for"
)
_QUESTIONS: tuple[tuple[Asks, re.Pattern[str]], ...] = (
    ("count", re.compile(r"^(?:how many|count|number of)\s+(?:of\s+)?(?P<what>.+)$")),
    ("is_there", re.compile(r"^(?:is|are)\s+there\s+(?P<what>.+)$")),
    ("is_there", re.compile(r"^(?:do|does|have|has)\s+(?:you|we|it|the \w+)\s+(?:have\s+|see\s+)?(?P<what>.+)$")),
    ("where", re.compile(r"^where(?:'s| is| are| do i find| can i find| did i leave)?\s+(?P<what>.+)$")),
    ("where", re.compile(rf"^(?:please\s+)?(?:{_FIND})\s+(?P<what>.+)$")),
)
_TAIL = re.compile(
    r"\s+(?:(?:are|is) there|(?:do|can) (?:we|you|i) (?:have|see)|here|there|please|now|in here|"
    r"in (?:this|the) (?:room|scene|map))$"
)


def plain(text: str) -> str:
    """Return a question in small letters without punctuation and what ends it politely."""
    bare = re.sub(r"[?!.,;:\"“”]+", " ", text.lower().replace("’", "'"))
    bare = re.sub(r"\b(?:kind|sort|piece|pair)s? of\b", " ", bare)
    return _TAIL.sub("", " ".join(bare.split()))


def place_for(words: str) -> str:
    """Return what somebody wants to put somewhere; "" where the words ask for no place."""
    match = _PLACE.match(words)
    return match["what"] if match else ""


def wanted(words: str) -> str:
    """Return what somebody wants to do: "drink from" of "something to drink from"; "" where the words say nothing."""
    match = _WANT.match(words)
    return re.sub(rf"^(?:{_CAN}|{_WHO})\s+", "", match["what"]) if match else ""


def question(words: str) -> tuple[Asks, str]:
    """Return what words ask for, and what is left of them."""
    for asks, pattern in _QUESTIONS:
        if match := pattern.match(words):
            return asks, match["what"]
    return "where", words


def relation_word(said: str) -> str:
    """Return the one of RELATIONS that is said; "" for another."""
    return next((name for name, words in RELATIONS.items() if re.fullmatch(words, said)), "")
