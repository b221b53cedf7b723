"""The thread as a curve in space, from its masks in both eyes of a rectified pair.

Skeleton and strands in either eye, the left eye's path from the swage on, its disparity by dynamic programming along
the curve, and splines with a prior on their bend through path and disparity, so that the parts that say little (gaps,
rows along the thread) are filled as a thread would run and are known to be uncertain.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.suture.rig import StereoRig
from scenewright.stages.suture.thread.curve import fitted
from scenewright.stages.suture.thread.matching import directions_of, matched, places_of
from scenewright.stages.suture.thread.path import Path, followed
from scenewright.stages.suture.thread.skeleton import stretches
from scenewright.stages.suture.thread.strands import strands

CENTRE_SIGMA = 0.35
"""Standard deviation [px] of a skeleton's point across the line; its errors are alike over CORRELATED pixels."""
CORRELATED = 4.0
"""Pixels of a line over which its errors are alike; by eye."""
ROW_ERROR = 0.2
"""Standard deviation [px] between the eyes' rows: calibration."""
COLUMN_ERROR = 0.15
"""Standard deviation [px] between the eyes' columns: it shifts the whole curve, and many samples do not make it
smaller."""
BEND = 110.0
"""Standard deviation of the thread's curvature [1/m]."""
PATH_SPACING, DISPARITY_SPACING = 8.0, 16.0
"""Distances of the splines' knots [px]."""
CAUCHY = 2.5
"""Misfit, in standard deviations, from which on a sample counts less; by eye."""
FEWEST = 10
"""Matched points that a curve needs; by eye."""
LEVEL = 0.15
"""Rise of the line [rows a px of line] below which rows say little of its disparity."""
POINTS_EVERY = 0.0005
"""Distance between points of the curve [m]; by eye."""
BORDER = 4.0
"""Width of the picture's border, where a thread leaves it [px]; by eye."""
DOUBTED_GAP = 40.0
"""Length of a gap from which on a curve is in doubt [px]; by eye."""
DOUBTED_LEFT_OVER = 0.012
"""Length of thread beside the curve from which on it is in doubt [m]; by eye."""
DOUBTED_SHARE = 0.15
"""Share of a curve in gaps, or vaguely known, from which on it is in doubt; by eye."""
DOUBTED_LEVEL = 0.012
"""Length of a stretch along the rows from which on a curve is in doubt [m]; by eye."""
DOUBTED_UNMATCHED = 0.25
"""Share of points without a match from which on a curve is in doubt; by eye."""
DOUBTED_DEVIATION, DOUBTED_SOMEWHERE = 0.002, 0.006
"""Standard deviation of a point that is vaguely known, and one from which on a single point puts the curve in doubt
[m]; by eye."""
DOUBTED_CUT = 0.003
"""Length left out at the end from which on a curve is in doubt [m]; by eye."""


@dataclass(frozen=True)
class ThreadCurve:
    """The thread's centre line from its start on: points (N, 3) [m] in the left camera's frame, the standard deviation
    (N,) [m] of each, the curve's length [m], and how far it may be trusted.

    `status` is "ok", "unsure" (`remarks` say where and why) or "none" (no curve; `remarks` say why).
    """

    points: np.ndarray
    standard_deviation: np.ndarray
    length_m: float
    status: str
    remarks: tuple[str, ...]

    @staticmethod
    def none(reason: str) -> ThreadCurve:
        """Return the answer that there is no curve."""
        return ThreadCurve(np.empty((0, 3)), np.empty(0), 0.0, "none", (reason,))


def reconstruct_thread(
    left_mask: np.ndarray, right_mask: np.ndarray, rig: StereoRig, *, start: np.ndarray | None = None
) -> ThreadCurve:
    """Return the thread's curve from masks (H, W) bool of both eyes.

    `start` (3,) [m, left camera's frame] is where the thread leaves the needle's swage; the curve then begins there,
    and its length is what is left for cinching. Without it the curve begins at one end of the longest strand and what
    continues it. Raises BadInput for masks of another size than the rig's images and for a rig without a baseline.
    """
    _check(left_mask, right_mask, rig, start)
    for name, mask in (("left", left_mask), ("right", right_mask)):
        if not mask.any():
            return ThreadCurve.none(f"The {name} eye sees no thread.")
    begin = None if start is None else np.asarray(start, dtype=float)
    start_pixel = None if begin is None else rig.left(begin[None])[0]
    path = followed(strands(stretches(left_mask)), start_pixel)
    if path is None:
        start_text = ""
        if start_pixel is not None:
            start_text = f" near the start at column {start_pixel[0]:.0f}, row {start_pixel[1]:.0f}"
        return ThreadCurve.none(f"The left eye sees no stretch of thread{start_text}.")
    start_disparity = None if begin is None else rig.focal * rig.baseline / float(begin[2])
    places = places_of(stretches(right_mask))
    index, disparity, sine = matched(path.points, path.seen, places, rig, start_disparity)
    if len(index) < FEWEST:
        return ThreadCurve.none(f"Only {len(index)} points of the left eye's thread are seen by the right eye too.")
    return _curve(path, index, disparity, sine, rig, start_pixel, start_disparity)


