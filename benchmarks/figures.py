"""Render every figure of README.md and docs/ from docs/results/<experiment>.json.

`python -m benchmarks.figures [--check]`. Pages carry markers, HTML comments that no renderer shows; what stands
between two of them is made here.

    <!--f mapping:ours/middle/PQ-->76.0 % [74.3, 77.5]<!--/f-->   a figure with its unit and its interval; `cases`: with
                                                  their number too; `bare`: the number alone; `.2`: two decimals
    <!-- table mapping (TOML) -->...<!-- /table -->               a table: rows, columns, labels, digits (see `table`)
    <!-- rows real entities -->...<!-- /rows -->                  a table of words, as it stands in the JSON
    <!-- about mapping -->...<!-- /about -->                      what the figures do not show, and where they are from
    <!-- headlines (TOML) -->...<!-- /headlines -->               figures of several experiments, one a row
    <!--given thesis-->24.5<!--/given-->                          a figure nobody measured here; why: `GIVEN`
"""

from __future__ import annotations

import argparse
import json
import re
import sys
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
GIVEN = {
    "parameter": "a setting of the method, the data or the experiment, not a result",
    "thesis": "a figure as the thesis or the paper prints it",
    "aim": "what was asked for before measuring",
    "standard": "a figure of a standard, a data sheet or a data set's own description",
}
"""Why a figure on a results page may stand outside of docs/results/*.json."""

BLOCK = re.compile(
    r"(?P<open><!-- (?P<kind>table|rows|about|headlines)(?P<spec>.*?)-->\n)(?P<body>.*?)(?P<close><!-- /(?P=kind) -->)",
    re.DOTALL,
)
INLINE = re.compile(r"(?P<open><!--f (?P<spec>[^>]*?)-->)(?P<body>.*?)(?P<close><!--/f-->)", re.DOTALL)
GIVEN_MARKER = re.compile(r"<!--given (?P<reason>\w+)-->.*?<!--/given-->", re.DOTALL)
IN_TEXT = re.compile(r"\{(?P<spec>[^{}]+)\}")
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


class FiguresError(Exception):
    """A page or a JSON file that can't be rendered; the message says where and why."""


@dataclass(frozen=True)
class Figure:
    """One measured value; `low` and `high` are None where no interval was measured."""

    value: float | int | None
    low: float | None
    high: float | None
    cases: int | None
    unit: str

    @property
    def has_interval(self) -> bool:
        return self.low is not None and self.high is not None


@dataclass(frozen=True)
class Experiment:
    """What docs/results/<name>.json holds (docs/results/index.md describes it)."""

    name: str
    about: Mapping[str, Any]
    figures: Mapping[str, Figure]
    rows: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)

    def figure(self, key: str) -> Figure:
        if key not in self.figures:
            raise FiguresError(f"{self.name}.json has no figure {key!r}")
        return self.figures[key]

    def shown(self, part: str) -> str:
        """The words for an arm, a case or a measure."""
        return str(self.about.get("names", {}).get(part, part.replace("_", " ")))

    def text(self, name: str) -> str:
        """A text of the JSON with the figures it names in braces: "over {ours/clean/PQ}"."""
        text = str(self.about[name])
        return IN_TEXT.sub(lambda match: inline({self.name: self}, match["spec"], self.name), text)

    def clause(self, name: str) -> str:
        """The same as a part of a sentence."""
        return self.text(name).rstrip(".")


REQUIRED = ("experiment", "title", "date", "commit", "machine", "command", "simulated", "knows", "does_not_show")


def load_experiments(folder: Path) -> dict[str, Experiment]:
    """Return the experiments of a folder by name; raises FiguresError where a file is not of the form."""
    words = tomllib.loads((folder / "words.toml").read_text())
    return {file.stem: load_experiment(file, words.get(file.stem, {})) for file in sorted(folder.glob("*.json"))}


