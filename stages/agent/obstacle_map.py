"""The obstacle map that the robot draws of what its head camera saw: free, occupied, unknown cells of 10 cm."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import ceil

import numpy as np
from scenewright.schemas.apartment import LARGEST_SIDE
from scenewright.stages.agent.fast_marching import distances
from scenewright.stages.agent.senses import Base, Sweep
from scipy.ndimage import binary_dilation

CELL = 0.1
"""Edge of a cell [m]; cell (i, j) has its middle at (i, j) * CELL of the map frame."""
UNKNOWN, FREE, OCCUPIED = 0, 1, 2
"""States of a cell."""
DEARER = 4.0
"""What a cell costs there: the corners of a turning base come nearer than its sides."""
DEAREST = 20.0
"""What a cell costs that is nearer than the clearance: where the base stands too near to something it first goes away
from it."""
BESIDE_MOVABLE = 2.0
"""Cells that the base keeps from the outline of something movable: that is known finely, and looked at with the arm's
collision model before anything is done there."""
HALF = int(LARGEST_SIDE / CELL) + 20
"""Half a side of the map [cells], with room around the largest apartment."""


def cell_of(x: float, y: float) -> tuple[int, int]:
    """Return the cell of a point [m]."""
    return round(x / CELL), round(y / CELL)


def _around(mask: np.ndarray, cells: float) -> np.ndarray:
    """Return (H, W) bool: cells at most so far from those of a mask (H, W)."""
    k = ceil(cells)
    return binary_dilation(mask, np.hypot(*np.mgrid[-k : k + 1, -k : k + 1]) <= cells)


@dataclass
class ObstacleMap:
    """Grows by sweeps. Only the rectangle around what is known is worked on."""

    start: Base
    clearance: float
    """Cells that the base keeps from what is occupied."""
    comfort: float = 0.0
    """Nearer than so many cells to what is occupied it goes where it has to."""
    state: np.ndarray = field(init=False)
    _aside: np.ndarray = field(init=False, default_factory=lambda: np.zeros((0, 2), int))
    """Cells (N, 2) that something movable stands over now."""
    _driven: np.ndarray = field(init=False)
    """Cells around where the base was."""
    _fields: dict[tuple[int, int], np.ndarray] = field(init=False, default_factory=dict)
    _drivable: np.ndarray | None = field(init=False, default=None)
    _dear: np.ndarray | None = field(init=False, default=None)

    def __post_init__(self) -> None:
        self.state = np.zeros((2 * HALF + 1, 2 * HALF + 1), np.int8)
        self._driven = np.zeros(self.state.shape, bool)
        i, j = cell_of(self.start.x, self.start.y)
        self._zero = (i - HALF, j - HALF)
        self._low, self._high = np.array([HALF - 1, HALF - 1]), np.array([HALF + 2, HALF + 2])

    def add(self, sweep: Sweep) -> int:
        """Enter what a sweep saw; return how many cells were not known before. Occupied wins."""
        before = np.count_nonzero(self.window)
        for cells, value in ((sweep.free, FREE), (sweep.occupied, OCCUPIED)):
            if not len(cells):
                continue
            rows = cells - self._zero
            self._low, self._high = np.minimum(self._low, rows.min(0)), np.maximum(self._high, rows.max(0) + 1)
            target = self.state[rows[:, 0], rows[:, 1]]
            self.state[rows[:, 0], rows[:, 1]] = np.maximum(target, value)
        self._fields.clear()
        self._drivable = self._dear = None
        return int(np.count_nonzero(self.window) - before)

    @property
    def window(self) -> np.ndarray:
        """(H, W) the known rectangle of the state."""
        return self.state[self._low[0] : self._high[0], self._low[1] : self._high[1]]

    @property
    def origin(self) -> tuple[float, float]:
        """Middle of the window's first cell [m]."""
        return (self._low[0] + self._zero[0]) * CELL, (self._low[1] + self._zero[1]) * CELL

    def _in_window(self, x: float, y: float) -> tuple[int, int] | None:
        i, j = cell_of(x, y)
        row, column = i - self._zero[0] - self._low[0], j - self._zero[1] - self._low[1]
        height, width = self.window.shape
        return (int(row), int(column)) if 0 <= row < height and 0 <= column < width else None

    @property
    def drivable(self) -> np.ndarray:
        """(H, W) bool: cells of the window where the base fits."""
        if self._drivable is None:
            too_close = _around(self.window == OCCUPIED, self.clearance) | _around(
                self._movable_cells(), BESIDE_MOVABLE
            )
            self._drivable = (self.window == FREE) & ~too_close
        return self._drivable

    def _near_obstacles(self, cells: float) -> np.ndarray:
        """Return (H, W) bool: cells of the window at most so far from what is occupied, for good or now."""
        return _around((self.window == OCCUPIED) | self._movable_cells(), cells)

    def _movable_cells(self) -> np.ndarray:
        """Return (H, W) bool: cells of the window that something movable stands over."""
        occupied = np.zeros(self.window.shape, bool)
        rows = self._aside - self._zero - self._low
        rows = rows[np.all((rows >= 0) & (rows < occupied.shape), axis=1)]
        occupied[rows[:, 0], rows[:, 1]] = True
        return occupied

    def put_aside(self, points: np.ndarray) -> None:
        """Say over which points (N, 2) [m] something movable stands now, in place of those said before."""
        self._aside = np.unique(np.rint(points / CELL).astype(int), axis=0).reshape(-1, 2)
        self._fields.clear()
        self._drivable = self._dear = None

    def driven(self, x: float, y: float) -> None:
        """Say that the base was at a point [m]: there it gets through, however near to something that it felt after."""
        i, j = (np.floor(np.array([x, y]) / CELL)).astype(int) - self._zero
        self._driven[i : i + 2, j : j + 2] = True
        self._fields.clear()

    def fits(self, x: float, y: float) -> bool:
        """Whether the base fits at a point [m], as far as is known."""
        at = self._in_window(x, y)
        return at is not None and bool(self.drivable[at])

    def at_ease(self, x: float, y: float) -> bool:
        """Whether nothing occupied is known within the comfortable distance of a point [m]."""
        at = self._in_window(x, y)
        if self._dear is None:
            self._dear = self._near_obstacles(self.comfort)
        return at is not None and not self._dear[at]

    def distances_from(self, x: float, y: float) -> np.ndarray:
        """Return (H, W) distances [m] that the base drives from a point, inf where it cannot get; where it is not
        at ease a multiple of them."""
        at = self._in_window(x, y)
        if at is None:
            return np.full(self.window.shape, np.inf)
        if at not in self._fields:
            k = ceil(self.clearance)
            before = self._driven[self._low[0] : self._high[0], self._low[1] : self._high[1]].copy()
            before[max(0, at[0] - k) : at[0] + k + 1, max(0, at[1] - k) : at[1] + k + 1] = True
            # it stands here already, however near to something
            free = self.drivable | (before & (self.window == FREE) & ~self._movable_cells())
            cost = np.ones(self.window.shape)
            if self.comfort > 0:
                self._dear = self._near_obstacles(self.comfort)
                cost[self._dear] = DEARER
                cost[self._near_obstacles(self.clearance)] = DEAREST
            self._fields[at] = distances(free, cost, at[0], at[1]) * CELL
        return self._fields[at]

    def way(self, start: Base, goal: tuple[float, float]) -> float:
        """Return the distance [m] to drive from a pose to a point; inf where there is no known way."""
        at = self._in_window(*goal)
        return float(self.distances_from(start.x, start.y)[at]) if at is not None else float("inf")

    def path(self, start: Base, goal: tuple[float, float]) -> list[tuple[float, float]] | None:
        """Return points [m] from a pose to a point, down the slope of the distances; None where no way is known."""
        field = self.distances_from(start.x, start.y)
        at = self._in_window(*goal)
        if at is None or not np.isfinite(field[at]):
            return None
        points = [goal]
        while field[at] > 0:
            around = [(at[0] + i, at[1] + j) for i in (-1, 0, 1) for j in (-1, 0, 1)]
            inside = [p for p in around if 0 <= p[0] < field.shape[0] and 0 <= p[1] < field.shape[1]]
            best = min(inside, key=lambda p: float(field[p]))
            if best == at:
                return None
            at = best
            points.append((at[0] * CELL + self.origin[0], at[1] * CELL + self.origin[1]))
        points[-1] = (start.x, start.y)
        return points[::-1] if len(points) > 1 else [(start.x, start.y), goal]

    def frontiers(self) -> np.ndarray:
        """Return (N, 2) points [m]: drivable cells next to which something is unknown."""
        near_unknown = binary_dilation(self.window == UNKNOWN, iterations=ceil(self.clearance) + 1)
        rows = np.argwhere(self.drivable & near_unknown)
        return rows * CELL + np.array(self.origin)
