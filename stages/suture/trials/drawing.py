"""A strip of pictures of one suture: key frames of a recorded trial from above and from the side (figure 3.2)."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt  # noqa: E402
import numpy as np  # noqa: E402

from stages.suture.motion.needle import ARC_POINTS  # noqa: E402
from stages.suture.trials.wound import RIDGE_HALF_WIDTH, RIDGE_HEIGHT, SUTURES, entry, exit_  # noqa: E402

COLORS = {"right": "#2f6fb3", "left": "#4d9a6a", "needle": "#b0413e", "thread": "#7a4fb0", "wound": "#e8c9b5"}
SHAFT_SHOWN = 0.05
VIEWS = ((0, 2, "front: x, z [mm]"), (0, 1, "above: x, y [mm]"))
LIMITS = {0: (-72, 72), 1: (-52, 72), 2: (-4, 92)}


def draw_strip(path: Path, frames: Mapping[str, np.ndarray], suture: int | None = None, most: int = 12) -> int:
    """Draw recorded frames (trials/recording.py) as PNG, a column each; return how many were drawn.

    Seen as by the thesis's cameras: the right driver on the right. `suture`: only frames of this one. ValueError when
    there is no such frame.
    """
    rows = np.flatnonzero(frames["suture"] == suture) if suture is not None else np.arange(len(frames["panel"]))
    rows = rows[:most]
    if not len(rows):
        raise ValueError(f"no frame of suture {suture} was recorded")
    figure, axes = plt.subplots(2, len(rows), figsize=(2.1 * len(rows), 4.2), squeeze=False, layout="constrained")
    for column, row in enumerate(rows):
        for line, (across, upwards, label) in enumerate(VIEWS):
            _draw(axes[line, column], frames, int(row), across, upwards)
            if column == 0:
                axes[line, column].set_ylabel(label, fontsize=7)
        seconds = float(frames["seconds"][row])
        axes[0, column].set_title(f"{frames['panel'][row]}\n{seconds:.0f} s", fontsize=7.5)
    figure.savefig(path, dpi=110, metadata={"Software": None})
    plt.close(figure)
    return len(rows)


def _draw(axes: Any, frames: Mapping[str, np.ndarray], row: int, across: int, upwards: int) -> None:
    sign = np.array([-1.0, 1.0, 1.0])  # the cameras look along -y, so that x runs to the left

    def line(points: np.ndarray, color: str, width: float) -> None:
        shown = points * sign * 1000.0
        axes.plot(shown[:, across], shown[:, upwards], color=color, linewidth=width, solid_capstyle="round")

    if upwards == 2:
        angle = np.linspace(0.0, np.pi, 40)
        axes.fill(1000 * RIDGE_HALF_WIDTH * np.cos(angle), 1000 * RIDGE_HEIGHT * np.sin(angle), color=COLORS["wound"])
        axes.axhline(0.0, color="#999999", linewidth=0.6)
    else:
        axes.axvspan(-1000 * RIDGE_HALF_WIDTH, 1000 * RIDGE_HALF_WIDTH, color=COLORS["wound"])
    holes = np.array([point for k in range(SUTURES) for point in (entry(k), exit_(k))]) * sign * 1000.0
    axes.plot(holes[:, across], holes[:, upwards], ".", color="#8a5a44", markersize=1.5)
    line(frames["thread"][row], COLORS["thread"], 0.9)
    needle = frames["world_from_needle"][row]
    arc = ARC_POINTS @ needle[:3, :3].T + needle[:3, 3]
    line(arc, COLORS["needle"], 1.8)
    axes.plot(*(arc[0] * sign * 1000.0)[[across, upwards]], "o", color="#e08a2e", markersize=2.5)
    for which, name in enumerate(("right", "left")):
        tool = frames["world_from_tool"][row, which]
        jaw = np.stack([tool[:3, 3] + 0.006 * tool[:3, 2], tool[:3, 3] - 0.010 * tool[:3, 2]])
        line(jaw, COLORS[name], 2.6)
        line(np.stack([jaw[1], jaw[1] - SHAFT_SHOWN * tool[:3, 2]]), COLORS[name], 0.8)
    axes.set_xlim(*LIMITS[across])
    axes.set_ylim(*LIMITS[upwards])
    axes.set_aspect("equal")
    axes.tick_params(labelsize=5)
