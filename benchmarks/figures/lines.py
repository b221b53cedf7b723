"""Figures in a line of text: decimals, units, intervals."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from benchmarks.figures.content import Experiment, Figure, FiguresError

IN_TEXT = re.compile(r"\{(?P<spec>[^{}]+)\}")
SPEC = re.compile(r"(?P<figure>.*?)(?P<options>(?: (?:bare|cases|\.\d))*)", re.DOTALL)


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
    parts = SPEC.fullmatch(spec)
    assert parts is not None
    options = set(parts["options"].split())
    name, _, key = parts["figure"].rpartition(":")
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
        said = [f"{figure.cases} {experiment.about.get('a_case', 'cases')}"] if figure.cases else []
        text += f" ({'; '.join([*said, *([] if figure.has_interval else ['interval not measured'])])})"
    return text


def text_of(experiment: Experiment, name: str) -> str:
    """Return a text of the JSON with the figures that it names in braces: "over {ours/clean/PQ}"."""
    text = str(experiment.about[name])
    return IN_TEXT.sub(lambda match: inline({experiment.name: experiment}, match["spec"], experiment.name), text)


def clause_of(experiment: Experiment, name: str) -> str:
    """Return the same as a part of a sentence."""
    return text_of(experiment, name).rstrip(".")
