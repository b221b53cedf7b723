"""Tables as CSV and Markdown."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

Cell = str | int | float | None
MISSING = "–"


@dataclass(frozen=True)
class Table:
    """A named table. Rows hold text, numbers or None (undefined)."""

    name: str
    """File stem."""
    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    note: str = ""


def format_cell(value: Cell, digits: int = 3) -> str:
    """Return a cell for people: floats rounded, None as a dash."""
    if value is None:
        return MISSING
    if isinstance(value, float):
        return f"{value:.{digits}f}"
    return str(value)


def as_csv(table: Table) -> str:
    """Return the table as CSV with full precision; None is an empty field."""
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(table.columns)
    for row in table.rows:
        writer.writerow(["" if value is None else repr(value) if isinstance(value, float) else value for value in row])
    return buffer.getvalue()


def as_markdown(table: Table) -> str:
    """Return the table as Markdown with its title and note; bars inside cells are escaped."""

    def line(cells: Sequence[str]) -> str:
        return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"

    numeric = [any(isinstance(row[k], int | float) for row in table.rows) for k in range(len(table.columns))]
    lines = [f"### {table.title}", "", line(table.columns), line(["--:" if n else ":--" for n in numeric])]
    lines += [line([format_cell(value) for value in row]) for row in table.rows]
    if table.note:
        lines += ["", table.note]
    return "\n".join(lines) + "\n"


def write_table(folder: Path, table: Table) -> None:
    """Write `<name>.csv` and `<name>.md` into a folder that exists."""
    (folder / f"{table.name}.csv").write_text(as_csv(table), encoding="utf-8")
    (folder / f"{table.name}.md").write_text(as_markdown(table), encoding="utf-8")
