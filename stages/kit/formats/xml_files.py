"""XML that nobody vouches for: no document types, and so no entities, whatever the encoding."""

from __future__ import annotations

from xml.etree import ElementTree
from xml.parsers import expat

from scenewright.schemas.errors import BadInput

DEEPEST = 200
"""Levels of nesting; deeper trees would exhaust Python's stack when they are written."""
MOST_ELEMENTS = 1_000_000
"""Elements and attributes: a few bytes of each take some hundred in memory."""
PIECE = 1 << 20
"""Bytes of XML that are parsed at a time; by eye."""
LONGEST_TAG = 4 << 20
"""Bytes of a tag, with all its attributes."""


def parse_xml(data: bytes, where: str) -> ElementTree.Element:
    """Return the root element. Raises BadInput, beginning with `where`, for what is not well-formed or has a DOCTYPE.

    The document is read once by expat itself, as a search for `<!DOCTYPE` in the bytes misses other encodings.
    """
    depth = elements = 0

    def refuse(*_: object) -> None:
        raise BadInput(f"{where}: declares a document type or entities", hint="it needs none; remove the DOCTYPE")

    def enter(_: str, attributes: dict[str, str]) -> None:
        nonlocal depth, elements
        depth += 1
        elements += 1 + len(attributes)
        if elements > MOST_ELEMENTS:
            raise BadInput(f"{where}: more than {MOST_ELEMENTS} elements and attributes", hint="split it")
        if depth > DEEPEST:
            raise BadInput(f"{where}: nested deeper than {DEEPEST} levels", hint="nest its elements less deeply")

    def leave(*_: object) -> None:
        nonlocal depth
        depth -= 1

    guard = expat.ParserCreate()
    guard.StartDoctypeDeclHandler = refuse
    guard.EntityDeclHandler = refuse
    guard.StartElementHandler = enter
    guard.EndElementHandler = leave
    try:
        for start in range(0, len(data), PIECE):
            guard.Parse(data[start : start + PIECE], False)
            if start + PIECE - guard.CurrentByteIndex > LONGEST_TAG:
                raise BadInput(f"{where}: a tag of more than {LONGEST_TAG} bytes", hint="shorten it")
        guard.Parse(b"", True)
        return ElementTree.fromstring(data)
    # LookupError: an encoding that Python does not know; ValueError: one of more than one byte a character.
    except (expat.ExpatError, ElementTree.ParseError, LookupError, ValueError) as error:
        raise BadInput(f"{where}: no well-formed XML: {error}", hint="correct it there") from None
