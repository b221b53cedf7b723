"""Whether left and right are exchanged, as far as the rows of both masks say so."""

from __future__ import annotations

import numpy as np
from scenewright.stages.suture.needle.starts import NEAREST
from scenewright.stages.suture.rig import StereoRig

LEAST_SHARED, LEAST_BEHIND, LEAST_STEADY = 0.6, 0.9, 0.8
"""Shares of the rows of either mask that both have; of those that say what nothing in front of two eyes can; and of
those that say about what their neighbours say. By eye."""
STEADY = 3.0
"""Difference [px] between what neighbouring rows say."""
SLACK = 1.0
"""Rows of a good calibration are off by less than this [px]."""


def eyes_exchanged(rig: StereoRig, masks: tuple[np.ndarray, np.ndarray]) -> str:
    """Return a sentence if the rows of both masks (H, W) match with right and left exchanged, else nothing.

    Masks of different things, or of one that lies too far away, are no reason to ask.
    """
    has = [mask.any(axis=1) for mask in masks]
    shared = has[0] & has[1]
    if not shared.any() or shared.sum() < LEAST_SHARED * (has[0] | has[1]).sum():
        return ""
    left, right = ((mask.argmax(axis=1)[shared], _last(mask)[shared]) for mask in masks)
    ends = np.stack([left[0] - right[0], left[1] - right[1]])
    behind = ((ends < -SLACK) & (ends > -rig.focal * rig.baseline / NEAREST)).all(axis=0)
    steady = (np.abs(np.diff(ends, axis=1)) <= STEADY).all(axis=0)
    if behind.mean() < LEAST_BEHIND or (steady.size and steady.mean() < LEAST_STEADY):
        return ""
    return (
        f"The needle lies {-np.median(ends):.0f} px farther right in the right eye than in the left, "
        "which nothing in front of both can. Are left and right exchanged?"
    )


def _last(mask: np.ndarray) -> np.ndarray:
    """Return the last column (H,) of each row's mask."""
    return np.asarray(mask.shape[1] - 1 - mask[:, ::-1].argmax(axis=1))
