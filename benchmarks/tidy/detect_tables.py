"""The figures of merit of vision, and their tables."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable
from typing import Protocol

import numpy as np

from benchmarks.tidy.detection_score import Match, measures, reliability

COLUMNS = ("items", "found", "precision", "recall", "center_mm", "center_p95_mm", "angle_deg", "head_right",
           "height_right", "stack_height_right", "sure_share")  # fmt: skip


class Look(Protocol):
    """What the tables need of one arm's look at one image."""

    @property
    def arm(self) -> str:
        """Who looked."""

    @property
    def tier(self) -> str:
        """Of the scene."""

    @property
    def seed(self) -> int:
        """Of the scene."""

    @property
    def level(self) -> str:
        """Of light and noise."""

    @property
    def scheme(self) -> str:
        """Of colours."""

    @property
    def seconds(self) -> float:
        """CPU time."""

    @property
    def quiet(self) -> float | None:
        """Least CPU time of several."""

    @property
    def matches(self) -> tuple[Match, ...]:
        """Items and detections."""


def metrics(looks: Iterable[Look]) -> dict[str, float]:
    """Return `<arm>/detect/<class>/<measure>` and `<arm>/detect_<case>/<class>/<measure>` -> value; cases are tiers,
    levels and schemes."""
    groups: dict[str, list[Match]] = defaultdict(list)
    times: dict[str, list[float]] = defaultdict(list)
    quiet: dict[str, list[float]] = defaultdict(list)
    for look in looks:
        for case in ("detect", *(f"detect_{name}" for name in (look.tier, look.level, look.scheme))):
            groups[f"{look.arm}/{case}"].extend(look.matches)
        times[look.arm].append(1e3 * look.seconds)
        if look.quiet is not None:
            quiet[look.arm].append(1e3 * look.quiet)
    result = {
        f"{at}/{kind}/{name}": value
        for at, matches in groups.items()
        for kind, values in measures(matches).items()
        for name, value in values.items()
    }
    for arm, values in times.items():
        result[f"{arm}/detect/all/images"] = float(len(values))
        result[f"{arm}/detect/all/milliseconds"] = float(np.median(values))
        result[f"{arm}/detect/all/milliseconds_p95"] = float(np.percentile(values, 95))
        if quiet[arm]:
            result[f"{arm}/detect/all/milliseconds_quiet"] = float(np.median(quiet[arm]))
            result[f"{arm}/detect/all/milliseconds_quiet_p95"] = float(np.percentile(quiet[arm], 95))
    if groups["ours/detect"]:
        result["ours/detect/all/calibration_error"] = reliability(groups["ours/detect"])[1]
    return {name: round(value, 5) for name, value in result.items()}


def table_text(looks: list[Look], result: dict[str, float]) -> str:
    """Return table.md: all cases and arms, calibration, reasons for doubt, time."""
    scenes = Counter(tier for tier, _ in {(look.tier, look.seed) for look in looks})
    per_tier = ", ".join(f"{tier} {count}" for tier, count in sorted(scenes.items()))
    images = len({(look.seed, look.level, look.scheme) for look in looks})
    lines = [f"{sum(scenes.values())} scenes ({per_tier}), {images} images.", ""]
    lines += ["| arm | case | class | " + " | ".join(COLUMNS) + " |", "|---" * (3 + len(COLUMNS)) + "|"]
    for row in sorted({name.rsplit("/", 1)[0] for name in result}):
        arm, case, kind = row.split("/")
        cells = []
        for column in COLUMNS:
            value = result.get(f"{row}/{column}")
            form = ".0f" if column in ("items", "found") else ".3f"
            cells.append("" if value is None else format(value, form))
        if cells[0]:
            name = case.removeprefix("detect").removeprefix("_") or "all"
            lines.append(f"| {arm} | {name} | {kind} | " + " | ".join(cells) + " |")
    lines += ["", *_calibration([m for look in looks if look.arm == "ours" for m in look.matches])]
    lines += ["", "| arm | ms a frame, median | 95th percentile | least of five looks, median | 95th percentile |",
              "|---|---|---|---|---|"]  # fmt: skip
    for arm in sorted({look.arm for look in looks}):
        names = ("milliseconds", "milliseconds_p95", "milliseconds_quiet", "milliseconds_quiet_p95")
        values = [result.get(f"{arm}/detect/all/{name}") for name in names]
        lines.append(f"| {arm} | " + " | ".join("" if value is None else f"{value:.1f}" for value in values) + " |")
    return "\n".join(lines) + "\n"


def _calibration(matches: list[Match]) -> list[str]:
    bins, error = reliability(matches)
    lines = ["Confidence of `ours` against correctness (the right kind within 20 mm):", "",
             "| confidence | detections | mean confidence | share right |", "|---|---|---|---|"]  # fmt: skip
    lines += [f"| {low:g} to {high:g} | {count} | {mean:.3f} | {share:.3f} |" for low, high, count, mean, share in bins]
    lines += ["", f"Expected calibration error {error:.4f}.", "", "| reason for doubt | detections | of these wrong |",
              "|---|---|---|"]  # fmt: skip
    claims = [m for m in matches if m.found not in (None, "unknown")]
    doubts = Counter(reason for m in claims for reason in m.unsure)
    wrong = Counter(reason for m in claims if not m.right for reason in m.unsure)
    lines += [f"| {reason} | {count} | {wrong[reason]} |" for reason, count in doubts.most_common()]
    silent = sum(not m.right and not m.unsure for m in claims)
    lines.append(f"| (none) | {sum(not m.unsure for m in claims)} | {silent} |")
    return lines
