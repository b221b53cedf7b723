"""Masks that may overlap become an image in which every pixel is of one."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scenewright.stages.segment.backends.masks.given import GivenFrame, GivenMask, ReadSettings
from scenewright.stages.segment.naming import KEPT_SHARE, SAME_OVERLAP


def flatten(
    masks: Sequence[np.ndarray], told: Sequence[GivenMask], settings: ReadSettings, shape: tuple[int, int]
) -> GivenFrame:
    """Return the frame of masks (H, W) bool, which keep their numbers 1..n in the order given.

    Masks under the score threshold are left out. Where no two overlap, nothing else happens. Otherwise, as for the
    instances of a network (stages/segment/naming.py): of masks that are the same the best scored stays (of equals the
    first), then smaller ones lie over larger ones (of equals the later), and what keeps less than half of itself, or
    less than the least number of pixels, is dropped. Masks of categories that are `behind` lie under all others and
    keep what is left.
    """
    likely = [k for k, mask in enumerate(told) if mask.score >= settings.score_threshold]
    sizes = {k: int(np.count_nonzero(masks[k])) for k in likely}
    cover = np.zeros(shape, dtype=np.int32)
    for k in likely:
        cover += masks[k]
    faint = len(told) - len(likely)
    ids = np.zeros(shape, dtype=np.int32)
    if cover.max(initial=0) <= 1:
        for k in likely:
            ids[masks[k]] = k + 1
        return GivenFrame(ids, {k + 1: told[k] for k in likely if sizes[k]}, 0, faint)
    distinct: list[int] = []
    behind = {k for k in likely if told[k].category in settings.behind}
    for k in sorted((k for k in likely if sizes[k]), key=lambda k: (k in behind, -told[k].score, k)):
        if not any(_are_same(masks[k], masks[other], sizes[k], sizes[other]) for other in distinct):
            distinct.append(k)
    for k in sorted(distinct, key=lambda k: (k not in behind, -sizes[k], k)):
        ids[masks[k]] = k + 1
    visible = np.bincount(ids.ravel(), minlength=len(told) + 1)
    least = {k: max(settings.minimum_pixels, 0 if k in behind else KEPT_SHARE * sizes[k]) for k in distinct}
    large_enough = {k for k in distinct if visible[k + 1] >= least[k]}
    overlapping = sum(1 for k in likely if sizes[k] and (k not in large_enough or visible[k + 1] < sizes[k]))
    ids[~np.isin(ids, [k + 1 for k in large_enough])] = 0
    return GivenFrame(ids, {k + 1: told[k] for k in sorted(large_enough)}, overlapping, faint)


def _are_same(first: np.ndarray, second: np.ndarray, size: int, other: int) -> bool:
    if min(size, other) <= SAME_OVERLAP * max(size, other):
        return False
    shared = int(np.count_nonzero(first & second))
    return shared > SAME_OVERLAP * (size + other - shared)
