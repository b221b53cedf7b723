"""Tables in Markdown, as the experiments print them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from stages.kit.measurement.bootstrap import Interval

if TYPE_CHECKING:
    from benchmarks.results import Results

MISSING = "–"


def number(value: float | None, digits: int = 1, scale: float = 1.0) -> str:
    """Format a number; a dash where there is none."""
    return MISSING if value is None else f"{scale * value:.{digits}f}"


def percent(value: float | None) -> str:
    """Format a share."""
    return number(value, 1, 100.0)


def with_interval(found: Interval | None, digits: int = 1, scale: float = 100.0) -> str:
    """Format a figure (a share, unless `scale` says otherwise) with its interval."""
    if found is None:
        return MISSING
    value, low, high = (f"{scale * bound:.{digits}f}" for bound in (found.value, found.low, found.high))
    return f"{value} [{low}, {high}]"


def markdown(title: str, head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return one table with its title."""
    lines = [*([f"### {title}", ""] if title else []), "| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    return "\n".join([*lines, *("| " + " | ".join(row) + " |" for row in rows), ""])


def figures_table(results: Results, case: str, measures: Sequence[str], *, digits: int = 3, scale: float = 1.0) -> str:
    """Return a line an arm of one case: measures with the intervals that they have."""
    rows = []
    for arm in results.arms(case):
        cells = []
        for name in measures:
            found = results.interval(arm, case, name) if results.experiment.measures[name].interval else None
            value = number(results.value(arm, case, name), digits, scale)
            cells.append(with_interval(found, digits, scale) if found else value)
        rows.append((results.experiment.arms[arm], str(len(results.of(arm, case))), *cells))
    units = [results.experiment.measures[name].unit for name in measures]
    heads = [f"{n.replace('_', ' ')}{f' [{unit}]' if unit else ''}" for n, unit in zip(measures, units, strict=True)]
    return markdown(case, ("arm", "trials", *heads), rows)


def differences_table(results: Results, *, digits: int = 3, scale: float = 1.0) -> str:
    """Return the differences that the experiment declares, case by case; empty when it declares none."""
    rows = []
    for case in results.cases:
        there = results.arms(case)
        for first, second in results.experiment.pairs:
            if first in there and second in there:
                cells = [
                    with_interval(results.difference(first, second, case, name), digits, scale)
                    for name in results.experiment.compared
                ]
                rows.append((case, f"{first} – {second}", *cells))
    head = ("case", "difference", *(name.replace("_", " ") for name in results.experiment.compared))
    return markdown("Differences on the same seeds (95 %)", head, rows) if rows else ""
