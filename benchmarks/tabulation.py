"""Tables in Markdown, as the experiments print them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

MISSING = "–"


@dataclass(frozen=True)
class Figure:
    """One number of figures.json."""

    value: float
    low: float | None
    high: float | None
    cases: int | None
    unit: str


def number(value: float | None, digits: int = 1, scale: float = 1.0) -> str:
    """Format a number; a dash where there is none."""
    return MISSING if value is None else f"{scale * value:.{digits}f}"


def markdown(title: str, head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return one table with its title."""
    lines = [*([f"### {title}", ""] if title else []), "| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    return "\n".join([*lines, *("| " + " | ".join(row) + " |" for row in rows), ""])


def figure_text(figure: Figure | None) -> str:
    """Format a figure with its interval where it has one."""
    if figure is None:
        return MISSING
    value = f"{figure.value:.4g}"
    return value if figure.low is None else f"{value} [{figure.low:.4g}, {figure.high:.4g}]"


def grid(title: str, corner: str, figures: Mapping[tuple[str, str], Figure]) -> str:
    """Return a table of figures by (row, column)."""
    rows = list(dict.fromkeys(row for row, _ in figures))
    columns = list(dict.fromkeys(column for _, column in figures))
    cells = [(row, *(figure_text(figures.get((row, column))) for column in columns)) for row in rows]
    return markdown(title, (corner, *columns), cells)
