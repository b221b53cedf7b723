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

    def place(name: str, depth: int) -> float:
        nonlocal next_row
        below = [place(child, depth + 1) for child in children.get(name, [])]
        if below:
            row = (below[0] + below[-1]) / 2.0
        else:
            row = float(next_row)
            next_row += 1
        positions[name] = (float(depth), row)
        return row

    for root in children.get(None, []):
        place(root, 0)
    if len(positions) != len(parents):
        raise ValueError("the parents form a circle")
    return positions
