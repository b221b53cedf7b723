"""Figures of an arm over other arms on the same tables."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from benchmarks.experiment import Results, ratio
from benchmarks.tabulation import Figure

SAME = 1e-6


def against(results: Results, arm: str, case: str, rival: str = "random", ending: str = "") -> dict[str, Figure | None]:
    """Return the ratios against a rival: its time over the arm's, the arm's objects a trip over its."""
    pairs = results.pairs(arm, rival, case)
    return {
        f"{arm}/{case}/time_ratio{ending}": ratio([(b.time, a.time) for a, b in pairs]),
        f"{arm}/{case}/objects_per_trip_ratio{ending}": ratio(
            [(a.objects_per_trip, b.objects_per_trip) for a, b in pairs]
        ),
    }


def no_slower(results: Results, arm: str, case: str, name: str = "time") -> float | None:
    """Return the share of tables on which an arm takes no longer than the better of Pull and Stack."""
    shares = []
    for seed in results.seeds(case):
        runs = [results.get(each, case, seed) for each in (arm, "pull", "stack")]
        if None not in runs:
            own, *others = (getattr(run, name) for run in runs)
            shares.append(own <= min(others) + SAME)
    return float(np.mean(shares)) if shares else None


def faster(results: Results, arm: str, case: str) -> dict[str, Figure | None]:
    """Return by what share of its time an arm takes less than Pull and than Stack, over the same tables."""
    flat: dict[str, Figure | None] = {}
    for rival in ("pull", "stack"):
        over = ratio([(a.time, b.time) for a, b in results.pairs(arm, rival, case)])
        flat[f"{arm}/{case}/faster_than_{rival}"] = one_less(over)
    return flat


def one_less(share: Figure | None) -> Figure | None:
    """Return one less a share."""
    if share is None or share.low is None or share.high is None:
        return share and replace(share, value=1 - share.value)
    return replace(share, value=1 - share.value, low=1 - share.high, high=1 - share.low)
