"""What the robot knew, as it grew: the obstacle map from above with furniture, things and the way driven."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Rectangle
from PIL import Image
from scenewright.schemas.agent_episode import MapThing
from scenewright.stages.agent.obstacle_map import CELL
from scenewright.stages.agent.senses import Base

MOST_PANELS = 6
"""Most panels of the picture; by eye."""
MOST_FRAMES, FRAME_MILLISECONDS = 24, 500
"""Most frames of the animation, and time that one is shown [ms]; by eye."""
VIEWS, VIEWS_ACROSS = 24, 6
"""Latest views that are shown, and how many in a row; by eye."""
DOTS = 100
"""Resolution of a picture [px/inch]."""
SHADES = np.array([0.72, 1.0, 0.35])
"""Grey of unknown, free and occupied cells."""
FURNITURE_COLOR, THING_COLOR, WAY_COLOR = "#cdb18a", "#c8553d", "#3d6cb9"


@dataclass(frozen=True)
class Panel:
    """What was known after a turn."""

    title: str
    window: np.ndarray
    """(H, W) states of cells, x along the rows."""
    origin: tuple[float, float]
    things: tuple[MapThing, ...]
    way: tuple[tuple[float, float], ...]
    base: Base


def draw_growing_map(path: Path, panels: Sequence[Panel], width: int) -> None:
    """Draw at most six of the panels, evenly chosen, the last one among them."""
    picks = np.unique(np.linspace(0, len(panels) - 1, min(MOST_PANELS, len(panels))).round().astype(int))
    chosen = [panels[k] for k in picks] if panels else []
    columns = max(1, min(3, len(chosen)))
    rows = max(1, -(-len(chosen) // columns))
    figure = Figure(figsize=(width / DOTS, width / DOTS / columns * rows), dpi=DOTS, layout="constrained")
    for number, panel in enumerate(chosen):
        _draw(figure.add_subplot(rows, columns, number + 1), panel)
    FigureCanvasAgg(figure)
    figure.savefig(path, metadata={"Software": None})


def animate_map(path: Path, panels: Sequence[Panel], width: int) -> None:
    """Write a GIF of the map as it grew, at most 24 of the panels, all of the last one's extent; nothing for none."""
    if not panels:
        return
    picks = np.unique(np.linspace(0, len(panels) - 1, min(MOST_FRAMES, len(panels))).round().astype(int))
    last = panels[-1]
    frames = []
    for number in picks:
        figure = Figure(figsize=(width / DOTS, width / DOTS), dpi=DOTS, layout="constrained")
        axes = figure.add_subplot()
        _draw(axes, panels[number])
        (x, y), (height, across) = last.origin, last.window.shape
        axes.set_xlim(x - CELL, x + (height + 1) * CELL)
        axes.set_ylim(y - CELL, y + (across + 1) * CELL)
        canvas = FigureCanvasAgg(figure)
        canvas.draw()
        frames.append(Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3].copy()).quantize(64))
    times = [FRAME_MILLISECONDS] * (len(frames) - 1) + [5 * FRAME_MILLISECONDS]
    frames[0].save(path, save_all=True, append_images=frames[1:], duration=times, loop=0, optimize=False)


def _draw(axes, panel: Panel) -> None:  # type: ignore[no-untyped-def]
    (x, y), (height, width) = panel.origin, panel.window.shape
    extent = (x - CELL / 2, x + (height - 0.5) * CELL, y - CELL / 2, y + (width - 0.5) * CELL)
    axes.imshow(SHADES[panel.window].T, origin="lower", extent=extent, cmap="gray", vmin=0, vmax=1)
    for thing in panel.things:
        px, py, _ = thing.position
        if not thing.place:
            w, d = thing.size
            axes.add_patch(Rectangle((px - w / 2, py - d / 2), w, d, facecolor=FURNITURE_COLOR, edgecolor="black"))
            axes.text(px, py, thing.key, fontsize=6, ha="center", va="center", parse_math=False)
        else:
            axes.add_patch(Circle((px, py), max(0.05, thing.size[0] / 2), color=THING_COLOR, alpha=0.7))
    axes.plot(*zip(*panel.way, strict=True), color=WAY_COLOR, linewidth=1)
    axes.add_patch(Circle((panel.base.x, panel.base.y), 0.25, fill=False, color=WAY_COLOR))
    axes.set_title(panel.title[:48], fontsize=7, parse_math=False)
    axes.set_xticks([])
    axes.set_yticks([])


def write_views(path: Path, pictures: Sequence[tuple[str, np.ndarray]]) -> None:
    """Write the last pictures of the wrist camera (H, W, 3) uint8, all of one size, as one sheet; nothing for none."""
    if not pictures:
        return
    last = [color for _, color in pictures[-VIEWS:]]
    last += [np.full_like(last[0], 255)] * (-len(last) % VIEWS_ACROSS)
    rows = [np.concatenate(last[k : k + VIEWS_ACROSS], axis=1) for k in range(0, len(last), VIEWS_ACROSS)]
    sheet = np.ascontiguousarray(np.concatenate(rows)[..., ::-1])
    path.write_bytes(cv2.imencode(".png", sheet)[1].tobytes())
