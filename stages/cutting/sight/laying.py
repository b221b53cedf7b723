"""How pieces are laid on the board to be seen: flat and apart."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scenewright.stages.cutting.board import LIFT, Board
from scenewright.stages.cutting.world.body import Body
from scenewright.stages.cutting.world.canonical import canonical
from scenewright.stages.kit.geometry.transforms import transform_from

BETWEEN = 0.05
"""Gap between pieces that are laid down beside each other [m]."""
ROW = 0.5
"""Length of a row, where all fragments are laid out together [m]."""
UP = np.array([0.0, 0.0, 1.0])
"""Direction up (3,)."""


class Hand:
    """Lays new pieces flat on the free middle of a board, longest edge across the row, and lets them come to rest.
    What has lain there is put away as it is."""

    def __init__(self) -> None:
        self._known: set[int] = set()
        self.board = Board()

    def close(self) -> None:
        """Let go of the board."""
        self.board.close()

    def lay(self, board: dict[int, Body]) -> None:
        """Lay down the pieces that were not there before, in place, in one row."""
        new_bodies = {number: body for number, body in board.items() if number not in self._known}
        self._known |= set(new_bodies)
        board |= self._at_rest(dict(zip(new_bodies, in_rows(list(new_bodies.values()), np.inf, BETWEEN), strict=True)))

    def lay_out(self, bodies: Sequence[Body], gap: float = BETWEEN) -> list[Body]:
        """Return bodies as they come to rest, laid in rows this far apart [m]."""
        return list(self._at_rest(dict(enumerate(in_rows(bodies, ROW, gap)))).values())

    def _at_rest(self, laid: dict[int, Body]) -> dict[int, Body]:
        self.board.rest(laid)  # physics keeps a margin under hulls
        return {number: body.shifted(-body.extent_along(UP)[0] * UP) for number, body in laid.items()}


def in_rows(bodies: Sequence[Body], length: float, gap: float) -> list[Body]:
    """Return bodies flat, side by side in rows of at most this length, the gap apart [m], over the board's middle."""
    laid: list[Body] = []
    rows: list[list[int]] = []
    end = 0.0
    for number, body in enumerate(bodies):
        laid.append(_flat(body))
        width = float(np.ptp(laid[-1].vertices[:, 0]))
        if not rows or end + width > length:
            rows.append([])
            end = 0.0
        rows[-1].append(number)
        end += width + gap
    y = 0.0
    for row in rows:
        deepest = max(float(np.ptp(laid[n].vertices[:, 1])) for n in row)
        widths = [float(np.ptp(laid[n].vertices[:, 0])) for n in row]
        ends = np.cumsum([0.0] + [width + gap for width in widths])
        for number, start in zip(row, ends[:-1] - 0.5 * (ends[-1] - gap), strict=True):
            to = np.array([start - laid[number].vertices[:, 0].min(), y + 0.5 * deepest, 0.0])
            laid[number] = laid[number].shifted(to)
        y += deepest + gap
    back = np.array([0.0, -0.5 * (y - gap), 0.0])
    return [body.shifted(back) for body in laid]


def _flat(body: Body) -> Body:
    """Return a body with its shortest axis up and its longest along y, just over the board's middle."""
    axes = canonical(body).world_from_fragment[:3, :3]
    turned = body.moved(transform_from(axes[:, [1, 2, 0]].T, np.zeros(3)))
    low, high = turned.vertices.min(axis=0), turned.vertices.max(axis=0)
    return turned.shifted(np.array([0.0, -0.5 * (low[1] + high[1]), LIFT - low[2]]))
