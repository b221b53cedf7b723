"""Whether what both eyes show is a needle at all: how well the best outline fits the mask about it, in absolute terms.

`evidence` weighs outlines against each other, and of any heap of pixels one of them is the best. Here that one stands a
test by itself: the logistic function of a few shares, and where there are pictures of what they show along the outline
(looks.py). What lies elsewhere says nothing. The weights were fitted on rendered tuning views with a needle and without
one (`python -m benchmarks.training.needle_presence`), where a wrong outline of a needle counts as none. What is as a
needle's is no better for being more so: each share counts up to where that is the case.
"""

from __future__ import annotations

import cv2
import numpy as np
from scenewright.stages.suture.needle.evidence import COVERED
from scenewright.stages.suture.needle.looks import NAMES as LOOKS
from scenewright.stages.suture.needle.looks import looks_of
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
PICTURED = (*FEATURES, "beside", *LOOKS)
"""Features where there are pictures."""
ENOUGH = np.array(
    [[0.0, 1.0], [0.0, 1.0], [0.0, EDGE_ON], [0.3, 2.0], [0.0, 0.3], [0.15, 0.6], [0.12, 0.5], [0.0, 0.12], [0.1, 0.6]]
)
"""From where to where (9, 2) each of PICTURED makes a difference: a needle of warmer or duller steel, or in worse
pictures than any that was rendered, is one too. By eye."""
PICTURED_WEIGHTS = np.array([3.12, 10.21, 10.52, -1.91, 5.44, -10.4, -4.77, 18.46, -1.9])
"""Weights (9,) of PICTURED, fitted on pictures with a needle and of drapes without one, on tuning seeds
(`benchmarks/training/needle_presence.py` says which)."""
PICTURED_BIAS = -13.27
"""Constant of the logistic function, fitted with PICTURED_WEIGHTS; one without a needle weighs as four with one."""


def presence_features(
    rig: StereoRig, sheets: tuple[Sheet, Sheet], outline: Outline, pictures: tuple[np.ndarray, np.ndarray] | None = None
) -> np.ndarray:
    """Return FEATURES (3,) of an outline, from 0 to 1; with `pictures` (H, W, 3) uint8 RGB of both eyes PICTURED (9,).

    How much of its area is mask in the worse eye; of the patches of mask that it touches, how much it explains (a
    streak goes on beyond it); how far it is from edge-on, in quarter turns and at most EDGE_ON (edge-on, any streak is
    a needle). Then how wide a strip [px] of mask lies beside it, in the worse eye, and its looks.
    """
    arc = arc_at(rig, outline.pose.camera_from_needle, outline.shift)
    inside, filled, explained, patches = np.zeros(2), np.zeros(2), np.zeros(2), np.zeros(2)
    beside, length = np.zeros(2), np.zeros(2)
    for eye, sheet in enumerate(sheets):
        _, pixels = trace(arc, sheet.corner, eye)
        draw(pixels, arc.growth, COVERED + 0.5, 1, sheet.drawn, sheet.piece)
        covered = (sheet.piece >= 0) & (sheet.drawn <= COVERED)
        within = covered & (sheet.drawn <= 0.0) & ~sheet.silent
        sheet.piece[:] = -1
        inside[eye], filled[eye] = within.sum(), (within & sheet.free).sum()
        beside[eye] = (covered & (sheet.drawn > 0.0) & sheet.free).sum()
        length[eye] = np.linalg.norm(np.diff(pixels[:, :2], axis=0), axis=1).sum() * filled[eye] / max(inside[eye], 1.0)
        explained[eye], patches[eye] = _explained_pixels(sheet.free, covered)
    of_masks = np.array(
        [
            (filled / np.maximum(inside, 1.0)).min(),
            explained.sum() / max(patches.sum(), 1.0),
            min(outline.pose.degrees_from_edge_on() / 90.0, EDGE_ON),
        ]
    )
    if pictures is None:
        return of_masks
    strip = float((beside / np.maximum(length, 1.0)).max())
    return np.concatenate([of_masks, [strip], looks_of(rig, sheets, pictures, outline)])


def _explained_pixels(mask: np.ndarray, near: np.ndarray) -> tuple[float, float]:
    """Return the pixels of the patches of `mask` that the outline touches, near it and altogether."""
    count, labels = cv2.connectedComponents(mask.astype(np.uint8), connectivity=8)
    covered_count = np.bincount(labels[mask & near], minlength=count)
    patch_size = np.bincount(labels[mask], minlength=count)
    touched = covered_count >= FEWEST
    return float(covered_count[touched].sum()), float(patch_size[touched].sum())


def presence_probability(features: np.ndarray) -> float:
    """Return how probable it is that an outline is that of a needle, given FEATURES (3,) or PICTURED (9,)."""
    if len(features) == len(FEATURES):
        logit = BIAS + WEIGHTS @ features
    else:
        logit = PICTURED_BIAS + PICTURED_WEIGHTS @ capped(features)
    return float(1.0 / (1.0 + np.exp(-np.clip(logit, -30.0, 30.0))))


def capped(features: np.ndarray) -> np.ndarray:
    """Return PICTURED (..., 9), each of them within ENOUGH."""
    return np.clip(features, ENOUGH[:, 0], ENOUGH[:, 1])
