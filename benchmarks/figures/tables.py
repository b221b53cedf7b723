"""Tables of figures, and the lines that say where they come from."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from benchmarks.figures.content import Experiment, Figure, FiguresError
from benchmarks.figures.lines import clause_of, digits_for, number, text_of, with_interval


def markdown_table(header: Sequence[str], rows: Sequence[Sequence[str]], right_from: int) -> str:
    rule = ["---" if place < right_from else "--:" for place in range(len(header))]
    return "".join(f"| {' | '.join(line)} |\n" for line in (header, rule, *rows))


def expand(experiment: Experiment, pattern: str, templates: Sequence[str]) -> list[str]:
    """Return the rows that a pattern with * means, in the order of the JSON."""
    if "*" not in pattern:
        return [pattern]
    found: dict[str, None] = {}
    for template in templates:
        before, _, after = template.partition("{}")
        inner = re.escape(pattern).replace(r"\*", "[^/]+")
        form = re.compile(f"{re.escape(before)}(?P<row>{inner}){re.escape(after)}")
        found |= {match["row"]: None for key in experiment.figures if (match := form.fullmatch(key))}
    if not found:
        raise FiguresError(f"{experiment.name}.json has nothing for the rows {pattern!r}")
    return list(found)


@dataclass(frozen=True)
class Row:
    labels: list[str]
    figures: list[Figure | None]

    @property
    def known(self) -> list[Figure]:
        return [figure for figure in self.figures if figure]


def table_rows(experiment: Experiment, spec: Mapping[str, Any], templates: Sequence[str]) -> list[Row]:
    wanted = spec.get("rows", ["*"])
    named = wanted if isinstance(wanted, dict) else {}
    rows = []
    for pattern in wanted.values() if named else wanted:
        for row in expand(experiment, pattern, templates):
            figures = [experiment.figures.get(template.replace("{}", row)) for template in templates]
            if not any(figures):
                raise FiguresError(f"{experiment.name}.json has nothing for the row {row!r}")
            rows.append(Row([experiment.shown(part) for part in row.split("/")], figures))
    if named:
        return [Row(label.split(" | "), row.figures) for label, row in zip(named, rows, strict=True)]
    return rows


def table(experiment: Experiment, spec: Mapping[str, Any], own_page: bool) -> str:
    """Return a table and the line below it that says of what the figures are.

    The spec's `rows` (a list, or label = row) are put for {} in the templates of `columns` (heading = template, or
    measures, which stand for "{}/MEASURE"); `labels` head the columns of labels, `digits` fixes decimals by heading.
    A column of labels that is headed "" and says the same in every row is left out.
    """
    unknown = set(spec) - {"rows", "columns", "labels", "digits"}
    if unknown:
        raise FiguresError(f"a table of {experiment.name} has unknown keys: {', '.join(sorted(unknown))}")
    columns = spec["columns"]
    if not isinstance(columns, dict):
        columns = {experiment.shown(measure): f"{{}}/{measure}" for measure in columns}
    rows = table_rows(experiment, spec, list(columns.values()))
    empty = [
        name
        for name, place in zip(columns, range(len(columns)), strict=True)
        if not any(r.figures[place] for r in rows)
    ]
    if empty:
        raise FiguresError(f"{experiment.name}.json has nothing for the columns {', '.join(empty)}")
    labels = spec.get("labels", [""] * len(rows[0].labels))
    if any(len(row.labels) != len(labels) for row in rows):
        raise FiguresError(f"a table of {experiment.name} has {len(labels)} labels for rows like {rows[0].labels}")
    cases = [{figure.cases for figure in row.known} for row in rows]
    varied = len({count for counts in cases for count in counts}) > 1 and all(len(counts) == 1 for counts in cases)
    header, cells = [*labels], [[*row.labels] for row in rows]
    for place in reversed(range(len(labels))):
        if not labels[place] and len({row.labels[place] for row in rows}) == 1:
            for line in (header, *cells):
                del line[place]
    shown_labels = len(header)
    if varied:
        header.append("n")
        for line, counts in zip(cells, cases, strict=True):
            line.append(str(next(iter(counts)) or "–"))
    for place, name in enumerate(columns):
        figures = [row.figures[place] for row in rows]
        known = [figure for figure in figures if figure]
        units = {figure.unit for figure in known}
        same_unit = len(units) < 2
        unit = "".join(units - {"count"}) if same_unit else ""
        header.append(f"{name} [{unit}]" if unit and "[" not in name else name)
        for line, figure in zip(cells, figures, strict=True):
            digits = spec.get("digits", {}).get(name, digits_for(known if same_unit else [figure] if figure else []))
            line.append("–" if not figure else with_interval(figure, digits) + ("" if same_unit else of_unit(figure)))
    caption = caption_of(experiment, [figure for row in rows for figure in row.known], varied)
    if not own_page:
        caption += f" {origin(experiment)}"
    return f"{markdown_table(header, cells, shown_labels)}\n*{caption}*\n"


def of_unit(figure: Figure) -> str:
    """What follows a figure in a column of several units."""
    if figure.unit == "count":
        return f" of {figure.cases}" if figure.cases else ""
    return f" {figure.unit}" if figure.unit else ""


def caption_of(experiment: Experiment, figures: Sequence[Figure], varied: bool) -> str:
    counts = sorted({figure.cases for figure in figures if figure.cases is not None})
    kind = experiment.about.get("a_case", "cases")
    if not counts:
        cases = "number of cases not recorded"
    elif varied:
        cases = f"n: {kind}"
    else:
        cases = f"{kind}: {counts[0]}" if len(counts) == 1 else f"{kind}: {counts[0]} to {counts[-1]}"
    measured = [figure.has_interval for figure in figures if figure.unit != "count"]
    if not any(measured):
        return f"{cases}; intervals: not measured." if measured else f"{cases}."
    interval = experiment.about.get("interval", "95 %")
    rest = "" if all(measured) else "; where none stands, none was measured"
    return f"{cases}; in brackets intervals, {interval}{rest}."


def origin(experiment: Experiment) -> str:
    return (
        f"Simulated: {clause_of(experiment, 'simulated')}. The method may know: {clause_of(experiment, 'knows')}. "
        f"{experiment.about['date']}, commit {experiment.about['commit']}."
    )


def words(experiment: Experiment, name: str, own_page: bool) -> str:
    """Return a table of words as it stands in the JSON's `rows`."""
    if name not in experiment.rows:
        raise FiguresError(f"{experiment.name}.json has no rows {name!r}")
    content = experiment.rows[name]
    end = "" if own_page else f"\n*{origin(experiment)}*\n"
    return markdown_table(content["columns"], content["rows"], len(content["columns"])) + end


