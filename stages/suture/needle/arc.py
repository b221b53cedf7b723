"""Where on its circle the needle lies, and which end is the tip."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stages.suture.needle.refine import CALIBRATION_SIGMA, CIRCLE_ANGLES, RESIDUAL_SIGMA, CircleFit
from stages.suture.rig import NEEDLE_RADIUS, StereoRig

SEEN_GAIN, MISSED_LOSS = 1.8, 0.8
"""Log-likelihood ratio of a cross-section that is seen, or not, for lying within the needle rather than beyond it: the
needle can be lost (glare, tissue), what is not needle is seldom seen just there."""
CORRELATED = 4.0
HALF = len(CIRCLE_ANGLES) // 2
UNSEEN_WIDTH, SEEN_WIDTH = 0.3, 1.3
"""Widths [px] of the wire up to which a mask does not show it, and from which it does."""
TAPER_ANGLE = 0.7
"""The tip's taper runs over this angle of the arc [rad]: 8.4 mm, as needles of this kind are ground."""


@dataclass(frozen=True)
class Arc:
    """The half circle begins at `start` [rad] with standard deviation `deviation` [rad]; `seen` (2,) are the shares of
    its cross-sections each eye sees; `likelihood` is the logarithm of the circle's and arc's, to compare fits by."""

    start: float
    deviation: float
    seen: np.ndarray
    likelihood: float


def place_arc(fit: CircleFit, tip_at_start: bool | None = None) -> Arc:
    """Return the half circle that best holds what is seen and leaves out what is not.

    Where it is known which end is the tip, nothing is held against the arc for not being seen where its taper is
    thinner than a pixel or so: masks end before the tip does.
    """
    seen = np.isfinite(fit.offsets)
    gain = np.where(seen, SEEN_GAIN, 0.0).sum(axis=0) / CORRELATED
    loss = np.where(seen | fit.hidden, 0.0, MISSED_LOSS) / CORRELATED
    rows = (np.arange(len(CIRCLE_ANGLES))[:, None] + np.arange(HALF)) % len(CIRCLE_ANGLES)
    counted: np.ndarray | float = 1.0
    if tip_at_start is not None:
        from_tip = (np.arange(HALF) + 0.5) * (CIRCLE_ANGLES[1] - CIRCLE_ANGLES[0])
        width = fit.expected[:, rows] * _profile(from_tip if tip_at_start else from_tip[::-1])
        counted = np.clip((width - UNSEEN_WIDTH) / (SEEN_WIDTH - UNSEEN_WIDTH), 0.0, 1.0)
    scores = gain[rows].sum(axis=1) - (loss[:, rows] * counted).sum(axis=(0, 2))
    best = int(np.argmax(scores))
    weight = np.exp(scores - scores[best])
    away = (CIRCLE_ANGLES - CIRCLE_ANGLES[best] + np.pi) % (2 * np.pi) - np.pi
    mean = float((weight * away).sum() / weight.sum())
    deviation = float(np.sqrt((weight * (away - mean) ** 2).sum() / weight.sum() + np.radians(1.5) ** 2))
    inside = np.roll(seen, -best, axis=1)[:, :HALF]
    misfit = np.minimum((np.where(seen, fit.offsets, 0.0) / RESIDUAL_SIGMA) ** 2, 9.0)
    misfit_inside = np.roll(misfit, -best, axis=1)[:, :HALF].sum() / CORRELATED
    likelihood = scores[best] - 0.5 * misfit_inside - 0.5 * float(fit.shift @ fit.shift) / CALIBRATION_SIGMA**2
    # cross-section i stands for the angles between i - 1/2 and i + 1/2
    half_step = (CIRCLE_ANGLES[1] - CIRCLE_ANGLES[0]) / 2.0
    start = float(CIRCLE_ANGLES[best] + mean - half_step)
    return Arc(start, deviation, inside.mean(axis=1), float(likelihood))


def tip_at_start(
    fit: CircleFit, arc: Arc, rig: StereoRig, threads: tuple[np.ndarray | None, np.ndarray | None]
) -> float:
    """Return the log-odds that the arc's start, not its end, is the tip: by the wire's taper and by the thread.

    `threads` are each eye's mask (H, W) of thread or None.
    """
    odds = 0.0
    along = (CIRCLE_ANGLES - arc.start) % (2 * np.pi)
    for eye in (0, 1):
        valid = np.isfinite(fit.widths[eye]) & (along < np.pi)
        if valid.sum() > 12:
            odds += _taper_odds(fit.widths[eye][valid], fit.expected[eye][valid], along[valid])
    for eye, thread in enumerate(threads):
        if thread is not None:
            odds += _thread_odds(fit, arc, rig, thread, eye)
    return float(np.clip(odds, -12.0, 12.0))


def _profile(from_tip: np.ndarray) -> np.ndarray:
    """Return the wire's width over its full width at arc angles from the tip [rad]."""
    along = np.clip(from_tip / TAPER_ANGLE, 0.0, 1.0)
    return 1.0 - (1.0 - along) ** 1.6


def _taper_odds(widths: np.ndarray, expected: np.ndarray, along: np.ndarray) -> float:
    """Return the log-odds from the widths of the mask's runs: both ways round, with the outline's growth fitted."""
    costs = []
    for from_tip in (along, np.pi - along):
        model = expected * _profile(from_tip)
        growth = float(np.median(widths - model))
        costs.append(float((np.minimum(np.abs(widths - model - growth) / 0.8, 3.0) ** 2).sum()))
    return (costs[1] - costs[0]) / 2.0 / 6.0


def _thread_odds(fit: CircleFit, arc: Arc, rig: StereoRig, thread: np.ndarray, eye: int) -> float:
    """Return the log-odds from thread that goes on, tangent to the arc, from its end and not from its start."""
    shares = []
    for end, onward in ((arc.start, -1.0), (arc.start + np.pi, 1.0)):
        u, v = fit.frame[:, 0], fit.frame[:, 1]
        place = fit.centre + NEEDLE_RADIUS * (np.cos(end) * u + np.sin(end) * v)
        tangent = onward * (np.cos(end) * v - np.sin(end) * u)
        beyond = place + np.linspace(0.0005, 0.0035, 7)[:, None] * tangent
        pixels = (rig.right(beyond) + fit.shift) if eye else rig.left(beyond)
        if not np.isfinite(pixels).all():
            return 0.0
        found = []
        for column, row in np.round(pixels).astype(int):
            window = thread[max(row - 3, 0) : max(row + 4, 0), max(column - 3, 0) : max(column + 4, 0)]
            found.append(bool(window.any()))
        shares.append(float(np.mean(found)))
    return 4.0 * (shares[1] - shares[0])
