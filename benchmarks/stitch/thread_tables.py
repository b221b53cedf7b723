"""Figures of merit of reconstructed threads and their table."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np

from benchmarks.stitch.thread_records import ThreadRecord
from stages.kit.measurement.proportions import wilson_interval


def _median(values: Iterable[float]) -> float:
    found = list(values)
    return float(np.median(found)) if found else -1.0


def _mean(values: Iterable[float]) -> float:
    found = list(values)
    return float(np.mean(found)) if found else -1.0


MEASURES: dict[str, Callable[[list[ThreadRecord]], float]] = {
    "views": lambda records: float(len(records)),
    "answered": lambda records: _mean(r.answered for r in records),
    "good": lambda records: _mean(r.good for r in records),
    "distance_mean_mm": lambda records: _median(r.distance_mean for r in records if r.answered),
    "distance_p95_mm": lambda records: _median(r.distance_p95 for r in records if r.answered),
    "missed_mean_mm": lambda records: _median(r.missed_mean for r in records if r.answered),
    "missed_p95_mm": lambda records: _median(r.missed_p95 for r in records if r.answered),
    "followed": lambda records: _mean(r.followed for r in records),
    "backward": lambda records: _mean(r.backward for r in records if r.answered),
    "inside_2sd": lambda records: _mean(r.inside_2sd for r in records if r.answered),
    "length_error_mm": lambda records: _median(abs(r.length - r.true_length) for r in records if r.answered),
    "length_error": lambda records: _median(abs(r.length / r.true_length - 1.0) for r in records if r.answered),
    "length_within_10_percent": lambda records: _mean(
        r.answered and abs(r.length / r.true_length - 1.0) <= 0.1 for r in records
    ),
    "cpu_seconds": lambda records: _median(r.seconds for r in records),
}


def groups(records: list[ThreadRecord]) -> dict[str, list[ThreadRecord]]:
    """Return all views, those that said ok or unsure, and those whose thread both eyes see whole."""
    named = {
        "thread_all": records,
        "thread_ok": [r for r in records if r.status == "ok"],
        "thread_unsure": [r for r in records if r.status == "unsure"],
        "thread_whole": [r for r in records if r.whole],
        "thread_whole_ok": [r for r in records if r.whole and r.status == "ok"],
        "thread_crossed": [r for r in records if r.crossed],
    }
    return {name: found for name, found in named.items() if found}


def metrics(records: list[ThreadRecord]) -> dict[str, float]:
    """Return `<masks>/<group>/<measure>` -> number."""
    return {
        f"{masks}/{name}/{measure}": round(function(found), 4)
        for masks in ("true", "learned")
        for name, found in groups([r for r in records if r.masks == masks]).items()
        for measure, function in MEASURES.items()
    }


def table(records: list[ThreadRecord]) -> str:
    """Return the table as Markdown."""
    lines = [
        "| masks | views | n | curve to truth mm, mean (95 %) | truth to curve mm, mean (95 %) | followed % | "
        "good % (95 % interval) | length error % | length within 10 % | inside 2 sd % | CPU s |",
        "|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    for masks in ("true", "learned"):
        for name, found in groups([r for r in records if r.masks == masks]).items():
            of = {measure: function(found) for measure, function in MEASURES.items()}
            low, high = wilson_interval(sum(r.good for r in found), len(found))
            lines.append(
                f"| {masks} | {name} | {len(found)} | {of['distance_mean_mm']:.2f} ({of['distance_p95_mm']:.2f}) "
                f"| {of['missed_mean_mm']:.2f} ({of['missed_p95_mm']:.2f}) | {100 * of['followed']:.1f} "
                f"| {100 * of['good']:.0f} ({100 * low:.0f}–{100 * high:.0f}) | {100 * of['length_error']:.1f} "
                f"| {100 * of['length_within_10_percent']:.0f} | {100 * of['inside_2sd']:.0f} "
                f"| {of['cpu_seconds']:.3f} |"
            )
    return "\n".join(lines) + "\n"
