"""Both drivers move at once, each with its own clock."""

from __future__ import annotations

import numpy as np
from scenewright.stages.kit.geometry.transforms import transform_from
from scenewright.stages.suture.motion.primitives import straight
from scenewright.stages.suture.trials.bench import Bench
from scenewright.stages.suture.trials.places import BESIDE, GRASPING
from scenewright.stages.suture.trials.wound import exit_

BACK = np.array([0.015, 0.0, 0.005])
"""How far [m] the left driver gives way for the look before another try."""


class BothAtOnce:
    """Coordination: a driver that has nothing to hold goes where it will be wanted while the other one works, instead
    of before or after it."""

    def withdraw(self, bench: Bench, arm: str, pose: np.ndarray) -> None:
        """Take an empty driver away to a pose (4, 4) while the other one goes on."""
        bench.move(arm, straight(bench.tools[arm], pose), aside=True)

    def wait_at(self, bench: Bench, arm: str, pose: np.ndarray) -> None:
        """Send an empty driver to the pose (4, 4) where it will be wanted."""
        self.withdraw(bench, arm, pose)

    def near_entry(self, bench: Bench, rotation: np.ndarray, place: np.ndarray) -> None:
        """Go straight to the wound: the left driver waits beside it."""

    def after_sweep(self, bench: Bench) -> None:
        """Take the left driver beside the wound, turned as it will grasp."""
        bench.go("left", transform_from(GRASPING, exit_(bench.suture) + BESIDE))

    def stand_back(self, bench: Bench, attempt: int) -> None:
        """Give way after a try that failed."""
        if attempt > 0:
            back = bench.tools["left"].copy()
            back[:3, 3] += BACK
            bench.go("left", back)
