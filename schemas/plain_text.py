"""Text from outside, made fit for a terminal, a log of lines and JSON."""

from __future__ import annotations

import re

UNPRINTABLE = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u2028-\u202e\u2066-\u2069\ud800-\udfff]")
"""Controls but tab and line feed, what ends lines or turns the direction of writing, and halves of characters: names
that are no UTF-8 reach Python as such halves."""
LONGEST_LINE = 2000
"""Longest line of text from outside [letters]."""


def cleaned(text: str) -> str:
    """Return the text with every unprintable character written as JSON writes it: an escape is \\u001b, six letters.

    JSON stays the same document.
    """
    return UNPRINTABLE.sub(lambda match: f"\\u{ord(match[0]):04x}", text)


def one_line(text: str) -> str:
    """Return the text cleaned, on one line, and without its middle when it is longer than LONGEST_LINE letters."""
    line = cleaned(" ".join(text.split()))
    if len(line) <= LONGEST_LINE:
        return line
    half = LONGEST_LINE // 2
    return f"{line[:half]} [{len(line) - 2 * half} letters left out] {line[-half:]}"
