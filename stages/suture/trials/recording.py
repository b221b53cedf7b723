"""Key frames and motions of a trial as arrays."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scenewright.stages.kit.geometry.transforms import inverse
from scenewright.stages.suture.robot.arms import ARMS
from scenewright.stages.suture.robot.inverse import solutions

ARM_ORDER = ("right", "left")
KEPT_OF_A_MOTION = 8
"""Poses of each motion that are kept, its last one always."""


class Recorder:
    """Keeps tool and needle poses and the thread at named moments (panels of figure 3.2), and what the arms did between
    them. Poses are (4, 4) in the world frame [m]."""

    def __init__(self) -> None:
        self.panels: list[str] = []
        self.sutures: list[int] = []
        self.seconds: list[float] = []
        self.tools: list[np.ndarray] = []
        self.needles: list[np.ndarray] = []
        self.ropes: list[np.ndarray] = []
        self._motions: list[tuple[float, int, np.ndarray, np.ndarray, bool]] = []

    def keep(
        self,
        panel: str,
        suture: int,
        seconds: float,
        tools: dict[str, np.ndarray],
        needle: np.ndarray,
        rope: np.ndarray,
    ) -> None:
        """Add a frame: poses (4, 4) in the world frame, rope (N, 3) [m]."""
        self.panels.append(panel)
        self.sutures.append(suture)
        self.seconds.append(seconds)
        self.tools.append(np.stack([self._tool_at(row, seconds, tools[name]) for row, name in enumerate(ARM_ORDER)]))
        self.needles.append(needle.copy())
        self.ropes.append(rope.copy())

    def follow(
        self, arm: str, path: np.ndarray, needles: np.ndarray, started: float, ended: float, aside: bool = False
    ) -> None:
        """Add a motion of one arm: tool poses (K, 4, 4) and needle poses (K, 4, 4) from `started` to `ended` [s];
        `aside`: beside what the other arm does with the needle meanwhile."""
        which = np.unique(np.linspace(0, len(path) - 1, KEPT_OF_A_MOTION).astype(int))
        for k in which:
            at = started + (ended - started) * (k / max(1, len(path) - 1))
            self._motions.append((at, ARM_ORDER.index(arm), path[k].copy(), needles[k].copy(), aside))

    def arrays(self) -> dict[str, np.ndarray]:
        """Return panel (F,), suture (F,), seconds (F,), world_from_tool (F, 2, 4, 4; right, left), world_from_needle
        (F, 4, 4), thread (F, N, 3) [m]."""
        return {
            "panel": np.array(self.panels, dtype="U40"),
            "suture": np.array(self.sutures, dtype=np.int32),
            "seconds": np.array(self.seconds),
            "world_from_tool": np.array(self.tools).reshape(-1, 2, 4, 4),
            "world_from_needle": np.array(self.needles).reshape(-1, 4, 4),
            "thread": np.array(self.ropes),
        }

    def motions(self) -> dict[str, np.ndarray]:
        """Return, by time, seconds (M,), arm (M,; 0 right, 1 left), world_from_tool and world_from_needle (M, 4, 4),
        and the arm's joints (M, 6), each solution the one nearest to the arm's last; NaN where the pose has none."""
        rows = sorted(self._motions, key=lambda row: row[0])
        needles, last = [], None
        for _, _, _, needle, aside in rows:
            last = needle if last is None or not aside else last
            needles.append(last)
        return {
            "seconds": np.array([row[0] for row in rows]),
            "arm": np.array([row[1] for row in rows], dtype=np.int8),
            "world_from_tool": np.array([row[2] for row in rows]).reshape(-1, 4, 4),
            "world_from_needle": np.array(needles).reshape(-1, 4, 4),
            "joints": _joints([(row[1], row[2]) for row in rows]),
        }

    def _tool_at(self, arm: int, seconds: float, there: np.ndarray) -> np.ndarray:
        """Return where an arm is at a moment: the kept pose (4, 4) nearest in time while it is under way aside."""
        ahead = [row for row in self._motions if row[1] == arm and row[4] and row[0] > seconds]
        return min(ahead, key=lambda row: row[0])[2] if ahead else there

    def write(self, path: Path) -> None:
        """Write the frames as one .npz that needs no pickle."""
        np.savez_compressed(path, allow_pickle=False, **self.arrays())


def _joints(tools: list[tuple[int, np.ndarray]]) -> np.ndarray:
    """Return the joints (M, 6) of arms (0 right, 1 left) at poses (4, 4)."""
    joints = np.full((len(tools), 6), np.nan)
    last = {name: np.zeros(6) for name in ARM_ORDER}
    for row, (arm, tool) in enumerate(tools):
        name = ARM_ORDER[arm]
        choices = solutions(inverse(ARMS[name].world_from_base) @ tool)
        if len(choices):
            joints[row] = choices[np.argmin(np.abs(choices - last[name]).max(axis=-1))]
            last[name] = joints[row]
    return joints
