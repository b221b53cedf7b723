"""JSON objects in what a language model writes. Nothing is repaired and nothing is executed: text is read, or refused.

Models without constrained decoding wrap their object into prose, fences or thoughts; `objects_in` finds it there.
"""

from __future__ import annotations

import json
import math
import re
from typing import Any

LONGEST_REPLY = 200_000
"""Longest reply that is read [characters]."""
MOST_OBJECTS = 16
"""Most different objects in one reply."""
LONGEST_INTEGER = 300
"""Longest integer [digits]: more are no double."""
THOUGHTS = re.compile(r"\A\s*<think>.*?</think>", re.DOTALL)
START = re.compile(r'\{\s*["}]')
"""How an object begins; braces in prose begin otherwise."""


class Unreadable(Exception):
    """A reply without a JSON object that can be read; the message says why."""


def objects_in(text: str) -> list[dict[str, Any]]:
    """Return the different JSON objects of a reply in the order in which they stand; at least one.

    The whole reply is one, or it is looked for in prose (`Here is the plan: {...}`), in fences and after thoughts
    (`<think>...</think>`). An object that is torn, says a name twice, or holds NaN or infinite numbers makes the whole
    reply unreadable: pieces of it are not taken for the answer. Raises Unreadable.
    """
    if len(text) > LONGEST_REPLY:
        raise Unreadable(f"the reply has {len(text)} characters, more than {LONGEST_REPLY}")
    text = THOUGHTS.sub("", text).strip()
    if not text:
        raise Unreadable("the reply is empty")
    objects: list[dict[str, Any]] = []
    start = START.search(text)
    while start is not None:
        value, end = _object_at(text, start.start())
        if value not in objects:
            objects.append(value)
        if len(objects) > MOST_OBJECTS:
            raise Unreadable(f"the reply holds more than {MOST_OBJECTS} JSON objects; one is wanted")
        start = START.search(text, end)
    if not objects:
        raise Unreadable("there is no JSON object in the reply")
    return objects


def _object_at(text: str, start: int) -> tuple[dict[str, Any], int]:
    try:
        value, end = _DECODER.raw_decode(text, start)
        json.dumps(value, ensure_ascii=False).encode()
    except UnicodeEncodeError:
        raise Unreadable("the JSON object is malformed: half a surrogate pair") from None
    except json.JSONDecodeError as error:
        if error.pos >= len(text) or error.msg.startswith("Unterminated string"):
            raise Unreadable("the JSON object is cut short") from None
        raise Unreadable(f"the JSON object is malformed: {error.msg} at character {error.pos - start}") from None
    except RecursionError:
        raise Unreadable("the JSON object is nested too deeply") from None
    except ValueError as error:  # of the functions below
        raise Unreadable(f"the JSON object is malformed: {error}") from None
    return value, end


def _finite(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(f"{text:.20} is not a finite number")
    return value


def _short(text: str) -> int:
    if len(text) > LONGEST_INTEGER:
        raise ValueError(f"a number of {len(text)} digits")
    return int(text)


def _refuse(text: str) -> float:
    raise ValueError(f"{text} is not a number")


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    members = dict(pairs)
    if len(members) < len(pairs):
        raise ValueError("an object says a name twice")
    return members


_DECODER = json.JSONDecoder(parse_float=_finite, parse_int=_short, parse_constant=_refuse, object_pairs_hook=_once)
