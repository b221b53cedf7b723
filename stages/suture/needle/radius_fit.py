"""The needle's radius where nobody knows it: one more parameter of the outline's fit, with what it is known to.

A rectified pair of known baseline measures lengths, so masks tell a needle's size from its distance. Radii are tried by
the eyes' distance (radius.py): over a coarse grid the outline that fits both masks best, then about the best radius
parabolas through three fits, each narrower than the one before. The misfit's curvature along the radius, with pose and
calibration fitted anew at each, is its information; the calibration's prior limits it. Wire and taper are taken to be
the usual needle's made smaller or larger.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from stages.suture.needle.estimate import COARSE_LEVELS, NARROW_LEVELS, POLISH, SAMPLED, VARIANCE, estimate
from stages.suture.needle.filter import SHARED, difference
from stages.suture.needle.observation import NeedleEstimate, NeedleObservation
from stages.suture.needle.radius import as_if_usual, in_metres, pose_scaled
from stages.suture.needle.silhouette import Outline, Sheet, fit_outline, sheet_of
from stages.suture.needle.starts import starts
from stages.suture.needle.windows import windows
from stages.suture.rig import NEEDLE_RADIUS, NeedlePose, StereoRig

TRIED = np.geomspace(0.006, 0.020, 10)
"""Radii of the grid [m]: those of suture needles for tissue, a seventh apart."""
STARTS, REFINED = 6, 2
"""Outlines begun with at each radius of the grid; radii from which the best is sought."""
WIDTHS = (0.06, 0.02, 0.01)
"""Half of what a parabola spans, as a share of the radius: the last one's curvature is the information."""
FARTHEST_STEP = 2.0
"""A parabola's least is looked for within so many of its half widths."""


@dataclass(frozen=True)
class Radius:
    """A radius [m] and its standard deviation [m]."""

    metres: float
    deviation: float


def estimate_without_radius(observation: NeedleObservation, seed: int = 0) -> tuple[NeedleEstimate, Radius | None]:
    """Return the pose [m] of a needle of unknown radius, what the radius is in its covariance, and the radius; None
    with an abstention for want of any outline. Raises BadInput as `estimate`."""
    observation.check()
    radius = fitted_radius(observation, seed)
    if radius is None:
        return estimate(observation, seed), None
    return estimate_with(observation, radius, seed), radius


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
    ends = [pose_scaled(at(1.0 + side).pose, radius.metres * (1.0 + side) / NEEDLE_RADIUS) for side in (-width, width)]
    slope = difference(ends[0], ends[1]) / (2.0 * width * radius.metres)
    return replace(told, covariance=told.covariance + radius.deviation**2 * np.outer(slope, slope))


def fitted_radius(observation: NeedleObservation, seed: int = 0) -> Radius | None:
    """Return the radius at which an outline fits both masks best; None where none fits at any that is tried."""
    if min(int(mask.sum()) for mask in (observation.left_mask, observation.right_mask)) == 0:
        return None
    sheets, eyes = _sheets(observation), windows(observation)
    found: list[tuple[Outline, float]] = []
    for radius in TRIED:
        rig = as_if_usual(observation.rig, float(radius))
        begun = starts(rig, eyes, np.empty((0, 3)), STARTS, SAMPLED, np.random.default_rng(seed))
        found += [(fit_outline(rig, sheets, pose, np.zeros(2), COARSE_LEVELS), float(radius)) for pose in begun]
    found.sort(key=lambda pair: pair[0].misfit)
    refined = [_refined(observation.rig, sheets, outline, radius) for outline, radius in found[:REFINED]]
    sound = [one for one in refined if one is not None]
    return min(sound, key=lambda one: one[0])[1] if sound else None


def together(radii: Sequence[Radius]) -> Radius:
    """Return one needle's radius from several frames (one at least) by their information; errors that frames share, the
    calibration's, do not shrink."""
    weights = np.array([1.0 / radius.deviation**2 for radius in radii])
    mean = float(weights @ [radius.metres for radius in radii] / weights.sum())
    alone = float(np.mean([radius.deviation**2 for radius in radii]))
    return Radius(mean, float(np.sqrt(SHARED * alone + (1.0 - SHARED) / weights.sum())))


def _refined(
    rig: StereoRig, sheets: tuple[Sheet, Sheet], outline: Outline, radius: float
) -> tuple[float, Radius] | None:
    """Return the least misfit about a radius, and that radius; None where the misfit has no least there."""
    for width in WIDTHS:
        at = _profile(rig, sheets, outline.pose, outline.shift, radius)
        below, outline, above = at(1.0 - width), at(1.0), at(1.0 + width)
        bend = above.misfit - 2.0 * outline.misfit + below.misfit
        if bend <= 0.0:
            return None
        step = np.clip(0.5 * (below.misfit - above.misfit) / bend, -FARTHEST_STEP, FARTHEST_STEP)
        information = 0.5 * bend / (width * radius) ** 2
        moved = radius * (1.0 + float(step) * width)
        outline = replace(outline, pose=at(1.0 + float(step) * width).pose)
        radius = moved
    return outline.misfit, Radius(radius, float(np.sqrt(VARIANCE / information)))


def _profile(
    rig: StereoRig, sheets: tuple[Sheet, Sheet], pose: NeedlePose, shift: np.ndarray, radius: float
) -> Callable[[float], Outline]:
    """Return what fits the outline at a multiple of `radius`, from an outline that fitted there. Poses are those of
    `as_if_usual`'s rig of the radius they belong to."""

    def at(factor: float) -> Outline:
        begun = pose_scaled(pose, 1.0 / factor)
        return fit_outline(as_if_usual(rig, radius * factor), sheets, begun, shift, NARROW_LEVELS, POLISH)

    return at


def _sheets(observation: NeedleObservation) -> tuple[Sheet, Sheet]:
    left, right = windows(observation)
    return sheet_of(left), sheet_of(right)
