"""The drivers move one at a time."""

from __future__ import annotations

import numpy as np
from scenewright.stages.kit.geometry.transforms import transform_from
from scenewright.stages.suture.trials.bench import HOME, Bench

HOVER = np.array([-0.015, 0.0, 0.02])
"""Way from the place of insertion to where the right driver comes from [m]; by eye."""


class OneAtATime:
    """Coordination: an empty driver goes home and comes when the other one is done."""

    def withdraw(self, bench: Bench, arm: str, pose: np.ndarray) -> None:
        """Take an empty driver away to a pose (4, 4) while the other one stands."""
        bench.go(arm, pose)

    def wait_at(self, bench: Bench, arm: str, pose: np.ndarray) -> None:
        """Leave the driver where it is."""

    def near_entry(self, bench: Bench, rotation: np.ndarray, place: np.ndarray) -> None:
        """Lead the right driver over the wound first."""
        bench.go("right", transform_from(rotation, place + HOVER))

    def after_sweep(self, bench: Bench) -> None:
        """Take the left driver home."""
        bench.go("left", HOME["left"])

    def stand_back(self, bench: Bench, attempt: int) -> None:
        """Take the left driver home."""
        bench.go("left", HOME["left"])
