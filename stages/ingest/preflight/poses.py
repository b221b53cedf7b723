"""Do the poses agree with the pictures, and when they do not, what single mistake explains it?

Every hypothesis (a convention, a scale of the translations, a focal length, a lag) is scored on the same pairs of
frames. A claim needs three things: a fit that is good in itself, a clear ratio to what it is compared with, and most
of the pairs in favour. Thresholds were set on generated rooms and are measured in docs/LOGS.md.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
from scenewright.stages.ingest.pose_convention_names import POSE_CONVENTIONS, PoseConvention
from scenewright.stages.ingest.pose_conventions import converted
from scenewright.stages.ingest.preflight.fits import Fit
from scenewright.stages.ingest.preflight.report import Hypothesis, PoseReport, PoseVerdict, exact, significant

SCALES = tuple(float(f"{10 ** (k / 3):.6g}") for k in range(-9, 10))
"""Scales of the translations that are searched: a factor 2.15 apart, which a fit is broad enough to bridge."""
FOCAL_FACTORS = (0.5, 0.6, 0.7, 0.8, 0.87, 0.93, 1.07, 1.15, 1.25, 1.4, 1.65, 2.0)
"""Factors of the focal length that are searched, closer around 1; by eye."""
LAGS = (-5, -4, -3, -2, -1, 1, 2, 3, 4, 5)
"""Lags between poses and pictures that are searched [frames]."""
CLEARLY_BETTER = 0.75
"""Ratio of costs up to which one candidate is clearly better than another."""
MOST_PAIRS = 0.7
"""Share of the pairs in which a better candidate must win."""
MOTION_RATIO = 0.8
"""Poses that agree must cost less than this share of no motion at all, or the pairs say nothing about them."""
COMBINED_COST = 1.1
"""Two mistakes at once must explain more than one."""
LEAST_PAIRS = 2
"""Fewest pairs of frames with which poses are checked."""
LEAST_OVERLAP = 0.25
"""Smallest overlap of a pair that may be called bad; with less, what is hidden decides."""


class Pairs(Protocol):
    """DepthPairs or FeaturePairs."""

    pairs: list[tuple[int, int]]

    def fit(self, poses: np.ndarray, focal_factor: float = 1.0) -> Fit:
        """Score poses (N, 4, 4)."""
        ...

    def fit_motionless(self) -> Fit:
        """Score no motion."""
        ...


@dataclass(frozen=True)
class Measure:
    """What residuals mean with one method."""

    name: Literal["depth", "epipolar"]
    good: float
    """Residual up to which frames agree."""
    bad: float
    """Residual over which they contradict each other whatever the reason."""
    unit: str
    factor: float
    sees_scale: bool
    still: float
    """Residual of no motion up to which the pairs cannot tell poses apart."""

    def words(self, residual: float) -> str:
        """Return `0.8 %` or `1.2 pixels`."""
        number = self.factor * residual
        return f"{number:.2g} {self.unit}" if number < 99.5 else f"over 99 {self.unit}"


BY_DEPTH = Measure("depth", 0.03, 0.06, "%", 100.0, sees_scale=True, still=0.02)
"""Residuals of depth as shares of depth: 3 % is good, 6 % is bad; by eye."""
BY_FEATURES = Measure("epipolar", 2.0, 4.0, "pixels", 1.0, sees_scale=False, still=1.0)
"""Residuals of features [px]: 2 is good, 4 is bad; by eye."""


@dataclass(frozen=True)
class Candidate:
    """A hypothesis with its fit."""

    fit: Fit
    convention: PoseConvention = "as-is"
    scale: float = 1.0
    focal: float = 1.0
    lag: int = 0

    @property
    def cost(self) -> float:
        """What candidates are ranked by."""
        changes = (self.convention != "as-is") + (self.scale != 1) + (self.focal != 1) + (self.lag != 0)
        return self.fit.cost * (COMBINED_COST if changes > 1 else 1.0)

    def poses(self, poses: np.ndarray) -> np.ndarray:
        """Return what it makes of poses (N, 4, 4)."""
        shifted = poses[np.clip(np.arange(len(poses)) + self.lag, 0, len(poses) - 1)] if self.lag else poses
        return converted(shifted, self.convention, self.scale)

    def differs(self, other: Candidate) -> bool:
        """Whether two candidates say something different, rather than nearly the same number."""
        return (
            self.convention != other.convention
            or not 0.6 < self.scale / other.scale < 1.67
            or not 0.85 < self.focal / other.focal < 1.18
            or (self.lag != other.lag and (self.lag * other.lag <= 0 or abs(self.lag - other.lag) > 1))
        )

    def report(self) -> Hypothesis:
        """Return it as the document has it."""
        return Hypothesis(
            convention=self.convention,
            translation_scale=exact(self.scale),
            focal_factor=exact(self.focal),
            lag=self.lag,
            residual=exact(self.fit.residual),
            cost=exact(self.fit.cost),
            overlap=exact(self.fit.overlap),
        )


@dataclass(frozen=True)
class PoseOutcome:
    """The report, and what the page and other checks need beside it."""

    report: PoseReport
    as_is: Candidate | None = None
    best: Candidate | None = None
    pairs: Pairs | None = None
    focal: Candidate | None = None
    """Best focal length with the poses as they are."""


def check_poses(pairs: Pairs, poses: np.ndarray, times: np.ndarray, measure: Measure) -> PoseOutcome:
    """Judge poses (N, 4, 4) of the selected frames at `times` (N,) [s] by prepared pairs of them."""
    if len(pairs.pairs) < LEAST_PAIRS:
        needed = "depth in common" if measure is BY_DEPTH else "matching features and some motion"
        detail = f"cannot be checked: {len(pairs.pairs)} pairs of frames with {needed}, {LEAST_PAIRS} are needed"
        return PoseOutcome(PoseReport(verdict="not checked", method="none", detail=detail, pairs=len(pairs.pairs)))
    as_is = Candidate(pairs.fit(poses))
    still = pairs.fit_motionless()
    candidates = [as_is, *_single_changes(pairs, poses, measure)]
    best = min(candidates, key=lambda c: c.cost)
    if as_is.fit.residual > measure.good or _better(best, as_is):
        best = _search(pairs, poses, candidates, measure)
        candidates.append(best)
    fine_scale = _fine_scale(pairs, poses, best if _better(best, as_is) else as_is) if measure.sees_scale else None
    focal = min((c for c in candidates if c.focal != 1), key=lambda c: c.cost, default=None)
    report = _judge(candidates, as_is, best, still, fine_scale, pairs, times, measure)
    return PoseOutcome(report, as_is, best, pairs, focal)


def _single_changes(pairs: Pairs, poses: np.ndarray, measure: Measure) -> list[Candidate]:
    changes = [Candidate(pairs.fit(converted(poses, n)), n) for n in POSE_CONVENTIONS if n != "as-is"]
    if measure.sees_scale:
        changes += [Candidate(pairs.fit(converted(poses, "as-is", s)), scale=s) for s in SCALES if s != 1]
        changes += [Candidate(pairs.fit(poses, f), focal=f) for f in FOCAL_FACTORS]
    if len(poses) > 3 * max(LAGS):
        for lag in LAGS:
            late = Candidate(as_is_fit(), lag=lag)
            changes.append(Candidate(pairs.fit(late.poses(poses)), lag=lag))
    return changes


def as_is_fit() -> Fit:
    """A fit of no pairs, for candidates that only convert."""
    return Fit(np.zeros(0), np.zeros(0), np.zeros(0))


def _better(first: Candidate, second: Candidate) -> bool:
    return first.cost < CLEARLY_BETTER * second.cost and first.fit.wins(second.fit) >= MOST_PAIRS


def _search(pairs: Pairs, poses: np.ndarray, candidates: list[Candidate], measure: Measure) -> Candidate:
    """Return the best of all single changes and of conventions with scales, the scale refined.

    One change that explains everything is tried with other scales only; otherwise every convention is.
    """
    candidates_so_far = list(candidates)
    if measure.sees_scale:
        best = min(candidates_so_far, key=lambda c: c.cost)
        rivals = [c for c in candidates_so_far if c.differs(best)]
        clear = best.fit.residual <= measure.good / 2 and all(_better(best, rival) for rival in rivals)
        names = POSE_CONVENTIONS[1:] if not clear else (best.convention,) if best.convention != "as-is" else ()
        for name in names:
            candidates_so_far += [_scaled(pairs, poses, name, scale) for scale in SCALES if scale != 1]
        ranked = sorted((c for c in candidates_so_far if not c.lag and c.focal == 1), key=lambda c: c.cost)
        for start in ranked[: 2 if clear else 6]:
            candidates_so_far += [
                _scaled(pairs, poses, start.convention, start.scale * f) for f in (0.7, 0.84, 1.19, 1.43)
            ]
    best = min(candidates_so_far, key=lambda c: c.cost)
    if measure.sees_scale and best.scale != 1:
        for step in (1.1, 1.05, 1.02):
            neighbours = [_scaled(pairs, poses, best.convention, best.scale * f) for f in (1 / step, step)]
            best = min([best, *neighbours], key=lambda c: c.cost)
        best = _round_scale(pairs, poses, best)
    return best


def _scaled(pairs: Pairs, poses: np.ndarray, name: PoseConvention, scale: float) -> Candidate:
    return Candidate(pairs.fit(converted(poses, name, scale)), name, scale)


ROUND_SCALES = (0.001, 0.01, 0.1, 0.2, 1 / 6.5535, 1.0, 5.0, 6.5535, 10.0, 100.0, 1000.0)
"""Scales that come from units: powers of ten, and the depth divisors 5000 and 6553.5 against 1000."""


def round_scale(scale: float) -> float:
    """Return the unit ratio that a measured scale is, or the scale itself when it is near none."""
    nearest = min(ROUND_SCALES, key=lambda round_number: abs(np.log(scale / round_number)))
    return nearest if abs(np.log(scale / nearest)) < np.log(1.12) else scale


def _round_scale(pairs: Pairs, poses: np.ndarray, best: Candidate) -> Candidate:
    scale = round_scale(best.scale)
    if scale == best.scale:
        return best
    rounded = _scaled(pairs, poses, best.convention, scale)
    return rounded if rounded.fit.cost < 1.15 * best.fit.cost else best


def _fine_scale(pairs: Pairs, poses: np.ndarray, about: Candidate) -> float | None:
    """Return the scale of the translations that fits best, beside a candidate; None where the pairs cannot tell."""
    if about.focal != 1 or about.lag:
        return None
    factors = np.array([0.75, 0.85, 0.92, 0.96, 1.0, 1.04, 1.09, 1.18, 1.33])
    costs = np.array([_scaled(pairs, poses, about.convention, about.scale * f).fit.cost for f in factors])
    low = int(np.argmin(costs))
    if min(costs[0], costs[-1]) < 1.15 * costs[low] or low in (0, len(factors) - 1):
        return None
    x = np.log(factors[low - 1 : low + 2])
    a, b, _ = np.polyfit(x, costs[low - 1 : low + 2], 2)
    center = float(np.clip(-b / (2 * a), x[0], x[2])) if a > 0 else x[1]
    return float(about.scale * np.exp(center))


def _judge(
    candidates: Iterable[Candidate],
    as_is: Candidate,
    best: Candidate,
    still: Fit,
    fine_scale: float | None,
    pairs: Pairs,
    times: np.ndarray,
    measure: Measure,
) -> PoseReport:
    ranked = sorted(candidates, key=lambda c: c.cost)
    others = [c for c in ranked if c.differs(best)]
    runner_up = others[0] if others else None
    moved = as_is.fit.cost < MOTION_RATIO * still.cost
    words = measure.words
    named_best: Candidate | None = None
    decisive = turns_only = False
    verdict: PoseVerdict
    if best is not as_is and _better(best, as_is):
        named_best = best
        fits = best.fit.residual <= measure.good
        stands = still.cost * CLEARLY_BETTER < best.fit.cost  # no motion at all explains the frames nearly as well
        decisive = fits and not stands and (runner_up is None or _better(best, runner_up))
        grave = as_is.fit.residual > measure.good or (decisive and as_is.fit.cost > 2 * best.fit.cost)
        verdict = "contradict" if grave and not best.lag and best.focal == 1 else "doubtful"
        detail = (
            f"median residual {words(as_is.fit.residual)} as they are, {words(best.fit.residual)} with another reading"
        )
        if stands:
            verdict = "contradict" if as_is.fit.residual > measure.bad else "doubtful"
            detail = f"median residual {words(as_is.fit.residual)}, but {words(still.residual)} with no motion at all"
        turns_only = not decisive and _turns_only(best, ranked)
        if turns_only:
            detail = f"median residual {words(as_is.fit.residual)}, {words(best.fit.residual)} without the translations"
    elif moved and as_is.fit.residual <= measure.good:
        verdict, detail = "agree", f"median residual {words(as_is.fit.residual)} over {len(pairs.pairs)} pairs"
    elif moved:
        verdict = "contradict" if as_is.fit.residual > measure.bad else "doubtful"
        detail = f"median residual {words(as_is.fit.residual)} over {len(pairs.pairs)} pairs, and no usual flip fits"
    elif still.residual <= measure.still:
        verdict = "not checked"
        detail = (
            f"cannot be checked: too little motion; frames agree within {words(still.residual)} with no motion at all, "
            f"within {words(as_is.fit.residual)} with the poses"
        )
    else:
        verdict = "contradict" if as_is.fit.residual > measure.good else "doubtful"
        detail = (
            f"the camera moves, and the poses do not tell how: median residual {words(as_is.fit.residual)}, "
            f"{words(still.residual)} with no motion at all"
        )
    bad = _bad_pairs(as_is.fit, measure) if verdict == "agree" else np.zeros(0, dtype=int)
    bad_times = sorted({float(times[pairs.pairs[k][0]]) for k in bad})
    reported = [as_is, *_candidates_to_report(ranked, as_is)]
    return PoseReport(
        verdict=verdict,
        method=measure.name,
        detail=detail,
        pairs=len(pairs.pairs),
        hypotheses=tuple(candidate.report() for candidate in reported),
        motionless=Hypothesis(
            convention="motionless",
            residual=exact(still.residual),
            cost=exact(still.cost),
            overlap=exact(still.overlap),
        ),
        scale_fit=significant(fine_scale, 3),
        best=named_best.report() if named_best else None,
        runner_up=runner_up.report() if named_best and runner_up else None,
        decisive=decisive,
        turns_only=turns_only,
        lag_frames=best.lag if decisive and best.lag else None,
        bad_pairs=len(bad),
        bad_times=tuple(exact(time, 15) for time in bad_times[:8]),
    )


def _turns_only(best: Candidate, ranked: list[Candidate]) -> bool:
    """Whether leaving the translations out (the smallest scale) is about as good as the best, which nearly does."""
    left_out = [c for c in ranked if c.convention == "as-is" and c.scale == min(SCALES)]
    short = best.convention == "as-is" and best.scale < 0.3
    return short and bool(left_out) and left_out[0].cost < 1.15 * best.cost


def _bad_pairs(fit: Fit, measure: Measure) -> np.ndarray:
    """Indices of pairs that disagree although most agree."""
    overlapping = fit.overlaps > LEAST_OVERLAP
    return np.flatnonzero(overlapping & (fit.residuals > measure.bad) & (fit.residuals > 4 * fit.residual))


def _candidates_to_report(ranked: list[Candidate], as_is: Candidate) -> list[Candidate]:
    """The conventions, the powers of ten, the best scale, focal length and lag: what a person wants to see."""
    reported, kinds = [], set()
    for candidate in ranked:
        kind = (
            candidate.convention,
            "focal" if candidate.focal != 1 else "",
            "lag" if candidate.lag else "",
            candidate.scale if candidate.scale in ROUND_SCALES else "scale",
        )
        combined = candidate.convention != "as-is" and candidate.scale != 1
        if candidate is not as_is and kind not in kinds and (not combined or candidate is ranked[0]):
            kinds.add(kind)
            reported.append(candidate)
    return reported
