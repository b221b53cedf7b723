"""Key frames and motions of a trial as arrays."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from stages.kit.geometry.transforms import inverse
from stages.suture.robot.arms import ARMS
from stages.suture.robot.inverse import solutions

ARM_ORDER = ("right", "left")
KEPT_OF_A_MOTION = 8
"""So many poses of each motion are kept, its last one always."""


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
        self._motions: list[tuple[float, int, np.ndarray, np.ndarray]] = []

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
        self.tools.append(np.stack([tools[name] for name in ARM_ORDER]))
        self.needles.append(needle.copy())
        self.ropes.append(rope.copy())

    def follow(self, arm: str, path: np.ndarray, needles: np.ndarray, started: float, ended: float) -> None:
        """Add a motion of one arm: tool poses (K, 4, 4) and needle poses (K, 4, 4) from `started` to `ended` [s]."""
        which = np.unique(np.linspace(0, len(path) - 1, KEPT_OF_A_MOTION).astype(int))
        for k in which:
            at = started + (ended - started) * (k / max(1, len(path) - 1))
            self._motions.append((at, ARM_ORDER.index(arm), path[k].copy(), needles[k].copy()))

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
        """Return seconds (M,), arm (M,; 0 right, 1 left), world_from_tool and world_from_needle (M, 4, 4), and the
        arm's joints (M, 6), each solution the one nearest to the arm's last; NaN where the pose has none."""
        tools = np.array([tool for _, _, tool, _ in self._motions]).reshape(-1, 4, 4)
        return {
            "seconds": np.array([seconds for seconds, *_ in self._motions]),
            "arm": np.array([arm for _, arm, *_ in self._motions], dtype=np.int8),
            "world_from_tool": tools,
            "world_from_needle": np.array([needle for *_, needle in self._motions]).reshape(-1, 4, 4),
            "joints": self._joints(),
        }

    def _joints(self) -> np.ndarray:
        joints = np.full((len(self._motions), 6), np.nan)
        last = {name: np.zeros(6) for name in ARM_ORDER}
        for row, (_, arm, tool, _) in enumerate(self._motions):
            name = ARM_ORDER[arm]
            choices = solutions(inverse(ARMS[name].world_from_base) @ tool)
            if len(choices):
                joints[row] = choices[np.argmin(np.abs(choices - last[name]).max(axis=-1))]
                last[name] = joints[row]
        return joints

    def write(self, path: Path) -> None:
        """Write the frames as one .npz that needs no pickle."""
        np.savez_compressed(path, allow_pickle=False, **self.arrays())
