"""How probable each of several fitted outlines is, by what it explains of both masks and what it leaves.

Log-weights are linear in a few counts; their factors were fitted by conditional logistic regression (which of a view's
outlines is the right one) on 300 tuning views of spoiled masks, those of thread on others and on states of trials,
of the network's masks too (`scenewright train needle-evidence`), so that the shares they give are probabilities.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scenewright.stages.kit.compiled import compiled
from scenewright.stages.suture.needle.silhouette import (
    ANGLES,
    GROWTH,
    PIECES,
    TAPER_ANGLE,
    Arc,
    Outline,
    Sheet,
    arc_at,
    box_of,
    draw,
    trace,
)
from scenewright.stages.suture.needle.windows import EyeMask
from scenewright.stages.suture.rig import NEEDLE_RADIUS, StereoRig

COVERED = 2.0
"""Mask within this many pixels of the outline is explained by it."""
LEAST_WIDTH = 1.3
"""Masks need not show a wire thinner than this [px]."""
MOST_LEFT_OVER = 150
"""Pixels of left-over mask from which on more of them say nothing; by eye."""
WEIGHTS = np.array([-0.071, -0.076, -0.039, -0.043, -0.072, -0.030, 1.296, -0.148, -0.230, 0.696, -0.502, 0.183, 0.321])
"""Log-weights: of a pixel of misfit but for the lost; of a pixel of mask that is left over (at most MOST_LEFT_OVER); of
a pixel's misfit for mask lost by one eye, or by both as in tissue; of a piece that one eye alone misses; of the
squared width (in units of WIDTH_SIGMA, at most 9 a piece) that the mask is off by near the ends; of thread in one eye
beyond the swage, beyond the tip, and along the arc before the tip; of an eye in which thread begins at the swage, or
at the tip, or passes by the swage, or by the tip."""
WIDTH_SIGMA = 0.8
"""Standard deviation [px] of the mask's width along a piece."""
TAPERED = np.flatnonzero((ANGLES[:-1] < TAPER_ANGLE) | (ANGLES[1:] > np.pi - TAPER_ANGLE))
"""Numbers of the pieces of the outline that taper, at both ends."""
BEYOND = np.linspace(0.0005, 0.0035, 7)
"""Distances beyond an end at which thread is looked for [m], along the arc's tangent."""
AROUND = 0.0025
"""Radius [m] of a circle about an end: thread that begins there crosses it once, and thread that passes by twice. It is
tied to the swage, whichever way it leaves it, and may cross the tip."""
ANGLES_AROUND = np.linspace(0.0, 2.0 * np.pi, 128, endpoint=False)
"""Angles [rad] of the circle about an end."""
ON_UNIT_CIRCLE = np.stack([np.cos(ANGLES_AROUND), np.sin(ANGLES_AROUND)], axis=1)
"""The same as points (128, 2)."""
CLOSE = 3
"""Thread within so many pixels of a place counts; mask farther than this from the outline is not the needle's."""


@dataclass(frozen=True)
class Evidence:
    """What an outline leaves: pixels of mask `left_over`; `lost`, `hidden`: the misfit for mask that one eye or both do
    not have; which of PIECES each eye sees (2, PIECES); pieces that one eye alone misses; how far widths near the ends
    are off; of thread, both eyes together (0 to 2): beyond the swage, beyond the tip and before it, whether it begins
    at the swage and at the tip, and passes by the swage and by the tip (7,)."""

    misfit: float
    left_over: float
    lost: float
    hidden: float
    seen: np.ndarray
    missing: int
    taper: float
    threads: np.ndarray

    @property
    def terms(self) -> np.ndarray:
        """What WEIGHTS (13,) weigh."""
        explained_misfit = self.misfit - self.lost - self.hidden
        capped_left_over = min(self.left_over, MOST_LEFT_OVER)
        return np.array(
            [explained_misfit, capped_left_over, self.lost, self.hidden, self.missing, self.taper, *self.threads]
        )

    @property
    def log_weight(self) -> float:
        """How probable the outline is: the logarithm, up to what is the same for all of a view."""
        return float(WEIGHTS @ self.terms)


@compiled(fastmath=True)
def _explain(arc: Arc, sheet: Sheet, eye: int, state: np.ndarray, lost: np.ndarray, excess: np.ndarray) -> float:
    """Return the pixels of free mask within COVERED of the outline; write each piece's `state` (K,), 0 seen, 1 missing,
    2 nothing can be said, its part in the misfit for mask that is not there, `lost` (K,), and by how much the mask is
    wider there, `excess` (K,) [px]."""
    growth, signed, weight, free, silent = arc.growth, sheet.signed, sheet.weight, sheet.free, sheet.silent
    drawn, piece = sheet.drawn, sheet.piece
    height, width = signed.shape
    covered = 0.0
    _, pixels = trace(arc, sheet.corner, eye)
    draw(pixels, growth, COVERED + 0.5, 1, drawn, piece)
    for k in range(len(pixels) - 1):
        first, last, top, bottom = box_of(pixels, k, growth + COVERED + 0.5, 1, height, width)
        area = 0.0
        for row in range(top, bottom + 1):
            for column in range(first, last + 1):
                if piece[row, column] == k:
                    piece[row, column] = -1
                    if drawn[row, column] < 0.0 and signed[row, column] > COVERED:
                        lost[k] += weight[row, column] * min(max(2.0 * pixels[k, 2] - 0.3, 0.05), 1.0)
                    if drawn[row, column] <= COVERED and free[row, column]:
                        covered += 1.0
                        area += 1.0
                    if drawn[row, column] <= 0.0 and not silent[row, column]:
                        area -= 1.0
        column = int(np.floor(0.5 * (pixels[k, 0] + pixels[k + 1, 0]) + 0.5))
        row = int(np.floor(0.5 * (pixels[k, 1] + pixels[k + 1, 1]) + 0.5))
        if not (0 <= column < width and 0 <= row < height):
            state[k] = 1
        elif signed[row, column] < 1.0:
            state[k] = 0
            if not silent[row, column]:
                length = np.hypot(pixels[k + 1, 0] - pixels[k, 0], pixels[k + 1, 1] - pixels[k, 1])
                excess[k] = area / max(length, 1.0)
        elif silent[row, column] or pixels[k, 2] + pixels[k + 1, 2] < LEAST_WIDTH:
            state[k] = 2
        else:
            state[k] = 1
    return covered


