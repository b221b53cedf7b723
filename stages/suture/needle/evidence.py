"""How probable each of several fitted outlines is, by what it explains of both masks and what it leaves.

Log-weights are linear in a few counts; their factors were fitted by conditional logistic regression (which of a view's
outlines is the right one) on 300 tuning views, so that the shares they give are probabilities.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from stages.suture.needle.silhouette import (
    GROWTH,
    ON_CIRCLE,
    PIECES,
    RADII,
    Outline,
    Sheet,
    box_of,
    camera_of,
    draw,
    trace,
)
from stages.suture.needle.windows import EyeMask
from stages.suture.rig import StereoRig

COVERED = 2.0
"""Mask within this many pixels of the outline is explained by it."""
LEAST_WIDTH = 1.3
"""Masks need not show a wire thinner than this [px]."""
MOST_FREE, MOST_NEAR = 60.0, 100.0
PER_MISFIT, PER_FREE, PER_NEAR, PER_MISSING, PER_THREAD = -0.100, -0.083, -0.050, -0.036, 1.35
"""Log-weights: of a pixel of misfit; of a pixel of mask that is left over far from thread and drivers (at most 60)
or near them (100); of one of PIECES that one eye misses; of thread beyond the swage in both eyes and not beyond the
tip, half of it for one eye."""
BEYOND = np.linspace(0.0005, 0.0035, 7)
"""Where beyond an end thread is looked for [m], along the arc's tangent."""
CLOSE = 3
"""Thread within so many pixels counts."""


@dataclass(frozen=True)
class Evidence:
    """What an outline leaves: pixels of mask `free`, `near` others; which of PIECES each eye sees (2, PIECES); pieces
    that one eye alone misses; thread beyond the swage less thread beyond the tip (-2 to 2); the log-weight of all."""

    free: float
    near: float
    seen: np.ndarray
    missing: int
    thread: float
    log_weight: float


@numba.njit(cache=True, fastmath=True)
def _explain(
    pose: np.ndarray,
    shift: np.ndarray,
    camera: np.ndarray,
    growth: float,
    signed: np.ndarray,
    kind: np.ndarray,
    silent: np.ndarray,
    corner: np.ndarray,
    drawn: np.ndarray,
    piece: np.ndarray,
    eye: int,
    on_circle: np.ndarray,
    radii: np.ndarray,
    covered: np.ndarray,
    state: np.ndarray,
) -> None:
    """Add to `covered` (3,) the pixels of mask of each kind within 2 px of the outline; write each piece's `state`
    (K,): 0 seen, 1 missing, 2 nothing can be said."""
    height, width = signed.shape
    _, pixels = trace(pose, shift, camera, corner, eye, on_circle, radii)
    draw(pixels, growth, COVERED + 0.5, 1, drawn, piece)
    for k in range(len(pixels) - 1):
        first, last, top, bottom = box_of(pixels, k, growth + COVERED + 0.5, 1, height, width)
        for row in range(top, bottom + 1):
            for column in range(first, last + 1):
                if piece[row, column] == k:
                    piece[row, column] = -1
                    if drawn[row, column] <= COVERED and signed[row, column] < 0.0:
                        covered[kind[row, column]] += 1.0
        column = int(np.floor(0.5 * (pixels[k, 0] + pixels[k + 1, 0]) + 0.5))
        row = int(np.floor(0.5 * (pixels[k, 1] + pixels[k + 1, 1]) + 0.5))
        if not (0 <= column < width and 0 <= row < height):
            state[k] = 1
        elif signed[row, column] < 1.0:
            state[k] = 0
        elif silent[row, column] or pixels[k, 2] + pixels[k + 1, 2] < LEAST_WIDTH:
            state[k] = 2
        else:
            state[k] = 1


def evidence_of(
    rig: StereoRig, eyes: tuple[EyeMask, EyeMask], sheets: tuple[Sheet, Sheet], outline: Outline
) -> Evidence:
    """Return what speaks for an outline."""
    left_over = np.zeros(3)
    states = np.zeros((2, PIECES), dtype=np.int64)
    for eye, s in enumerate(sheets):
        covered = np.zeros(3)
        given = (s.signed, s.kind, s.silent, s.corner, s.drawn, s.piece, eye, ON_CIRCLE, RADII, covered, states[eye])
        _explain(outline.pose.camera_from_needle, outline.shift, camera_of(rig), GROWTH, *given)
        left_over += np.bincount(s.kind[s.signed < 0], minlength=3) - covered
    free, near = float(left_over[0]), float(left_over[1])
    missing = int(((states == 1) & (states[::-1] == 0)).any(axis=0).sum())
    thread = sum(_thread_beyond(rig, eyes[eye], outline, eye) for eye in (0, 1))
    log_weight = PER_MISFIT * outline.misfit + PER_FREE * min(free, MOST_FREE) + PER_NEAR * min(near, MOST_NEAR)
    log_weight += PER_MISSING * missing + PER_THREAD * thread
    return Evidence(free, near, states == 0, missing, thread, log_weight)


def _thread_beyond(rig: StereoRig, eye: EyeMask, outline: Outline, which: int) -> float:
    """Return the share of places beyond the swage where an eye has thread, less the share beyond the tip."""
    if not eye.thread.any():
        return 0.0
    pose = outline.pose
    onward = -pose.camera_from_needle[:3, 1]
    places = np.concatenate([pose.swage + BEYOND[:, None] * onward, pose.tip + BEYOND[:, None] * onward])
    pixels = rig.right(places) + outline.shift if which else rig.left(places)
    if not np.isfinite(pixels).all():
        return 0.0
    found = []
    for column, row in np.round(pixels - eye.corner).astype(int):
        part = eye.thread[
            max(row - CLOSE, 0) : max(row + CLOSE + 1, 0), max(column - CLOSE, 0) : max(column + CLOSE + 1, 0)
        ]
        found.append(bool(part.any()))
    return float(np.mean(found[: len(BEYOND)]) - np.mean(found[len(BEYOND) :]))
