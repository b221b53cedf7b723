"""The summary of a batch on disk: summary.csv, summary.md, summary.html, each replaced as a whole."""

from __future__ import annotations

import html
import os
from collections.abc import Mapping, Sequence
from pathlib import Path

from scenewright.schemas.errors import MachineFailure
from scenewright.stages.engine.batch.job import Job
from scenewright.stages.engine.batch.results import SceneResult
from scenewright.stages.engine.batch.summary import (
    accepted_table,
    cost_table,
    count_table,
    group_table,
    reason_table,
    scene_table,
)
from scenewright.stages.kit.measurement.tables import Table, as_csv, as_markdown, format_cell

PEOPLE_COLUMNS = ("scene", "parameters", "seed", "outcome", "failed_step", "reason", "seconds", "peak_memory_mb")
_STYLE = """
body { font: 15px/1.45 system-ui, sans-serif; margin: 2rem auto; max-width: 76rem; padding: 0 1rem; color: #1d2733; }
table { border-collapse: collapse; margin: 0.5rem 0 1.5rem; }
th, td { padding: 0.25rem 0.7rem; border-bottom: 1px solid #d8dee6; text-align: left; vertical-align: top; }
td.number { text-align: right; font-variant-numeric: tabular-nums; }
tr.done td:first-child { border-left: 4px solid #2e8b57; }
tr.explained td:first-child { border-left: 4px solid #d9a400; }
tr.crashed td:first-child { border-left: 4px solid #c0392b; }
p.note { color: #5a6675; }
"""


def _columns(table: Table, columns: Sequence[str]) -> Table:
    positions = [table.columns.index(name) for name in columns]
    rows = tuple(tuple(row[k] for k in positions) for row in table.rows)
    return Table(table.name, table.title, tuple(columns), rows, table.note)


def _html_table(table: Table, kinds: Sequence[str] = (), links: Sequence[str | None] = ()) -> str:
    """Return a table; `kinds` colours the rows, `links` are where the first cell of each row leads."""
    lines = [f"<h2>{html.escape(table.title)}</h2>", "<table>"]
    lines.append(
        "<tr>" + "".join(f"<th>{html.escape(name.replace('_', ' '))}</th>" for name in table.columns) + "</tr>"
    )
    for number, row in enumerate(table.rows):
        cells = []
        for column, value in enumerate(row):
            text = html.escape(format_cell(value))
            if column == 0 and links and links[number]:
                text = f'<a href="{html.escape(links[number] or "")}">{text}</a>'
            cells.append(f"<td{' class=number' if isinstance(value, int | float) else ''}>{text}</td>")
        kind = f' class="{html.escape(kinds[number])}"' if kinds and kinds[number] else ""
        lines.append(f"<tr{kind}>{''.join(cells)}</tr>")
    lines.append("</table>")
    if table.note:
        lines.append(f'<p class="note">{html.escape(table.note)}</p>')
    return "\n".join(lines)


def _as_link(path: str) -> str:
    from urllib.parse import quote

    return quote(path)


def summary_texts(title: str, jobs: Sequence[Job], latest: Mapping[str, SceneResult]) -> dict[str, str]:
    """Return file name -> text of the three summaries. `title` stands above them."""
    full_table = scene_table(jobs, latest, measures=True)
    people = _columns(scene_table(jobs, latest, measures=False), PEOPLE_COLUMNS)
    kinds = [str(row[full_table.columns.index("kind")]) for row in full_table.rows]
    logs = [row[full_table.columns.index("log")] for row in full_table.rows]
    tables = [count_table(jobs, latest)]
    tables += [t for t in (reason_table(jobs, latest), accepted_table(jobs, latest)) if t.rows]
    groups = group_table(jobs, latest)
    costs = cost_table(jobs, latest)
    tables += [table for table in (groups, costs) if table.rows]
    markdown = [f"# {title}\n", *(as_markdown(table) for table in (*tables, people))]
    page = [
        "<!doctype html>",
        '<html lang="en"><head><meta charset="utf-8">',
        f"<title>{html.escape(title)}</title><style>{_STYLE}</style></head><body>",
        f"<h1>{html.escape(title)}</h1>",
        *(_html_table(table) for table in tables),
        _html_table(people, kinds, [None if log is None else _as_link(str(log)) for log in logs]),
        "</body></html>\n",
    ]
    return {"summary.csv": as_csv(full_table), "summary.md": "\n".join(markdown), "summary.html": "\n".join(page)}


def write_summary(folder: Path, title: str, jobs: Sequence[Job], latest: Mapping[str, SceneResult]) -> None:
    """Write the three files, each whole or not at all. Raises MachineFailure."""
    for name, text in summary_texts(title, jobs, latest).items():
        fresh = folder / f".{name}.new"
        try:
            fresh.write_text(text, encoding="utf-8")
            os.replace(fresh, folder / name)
        except OSError as error:
            raise MachineFailure(f"{folder / name}: {error.strerror}", hint="free space, then run again") from None