def evidence_of(
    rig: StereoRig, eyes: tuple[EyeMask, EyeMask], sheets: tuple[Sheet, Sheet], outline: Outline
) -> Evidence:
    """Return what speaks for an outline and against it."""
    left_over = 0.0
    states, lost = np.zeros((2, PIECES), dtype=np.int64), np.zeros((2, PIECES))
    excess = np.zeros((2, PIECES))
    arc = arc_at(rig, outline.pose.camera_from_needle, outline.shift)
    for eye, sheet in enumerate(sheets):
        covered = _explain(arc, sheet, eye, states[eye], lost[eye], excess[eye])
        left_over += float(sheet.free.sum()) - covered
    hidden = (states > 0).all(axis=0)
    return Evidence(
        misfit=outline.misfit,
        left_over=left_over,
        lost=float(lost[:, ~hidden].sum()),
        hidden=float(lost[:, hidden].sum()),
        seen=states == 0,
        missing=int(((states == 1) & (states[::-1] == 0)).any(axis=0).sum()),
        taper=float(np.minimum((excess[:, TAPERED] / WIDTH_SIGMA) ** 2, 9.0).sum()),
        threads=_threads(rig, eyes[0], outline, 0) + _threads(rig, eyes[1], outline, 1),
    )


def _threads(rig: StereoRig, eye: EyeMask, outline: Outline, which: int) -> np.ndarray:
    """Return what Evidence says of thread (7,), of one eye (0 to 1): shares of places that have thread, and 0 or 1."""
    if not eye.thread.any():
        return np.zeros(7)
    pose = outline.pose
    beyond = -BEYOND[:, None] * pose.camera_from_needle[:3, 1]
    places = np.concatenate([pose.swage + beyond, pose.tip + beyond, pose.points(BEYOND / NEEDLE_RADIUS)])
    ends = np.stack([pose.swage, pose.tip])
    pixels, of_ends = (rig.right(p) + outline.shift if which else rig.left(p) for p in (places, ends))
    if not (np.isfinite(pixels).all() and np.isfinite(of_ends).all()):
        return np.zeros(7)
    has_thread = []
    for column, row in np.round(pixels - eye.corner).astype(int):
        rows = slice(max(row - CLOSE, 0), max(row + CLOSE + 1, 0))
        columns = slice(max(column - CLOSE, 0), max(column + CLOSE + 1, 0))
        has_thread.append(bool(eye.thread[rows, columns].any()))
    radii = AROUND * rig.focal / ends[:, 2]
    times = np.array([_crossings(eye.thread, *end) for end in zip(of_ends - eye.corner, radii, strict=True)])
    return np.array([*np.array(has_thread).reshape(3, -1).mean(axis=1), *(times == 1), *(times > 1)])


def _crossings(thread: np.ndarray, middle: np.ndarray, radius: float) -> int:
    """Return how often thread (h, w) bool crosses a circle about a place (column, row) [px]."""
    on_thread = np.zeros(len(ON_UNIT_CIRCLE), dtype=bool)
    # two circles, as a line of pixels may slip through one
    for reach in (radius, radius + 1.0):
        columns, rows = np.round(middle + reach * ON_UNIT_CIRCLE).astype(int).T
        inside = (columns >= 0) & (rows >= 0) & (columns < thread.shape[1]) & (rows < thread.shape[0])
        on_thread[inside] |= thread[rows[inside], columns[inside]]
    on_thread |= np.roll(on_thread, 1) & np.roll(on_thread, -1)
    return int((on_thread & ~np.roll(on_thread, 1)).sum())


def left_over(
    rig: StereoRig, eyes: tuple[EyeMask, EyeMask], sheets: tuple[Sheet, Sheet], outline: Outline
) -> tuple[np.ndarray, np.ndarray]:
    """Return what (H, W) bool of each eye's mask, where no driver should be, lies beyond CLOSE of the outline."""
    rests = []
    arc = arc_at(rig, outline.pose.camera_from_needle, outline.shift)
    for which, (eye, s) in enumerate(zip(eyes, sheets, strict=True)):
        _, pixels = trace(arc, s.corner, which)
        draw(pixels, GROWTH, CLOSE + 0.5, 1, s.drawn, s.piece)
        unexplained = s.free & ~((s.piece >= 0) & (s.drawn <= CLOSE))
        s.piece[:] = -1
        full_mask = np.zeros((rig.height, rig.width), dtype=bool)
        full_mask[eye.row : eye.row + unexplained.shape[0], eye.column : eye.column + unexplained.shape[1]] = (
            unexplained
        )
        rests.append(full_mask)
    return rests[0], rests[1]
