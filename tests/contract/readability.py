"""How long the sentences of a page are, and how many words it has: counted, without taggers."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

CODE = re.compile(r"^```.*?^```", re.DOTALL | re.MULTILINE)
GENERATED = re.compile(r"<!-- (table|rows|about|headlines).*?<!-- /\1 -->", re.DOTALL)
"""Tables of docs/results/*.json, which benchmarks/figures writes."""
COMMENT = re.compile(r"<!--.*?-->", re.DOTALL)
ITEM = re.compile(r"(?:[-*]|\d+\.) ")
ENDS = re.compile(r"(?<=[.!?])[*_)\"]*\s+(?=[^a-z\s])|(?<=:)\s+(?=[A-Z])")
"""A sentence ends at . ! ? before anything but a small letter, and at a colon before a capital."""


def words(text: str) -> int:
    """Return the number of words: what holds a letter or a digit. A span of code is one word."""
    return sum(1 for word in text.split() if re.search(r"\w", word))


def read(text: str) -> str:
    """Return what a reader reads of a page: no code blocks, no generated tables, no comments, links by their text."""
    text = COMMENT.sub("", GENERATED.sub("", CODE.sub("", text)))
    text = re.sub(r"!\[[^\]]*\]\([^)]*\)", "", text)
    return re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", text)


def blocks(text: str) -> Iterator[str]:
    """Yield the paragraphs, list items and table cells of what a reader reads, each on one line."""
    own: list[str] = []
    for line in [*text.splitlines(), ""]:
        line = line.strip()
        begins = ITEM.match(line) is not None
        if not line or line.startswith(("#", "|")) or begins:
            if own:
                yield " ".join(own)
            own = []
        if line.startswith("|"):
            yield from (cell.strip() for cell in line.strip("|").split("|"))
        elif line and not line.startswith("#"):
            own.append(ITEM.sub("", line, count=1) if begins else line)


def sentences(page: str) -> list[str]:
    """Return the sentences of a page of Markdown. In a table's cell a semicolon ends one too."""
    text = re.sub(r"`[^`]+`", "Code", read(page))
    cells = {cell for line in text.splitlines() if line.startswith("|") for cell in map(str.strip, line.split("|"))}
    found = [part for block in blocks(text) for part in ENDS.split(block)]
    whole = [part for block in found for part in (block.split("; ") if block in cells else [block])]
    return [sentence for sentence in whole if words(sentence)]


def prose(page: str) -> list[str]:
    """Return the sentences that stand in no table."""
    without = "\n".join(line for line in page.splitlines() if not line.lstrip().startswith("|"))
    return sentences(without)


def words_of(file: Path) -> int:
    """Return the words of a page that a reader reads, tables included."""
    return words(re.sub(r"`[^`]+`", lambda span: span[0].replace(" ", "·"), read(file.read_text())))
