"""Elements of an XML description that its reader does not know: told, never passed over.

A table says for each element which children are read or hold nothing of a model's shape and motion (sensors, colours of
a viewer). Everything else below it is unknown.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from xml.etree import ElementTree

Table = Mapping[str, frozenset[str]]
"""Tag -> tags of the children that are known."""
LONGEST_TAG = 40
"""Characters of a tag in a line; by eye."""


def unknown_elements(roots: Sequence[ElementTree.Element], table: Table, counted: Sequence[str]) -> list[str]:
    """Return a line for each kind of unknown element at and below `roots`, in the order in which they stand.

    A line says in what the element stands, and how many of the `counted` elements are lost with it.
    """
    times: Counter[tuple[str, str]] = Counter()
    lost: dict[tuple[str, str], Counter[str]] = {}
    waiting = list(reversed(roots))
    while waiting:
        parent = waiting.pop()
        known = table.get(plain_tag(parent))
        if known is None:
            continue
        children = list(parent)
        for child in children:
            kind = (plain_tag(parent), plain_tag(child))
            if kind[1] not in known:
                times[kind] += 1
                inside = Counter(tag for tag in map(plain_tag, child.iter()) if tag in counted and tag != kind[1])
                lost.setdefault(kind, Counter()).update(inside)
        waiting += [child for child in reversed(children) if plain_tag(child) in known]
    return [_line(*kind, count, lost[kind], counted) for kind, count in times.items()]


def plain_tag(element: ElementTree.Element) -> str:
    """Return the tag without its namespace."""
    return str(element.tag).rpartition("}")[2]


def _line(parent: str, tag: str, count: int, lost: Counter[str], counted: Sequence[str]) -> str:
    number = "" if count == 1 else f"{count} "
    things = ", ".join(f"{lost[name]} <{name}>" for name in counted if lost[name])
    verb = "is" if count == 1 else "are"
    what = f": {things} in it left out" if things else ""
    return f"{number}<{tag:.{LONGEST_TAG}}> in <{parent:.{LONGEST_TAG}}> {verb} not read{what}"
