"""Is the depth depth: how much of it is valid, in which unit, how finely quantised, cut off where."""

from __future__ import annotations

import re
from collections.abc import Iterable

import numpy as np
from scenewright.stages.ingest.preflight.looking import Look
from scenewright.stages.ingest.preflight.report import DepthReport, Finding, exact
from scenewright.stages.ingest.preflight.units import plausible_units

PLAUSIBLE = (0.15, 15.0)
"""Median depth [m] of what depth cameras record."""
LITTLE_VALID = 0.1
"""Share of valid pixels below which depth is called scarce; by eye."""
SATURATED = 0.2
"""Share of valid pixels at the largest value that suggests a cut-off."""
COARSE_VALUES = 256
"""Depth with fewer values in every frame was 8-bit once."""
MULTIPLE = 5
"""What TUM's 1/5000 m makes of millimetres, which keep it in every value."""
HISTOGRAM_BINS = 48
"""Bars of the depth histogram; by eye."""


def depth_report(looks: Iterable[Look]) -> DepthReport | None:
    """Return what is to be said of the depth of the frames; None without any."""
    frames = [look for look in looks if look.depth_values is not None and len(look.depth_values)]
    if not frames:
        return None
    totals = np.zeros(65536, dtype=np.int64)
    medians, distinct, steps = [], [], []
    for look in frames:
        assert look.depth_values is not None and look.depth_counts is not None
        totals[look.depth_values] += look.depth_counts
        medians.append(_weighted_quantile(look.depth_values, look.depth_counts, 0.5))
        distinct.append(len(look.depth_values))
        if len(look.depth_values) > 1:
            steps.append(int(np.diff(look.depth_values.astype(int)).min()))
    values = np.flatnonzero(totals)
    counts = totals[values]
    median = float(np.median(medians)) * 1e-3
    low, high = (_weighted_quantile(values, counts, q) * 1e-3 for q in (0.05, 0.95))
    end = 1.1 * _weighted_quantile(values, counts, 0.995) * 1e-3
    histogram, _ = np.histogram(values * 1e-3, bins=HISTOGRAM_BINS, range=(0, end), weights=counts)
    return DepthReport(
        frames=len(frames),
        valid_share=exact(counts.sum() / sum(look.depth_pixels for look in frames)),
        median=exact(median),
        low=exact(low),
        high=exact(high),
        plausible=PLAUSIBLE[0] <= median <= PLAUSIBLE[1],
        factor=None,
        step=exact(min(steps, default=0) * 1e-3),
        distinct_values=int(np.median(distinct)),
        saturated_share=exact(counts[-1] / counts.sum()),
        saturated_value=exact(values[-1] * 1e-3),
        histogram=tuple(exact(share, 3) for share in histogram / counts.sum()),
        histogram_end=exact(end),
    )


def _weighted_quantile(values: np.ndarray, counts: np.ndarray, quantile: float) -> float:
    total = np.cumsum(counts)
    return float(values[np.searchsorted(total, quantile * total[-1])])


def units_per_metre(notes: Iterable[str], depth_scale: float | None) -> float:
    """Return the depth units per metre that a log was read with: the option's, else what the reader noted, else 1000
    (millimetres, which every other reader takes)."""
    if depth_scale is not None:
        return depth_scale
    noted = [
        match
        for note in notes
        if (match := re.match(r"depth unit (?:assumed|stated by the calibration): 1/([0-9.e+]+) m", note))
    ]
    return float(noted[0][1]) if noted else 1000.0


def depth_findings(report: DepthReport, units: float, camera: str, *, has_poses: bool = True) -> list[Finding]:
    """Return what is odd about the depth itself; `units` per metre is how it was read.

    Whether it agrees with the poses is said with the poses.
    """
    findings = []

    def add(severity: str, message: str, fix: str = "") -> None:
        findings.append(Finding(severity=severity, check="depth", message=message, fix=fix, camera=camera))  # type: ignore[arg-type]

    if not report.plausible and report.factor_by != "poses":
        likely = plausible_units(report.median, units)
        words = [f"--depth-scale {unit:g} ({report.median * units / unit:.3g} m away)" for unit in likely[:4]]
        no_unit = "" if likely else ", and no usual unit explains it"
        add(
            "wasted",
            f"depth unit: the median depth is {report.median:.3g} m{no_unit}",
            f"ingest with {', or '.join(words)}" if words else "find out the unit of the depth images: --depth-scale",
        )
    elif not has_poses and units == 1000 and report.step == MULTIPLE / 1000 and report.distinct_values >= COARSE_VALUES:
        add(
            "doubtful",
            f"every value of the depth is a multiple of {MULTIPLE}, as of millimetres that were stored in 1/5000 m; "
            f"the median is {report.median:.3g} m, or {report.median / MULTIPLE:.3g} m",
            f"ingest with --depth-scale {MULTIPLE * 1000}, where that is so",
        )
    if report.valid_share < LITTLE_VALID:
        add(
            "doubtful",
            f"only {100 * report.valid_share:.1f} % of the depth pixels are valid",
            "come nearer; glass and sunlight give none",
        )
    if report.saturated_share > SATURATED:
        add(
            "doubtful",
            f"{100 * report.saturated_share:.0f} % of the depth is exactly {report.saturated_value:.3f} m: cut off, or "
            "a value that means invalid",
            f"ingest with --maximum-depth {0.999 * report.saturated_value:.4g}",
        )
    if report.distinct_values < COARSE_VALUES and report.step >= 0.004:
        add(
            "doubtful",
            f"depth has {report.distinct_values} different values a frame, {1000 * report.step:.0f} mm apart: it was "
            "8-bit once",
            "record 16-bit depth",
        )
    return findings
