"""A strip of pictures of one suture: key frames of a recorded trial from the cameras and from above (figure 3.2)."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt  # noqa: E402
import numpy as np  # noqa: E402
from matplotlib.lines import Line2D  # noqa: E402
from scenewright.stages.suture.motion.needle import ARC_POINTS  # noqa: E402
from scenewright.stages.suture.robot.arms import REMOTE_CENTRES  # noqa: E402
from scenewright.stages.suture.robot.psm import YAW_TO_TIP  # noqa: E402
from scenewright.stages.suture.trials.recording import ARM_ORDER  # noqa: E402
from scenewright.stages.suture.trials.wound import RIDGE_HALF_WIDTH, RIDGE_HEIGHT, SUTURES, entry, exit_  # noqa: E402

COLORS = {
    "right driver": "#2f6fb3",
    "left driver": "#4d9a6a",
    "needle": "#b0413e",
    "tip": "#e08a2e",
    "thread": "#7a4fb0",
    "wound": "#e8c9b5",
    "holes": "#8a5a44",
}
MILLIMETRES = np.array([-1000.0, -1000.0, 1000.0])
"""Factors of x, y and z as drawn [mm/m]: seen as by one who stands at the cameras, which look along -y. So x runs to
the left, away is up."""
VIEWS = ((0, 2, "from the cameras"), (0, 1, "from above"))
"""Axis across, axis up, and name of each view."""
LIMITS = {0: (-72, 72), 1: (-76, 56), 2: (-4, 102)}
"""Axis -> what of it is drawn [mm]."""
ACROSS, SIDE = 6, 2.3
"""Pictures in a row, and the side of one [inches]."""
ORDER = "abcdefghijk"


def draw_strip(path: Path, frames: Mapping[str, np.ndarray], suture: int | None = None, most: int = 12) -> int:
    """Draw recorded frames (trials/recording.py) as PNG, six columns across; return how many were drawn.

    The first suture that was thrown whole, in the order of figure 3.2, a to k (its needle is corrected before it is
    inserted, so i to k are those of the next). Where none was, or for one `suture` (0 first), the frames as they come.
    ValueError when there is no such frame.
    """
    rows = np.flatnonzero(frames["suture"] == suture) if suture is not None else whole_suture(frames)
    rows = rows[:most]
    if not len(rows):
        raise ValueError(f"no frame of suture {suture} was recorded")
    bands = -(-len(rows) // ACROSS)
    columns = min(ACROSS, len(rows))
    heights = [np.ptp(LIMITS[upwards]) for _ in range(bands) for _, upwards, _ in VIEWS]
    size = (SIDE * columns + 0.3, SIDE / np.ptp(LIMITS[0]) * sum(heights) + 0.5 * bands + 0.3)
    figure, axes = plt.subplots(
        2 * bands, columns, figsize=size, squeeze=False, layout="constrained", height_ratios=heights
    )
    for axis in axes.flat:
        axis.axis("off")
    for number, row in enumerate(rows):
        band, column = divmod(number, ACROSS)
        for line, (across, upwards, label) in enumerate(VIEWS):
            axis = axes[2 * band + line, column]
            _draw(axis, frames, int(row), across, upwards)
            if column == 0:
                axis.set_ylabel(f"{label} [mm]", fontsize=7)
        axes[2 * band, column].set_title(
            f"{frames['panel'][row]}\n{float(frames['seconds'][row]):.0f} s", fontsize=8, loc="left"
        )
    handles = [
        Line2D(
            [],
            [],
            color=color,
            marker="o" if name in ("tip", "holes") else None,
            markersize=3,
            linestyle="none" if name in ("tip", "holes") else "-",
            linewidth=5 if name == "wound" else 2,
            label=name,
        )
        for name, color in COLORS.items()
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=min(len(COLORS), 2 * columns), fontsize=7)
    figure.savefig(path, dpi=110, metadata={"Software": None})
    plt.close(figure)
    return len(rows)


def whole_suture(frames: Mapping[str, np.ndarray]) -> np.ndarray:
    """Return the rows of the first suture with its panels a to h and, of the correction after it, i to k; of panels
    that were tried more than once the last. All rows where no suture was thrown whole."""
    names = [str(panel) for panel in frames["panel"]]
    letters = np.array([name[0] if name[1:2] == ":" else "" for name in names])
    released = np.flatnonzero(letters == "h")
    inserted = np.flatnonzero(letters == "b")
    if not len(released) or not (inserted < released[0]).any():
        return np.arange(len(letters))
    start = int(inserted[inserted < released[0]].max())
    after = np.flatnonzero(inserted > released[0])
    end = int(inserted[after[0]]) if len(after) else len(letters)
    row_of_panel: dict[str, int] = {}
    for row in range(max(0, start - 1), end):
        panel = names[row]
        in_suture = row >= start or letters[row] == "a"
        if in_suture and letters[row] and letters[row] in ORDER and not (letters[row] == "a" and row > start):
            row_of_panel[panel] = row
    return np.array(sorted(row_of_panel.values(), key=lambda row: (ORDER.index(names[row][0]), row)))


def _draw(axes: Any, frames: Mapping[str, np.ndarray], row: int, across: int, upwards: int) -> None:
    def line(points: np.ndarray, color: str, width: float) -> None:
        in_millimetres = points * MILLIMETRES
        axes.plot(
            in_millimetres[:, across], in_millimetres[:, upwards], color=color, linewidth=width, solid_capstyle="round"
        )

    axes.axis("on")
    if upwards == 2:
        angle = np.linspace(0.0, np.pi, 40)
        axes.fill(1000 * RIDGE_HALF_WIDTH * np.cos(angle), 1000 * RIDGE_HEIGHT * np.sin(angle), color=COLORS["wound"])
        axes.axhline(0.0, color="#999999", linewidth=0.6)
    else:
        axes.axvspan(-1000 * RIDGE_HALF_WIDTH, 1000 * RIDGE_HALF_WIDTH, color=COLORS["wound"])
    holes = np.array([point for k in range(SUTURES) for point in (entry(k), exit_(k))]) * MILLIMETRES
    axes.plot(holes[:, across], holes[:, upwards], ".", color=COLORS["holes"], markersize=1.5)
    line(frames["thread"][row], COLORS["thread"], 0.9)
    needle = frames["world_from_needle"][row]
    arc = ARC_POINTS @ needle[:3, :3].T + needle[:3, 3]
    for which, name in enumerate(ARM_ORDER):
        tool, color = frames["world_from_tool"][row, which], COLORS[f"{name} driver"]
        wrist = tool[:3, 3] - YAW_TO_TIP * tool[:3, 2]
        line(np.stack([tool[:3, 3] + 0.006 * tool[:3, 2], wrist]), color, 2.8)
        line(np.stack([wrist, REMOTE_CENTRES[name]]), color, 1.1)
    line(arc, COLORS["needle"], 1.8)
    axes.plot(*(arc[0] * MILLIMETRES)[[across, upwards]], "o", color=COLORS["tip"], markersize=2.8)
    axes.set_xlim(*LIMITS[across])
    axes.set_ylim(*LIMITS[upwards])
    axes.set_aspect("equal")
    axes.tick_params(labelsize=5)
