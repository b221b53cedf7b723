"""Figures on a page that stand outside of every marker."""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import partial

from benchmarks.figures.pages import BLOCK, INLINE

GIVEN = {
    "parameter": "a setting of the method, the data or the experiment, not a result",
    "thesis": "a figure as the thesis or the paper prints it",
    "aim": "what was asked for before measuring",
    "standard": "a figure of a standard, a data sheet or a data set's own description",
}
"""Why a figure on a results page may stand outside of docs/results/*.json."""

GIVEN_MARKER = re.compile(r"<!--given (?P<reason>\w+)-->.*?<!--/given-->", re.DOTALL)
MEASURED = re.compile(
    r"(?<![\w.:/])\d+\.\d+(?!\.?\d)"  # a decimal
    r"|(?<![\w.])\d[\d,]*(?:\.\d+)? ?(?:%|per cent|percent)"  # a share
    r"|(?<![\w.])\d+ of \d+\b"  # a count of cases
    r"|(?<![\w.])\d[\d,]*(?:\.\d+)? ?(?:°|(?:ms|s|min|minutes|seconds|mm|cm|m|px|MB|GB|kB|Hz|degrees|times|points)\b)"
)
"""What looks measured: a decimal, a share, `N of M`, a number with a unit. Bare whole numbers are left alone, because
seeds, counts of cases and settings look the same."""
CLEARLY_MEASURED = re.compile(
    r"\d+\.\d+ ?%"
    r"|\b(?:F1|PQ|AP|IoU|recall|precision|success|accuracy)(?: of| is|:)? \d[\d.]*"
    r"|(?<![\w.])\d[\d.]* ?(?:ms|s|minutes|min|h)\b(?= of| a frame| on one)"
    r"|\d[\d.]* ?(?:CPU|frames/s|Hz)\b"
    r"|(?<![\w.])\d+ of \d+\b"
    r"|\d[\d.]* times (?:faster|slower|as)"
)
"""The same for other pages of docs/, full of settings, limits and formats: only what can hardly be one of them."""
NUMBERED = re.compile(
    r"\b(?:[Tt]able|[Ss]ection|[Cc]hapter|[Ff]igure|[Ee]quation|Python)s? [\d.]*\d(?:(?:,| and| to) \d+\.\d+)*"
)
"""Numbers of tables and sections elsewhere, and of versions."""


def unmarked(text: str, pattern: re.Pattern[str] = MEASURED) -> Iterator[tuple[int, str]]:
    """Yield line and text of what looks measured (by `pattern`) and stands outside of every marker.

    Left out: code, link targets and numbers of tables and sections.
    """
    blank = partial(re.sub, r"[^\n]", " ")

    def hidden(match: re.Match[str]) -> str:
        return blank(match[0])

    for marked in (
        BLOCK,
        INLINE,
        GIVEN_MARKER,
        re.compile(r"^```.*?^```", re.DOTALL | re.MULTILINE),
        re.compile(r"`[^`\n]+`"),
        re.compile(r"\]\([^)]*\)"),
        re.compile(r"<!--.*?-->", re.DOTALL),
        NUMBERED,
    ):
        text = marked.sub(hidden, text)
    for line, content in enumerate(text.splitlines(), start=1):
        for match in pattern.finditer(content):
            yield line, match[0]
