"""Ours: everything on its support and in nothing else.

Min-conflicts exchanges models; neighbours that were seen to touch overlap by a centimetre or two whatever the model,
and a physics engine throws them apart.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scenewright.schemas.scene_parts import Box
from scenewright.stages.cad.arranging import Placed, Seat, shifted_box
from scenewright.stages.cad.bearing import shift_to_bearing
from scenewright.stages.cad.conflicts import placed_solid
from scenewright.stages.cad.fitting import shape_at
from scenewright.stages.cad.free_spots import free_spot
from scenewright.stages.cad.model_surfaces import ModelSurface, to_world
from scenewright.stages.cad.shapes import Placement
from scenewright.stages.kit.geometry.boxes import bottom
from scenewright.stages.kit.geometry.convex_solids import Solid

SHRINKING = (0.97, 0.94, 0.9)
"""Scales that are tried, as shares of the fitted one, for what is nowhere free."""
FAR = 2.5
"""How many times farther away a free place is looked for where there is none near."""
CLOSING = (0.8, 0.5, 0.0)
"""Joint values that are tried, as shares of the fitted ones."""


@dataclass(frozen=True)
class Apart:
    """Every model stands on its support and lies no deeper than `tolerance` [m] in what stands already, if there is any
    way: as it is, moved aside by at most `maximum_shift` [m] (then `FAR` times that), a little smaller or less open, as
    another of its `alternatives`."""

    surfaces: Mapping[str, ModelSurface]
    alternatives: Mapping[str, Sequence[Placement]]
    tolerance: float
    maximum_shift: float

    def place(self, placement: Placement, seat: Seat, others: Sequence[Solid]) -> Placed:
        """Return the first way in which it meets nothing, else that in which it lies least deep."""
        options = list(self._options(placement, self.alternatives.get(seat.name, ())))
        best: tuple[float, Placed] | None = None
        for reach in (self.maximum_shift, FAR * self.maximum_shift):
            for option in options:
                depth, placed = self._try_placing(option, seat, others, reach)
                if best is None or depth < best[0]:
                    best = (depth, placed)
                if depth == 0.0:
                    return best[1]
        assert best is not None  # the placement itself is an option
        return best[1]

    def _try_placing(
        self, option: Placement, seat: Seat, others: Sequence[Solid], reach: float
    ) -> tuple[float, Placed]:
        """Return how deep [m] an option still lies in something, moved by at most `reach` [m], and where."""
        surface = self.surfaces[option.shape.model.id]
        moved, box, stand = seat.standing(option, surface)
        outline = None if stand is None else stand.outline
        if seat.parent is not None and outline is not None:
            holder = self.surfaces[seat.parent.shape.model.id]
            aside = shift_to_bearing(seat.parent, holder, box, bottom(box), outline.mean(axis=0))
            moved = replace(moved, translation=moved.translation + [*aside, 0.0])
            box = shifted_box(box, np.array([*aside, 0.0]))
        solid = placed_solid(moved, surface)
        if stand is not None and stand.on_top:
            # In physics it ends where its shape does: that of other people's models reaches below what is drawn, and
            # in the floor it is nowhere free.
            lift = np.array([0.0, 0.0, max(0.0, bottom(box) - float(solid.low[:, 2].min()))])
            moved, box = replace(moved, translation=moved.translation + lift), shifted_box(box, lift)
            solid = solid.shifted(lift)
        spot = free_spot(
            solid, list(others), partial(stays_on, box, outline), tolerance=self.tolerance, maximum_shift=reach
        )
        moved = replace(moved, translation=moved.translation + spot.offset)
        return spot.depth, Placed(moved, stand, solid.shifted(spot.offset))

    def shift(self, box: Box, seat: Seat, solid: Solid, others: Sequence[Solid]) -> np.ndarray:
        """Return how far (3,) [m] a thing goes that keeps its mesh: along with its parent, out of what carries it and,
        where that makes it free, aside."""
        shift = seat.along.copy()
        stand = seat.stand(shifted_box(box, shift))
        if stand is not None and stand.on_top:
            # In physics it ends where its shape does, not its box. What ends above its support is borne all the same.
            sunk = bottom(box) + stand.move[2] - float(solid.low[:, 2].min())
            move = np.array([*stand.move[:2], max(0.0, sunk)])
            if np.linalg.norm(move) <= self.maximum_shift:
                shift += move
        outline = None if stand is None else stand.outline
        spot = free_spot(
            solid.shifted(shift),
            list(others),
            partial(stays_on, shifted_box(box, shift), outline),
            tolerance=self.tolerance,
            maximum_shift=self.maximum_shift,
        )
        return shift + spot.offset if spot.depth == 0.0 else shift

    def _options(self, placement: Placement, alternatives: Sequence[Placement]) -> Iterator[Placement]:
        """Yield the placement, then what may take its place: smaller, less open, another candidate."""
        yield placement
        surface = self.surfaces[placement.shape.model.id]
        for share in SHRINKING:
            yield about_its_foot(placement, surface, share)
        if any(placement.shape.joints.values()):
            for share in CLOSING:
                joints = {name: share * value for name, value in placement.shape.joints.items()}
                yield replace(placement, shape=shape_at(surface, placement.shape, joints))
        yield from (candidate for candidate in alternatives if candidate is not placement)


def about_its_foot(placement: Placement, surface: ModelSurface, share: float) -> Placement:
    """Return the placement at `share` of its scale, the middle of its foot where it was."""
    points = to_world(placement, surface.hull_points(placement.shape.joints))
    low, high = points.min(axis=0), points.max(axis=0)
    foot = np.array([*(0.5 * (low + high))[:2], low[2]])
    translation = foot + share * (placement.translation - foot)
    return replace(placement, scale=share * placement.scale, translation=translation)


def stays_on(box: Box, outline: np.ndarray | None, shift: np.ndarray) -> bool:
    """Whether the middle of a box that is moved by `shift` (2,) [m] still lies over a surface's outline (4, 2), or as
    much as before; on layout (None) it does."""
    if outline is None or len(outline) < 4:
        return True
    middle = np.asarray(box.center[:2])
    return _outside(outline, middle + shift) <= max(0.0, _outside(outline, middle)) + 1e-9


def _outside(outline: np.ndarray, point: np.ndarray) -> float:
    """Return how far [m] a point (2,) lies outside a rectangle (4, 2); negative inside."""
    center = outline.mean(axis=0)
    distances = []
    for axis in (outline[1] - outline[0], outline[2] - outline[1]):
        length = float(np.linalg.norm(axis))
        if length > 0:
            distances.append(abs(float((point - center) @ axis) / length) - 0.5 * length)
    return max(distances, default=0.0)
