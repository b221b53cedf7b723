"""Depth and translations that differ by a factor: which unit of which of the two it is, and how large a room is then.

The factor alone can't tell: a log that is seen through depth times 4 is the same as one whose cameras moved a quarter
as far. A unit that depth images are known to have, and a room that has the size of a room, do.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from scenewright.stages.ingest.preflight.looking import Look
from scenewright.stages.kit.geometry.cameras import back_project
from scenewright.stages.kit.geometry.transforms import apply

TYPICAL = (0.4, 6.0)
"""Median depth [m] of rooms and tables; used to choose between explanations, never to refuse."""
USUAL = 1.8
"""Median depth [m] of a log of a room, by eye."""
COMMON = (1000.0, 5000.0, 10000.0)
"""Units a metre that depth images have: millimetres, TUM, 0.1 mm (RealSense D405)."""
DEPTH_UNITS = (*COMMON, 6553.5, 4000.0, 8000.0, 256.0, 100.0, 1.0)
"""The same with those of Replica, RealSense L515 and SR300, eight bits of fraction (Void), centimetres, and metres."""
RATIOS = (5.0, 6.5535, 1 / 5.0, 1 / 6.5535)
"""What millimetres and the units of TUM and Replica are, one taken for another: of depth, never of translations."""
POSE_UNITS = (1.0, 0.001, 0.01, 0.0254, 0.3048, 0.1, 10.0, 100.0, 1000.0)
"""Factors to metres of known units of translations, and powers of ten."""
LENGTHS = (0.001, 0.01)
"""Those that a log has whose depth is not in millimetres either."""
SAME_UNIT = math.log(1.04)
"""A measured factor this near to a known one is that: the fit finds it to some percent."""


@dataclass(frozen=True)
class Reading:
    """One way in which depth and translations agree."""

    depth_scale: float
    """Units a metre that depth is read with."""
    pose_scale: float
    """Factor of the translations."""
    changes: tuple[str, ...]
    """Of `depth_scale` and `pose_scale`, what differs from how the log was read."""
    depth: float
    """Median depth [m]."""
    room: float | None
    """Largest extent of what is seen [m]."""

    @property
    def typical(self) -> bool:
        """Whether a room, or a table, is seen from as far."""
        return TYPICAL[0] <= self.depth <= TYPICAL[1]

    def words(self, pose_scale: float = 1.0) -> str:
        """Return the options of ingest, and the size of the room under them; `pose_scale` is what they have already."""
        options = []
        if "depth_scale" in self.changes:
            options.append(f"--depth-scale {self.depth_scale:.6g}")
        if "pose_scale" in self.changes:
            options.append(f"--pose-scale {pose_scale * self.pose_scale:.4g}")
        size = f"a room of {self.room:.3g} m" if self.room is not None else f"{self.depth:.3g} m away"
        return f"{' '.join(options)} ({size})"


def readings(scale: float, units: float, median_depth: float, room: float | None) -> list[Reading]:
    """Return how depth and translations may agree, the likeliest first; two at least, of each of the two alone.

    `scale` is what translations must be multiplied by for depth that was read with `units` a metre; `median_depth` and
    `room`, its largest extent with translations so multiplied [m], are of depth as it was read.
    """

    def reading(depth_scale: float, pose_scale: float, *changes: str) -> Reading:
        factor = units / depth_scale
        return Reading(depth_scale, pose_scale, changes, median_depth * factor, None if room is None else room * factor)

    depth_scale = known(units * scale, DEPTH_UNITS)
    found = [reading(depth_scale, 1.0, "depth_scale"), reading(units, known(scale, POSE_UNITS), "pose_scale")]
    found += [
        reading(unit, length, "depth_scale", "pose_scale")
        for unit in DEPTH_UNITS
        for length in LENGTHS
        if unit != units and abs(math.log(scale * units / (unit * length))) < SAME_UNIT
    ]

    is_ratio = known(scale, RATIOS) in RATIOS

    def rank(entry: Reading) -> tuple[bool, int, bool]:
        odd = entry.changes == ("depth_scale",) and not (entry.depth_scale in DEPTH_UNITS or is_ratio)
        return not entry.typical, len(entry.changes), odd

    # Stable: of two that are as likely, depth is first.
    return [entry for entry in sorted(found, key=rank) if len(entry.changes) == 1 or entry.typical]


def known(value: float, units: Iterable[float]) -> float:
    """Return the known unit that a measured value is, or the value itself where it is near none."""
    nearest = min(units, key=lambda unit: abs(math.log(value / unit)))
    return nearest if abs(math.log(value / nearest)) < SAME_UNIT else value


def plausible_units(median_depth: float, units: float) -> list[float]:
    """Return the known units a metre that make a median depth [m], read with `units`, one of a room, likelier first."""
    depths = {unit: median_depth * units / unit for unit in DEPTH_UNITS if unit != units}
    fitting = [unit for unit, depth in depths.items() if TYPICAL[0] <= depth <= TYPICAL[1]]
    return sorted(fitting, key=lambda unit: (unit not in COMMON, abs(math.log(depths[unit] / USUAL))))


def room_extent(looks: Sequence[tuple[Look, np.ndarray]]) -> float | None:
    """Return the largest extent [m] along an axis of what frames with their poses (4, 4) see, without its 2 percent on
    either side; None without depth."""
    clouds = []
    for look, pose in looks:
        if look.depth is not None:
            points = back_project(look.depth * np.float32(1e-3), look.depth_camera, stride=4).reshape(-1, 3)
            clouds.append(apply(pose, points[points[:, 2] > 0].astype(float)))
    if not clouds or not sum(map(len, clouds)):
        return None
    return float(np.ptp(np.percentile(np.concatenate(clouds), (2, 98), axis=0), axis=0).max())