def _check(left_mask: np.ndarray, right_mask: np.ndarray, rig: StereoRig, start: np.ndarray | None) -> None:
    size = (rig.height, rig.width)
    for name, mask in (("left", left_mask), ("right", right_mask)):
        if mask.shape != size or mask.dtype != bool:
            raise BadInput(
                f"the {name} thread mask is {mask.shape} {mask.dtype}, the rig's images are {size} (rows, columns)",
                hint="give bool masks of the rectified images at full size",
            )
    if not rig.baseline > 0:
        raise BadInput(
            f"the stereo rig's baseline is {rig.baseline} m: two eyes at one place measure no depth",
            hint="check the calibration's baseline and the order of the eyes",
        )
    if start is not None and (np.shape(start) != (3,) or not np.isfinite(start).all() or not start[2] > 0):
        raise BadInput(f"the thread's start is {start}", hint="give three numbers [m] before the left camera")


def _curve(
    path: Path,
    index: np.ndarray,
    disparity: np.ndarray,
    sine: np.ndarray,
    rig: StereoRig,
    start_pixel: np.ndarray | None,
    start_disparity: float | None,
) -> ThreadCurve:
    """Return the curve of a path and its matched disparities."""
    pixels, visible = path.points, path.seen
    if start_pixel is not None:
        # the way from the swage to where the thread is first seen
        pixels, visible, index = np.vstack([start_pixel, pixels]), np.concatenate([[False], visible]), index + 1
    steps = np.linalg.norm(np.diff(pixels, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(steps)])
    end = float(along[-1])
    depth = rig.focal * rig.baseline / float(np.median(disparity))
    bend = BEND * depth / rig.focal
    used = visible.copy()
    deviations = np.full(len(pixels), CENTRE_SIGMA * np.sqrt(CORRELATED))
    if start_pixel is not None:
        used[0] = True
        deviations[0] = 1.0
    lines = [
        fitted(along[used], pixels[used, axis], deviations[used], end, PATH_SPACING, bend, CAUCHY) for axis in (0, 1)
    ]
    rise = np.abs(directions_of(pixels)[index, 1])
    slope = np.maximum(np.minimum(rise, sine), 0.02)
    sigma = np.hypot(CENTRE_SIGMA * np.sqrt(2.0), ROW_ERROR * np.sqrt(1.0 - np.minimum(slope, 1.0) ** 2)) / slope
    places, values, sigmas = along[index], disparity, np.minimum(sigma, 60.0) * np.sqrt(CORRELATED / 2.0)
    if start_disparity is not None:
        places, values = np.concatenate([[0.0], places]), np.concatenate([[start_disparity], values])
        sigmas = np.concatenate([[1.0], sigmas])
    shifts = fitted(places, values, sigmas, end, DISPARITY_SPACING, bend * rig.baseline / depth, CAUCHY)
    # beyond the last point that both eyes see, a depth would be made up
    last = float(places[-1])
    count = max(round(last * depth / rig.focal / POINTS_EVERY), 8)
    at = np.linspace(0.0, last, count + 1)
    left_pixels = np.stack([line.spline(at) for line in lines], axis=1)
    shift = np.maximum(shifts.spline(at), rig.focal * rig.baseline / 2.0)
    points = rig.triangulate(left_pixels, shift)
    in_depth = points[:, 2] / shift * np.hypot(shifts.deviation(at), COLUMN_ERROR)
    across = points[:, 2] / rig.focal * np.hypot(lines[0].deviation(at), lines[1].deviation(at))
    sight = np.linalg.norm(points, axis=1) / points[:, 2]
    deviation = np.hypot(in_depth * sight, across)
    length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    scale = depth / rig.focal
    level = _longest(rise < LEVEL, np.gradient(along)[index] * max(1.0, float(np.median(np.diff(index)))))
    unmatched = 1.0 - len(index) / max(int(visible.sum()) / 2.0, 1.0)
    vague = float((deviation > DOUBTED_DEVIATION).mean())
    cut = scale * (end - last)
    leaves = _at_border(left_pixels[-1], rig) or _at_border(left_pixels[-1] - [shift[-1], 0.0], rig)
    remarks = _remarks(path, _Doubts(scale, end, level, unmatched, vague, float(deviation.max()), cut, leaves))
    return ThreadCurve(points, deviation, length, "unsure" if remarks else "ok", remarks)


