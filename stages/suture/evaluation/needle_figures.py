"""Figures of merit of the needle's pose with 95 % intervals, and their tables."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

import numpy as np
from scenewright.stages.kit.measurement.proportions import wilson_interval
from scenewright.stages.suture.evaluation.judgement import Estimate

ARMS = ("thesis", "ours")
"""Estimators in the order in which they are shown; any others come after."""
OF_TIME = ("cpu_seconds", "hertz")
INSIDE_95 = 12.592
"""The 95 % point of chi-squared with 6 degrees of freedom."""
MEASURES: dict[str, Callable[[list[Estimate]], float]] = {
    "views": lambda records: float(len(records)),
    "within_tolerance": lambda records: float(np.mean([r.within for r in records])),
    "right_guess": lambda records: float(np.mean([r.right for r in records])),
    "abstained": lambda records: float(np.mean([not r.answered for r in records])),
    "wrong_though_answered": lambda records: float(np.mean([r.answered and not r.right for r in records])),
    "normal_error_deg": lambda records: _median(r.normal_error_deg for r in records if r.answered),
    "normal_error_deg_p95": lambda records: _percentile(r.normal_error_deg for r in records if r.answered),
    "centre_error_mm": lambda records: _median(r.centre_error_mm for r in records if r.answered),
    "centre_error_mm_p95": lambda records: _percentile(r.centre_error_mm for r in records if r.answered),
    "tip_error_mm": lambda records: _median(r.tip_error_mm for r in records if r.answered),
    "tip_error_mm_p95": lambda records: _percentile(r.tip_error_mm for r in records if r.answered),
    "tip_within_2mm": lambda records: float(np.mean([r.answered and r.tip_error_mm <= 2.0 for r in records])),
    "end_error_mm": lambda records: _median(r.end_error_mm for r in records if r.answered),
    "swap_rate": lambda records: _mean(r.swapped for r in records if r.answered),
    "inside_95": lambda records: _mean(
        r.mahalanobis <= INSIDE_95 for r in records if r.answered and r.mahalanobis >= 0
    ),
    "cpu_seconds": lambda records: _median(r.seconds for r in records),
    "hertz": lambda records: 1.0 / max(_median(r.seconds for r in records), 1e-9),
}
"""Name of a figure -> what computes it from the estimates of a case."""


def _values(numbers: Iterable[float]) -> list[float]:
    return [float(number) for number in numbers]


def _median(numbers: Iterable[float]) -> float:
    values = _values(numbers)
    return float(np.median(values)) if values else -1.0


def _percentile(numbers: Iterable[float]) -> float:
    values = _values(numbers)
    return float(np.quantile(values, 0.95)) if values else -1.0


def _mean(numbers: Iterable[float]) -> float:
    values = _values(numbers)
    return float(np.mean(values)) if values else -1.0


def by_arm(records: list[Estimate]) -> dict[str, list[Estimate]]:
    """Return the records of each arm that has any."""
    arms = dict.fromkeys((*ARMS, *(record.arm for record in records)))
    groups = {arm: [record for record in records if record.arm == arm] for arm in arms}
    return {arm: of_arm for arm, of_arm in groups.items() if of_arm}


def metrics(groups: Mapping[str, list[Estimate]]) -> dict[str, float]:
    """Return `<arm>/<case>/<measure>` -> number of cases with their records of all arms."""
    result = {}
    for case, records in groups.items():
        for arm, of_arm in by_arm(records).items():
            timed = any(record.seconds > 0 for record in of_arm)
            for measure, function in MEASURES.items():
                if timed or measure not in OF_TIME:
                    result[f"{arm}/{case}/{measure}"] = round(function(of_arm), 4)
    return result


def _share(records: list[Estimate], test: Callable[[Estimate], bool]) -> str:
    """Return a percentage with its 95 % interval."""
    hits = sum(test(record) for record in records)
    low, high = wilson_interval(hits, len(records))
    return f"{100 * hits / len(records):.1f} ({100 * low:.0f}–{100 * high:.0f})"


def _row(name: str, records: list[Estimate]) -> str:
    figures = {measure: function(records) for measure, function in MEASURES.items()}
    inside = "–" if figures["inside_95"] < 0 else f"{100 * figures['inside_95']:.0f}"
    cells = [
        name,
        str(len(records)),
        _share(records, lambda record: record.within),
        f"{100 * figures['abstained']:.1f}",
        f"{100 * figures['wrong_though_answered']:.1f}",
        f"{figures['normal_error_deg']:.1f} / {figures['normal_error_deg_p95']:.1f}",
        f"{figures['centre_error_mm']:.2f} / {figures['centre_error_mm_p95']:.2f}",
        f"{figures['tip_error_mm']:.2f} / {figures['tip_error_mm_p95']:.2f}",
        f"{100 * figures['tip_within_2mm']:.1f}",
        f"{100 * figures['swap_rate']:.1f}",
        inside,
        f"{1000 * figures['cpu_seconds']:.0f}" if figures["cpu_seconds"] > 0 else "–",
    ]
    return "| " + " | ".join(cells) + " |"


HEADER = (
    "| {0} | views | within 1 mm and 10° % (95 % interval) | abstained % | wrong though answered % "
    "| normal ° median / p95 | centre mm median / p95 | tip mm median / p95 | tip within 2 mm % | swapped % "
    "| inside 95 % ellipsoid % | CPU ms |\n"
    "|---|---|---|---|---|---|---|---|---|---|---|---|"
)


def rows(title: str, groups: Mapping[str, list[Estimate]]) -> list[str]:
    """Return the lines of a table: a head, and a row for every group and arm that has records."""
    lines = [HEADER.format(f"{title}, arm")]
    for name, records in groups.items():
        lines += [_row(f"{name}, {arm}", of_arm) for arm, of_arm in by_arm(records).items()]
    return lines
