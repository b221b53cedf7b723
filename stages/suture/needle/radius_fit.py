"""The needle's radius where nobody knows it: one more parameter of the outline's fit, with what it is known to.

A rectified pair of known baseline measures lengths, so masks tell a needle's size from its distance. Radii are tried by
the eyes' distance (radius.py): over a coarse grid the outlines that fit both masks best, then parabolas about each of
them, from wide to narrow. Masks that are too wide look like a larger needle, so that their growth is fitted with the
radius. The misfit's curvature along both, with pose and calibration fitted anew at each, is their information; priors
of growth and calibration limit it. What the radius is known to holds the rivals' radii too, by the evidence for each.
Wire and taper are taken to be the usual needle's made smaller or larger.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scenewright.stages.suture.needle.estimate import (
    ALIKE,
    COARSE_LEVELS,
    NARROW_LEVELS,
    POLISH,
    SAME,
    SAMPLED,
    VARIANCE,
    estimate,
)
from scenewright.stages.suture.needle.evidence import evidence_of
from scenewright.stages.suture.needle.filter import SHARED, difference, either_way
from scenewright.stages.suture.needle.observation import NeedleEstimate, NeedleObservation
from scenewright.stages.suture.needle.radius import as_if_usual, in_metres, pose_scaled
from scenewright.stages.suture.needle.silhouette import GROWTH, Outline, Sheet, fit_outline, sheet_of
from scenewright.stages.suture.needle.starts import starts
from scenewright.stages.suture.needle.windows import EyeMask, windows
from scenewright.stages.suture.rig import NEEDLE_RADIUS, NeedlePose, StereoRig

TRIED = np.geomspace(0.006, 0.020, 10)
"""Radii of the grid [m]: those of suture needles for tissue, a seventh apart."""
STARTS, AT_A_RADIUS, REFINED = 6, 2, 8
"""Outlines begun with at each radius of the grid, and those of them that are kept; outlines from which the best radius
is sought."""
WIDTHS = (0.06, 0.02, 0.01)
"""Half of what each parabola spans, as a share of the radius: the last one's curvature is the information."""
CALIBRATED = 1.45
"""Deviations are larger than the fit's by this, so that two of them held 95 % of the errors in 79 tuning views (seeds
300 to 379, spoiled masks): lumps in masks err together over more pixels than VARIANCE counts."""
GROWTH_SIGMA, GROWTH_STEP = 0.3, 0.1
"""Prior standard deviation of the masks' growth [px], and half of what its parabola spans."""
FARTHEST_STEP, MOST_STEPS = 2.0, 4
"""A parabola's least is looked for within so many of its half widths, so often."""
OUTLYING = 3.0
"""A frame whose radius is off by more of its deviations than this is left out where frames count together."""
LEAST, MOST = 0.005, 0.024
"""Radii [m] beyond which no least is looked for."""


@dataclass(frozen=True)
class Radius:
    """A radius [m] and its standard deviation [m]."""

    metres: float
    deviation: float


def estimate_without_radius(observation: NeedleObservation, seed: int = 0) -> tuple[NeedleEstimate, Radius | None]:
    """Return the pose [m] of a needle of unknown radius, what the radius is in its covariance, and the radius; None
    with an abstention: what is no needle for sure has no radius. Raises BadInput as `estimate`."""
    observation.check()
    radius = fitted_radius(observation, seed)
    if radius is None:
        return estimate(observation, seed), None
    answer = estimate_with(observation, radius, seed)
    return answer, None if answer.abstained else radius


def estimate_with(observation: NeedleObservation, radius: Radius, seed: int = 0) -> NeedleEstimate:
    """Return the pose [m] of a needle whose radius was fitted: at that radius, with what it adds to the covariance."""
    usual = replace(observation, rig=as_if_usual(observation.rig, radius.metres))
    answer = estimate(usual, seed)
    return with_radius_unknown(in_metres(answer, radius.metres), answer, usual, radius)