def _longest(which: np.ndarray, lengths: np.ndarray) -> float:
    """Return the greatest sum of `lengths` over a run of `which`."""
    longest = run = 0.0
    for inside, length in zip(which, lengths, strict=True):
        run = run + float(length) if inside else 0.0
        longest = max(longest, run)
    return longest


def _at_border(pixel: np.ndarray, rig: StereoRig) -> bool:
    """Return whether a pixel (column, row) lies within BORDER of the picture's border or beyond it."""
    column, row = pixel
    return not (BORDER < column < rig.width - 1 - BORDER and BORDER < row < rig.height - 1 - BORDER)


@dataclass(frozen=True)
class _Doubts:
    """What may make a curve doubtful. `scale` [m/px]; `end`: the path's length, `level`: the longest part of it along
    the rows [px]; `unmatched`: share of the left eye's thread that the right eye has not; `vague`: share of the curve
    that is not well known, `vaguest`: its worst deviation [m]; `cut`: what is left out at the end [m]; `leaves`:
    whether the thread leaves the picture."""

    scale: float
    end: float
    level: float
    unmatched: float
    vague: float
    vaguest: float
    cut: float
    leaves: bool


def _remarks(path: Path, doubts: _Doubts) -> tuple[str, ...]:
    """Return what makes the curve doubtful, a sentence each."""
    scale, level, unmatched, cut = doubts.scale, doubts.level, doubts.unmatched, doubts.cut
    vague, vaguest = doubts.vague, doubts.vaguest
    remarks = []
    gaps = sum(path.gaps) + path.start_gap
    longest = max([*path.gaps, path.start_gap], default=0.0)
    if longest > DOUBTED_GAP or gaps > DOUBTED_SHARE * doubts.end:
        remarks.append(
            f"{len(path.gaps)} gaps of together {1000 * scale * gaps:.0f} mm, the longest of "
            f"{1000 * scale * longest:.0f} mm, are bridged along their tangents."
        )
    if path.doubtful_start:
        remarks.append("Two strands might begin at the start; the one with the longer thread is followed.")
    if scale * path.left_over > DOUBTED_LEFT_OVER:
        remarks.append(
            f"{1000 * scale * path.left_over:.0f} mm of thread in the left eye are not part of the curve: another "
            "thread, or a part that what lies before it cuts off."
        )
    if doubts.leaves:
        remarks.append("The thread leaves the image; its length is that of the part in it.")
    if path.doubtful_gaps:
        remarks.append(f"At {path.doubtful_gaps} gaps another strand would continue the thread almost as well.")
    if path.doubtful_crossings:
        remarks.append(f"At {path.doubtful_crossings} crossings another way is almost as straight.")
    if scale * level > DOUBTED_LEVEL:
        remarks.append(
            f"Over {1000 * scale * level:.0f} mm the thread runs along the rows, where two eyes see no depth."
        )
    if unmatched > DOUBTED_UNMATCHED:
        remarks.append(f"{100 * unmatched:.0f} % of the left eye's thread was not found in the right eye.")
    if cut > DOUBTED_CUT:
        remarks.append(f"The last {1000 * cut:.0f} mm that the left eye sees are left out: the right eye misses them.")
    if vague > DOUBTED_SHARE or vaguest > DOUBTED_SOMEWHERE:
        remarks.append(
            f"{100 * vague:.0f} % of the curve is known to worse than {1000 * DOUBTED_DEVIATION:.0f} mm, its worst "
            f"point to {1000 * vaguest:.0f} mm."
        )
    return tuple(remarks)
