"""Goals in words: their parts, which `and` joins, with places for objects."""

from __future__ import annotations

from collections.abc import Iterable

Part = tuple[str, tuple[str, ...]]
"""A phrase with <1>, <2> in place of objects, and these."""


def goal_phrases(sentence: str, names: Iterable[str]) -> list[Part]:
    """Return the parts of a goal that `and` joins, each as text with <1>, <2> and its objects."""
    known_names = set(names)
    phrases = []
    for part in " ".join(sentence.lower().rstrip(".").split()).split(" and "):
        objects: list[str] = []
        words = []
        for word in part.split():
            if word in known_names:
                if word not in objects:
                    objects.append(word)
                words.append(f"<{objects.index(word) + 1}>")
            else:
                words.append(word)
        phrases.append((" ".join(words), tuple(objects)))
    return phrases