def load_experiment(file: Path, words: Mapping[str, Any]) -> Experiment:
    """Return one experiment; `words` are its section of words.toml: `a_case`, `interval`, `names`."""
    content = json.loads(file.read_text())
    missing = [name for name in (*REQUIRED, "figures") if not content.get(name)]
    if missing or content["experiment"] != file.stem:
        raise FiguresError(f"{file.name}: {'lacks ' + ', '.join(missing) if missing else 'is of another experiment'}")
    figures = {}
    for key, entry in content["figures"].items():
        if len(key.split("/")) < 3 or set(entry) != {"value", "low", "high", "cases", "unit"}:
            raise FiguresError(f"{file.name}: {key!r} is no <arm>/<case>/<measure> with value, low, high, cases, unit")
        if (entry["low"] is None) != (entry["high"] is None):
            raise FiguresError(f"{file.name}: {key!r} has half an interval")
        figures[key] = Figure(**entry)
    return Experiment(file.stem, {**content, **words}, figures, content.get("rows", {}))


# ---- numbers --------------------------------------------------------------------------------------------------------


def digits_of(values: Sequence[float | int | None]) -> int:
    """Decimals for figures that stand together: what they carry, but no more than three figures of the largest one, or
    two of the smallest."""
    sizes = sorted(abs(value) for value in values if value)
    if not sizes:
        return 0 if all(isinstance(value, int) for value in values if value is not None) else 1
    carried = max(len(repr(float(size)).partition(".")[2]) if size % 1 else 0 for size in sizes)
    for_largest = 3 if sizes[-1] <= 1 else 2 if sizes[-1] < 10 else 1
    for_smallest = 0 if sizes[0] >= 10 else 1 if sizes[0] >= 1 else 2 if sizes[0] >= 0.1 else 3
    return min(carried, max(for_largest, for_smallest))


def number(value: float | int | None, digits: int) -> str:
    return "–" if value is None else f"{value:.{digits}f}"


def digits_for(figures: Sequence[Figure]) -> int:
    """Decimals for figures that stand together, their intervals' included."""
    return digits_of([number for figure in figures for number in (figure.value, figure.low, figure.high)])


def with_interval(figure: Figure, digits: int) -> str:
    text = number(figure.value, digits)
    if not figure.has_interval:
        return text
    ends = min(digits, digits_of([figure.low, figure.high]))
    return f"{text} [{number(figure.low, ends)}, {number(figure.high, ends)}]"


def inline(experiments: Mapping[str, Experiment], spec: str, default: str = "") -> str:
    """Return one figure in a line of text: `EXPERIMENT:KEY OPTION...`."""
    words, options = [], set()
    for word in spec.split():
        (options.add if word in ("bare", "cases") or re.fullmatch(r"\.\d", word) else words.append)(word)
    name, _, key = " ".join(words).rpartition(":")
    experiment = experiments.get(name or default)
    if experiment is None:
        raise FiguresError(f"no docs/results/{name or default}.json")
    figure = experiment.figure(key)
    fixed = [int(option[1]) for option in options if option.startswith(".")]
    digits = fixed[0] if fixed else digits_for([figure])
    if "bare" in options:
        return number(figure.value, digits)
    value, bracket, interval = with_interval(figure, digits).partition(" [")
    unit = f" {figure.unit}" if figure.unit and figure.unit != "count" else ""
    text = value + unit + bracket + interval
    if "cases" in options:
        text += f" of {figure.cases} {experiment.about.get('a_case', 'cases')}" if figure.cases else ""
        text += "" if figure.has_interval else " (interval not measured)"
    return text


# ---- tables ---------------------------------------------------------------------------------------------------------


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
        f"Simulated: {experiment.clause('simulated')}. The method may know: {experiment.clause('knows')}. "
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
        f"**What this does not show.** {experiment.text('does_not_show')}",
        "",
        f"- **Simulated:** {experiment.clause('simulated')}.",
        f"- **The method may know:** {experiment.clause('knows')}.",
        f"- **Measured:** {', '.join(str(experiment.about[name]) for name in ('date', 'commit', 'machine'))}.",
        f"- **Command:** `{experiment.about['command']}`",
    ]
    if experiment.about.get("notes"):
        lines.append(f"- {experiment.text('notes')}")
    return "\n".join(lines) + "\n"