def with_radius_unknown(
    told: NeedleEstimate, answer: NeedleEstimate, observation: NeedleObservation, radius: Radius
) -> NeedleEstimate:
    """Return an estimate [m] with what a radius' deviation adds to its covariance; `answer` is the same before the rig
    of `as_if_usual`, which `observation` has."""
    if answer.pose is None or not np.isfinite(answer.covariance).all():
        return told
    at = _profile(observation.rig, _sheets(observation), answer.pose, np.zeros(2), NEEDLE_RADIUS)
    width = WIDTHS[0]
    ends = [
        pose_scaled(at(1.0 + side, GROWTH).pose, radius.metres * (1.0 + side) / NEEDLE_RADIUS)
        for side in (-width, width)
    ]
    slope = difference(ends[0], ends[1]) / (2.0 * width * radius.metres)
    return replace(told, covariance=told.covariance + radius.deviation**2 * np.outer(slope, slope))


def fitted_radius(observation: NeedleObservation, seed: int = 0) -> Radius | None:
    """Return the radius at which an outline fits both masks best, and how far it and its rivals leave it open; None
    where none fits at any that is tried."""
    if min(int(mask.sum()) for mask in (observation.left_mask, observation.right_mask)) == 0:
        return None
    sheets, eyes = _sheets(observation), windows(observation)
    fits: list[_Fit] = []
    for metres in map(float, TRIED):
        rig = as_if_usual(observation.rig, metres)
        begun = starts(rig, eyes, np.empty((0, 3)), STARTS, SAMPLED, np.random.default_rng(seed))
        fits_of_radius = [_Fit(fit_outline(rig, sheets, pose, np.zeros(2), COARSE_LEVELS), metres) for pose in begun]
        fits += _different(sorted(fits_of_radius, key=_misfit), SAME)[:AT_A_RADIUS]
    fits.sort(key=_misfit)
    refined = [_refine(observation.rig, eyes, sheets, fit) for fit in _different(fits, SAME)[:REFINED]]
    return _radius_with_spread(
        _different(sorted((fit for fit in refined if fit), key=lambda fit: -fit.log_weight), ALIKE)
    )


@dataclass(frozen=True)
class _Fit:
    """An outline before the rig of `as_if_usual`, the radius [m] it was fitted at, the radius' variance [m^2], and what
    the evidence gives for it."""

    outline: Outline
    metres: float
    variance: float = 0.0
    log_weight: float = 0.0

    @property
    def pose(self) -> NeedlePose:
        """The pose before the rig as it is."""
        return pose_scaled(self.outline.pose, self.metres / NEEDLE_RADIUS)


def _misfit(fit: _Fit) -> float:
    return fit.outline.misfit


def _different(fits: list[_Fit], limits: tuple[float, float]) -> list[_Fit]:
    """Return the fits, of those within limits [m], [rad] of each other the first."""
    distinct: list[_Fit] = []
    for fit in fits:
        steps = (either_way(fit.pose, earlier.pose)[0] for earlier in distinct)
        if not any(np.linalg.norm(step[:3]) < limits[0] and np.linalg.norm(step[3:]) < limits[1] for step in steps):
            distinct.append(fit)
    return distinct


def _radius_with_spread(rivals: list[_Fit]) -> Radius | None:
    """Return the likeliest one's radius; its variance is that of all about it, each with its probability."""
    if not rivals:
        return None
    first = rivals[0]
    weights = np.exp([fit.log_weight - first.log_weight for fit in rivals])
    apart = np.array([fit.variance + (fit.metres - first.metres) ** 2 for fit in rivals])
    return Radius(first.metres, CALIBRATED * float(np.sqrt(weights @ apart / weights.sum())))


def together(radii: Sequence[Radius]) -> Radius:
    """Return one needle's radius from several frames (one at least) by their information; errors that frames share, the
    calibration's, do not shrink. Frames that are OUTLYING from the weighted median are left out: half hidden, a needle
    looks like a whole smaller one."""
    metres, deviations = (np.array(values) for values in zip(*((r.metres, r.deviation) for r in radii), strict=True))
    weights = 1.0 / deviations**2
    order = np.argsort(metres)
    upto = np.cumsum(weights[order])
    middle = metres[order][np.searchsorted(upto, 0.5 * upto[-1])]
    inlying = np.abs(metres - middle) <= OUTLYING * deviations
    metres, deviations, weights = metres[inlying], deviations[inlying], weights[inlying]
    alone = float(np.mean(deviations**2))
    mean = float(weights @ metres / weights.sum())
    return Radius(mean, float(np.sqrt(SHARED * alone + (1.0 - SHARED) / weights.sum())))


