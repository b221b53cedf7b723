"""Plans that were tried as one tree: what they share is drawn once, and at each cut branch stands the reason."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, field

from matplotlib.axes import Axes
from matplotlib.figure import Figure

CUT, UNMET, REACHED = "#b3261e", "#a86400", "#2e7d32"
"""Colours of an action without a motion, of a plan whose goal does not hold, of one that was carried through."""
EDGE, BOX = "#90a0b0", "#eef2f6"
MOST_BRANCHES, LONGEST_REASON = 28, 110
"""Most plans that are drawn, and longest reason [characters]."""
DOTS = 100
"""Dots an inch of the figure."""


@dataclass(frozen=True)
class Branch:
    """One plan as far as it went, and how it ended."""

    steps: tuple[tuple[Hashable, str], ...]
    """Key and label of every step that went through; equal keys are the same step."""
    end: str
    color: str = CUT


@dataclass
class _Node:
    label: str
    children: dict[Hashable, _Node] = field(default_factory=dict)
    ends: list[tuple[str, str]] = field(default_factory=list)


def plan_tree(branches: Sequence[Branch], title: str, width: int = 1100) -> Figure:
    """Return the figure of a tree of plans, numbered from 1; of more than `MOST_BRANCHES` the last. `width` [px]."""
    drawn_branches = branches[-MOST_BRANCHES:]
    hidden = len(branches) - len(drawn_branches)
    root = _Node("start")
    for number, branch in enumerate(drawn_branches, start=hidden + 1):
        node = root
        for key, label in branch.steps:
            node = node.children.setdefault(key, _Node(label))
        node.ends.append((f"{number}: {branch.end}", branch.color))
    deepest = max((len(branch.steps) for branch in drawn_branches), default=0)
    height = max(240, 60 + 34 * len(drawn_branches))
    figure = Figure(figsize=(1.6 * width / DOTS, 1.1 * height / DOTS), dpi=DOTS)
    axes = figure.add_axes((0.01, 0.01, 0.98, 0.93))
    _draw(axes, root, 0, 0.0)
    axes.set_xlim(-0.5, deepest + 4.5)
    axes.set_ylim(max(len(drawn_branches), 1) - 0.3, -0.7)
    axes.axis("off")
    figure.suptitle(title + (f" (the last {len(drawn_branches)}, {hidden} before)" if hidden else ""), fontsize=10)
    return figure


def _draw(axes: Axes, node: _Node, depth: int, row: float) -> float:
    """Draw a node and what follows it from a row down; return how many rows it took."""
    axes.text(
        depth,
        row,
        node.label,
        fontsize=7,
        va="center",
        ha="center",
        bbox={"boxstyle": "round,pad=0.2", "facecolor": BOX, "edgecolor": EDGE},
    )
    used = 0.0
    for child in node.children.values():
        axes.plot([depth, depth + 1], [row, row + used], color=EDGE, linewidth=0.8, zorder=0)
        used += _draw(axes, child, depth + 1, row + used)
    for text, color in node.ends:
        axes.plot([depth, depth + 0.55], [row, row + used], color=color, linewidth=0.8, zorder=0)
        short = text if len(text) < LONGEST_REASON else text[: LONGEST_REASON - 3] + "..."
        axes.text(depth + 0.6, row + used, short, fontsize=7, va="center", color=color)
        used += 1
    return max(used, 1.0)
