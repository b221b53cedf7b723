"""Whether what both eyes show is a needle at all: how well the best outline fits the mask about it, in absolute terms.

`evidence` weighs outlines against each other, and of any heap of pixels one of them is the best. Here that one stands a
test by itself: the logistic function of a few shares. What lies elsewhere in the picture says nothing. The weights were
fitted on rendered tuning views with a needle and without one (`python -m benchmarks.training.needle_presence`), where a
wrong outline of a needle counts as none; no real picture was used. Whether both eyes agree piece by piece, in how long
a stretch, and how wide the mask is near the ends, added nothing to these.
"""

from __future__ import annotations

import cv2
import numpy as np
from scenewright.stages.suture.needle.evidence import COVERED
from scenewright.stages.suture.needle.silhouette import Outline, Sheet, arc_at, draw, trace
from scenewright.stages.suture.rig import StereoRig

FEWEST = 10
"""Pixels of a patch of mask within the outline for which the patch is held against it."""
EDGE_ON = 0.25
"""Quarter turns from edge-on beyond which it makes no difference."""
FEATURES = ("filled_least", "own", "facing")
WEIGHTS = np.array([6.8, 16.79, 19.1])
"""Weights (3,) of FEATURES, fitted on rendered tuning views (`python -m benchmarks.training.needle_presence`)."""
BIAS = -23.27
"""Constant of the logistic function, fitted with WEIGHTS."""


def presence_features(rig: StereoRig, sheets: tuple[Sheet, Sheet], outline: Outline) -> np.ndarray:
    """Return FEATURES (3,) of an outline, from 0 to 1.

    How much of its area is mask in the worse eye; of the patches of mask that it touches, how much it explains (a
    streak goes on beyond it); how far it is from edge-on, in quarter turns and at most EDGE_ON (edge-on, any streak is
    a needle).
    """
    arc = arc_at(rig, outline.pose.camera_from_needle, outline.shift)
    inside, filled, explained, patches = np.zeros(2), np.zeros(2), np.zeros(2), np.zeros(2)
    for eye, sheet in enumerate(sheets):
        _, pixels = trace(arc, sheet.corner, eye)
        draw(pixels, arc.growth, COVERED + 0.5, 1, sheet.drawn, sheet.piece)
        covered = (sheet.piece >= 0) & (sheet.drawn <= COVERED)
        within = covered & (sheet.drawn <= 0.0) & ~sheet.silent
        sheet.piece[:] = -1
        inside[eye], filled[eye] = within.sum(), (within & sheet.free).sum()
        explained[eye], patches[eye] = _explained_pixels(sheet.free, covered)
    return np.array(
        [
            (filled / np.maximum(inside, 1.0)).min(),
            explained.sum() / max(patches.sum(), 1.0),
            min(outline.pose.degrees_from_edge_on() / 90.0, EDGE_ON),
        ]
    )


def _explained_pixels(mask: np.ndarray, near: np.ndarray) -> tuple[float, float]:
    """Return the pixels of the patches of `mask` that the outline touches, near it and altogether."""
    count, labels = cv2.connectedComponents(mask.astype(np.uint8), connectivity=8)
    covered_count = np.bincount(labels[mask & near], minlength=count)
    patch_size = np.bincount(labels[mask], minlength=count)
    touched = covered_count >= FEWEST
    return float(covered_count[touched].sum()), float(patch_size[touched].sum())


def presence_probability(features: np.ndarray) -> float:
    """Return how probable it is that an outline is that of a needle, given FEATURES (3,)."""
    return float(1.0 / (1.0 + np.exp(-np.clip(BIAS + WEIGHTS @ features, -30.0, 30.0))))
