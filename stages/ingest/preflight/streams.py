"""Streams of a log by their stamps: rates, gaps, duplicates, time running backward, and how their clocks compare."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from scenewright.stages.ingest.clocks import FASTEST, NO_RATE
from scenewright.stages.ingest.preflight.report import Finding, Gaps, StreamReport, exact, significant
from scenewright.stages.ingest.source import Entry, LogSource, StreamInfo
from scenewright.stages.kit.formats.stamps import USUAL_STEP

GAP_FACTOR = 3.0
"""Intervals over so many medians are gaps."""
ODD_DELAY = 1.0
"""Median of log time minus header stamp [s] over which the two clocks are called different."""
MANY_GAPS = 0.02
"""Gaps per interval from which on a warning is given."""
LONG_GAP = 2.0
"""Seconds without a frame worth a warning, when it is a gap at all."""


def stream_reports(source: LogSource) -> tuple[StreamReport, ...]:
    """Return a report of every stream, and of the frames where no stream of images carries stamps."""
    return tuple(stream_report(stream) for stream in all_streams(source))


def all_streams(source: LogSource) -> tuple[StreamInfo, ...]:
    """Return the streams of the log, and what its frames say where no stream of images carries stamps."""
    if any(stream.role in ("color", "depth") and len(stream.stamps) for stream in source.streams):
        return source.streams
    return (*source.streams, *streams_of_entries(source.entries))


def streams_of_entries(entries: Iterable[Entry]) -> tuple[StreamInfo, ...]:
    """Return what the frames say of the streams: one a camera, and one of the poses."""
    times: dict[str, list[float]] = {}
    posed: dict[str, list[float]] = {}
    for entry in entries:
        times.setdefault(entry.camera_name, []).append(entry.time)
        if entry.world_from_camera is not None:
            posed.setdefault(entry.camera_name, []).append(entry.time)
    streams = [StreamInfo(f"frames of {n}", "color", "frames", _stamps(t), len(t)) for n, t in times.items()]
    streams += [StreamInfo(f"poses of {n}", "pose", "with the frames", _stamps(t), len(t)) for n, t in posed.items()]
    return tuple(streams)


def _stamps(times: list[float]) -> np.ndarray:
    seconds = np.array(times, dtype=float)
    seconds = seconds[np.isfinite(seconds) & (np.abs(seconds) < 9e9)]
    return np.rint(seconds * 1e9).astype(np.int64)


def stream_report(stream: StreamInfo) -> StreamReport:
    """Return the report of one stream."""
    stamps = np.asarray(stream.stamps, dtype=np.int64)
    count = max(stream.count, len(stamps))
    rate, gaps, duplicates, reversals = None, Gaps(), 0, 0
    if len(stamps) > 1:
        ordered = np.unique(stamps)
        duplicates = len(stamps) - len(ordered)
        reversals = int((np.diff(stamps) < 0).sum())
        intervals = np.diff(ordered)
        if len(intervals):
            median = float(np.median(intervals))
            rate = 1e9 / median
            gaps = _gaps(ordered, intervals, median)
    return StreamReport(
        name=stream.name,
        role=stream.role,
        detail=stream.detail,
        count=count,
        rate=significant(rate),
        first=significant(stamps.min() * 1e-9, 15) if len(stamps) else None,
        last=significant(stamps.max() * 1e-9, 15) if len(stamps) else None,
        gaps=gaps,
        duplicates=duplicates,
        reversals=reversals,
        log_delay=significant(stream.log_delay),
    )


def _gaps(ordered: np.ndarray, intervals: np.ndarray, median: float) -> Gaps:
    wide = np.flatnonzero(intervals > GAP_FACTOR * median)
    if not len(wide):
        return Gaps()
    longest = int(wide[np.argmax(intervals[wide])])
    return Gaps(
        count=len(wide), longest=exact(intervals[longest] * 1e-9), longest_at=significant(ordered[longest] * 1e-9, 15)
    )


def clock_lines(source: LogSource) -> tuple[str, ...]:
    """Return what comparing stamps of streams tells: log time against header, and depth against colour."""
    lines = []
    for stream in source.streams:
        if stream.log_delay is not None and abs(stream.log_delay) > ODD_DELAY:
            lines.append(
                f"{stream.name}: was logged {stream.log_delay:+.3g} s after its header stamps; header stamps are used"
            )
    images = {
        role: np.unique(np.concatenate([s.stamps for s in source.streams if s.role == role] or [np.zeros(0, np.int64)]))
        for role in ("color", "depth")
    }
    color, depth = images["color"], images["depth"]
    if len(color) > 1 and len(depth) > 1:
        lines.append(_offset_line(color, depth))
    return tuple(lines)


def _offset_line(color: np.ndarray, depth: np.ndarray) -> str:
    """Median and drift of the nearest depth stamp minus the colour stamp."""
    after = np.clip(np.searchsorted(depth, color), 0, len(depth) - 1)
    before = np.maximum(after - 1, 0)
    nearer = np.where(np.abs(depth[after] - color) < np.abs(depth[before] - color), after, before)
    offsets = (depth[nearer] - color) * 1e-9
    line = f"depth stamps are {1000 * float(np.median(offsets)):+.1f} ms from the nearest colour stamps (median)"
    span = (color[-1] - color[0]) * 1e-9
    if span > 1 and len(offsets) >= 20:
        tenth = max(len(offsets) // 10, 1)
        drift = float(np.median(offsets[-tenth:]) - np.median(offsets[:tenth])) / span
        line += f", drifting by {1e6 * drift:+.0f} us/s"
    return line


def stream_findings(streams: Iterable[StreamReport], notes: Iterable[str] = ()) -> list[Finding]:
    """Return what is odd about the streams; a rate that a note of the reader speaks of is not spoken of again."""
    findings = []
    told = any(NO_RATE in note for note in notes)
    for stream in streams:
        if stream.role in ("calibration", "transforms", "other", "unreadable"):
            continue
        is_of_images, rate = stream.role in ("color", "depth", "right"), stream.rate or 0.0
        if is_of_images and stream.count > 2 and 0 < rate < 1 / USUAL_STEP:
            message = f"{stream.name}: images are {1 / rate:.3g} s apart: are the stamps of another unit than seconds?"
            advice = "write them in seconds, where they are"
            findings.append(Finding(severity="doubtful", check="streams", message=message, fix=advice))
        if is_of_images and rate > FASTEST:
            if not told:
                message = f"{stream.name}: stamps make {rate:,.0f} images a second, {NO_RATE}"
                findings.append(
                    Finding(severity="doubtful", check="streams", message=message, fix="correct the stamps")
                )
        elif stream.gaps.count and (
            stream.gaps.longest > LONG_GAP or stream.gaps.count > MANY_GAPS * max(stream.count - 1, 1) + 1
        ):
            findings.append(
                Finding(
                    severity="doubtful",
                    check="streams",
                    message=f"{stream.name}: {stream.gaps.count} gaps, the longest {stream.gaps.longest:.3g} s at "
                    f"{stream.gaps.longest_at:.3f} s",
                    fix="record fewer topics at a time, or to a faster disk",
                )
            )
        if stream.duplicates:
            message = f"{stream.name}: {stream.duplicates} stamps occur twice"
            findings.append(Finding(severity="note", check="streams", message=message))
        if stream.reversals:
            message = f"{stream.name}: time runs backward {stream.reversals} times in file order"
            findings.append(Finding(severity="note", check="streams", message=message))
    return findings
