"""The floor of an apartment as cells: where the base fits, and what the head camera sees of it from a place."""

from __future__ import annotations

from math import pi

import numpy as np
from scenewright.schemas.apartment import Apartment
from scenewright.stages.agent.obstacle_map import CELL, cell_of
from scenewright.stages.agent.senses import Base

RANGE, RAYS = 5.0, 360
"""Range of the head camera [m], and rays of one turn."""
ROBOT_CELLS = 2
"""Cells around the base's own that have to be free."""
SEEN_CELLS = 3
"""Cells of a piece of furniture that have to be hit for it to be made out."""
Swept = tuple[np.ndarray, np.ndarray, tuple[int, ...]]


class Floor:
    """Cells of 10 cm. What is worked out once is kept: arms that are compared drive through the same apartment."""

    def __init__(self, apartment: Apartment) -> None:
        low = np.min([room.low for room in apartment.rooms], axis=0)
        high = np.max([room.high for room in apartment.rooms], axis=0)
        self._corner = np.rint(low / CELL).astype(int) - 1
        shape = np.rint(high / CELL).astype(int) + 2 - self._corner
        self._x = (np.arange(shape[0]) + self._corner[0])[:, None] * CELL
        self._y = (np.arange(shape[1]) + self._corner[1])[None, :] * CELL
        self.occupied = np.ones(shape, bool)
        for room in apartment.rooms:
            middle = [(a + b) / 2 for a, b in zip(room.low, room.high, strict=True)]
            half = [(b - a) / 2 - CELL / 2 - 2e-9 for a, b in zip(room.low, room.high, strict=True)]
            self.occupied &= ~self._within(middle, half)
        for door in apartment.doors:
            self.occupied &= ~self._within(door.centre, (door.width / 2, door.width / 2))
        self._owner = np.full(shape, -1, np.int16)
        for number, piece in enumerate(apartment.furniture):
            within = self._within(piece.centre, [side / 2 for side in piece.size])
            self.occupied |= within
            self._owner[within] = number
        self._swept: dict[tuple[float, float], Swept] = {}

    def _within(self, centre: tuple[float, ...] | list[float], half: tuple[float, ...] | list[float]) -> np.ndarray:
        """Return (H, W): cells whose middle is in a rectangle."""
        near_x = abs(self._x - centre[0]) <= half[0] + 1e-9
        near_y = abs(self._y - centre[1]) <= half[1] + 1e-9
        return np.asarray(near_x & near_y)

    def stands(self, base: Base) -> bool:
        """Whether the base is on free floor."""
        i, j = np.array(cell_of(base.x, base.y)) - self._corner
        k, (height, width) = ROBOT_CELLS, self.occupied.shape
        if not (k <= i < height - k and k <= j < width - k):
            return False
        return not self.occupied[i - k : i + k + 1, j - k : j + k + 1].any()

    def cells(self) -> tuple[np.ndarray, np.ndarray]:
        """Return free and occupied cells (N, 2) of all that there is."""
        return np.argwhere(~self.occupied) + self._corner, np.argwhere(self.occupied) + self._corner

    def swept(self, base: Base) -> Swept:
        """Return free and occupied cells (N, 2) that are seen from a base pose, and numbers of furniture made out."""
        at = (base.x, base.y)
        if at not in self._swept:
            self._swept[at] = self._cast(base)
        return self._swept[at]

    def _cast(self, base: Base) -> Swept:
        """Cast rays over the floor to the first occupied cell."""
        angles = np.linspace(-pi, pi, RAYS, endpoint=False)
        steps = np.arange(0.0, RANGE, CELL / 2)
        x, y = base.x + np.outer(np.cos(angles), steps), base.y + np.outer(np.sin(angles), steps)
        rows = np.stack([np.rint(x / CELL), np.rint(y / CELL)], axis=-1).astype(int) - self._corner
        inside = (rows >= 0).all(-1) & (rows < self.occupied.shape).all(-1)
        rows = np.clip(rows, 0, np.array(self.occupied.shape) - 1)
        hit = self.occupied[rows[..., 0], rows[..., 1]] | ~inside
        passed = np.cumsum(hit, axis=1)
        free, struck = self._once(rows[passed == 0]), self._once(rows[hit & (passed == 1)])
        owners, counts = np.unique(self._owner[struck[:, 0], struck[:, 1]], return_counts=True)
        furniture_seen = tuple(int(k) for k, n in zip(owners, counts, strict=True) if k >= 0 and n >= SEEN_CELLS)
        return free + self._corner, struck + self._corner, furniture_seen

    def _once(self, rows: np.ndarray) -> np.ndarray:
        """Return the rows (N, 2) once each, in order."""
        hit = np.zeros(self.occupied.shape, bool)
        hit[rows[:, 0], rows[:, 1]] = True
        return np.argwhere(hit)
