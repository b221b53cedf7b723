"""The parse tree of a plan as a picture: pieces by number and type, and the probability of every rule."""

from __future__ import annotations

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image
from scenewright.schemas.cutting_plan import CuttingPlanFile
from scenewright.stages.kit.drawing.palette import instance_color
from scenewright.stages.kit.drawing.tree_layout import tree_layout

DOTS, ROW = 100, 0.3
"""Dots and inches of a row."""
TALLEST = 60.0
"""Greatest height of the picture [inches]: rows of larger trees stand closer."""
EDGE = "#90a0b0"


def draw_tree(file: CuttingPlanFile, width: int) -> Image.Image:
    """Return the tree of a plan's cuts, objects left, fragments right; `width` [px]."""
    cuts = {cut.piece: cut for cut in file.cuts}
    parents: dict[str, str | None] = {_name(number): None for number in range(file.objects)}
    for cut in file.cuts:
        parents |= {_name(number): _name(cut.piece) for number in cut.results}
    places = tree_layout(parents)
    rows = 1.0 + max(row for _, row in places.values())
    deepest = max(depth for depth, _ in places.values())
    figure = Figure(figsize=(width / DOTS, min(TALLEST, 0.6 + ROW * rows)), dpi=DOTS)
    axes = figure.add_axes((0.02, 0.02, 0.96, 0.96))
    for name, above in parents.items():
        if above is not None:
            (x, y), (x_above, y_above) = places[name], places[above]
            axes.plot([x_above, x_above + 0.45, x], [y_above, y, y], color=EDGE, linewidth=0.9, zorder=0)
    for name, (x, y) in places.items():
        number = int(name)
        mine = cuts.get(number)
        words = str(number)
        if mine is not None and mine.chance is not None:
            words += f"  type {mine.types[0]} into {mine.types[1]}, {mine.types[2]}  p {mine.chance:.2f}"
        color = 1.0 - 0.35 * (1.0 - np.array(instance_color(number + 1)))  # opaque: lines end at the box
        box = {"boxstyle": "round,pad=0.25", "facecolor": tuple(color), "edgecolor": EDGE, "linewidth": 0.6}
        axes.text(x, y, words, fontsize=7, va="center", ha="left", bbox=box)
    axes.set_xlim(-0.05, deepest + 0.45)
    axes.set_ylim(rows - 0.4, -0.6)
    axes.axis("off")
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB").quantize(64)


def _name(number: int) -> str:
    return f"{number:04d}"
