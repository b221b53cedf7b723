"""The figures of merit of vision."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np

from benchmarks.experiment import Measure, Results
from benchmarks.experiments.tidy_detect.looks import Looks
from benchmarks.experiments.tidy_detect.score import Match, measures, reliability
from benchmarks.tabulation import markdown

ALL, OURS = "detect", "ours"


def matches_of(records: Sequence[Looks]) -> list[Match]:
    """Return the matches of all looks."""
    return [match for looks in records for look in looks for match in look.matches]


def timed(name: str, share: float) -> Measure:
    """Return a quantile over the looks of a time [ms]."""

    def quantile(records: Sequence[Looks]) -> float | None:
        values = [v for looks in records for look in looks if (v := getattr(look, name)) is not None]
        return 1e3 * float(np.quantile(values, share)) if values else None

    return Measure(quantile, "ms", interval=False)


MEASURES = {
    "all/images": Measure(lambda records: float(sum(map(len, records))), interval=False),
    "all/milliseconds": timed("seconds", 0.5),
    "all/milliseconds_p95": timed("seconds", 0.95),
    "all/milliseconds_quiet": timed("quiet", 0.5),
    "all/milliseconds_quiet_p95": timed("quiet", 0.95),
}


def more_figures(results: Results) -> dict[str, float | None]:
    """`<arm>/detect[_<tier, level or scheme>]/<class>/<measure>`."""
    flat: dict[str, float | None] = {}
    for case in results.cases:
        for arm in results.arms(case):
            for kind, values in measures(matches_of(results.of(arm, case))).items():
                flat |= {f"{arm}/{case}/{kind}/{name}": value for name, value in values.items()}
    flat[f"{OURS}/{ALL}/all/calibration_error"] = reliability(matches_of(results.of(OURS, ALL)))[1]
    return flat


def doubts(results: Results) -> str:
    """Confidence of `ours` against correctness (the right kind within 20 mm), and its reasons for doubt."""
    matches = matches_of(results.of(OURS, ALL))
    bins = [
        (f"{low:g} to {high:g}", str(count), f"{mean:.3f}", f"{share:.3f}")
        for low, high, count, mean, share in reliability(matches)[0]
    ]
    claims = [m for m in matches if m.found not in (None, "unknown")]
    silent = "(none)"
    doubted = Counter(reason for m in claims for reason in m.unsure or (silent,))
    wrong = Counter(reason for m in claims if not m.right for reason in m.unsure or (silent,))
    reasons = [(reason, str(count), str(wrong[reason])) for reason, count in doubted.most_common()]
    return "\n".join(
        (
            markdown("Confidence of ours", ("confidence", "detections", "mean confidence", "share right"), bins),
            markdown("", ("reason for doubt", "detections", "of these wrong"), reasons),
        )
    )
