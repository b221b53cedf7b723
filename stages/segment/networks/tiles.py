"""A network on the whole frame and on overlapping tiles of it, and one answer of all these runs."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scenewright.stages.segment.networks.decoding import Found
from scenewright.stages.segment.same_things import BoxedMask, groups_of, mean_mask, not_nested

SUM_OF_SIDES = 1.2
"""Sides of the tiles along a side of the frame, together: two tiles have .6 of it each."""
INNER_MARGIN = 0.015
"""A mask that comes this close to a side of a tile within the frame is cut off by it [share of the tile's side]."""
SMALL_AREA, LARGE_AREA = 32 * 32, 96 * 96
"""Areas in a network's input [pixels] between which COCO calls a thing medium. What is smaller no run is taken to see;
what is larger the whole frame is for: on a tile, as a blurred part of it, networks are often silent about it."""

Window = tuple[int, int, int, int]
"""x0, y0, x1, y1 [pixels] of a part of the image."""


def grid_windows(width: int, height: int, count: int) -> list[Window]:
    """Return the whole image and `count` x `count` overlapping tiles of it, row by row; the whole alone under two."""
    whole = (0, 0, width, height)
    if count < 2:
        return [whole]
    starts = []
    for length in (width, height):
        side = min(length, round(length * SUM_OF_SIDES / count))
        starts.append([(int(round(at)), side) for at in np.linspace(0, length - side, count)])
    return [whole, *((x, y, x + wide, y + high) for y, high in starts[1] for x, wide in starts[0])]


@dataclass(frozen=True)
class Run:
    """One run of a network: the window it looked at, and how large an image pixel was there."""

    window: Window
    pixels_of_input: float
    """Area in the input of one pixel of the image."""
    is_whole: bool
    """Whether the window is the image."""

    def holds(self, boxed: BoxedMask, shape: tuple[int, int]) -> bool:
        """Whether no side of the window that lies within the image of `shape` (H, W) cuts a mask off."""
        x0, y0, x1, y1 = self.window
        first, after, left, right = boxed.box
        over, beside = INNER_MARGIN * (y1 - y0), INNER_MARGIN * (x1 - x0)
        return (
            (y0 == 0 or first >= y0 + over)
            and (x0 == 0 or left >= x0 + beside)
            and (y1 == shape[0] or after <= y1 - over)
            and (x1 == shape[1] or right <= x1 - beside)
        )

    def sees(self, boxed: BoxedMask, shape: tuple[int, int]) -> bool:
        """Whether this run's silence about a thing with this mask says something."""
        area = boxed.area * self.pixels_of_input
        return area >= SMALL_AREA and (self.is_whole or area < LARGE_AREA) and self.holds(boxed, shape)


def one_answer(
    found: Sequence[tuple[int, Found]], runs: Sequence[Run], shape: tuple[int, int], *, score_threshold: float
) -> list[Found]:
    """Return the things of an image of `shape` (H, W) from what runs found, with the number of the run; best first.

    Masks that a tile's side cuts off count for nothing. Those whose IoU is over .5 are one thing: their mean mask, and
    per class the mean of the scores over the runs that found or could see it. Of masks of one class of which one lies
    in the other the weaker goes, and so does what is under the threshold.
    """
    told = [(run, thing, BoxedMask(thing.mask)) for run, thing in found]
    whole = [(run, thing, mask) for run, thing, mask in told if mask.area and runs[run].holds(mask, shape)]
    things: list[tuple[BoxedMask, int, float]] = []
    for group in groups_of([mask for _, _, mask in whole], [thing.score for _, thing, _ in whole]):
        members = [whole[k] for k in group]
        mean = mean_mask([mask for _, _, mask in members], [thing.score for _, thing, _ in members])
        per_class: dict[int, dict[int, float]] = defaultdict(dict)
        for run, thing, _ in members:
            per_class[thing.number][run] = max(thing.score, per_class[thing.number].get(run, 0.0))
        asked = {run for run, _, _ in members} | {k for k, run in enumerate(runs) if run.sees(mean, shape)}
        sums = {number: sum(of_runs[run] for run in sorted(of_runs)) for number, of_runs in per_class.items()}
        best = min(sums, key=lambda number: (-sums[number], number))
        if mean.area and sums[best] / len(asked) >= score_threshold:
            things.append((mean, best, sums[best] / len(asked)))
    things.sort(key=lambda thing: -thing[2])
    kept = not_nested(*([thing[part] for thing in things] for part in (0, 2, 1)))  # type: ignore[arg-type]
    return [Found(things[k][0].mask, things[k][1], things[k][2]) for k in kept]
