"""Whether what both eyes show is a needle at all: how well the best outline fits the mask about it, in absolute terms.

`evidence` weighs outlines against each other, and of any heap of pixels one of them is the best. Here that one stands a
test by itself: the logistic function of a few shares. What lies elsewhere in the picture says nothing. The weights were
fitted on rendered tuning views with a needle and without one (`python -m benchmarks.training.needle_presence`); no real
picture was used.
"""

from __future__ import annotations

import cv2
import numpy as np

from stages.suture.needle.evidence import COVERED, Evidence
from stages.suture.needle.silhouette import PIECES, Outline, Sheet, arc_at, draw, trace
from stages.suture.rig import StereoRig

FEWEST = 10
"""Pixels of a patch of mask within the outline for which the patch is held against it."""
EDGE_ON = 0.25
"""Quarter turns from edge-on beyond which it makes no difference."""
FEATURES = ("filled_least", "solid", "own", "facing", "one_sided", "widths")
WEIGHTS = np.array([6.63, 1.87, 14.41, 25.25, 6.89, -1.55])
BIAS = -23.02


def presence_features(rig: StereoRig, sheets: tuple[Sheet, Sheet], outline: Outline, evidence: Evidence) -> np.ndarray:
    """Return FEATURES (6,) of an outline, from 0 to 1 but for the last.

    How much of its area is mask in the worse eye; that, or how much of what both eyes see of it lies in one stretch,
    whichever is more (a needle is seen nearly whole or in a piece, a ring of glints neither); of the patches of mask
    that it touches, how much it explains (a streak goes on beyond it); how far it is from edge-on, in quarter turns and
    at most EDGE_ON (edge-on, any streak is a needle); how many of its pieces one eye alone misses; the mean squared
    error of the widths near its ends.
    """
    arc = arc_at(rig, outline.pose.camera_from_needle, outline.shift)
    inside, filled, own, patches = np.zeros(2), np.zeros(2), np.zeros(2), np.zeros(2)
    for eye, sheet in enumerate(sheets):
        _, pixels = trace(arc, sheet.corner, eye)
        draw(pixels, arc.growth, COVERED + 0.5, 1, sheet.drawn, sheet.piece)
        near = (sheet.piece >= 0) & (sheet.drawn <= COVERED)
        within = near & (sheet.drawn <= 0.0) & ~sheet.silent
        sheet.piece[:] = -1
        inside[eye], filled[eye] = within.sum(), (within & sheet.free).sum()
        own[eye], patches[eye] = _explained(sheet.free, near)
    filled_least = float((filled / np.maximum(inside, 1.0)).min())
    both = np.asarray(evidence.seen.all(axis=0))
    return np.array(
        [
            filled_least,
            max(filled_least, _longest(both) / max(int(both.sum()), 1)),
            own.sum() / max(patches.sum(), 1.0),
            min(outline.pose.degrees_from_edge_on() / 90.0, EDGE_ON),
            evidence.missing / PIECES,
            evidence.taper / (2 * PIECES),
        ]
    )


def _longest(flags: np.ndarray) -> int:
    """Return the length of the longest run of true `flags` (K,)."""
    changes = np.flatnonzero(np.diff(flags.astype(int), prepend=0, append=0))
    return int((changes[1::2] - changes[::2]).max(initial=0))


def _explained(mask: np.ndarray, near: np.ndarray) -> tuple[float, float]:
    """Return the pixels of the patches of `mask` that the outline touches, near it and altogether."""
    count, labels = cv2.connectedComponents(mask.astype(np.uint8), connectivity=8)
    own = np.bincount(labels[mask & near], minlength=count)
    whole = np.bincount(labels[mask], minlength=count)
    touched = own >= FEWEST
    return float(own[touched].sum()), float(whole[touched].sum())


def presence_probability(features: np.ndarray) -> float:
    """Return how probable it is that there is a needle, given FEATURES (6,)."""
    return float(1.0 / (1.0 + np.exp(-np.clip(BIAS + WEIGHTS @ features, -30.0, 30.0))))
