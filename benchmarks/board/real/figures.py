"""Figures out of records, and the line that a lab understands. Nothing here looks at anything but records."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict

import numpy as np

from benchmarks.board.real.records import AnnotatedRecord, Edges, Half, HalvesRecord, Tally, Things, TruthRecord

Figures = dict[str, float | None]


def share(part: float, whole: float) -> float | None:
    """Return part of whole, 0..1; None of nothing."""
    return part / whole if whole else None


def median(values: Iterable[float]) -> float | None:
    """Return the median; None of nothing."""
    listed = list(values)
    return float(np.median(listed)) if listed else None


def things_figures(things: Things) -> Figures:
    """Figures of the things of one or more rooms, large and small apart; shares are of the true things."""
    figures: Figures = {}
    for size, tally in (("large", things.large), ("small", things.small)):
        figures |= {
            size: float(tally.true),
            f"{size}_found": share(tally.found, tally.true),
            f"{size}_named": share(tally.named, tally.true),
            f"{size}_stand": share(tally.stand, tally.true),
            f"{size}_off_mm": median(tally.off_mm),
        }
    return figures | {"false_things": float(things.false)}


def annotated_figures(records: Sequence[AnnotatedRecord]) -> Figures:
    """Figures of annotated logs, pooled: counts are added before they are divided."""
    told = [record for record in records if record.annotated]
    settled = [record.settling for record in records if record.settling is not None]
    supports = sum((record.supports for record in told), Edges())
    return {
        "logs": float(len(records)),
        "failed": float(sum(bool(record.failed) for record in records)),
        "support_f1": supports.f1,
        **things_figures(sum((record.things for record in told), Things())),
        "stay": share(sum(s.stay for s in settled), sum(s.movable for s in settled)),
        "collisions": float(sum(s.collisions for s in settled)),
        "minutes": minutes(records),
    }


def halves_figures(records: Sequence[HalvesRecord]) -> Figures:
    """Figures of the halves of logs, pooled: how far they agree, and how much they explain."""
    halves = [half for record in records for half in (record.even, record.odd)]
    pairs = sum(record.matched for record in records)
    surface = sum(half.surface for half in halves)
    return {
        "logs": float(len(records)),
        "failed": float(sum(bool(record.failed) for record in records)),
        "matched": share(2 * pairs, sum(half.things for half in halves)),
        "apart_mm": None if (apart := median(x for r in records for x in r.apart_m)) is None else 1000 * apart,
        "same_parent": share(sum(record.same_parent for record in records), pairs),
        "same_class": share(sum(r.same_class for r in records), sum(r.with_name for r in records)),
        "same_model": share(sum(r.same_model for r in records), sum(r.with_model for r in records)),
        "things_a_half": share(sum(half.things for half in halves), len(halves)),
        "explained": share(sum(half.by_things + half.by_layout for half in halves), surface),
        "explained_by_things": share(sum(half.by_things for half in halves), surface),
        "minutes": minutes(records),
    }


def truth_figures(record: TruthRecord) -> Figures:
    """Figures of one log with a measured truth."""
    return {
        **things_figures(record.things),
        "support_f1": record.supports.f1 if record.supports.true else None,
        "unseen": float(record.unseen),
        "minutes": minutes([record]),
    }


def counts(record: AnnotatedRecord | HalvesRecord | TruthRecord) -> dict[str, float]:
    """Return every number of a record by a name of its own (`large_found`, `supports_agreed`, `even_things`).

    Of lists the median, of words how many there are. What was not measured is left out; seconds stand in the record.
    """
    plain = asdict(record)
    del plain["seconds"]
    things = plain.pop("things", {})
    return dict(_numbers("", {**things, **plain}))


def _numbers(name: str, value: object) -> Iterator[tuple[str, float]]:
    if isinstance(value, dict):
        for key, part in value.items():
            yield from _numbers(f"{name}_{key}" if name else key, part)
    elif isinstance(value, tuple):
        words = [entry for entry in value if isinstance(entry, str)]
        if value:
            yield name, float(len(words)) if words else float(np.median(value))
    elif isinstance(value, int | float):
        yield name, float(value)


def minutes(records: Iterable[AnnotatedRecord | HalvesRecord | TruthRecord]) -> float:
    """Processor minutes of the chain."""
    return sum(sum(record.seconds.values()) for record in records) / 60


def line(record: AnnotatedRecord | HalvesRecord | TruthRecord) -> str:
    """Return what a lab wants to know of a log, in one line."""
    took = f"{minutes([record]):.1f} minutes of one processor"
    failed = f"; STOPPED: {record.failed}" if record.failed else ""
    if isinstance(record, HalvesRecord):
        return f"{record.log}, even and odd frames: {_agreed(record)}; {took}{failed}"
    if isinstance(record, AnnotatedRecord) and not record.annotated:
        return f"{record.log}: nothing annotated; {took}{failed}"
    return f"{record.log}: {_found(record.things.large)}; {record.things.false} false; {took}{failed}"


def _found(tally: Tally) -> str:
    off = median(tally.off_mm)
    apart = "" if off is None else f", {off:.0f} mm off"
    return (
        f"of the room's large things {tally.found} of {tally.true} are found, {tally.named} named right, "
        f"{tally.stand} stand where they stood{apart}"
    )


def _agreed(record: HalvesRecord) -> str:
    apart = median(record.apart_m)
    off = "" if apart is None else f", {1000 * apart:.0f} mm apart"
    return (
        f"{record.matched} things are in both ({record.even.things} and {record.odd.things}){off}, "
        f"{record.same_parent} on the same, {record.same_class} of {record.with_name} names and "
        f"{record.same_model} of {record.with_model} models alike; "
        f"{_explained(record.even)} and {_explained(record.odd)} of the surface explained"
    )


def _explained(half: Half) -> str:
    value = share(half.by_things + half.by_layout, half.surface)
    return "–" if value is None else f"{100 * value:.0f} %"