def headlines(experiments: Mapping[str, Experiment], spec: Mapping[str, Any], pages: Mapping[str, str]) -> str:
    """Return a table with a figure a row: label = ["experiment", "key of ours", "key beside it"...]."""
    rows: list[list[str]] = []
    above = ""
    for label, (name, ours, *beside) in spec.items():
        experiment = experiments.get(name)
        if experiment is None:
            raise FiguresError(f"no docs/results/{name}.json")
        figure = experiment.figure(ours)
        others = [experiment.figure(key) for key in beside]
        digits = digits_for([figure, *others])
        unit = f" [{figure.unit}]" if figure.unit not in ("", "count") else ""
        rivals = [
            f"{experiment.shown(key.split('/')[0])} {cell(other, digits)}"
            for key, other in zip(beside, others, strict=True)
        ]
        linked = f"[{label}]({pages[name]})" if name in pages else label
        cases = f"{figure.cases} {experiment.about.get('a_case', 'cases')}" if figure.cases else "–"
        about_it = "″" if name == above else f"{experiment.clause('simulated')}; {experiment.clause('knows')}"
        above = name
        date = str(experiment.about["date"])
        rows.append([linked + unit, cell(figure, digits), "; ".join(rivals) or "–", cases, about_it, date])
    header = ["figure", "ours", "beside it", "cases", "what was simulated; what the method may know", "measured"]
    return markdown_table(header, rows, len(header))


def cell(figure: Figure, digits: int) -> str:
    return (
        with_interval(figure, digits)
        if figure.has_interval
        else f"{number(figure.value, digits)} (interval not measured)"
    )


# ---- pages ----------------------------------------------------------------------------------------------------------


def pages(root: Path) -> list[Path]:
    return [root / "README.md", *sorted((root / "docs").glob("**/*.md"))]


def homes(root: Path, page: Path) -> dict[str, str]:
    """Return, by experiment, the address of its page as seen from `page`."""
    folder = root / "docs" / "results"
    above = "" if page.parent == folder else "results/" if page.parent == root / "docs" else "docs/results/"
    found = {}
    for home in sorted(folder.glob("*.md")):
        for name in re.findall(r"<!-- about (\w+) -->", home.read_text()):
            found[name] = f"{above}{home.name}"
    return found


def render(text: str, experiments: Mapping[str, Experiment], addresses: Mapping[str, str]) -> str:
    """Return the page with everything between markers made anew."""
    own = set(re.findall(r"<!-- about (\w+) -->", text))

    def block(match: re.Match[str]) -> str:
        kind, spec = match["kind"], match["spec"].strip()
        name, _, rest = spec.partition("\n") if kind == "table" else spec.partition(" ")
        name = name.strip()
        if kind != "headlines" and name not in experiments:
            raise FiguresError(f"no docs/results/{name}.json")
        made: dict[str, Callable[[], str]] = {
            "table": lambda: table(experiments[name], tomllib.loads(rest), name in own),
            "rows": lambda: words(experiments[name], rest.strip(), name in own),
            "about": lambda: about(experiments[name]),
            "headlines": lambda: headlines(experiments, tomllib.loads(spec), addresses),
        }
        return match["open"] + made[kind]() + match["close"]

    text = BLOCK.sub(block, text)
    return INLINE.sub(lambda match: match["open"] + inline(experiments, match["spec"]) + match["close"], text)


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


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description="Render the figures of README.md and docs/ from docs/results/*.json.")
    parser.add_argument("--check", action="store_true", help="change nothing; fail where a page shows another figure")
    options = parser.parse_args(arguments)
    experiments = load_experiments(ROOT / "docs" / "results")
    stale = []
    for page in pages(ROOT):
        text = page.read_text()
        try:
            made = render(text, experiments, homes(ROOT, page))
        except (FiguresError, tomllib.TOMLDecodeError) as error:
            print(f"{page.relative_to(ROOT)}: {error}", file=sys.stderr)
            return 3
        if made != text:
            stale.append(str(page.relative_to(ROOT)))
            if not options.check:
                page.write_text(made)
    if stale:
        print(f"{'shows other figures' if options.check else 'written'}: {', '.join(stale)}", file=sys.stderr)
    return 4 if options.check and stale else 0


if __name__ == "__main__":
    sys.exit(main())
