"""`scenewright diff`: two runs, or two artifacts, side by side."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path
from typing import Annotated, Any

import typer
from scenewright.cli.output import out

LISTED_FILES = 6
"""Most changed files that are named unless all are asked for."""
MEGABYTE = 1e6
"""Bytes a megabyte."""


def diff(
    first: Annotated[Path, typer.Argument(help="Run folder, or artifact folder.")],
    second: Annotated[Path, typer.Argument(help="The other one.")],
    everything: Annotated[bool, typer.Option("--all", help="List every changed file and unchanged artifacts.")] = False,
    json_output: Annotated[bool, typer.Option("--json", help="One JSON object on standard output.")] = False,
    debug: Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")] = False,
) -> int:
    """Say what two runs differ in: parameters, versions, inputs, outcomes, measures, files, sizes, times."""
    from scenewright.stages.engine.comparison import compare

    comparisons = compare(first, second)
    if json_output:
        counts = Counter(item.status for item in comparisons)
        document = {
            "first": str(first),
            "second": str(second),
            "counts": dict(sorted(counts.items())),
            "artifacts": [item.as_json() for item in comparisons],
        }
        out(json.dumps(document, sort_keys=True))
    else:
        out("\n".join(_lines(comparisons, everything)))
    return 0


def _lines(comparisons: list[Any], everything: bool) -> list[str]:
    common = _common_changes(comparisons)
    lines = [f"everywhere: {_change_text(change)}" for change in common]
    for item in comparisons:
        lines.append(f"{item.status:15} {item.name:22} {_cost_text(item.costs)}".rstrip())
        if item.status == "same" and not everything:
            continue
        lines += [f"  {_change_text(change)}" for change in item.changes if change not in common]
        lines += [f"  measure {_measure_text(figure)}" for figure in item.measures]
        if item.measures and item.equal_measures:
            lines.append(f"  measure: {item.equal_measures} others are equal")
        lines += [f"  {text}" for text in _file_texts(item.files, everything)]
    counts = Counter(item.status for item in comparisons)
    lines.append(", ".join(f"{count} {status}" for status, count in counts.most_common()))
    return lines


def _common_changes(comparisons: list[Any]) -> list[Any]:
    """Versions that changed in the same way in every artifact that both have: said once."""
    with_costs = [item for item in comparisons if item.costs]
    if len(with_costs) < 2:
        return []
    return [
        change
        for change in with_costs[0].changes
        if change.group == "version" and all(change in item.changes for item in with_costs)
    ]


def _change_text(change: Any) -> str:
    if change.group == "problem":
        return f"problem: {change.after}"
    before, after = (_value_text(change, value) for value in (change.before, change.after))
    name = change.name if change.group in ("stage", "outcome") else f"{change.group} {change.name}"
    return f"{name}: {before} -> {after}"


def _value_text(change: Any, value: Any) -> str:
    if value in (None, ""):
        return "none"
    if change.group in ("input", "data file") or change.name in ("git_commit", "lock_digest"):
        return str(value)[:12]
    return json.dumps(value) if isinstance(value, bool | list | dict) else str(value)


def _measure_text(figure: Any) -> str:
    before, after = ("undefined" if value is None else f"{value:.6g}" for value in (figure.before, figure.after))
    change = "" if figure.change is None else f"  ({figure.change:+.4g}"
    relative = "" if figure.relative is None else f", {100 * figure.relative:+.1f} %"
    return f"{figure.name}: {before} -> {after}{change}{relative}{')' if change else ''}"


def _cost_text(costs: tuple[Any, ...]) -> str:
    if not costs:
        return ""
    values = {figure.name: figure for figure in costs}
    size, seconds, memory = values["bytes"], values["seconds"], values["peak_memory_bytes"]
    return (
        f"{size.before / MEGABYTE:.1f} -> {size.after / MEGABYTE:.1f} MB, {seconds.before:.1f} -> {seconds.after:.1f} "
        f"s, {memory.before / 2**20:.0f} -> {memory.after / 2**20:.0f} MiB"
    )


def _file_texts(files: Any, everything: bool) -> list[str]:
    lines = []
    for name, paths in vars(files).items():
        listed = paths if everything else paths[:LISTED_FILES]
        and_more = f", ... ({len(paths)} files; --all lists them)" if len(paths) > len(listed) else ""
        if paths:
            lines.append(f"{name}: {', '.join(listed)}{and_more}")
    return lines