def _refine(rig: StereoRig, eyes: tuple[EyeMask, EyeMask], sheets: tuple[Sheet, Sheet], fit: _Fit) -> _Fit | None:
    """Return the fit with the least misfit about a radius; None where the misfit has no least there.

    Radius and growth of the masks are fitted together, by the misfit's second differences and the prior of the growth
    (Newton's steps); the radius' variance is that of the two, the growth's share in it.
    """
    outline, radius, growth, variance = fit.outline, fit.metres, GROWTH, 0.0
    for width in WIDTHS:
        for _ in range(MOST_STEPS):
            at = _profile(rig, sheets, outline.pose, outline.shift, radius)
            slope, bend = _parabola(at, growth, width)
            if bend[0, 0] > 0.0:
                step = np.clip(-np.linalg.solve(bend, slope), -FARTHEST_STEP, FARTHEST_STEP)
                variance = 2.0 * VARIANCE * float(np.linalg.inv(bend)[0, 0]) * (width * radius) ** 2
            else:
                step, variance = np.array([-np.sign(slope[0]) * FARTHEST_STEP, 0.0]), 0.0
            factor, growth = 1.0 + float(step[0]) * width, growth + float(step[1]) * GROWTH_STEP
            outline = at(factor, growth)
            radius *= factor
            if not LEAST < radius < MOST:
                return None
            if abs(step[0]) < 1.0:
                break
    if variance == 0.0:
        return None
    evidence = evidence_of(as_if_usual(rig, radius), eyes, sheets, outline)
    return _Fit(outline, radius, variance, evidence.log_weight)


def _parabola(at: Callable[[float, float], Outline], growth: float, width: float) -> tuple[np.ndarray, np.ndarray]:
    """Return first (2,) and second differences (2, 2) of the misfit with the growth's prior, in units of `width` of the
    radius and of GROWTH_STEP."""
    middle = at(1.0, growth).misfit
    narrower, wider = at(1.0 - width, growth).misfit, at(1.0 + width, growth).misfit
    thin, thick = at(1.0, growth - GROWTH_STEP).misfit, at(1.0, growth + GROWTH_STEP).misfit
    prior = 2.0 * VARIANCE * (GROWTH_STEP / GROWTH_SIGMA) ** 2
    slope = np.array([0.5 * (wider - narrower), 0.5 * (thick - thin) + prior * (growth - GROWTH) / GROWTH_STEP])
    across = at(1.0 + width, growth + GROWTH_STEP).misfit - wider - thick + middle
    bend = np.array([[wider - 2.0 * middle + narrower, across], [across, thick - 2.0 * middle + thin + prior]])
    if np.linalg.det(bend) <= 0.0:
        # far from the least the misfit is no bowl: the growth stays as it is
        return np.array([slope[0], 0.0]), np.diag([bend[0, 0], prior])
    return slope, bend


def _profile(
    rig: StereoRig, sheets: tuple[Sheet, Sheet], pose: NeedlePose, shift: np.ndarray, radius: float
) -> Callable[[float, float], Outline]:
    """Return what fits the outline at a multiple of `radius` and a growth [px], from an outline that fitted there.
    Poses are those of `as_if_usual`'s rig of the radius they belong to."""

    def at(factor: float, growth: float) -> Outline:
        begun = pose_scaled(pose, 1.0 / factor)
        return fit_outline(as_if_usual(rig, radius * factor), sheets, begun, shift, NARROW_LEVELS, POLISH, growth)

    return at


def _sheets(observation: NeedleObservation) -> tuple[Sheet, Sheet]:
    left, right = windows(observation)
    return sheet_of(left), sheet_of(right)
