"""Where to draw the nodes of a support tree: depth goes right, leaves go down, parents at their children's middle."""

from __future__ import annotations

import math
from collections.abc import Mapping


def tree_layout(
    parents: Mapping[str, str | None], order: Mapping[str, float] | None = None
) -> dict[str, tuple[float, float]]:
    """Return (depth, row) of every node. `parents`: node -> parent, None for a root.

    Leaves take rows 0, 1, ... in order of (subtree first by name); a parent stands at the mean of its first and last
    child. `order`: node -> where it should stand among its siblings (rows of another tree, to draw two beside each
    other); nodes that are not in it come last. A node whose parent is no key is a root. Raises ValueError for a circle.
    """
    children: dict[str | None, list[str]] = {}
    ranks = order or {}
    for name in sorted(parents, key=lambda name: (ranks.get(name, math.inf), name)):
        above = parents[name]
        children.setdefault(above if above in parents else None, []).append(name)
    positions: dict[str, tuple[float, float]] = {}
    next_row = 0
    waiting = [(root, 0, False) for root in reversed(children.get(None, []))]
    while waiting:  # no recursion: a tower may be higher than Python calls deep
        name, depth, placed_below = waiting.pop()
        below = children.get(name, [])
        if below and not placed_below:
            waiting.append((name, depth, True))
            waiting += [(child, depth + 1, False) for child in reversed(below)]
        elif below:
            positions[name] = (float(depth), (positions[below[0]][1] + positions[below[-1]][1]) / 2.0)
        else:
            positions[name] = (float(depth), float(next_row))
            next_row += 1
    if len(positions) != len(parents):
        raise ValueError("the parents form a circle")
    return positions
