"""Key frames of a trial as arrays."""

from __future__ import annotations

from pathlib import Path

import numpy as np

ARM_ORDER = ("right", "left")


class Recorder:
    """Keeps tool and needle poses and the thread at named moments (panels of figure 3.2)."""

    def __init__(self) -> None:
        self.panels: list[str] = []
        self.sutures: list[int] = []
        self.seconds: list[float] = []
        self.tools: list[np.ndarray] = []
        self.needles: list[np.ndarray] = []
        self.ropes: list[np.ndarray] = []

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

    def write(self, path: Path) -> None:
        """Write the frames as one .npz that needs no pickle."""
        np.savez_compressed(path, allow_pickle=False, **self.arrays())