def about(experiment: Experiment) -> str:
    """Return the head of an experiment's page: first what its figures do not show."""
    lines = [
        f"**What this does not show.** {text_of(experiment, 'does_not_show')}",
        "",
        f"- **Simulated:** {clause_of(experiment, 'simulated')}.",
        f"- **The method may know:** {clause_of(experiment, 'knows')}.",
        f"- **Measured:** {', '.join(str(experiment.about[name]) for name in ('date', 'commit', 'machine'))}.",
        f"- **Command:** `{experiment.about['command']}`",
    ]
    if experiment.about.get("not_measured"):
        lines.append(f"- **Asked for and not measured:** {missing_of(experiment)}.")
    if experiment.about.get("notes"):
        lines.append(f"- {text_of(experiment, 'notes')}")
    return "\n".join(lines) + "\n"


def missing_of(experiment: Experiment) -> str:
    """Return which arms of which cases were asked for and not measured, in how many trials."""
    parts = []
    for name, count in experiment.about["not_measured"].items():
        arm, *case = name.split("/")
        trials = "" if count == 1 else f" ({count} trials)"
        parts.append(f"{experiment.shown(arm)}, {', '.join(experiment.shown(part) for part in case)}{trials}")
    return "; ".join(parts)


def headlines(experiments: Mapping[str, Experiment], spec: Mapping[str, Any], pages: Mapping[str, str]) -> str:
    """Return a table with a figure a row: label = ["experiment", "key of ours", "key beside it"...].

    Where all rows must stand on one screen each is label = {figures = [as above], simulated = "in few words", rival =
    "a name in few words, where that of the arm is long, or why no figure stands beside ours"}; what the method may know
    stands on the linked page alone.
    """
    rows: list[list[str]] = []
    above = ""
    brief = all(isinstance(row, Mapping) for row in spec.values())
    for label, row in spec.items():
        said: Mapping[str, Any] = row if isinstance(row, Mapping) else {"figures": row}
        name, ours, *beside = said["figures"]
        experiment = experiments.get(name)
        if experiment is None:
            raise FiguresError(f"no docs/results/{name}.json")
        figure = experiment.figure(ours)
        others = [experiment.figure(key) for key in beside]
        digits = digits_for([figure, *others])
        unit = f" [{figure.unit}]" if figure.unit not in ("", "count") else ""
        rivals = [
            f"{said.get('rival') or experiment.shown(key.split('/')[0])} {cell(other, digits, brief)}"
            for key, other in zip(beside, others, strict=True)
        ]
        linked = f"[{label}]({pages[name]})" if name in pages else label
        cases = f"{figure.cases} {experiment.about.get('a_case', 'cases')}" if figure.cases else "–"
        about_it = "″" if name == above else f"{clause_of(experiment, 'simulated')}; {clause_of(experiment, 'knows')}"
        above = name
        told = said.get("simulated", about_it)
        rival = "; ".join(rivals) or said.get("rival", "–")
        rows.append([linked + unit, cell(figure, digits, brief), rival, cases, told, experiment.day(ours)])
    what = "simulated" if brief else "what was simulated; what the method may know"
    header = ["figure", "ours", "beside it", "cases", what, "measured"]
    return markdown_table(header, rows, len(header))


def cell(figure: Figure, digits: int, brief: bool = False) -> str:
    if figure.has_interval:
        return with_interval(figure, digits)
    return f"{number(figure.value, digits)} {'[–]' if brief else '(interval not measured)'}"
