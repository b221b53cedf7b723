"""The figures of merit of vision."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np
from scenewright.stages.kit.measurement.bootstrap import pooled_interval

from benchmarks.experiment import RESAMPLES, SEED_OF_INTERVALS, Measure, Results
from benchmarks.experiments.tidy_detect.looks import Looks
from benchmarks.experiments.tidy_detect.score import Match, counts, measures, reliability
from benchmarks.tabulation import Figure, markdown

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


def more_figures(results: Results) -> dict[str, float | Figure | None]:
    """`<arm>/detect[_<tier, level or scheme>]/<class>/<measure>`, shares of all looks with intervals over scenes, and
    `ours/confidence <from> to <to>/<measure>`."""
    flat: dict[str, float | Figure | None] = {}
    for case in results.cases:
        for arm in results.arms(case):
            records = results.of(arm, case)
            for kind, values in measures(matches_of(records)).items():
                flat |= {f"{arm}/{case}/{kind}/{name}": value for name, value in values.items()}
                flat |= {f"{arm}/{case}/{kind}/{name}": share for name, share in _shares(records, kind).items()}
    bins, flat[f"{OURS}/{ALL}/all/calibration_error"] = reliability(matches_of(results.of(OURS, ALL)))
    for low, high, number, confidence, right in bins:
        name = f"{OURS}/confidence {low:g} to {high:g}"
        flat[f"{name}/mean_confidence"] = Figure(confidence, None, None, number, "")
        flat[f"{name}/share_right"] = Figure(right, None, None, number, "")
    return flat


def _shares(records: Sequence[Looks], kind: str) -> dict[str, Figure]:
    """Return precision and recall of a class; a scene under all its conditions is one sample."""
    rows = np.array([counts([m for look in looks for m in look.matches], kind) for looks in records], dtype=float)
    found = {}
    for name, column in (("precision", 1), ("recall", 2)):
        random = np.random.default_rng(SEED_OF_INTERVALS)
        of = pooled_interval(rows[:, [0, column]], None, random, resamples=RESAMPLES)
        if of is not None:
            found[name] = Figure(of.value, of.low, of.high, int(rows[:, column].sum()), "")
    return found


def doubts(results: Results) -> str:
    """Reasons of `ours` for doubt, and how often what it doubted was wrong."""
    silent = "(none)"
    claims = [m for m in matches_of(results.of(OURS, ALL)) if m.found not in (None, "unknown")]
    doubted = Counter(reason for m in claims for reason in m.unsure or (silent,))
    wrong = Counter(reason for m in claims if not m.right for reason in m.unsure or (silent,))
    reasons = [(reason, str(count), str(wrong[reason])) for reason, count in doubted.most_common()]
    return markdown("", ("reason for doubt", "detections", "of these wrong"), reasons)
