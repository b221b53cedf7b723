"""The left driver pulls the needle away from the wound."""

from __future__ import annotations

import numpy as np
from scenewright.stages.suture.motion.needle import point_at
from scenewright.stages.suture.trials.bench import Bench
from scenewright.stages.suture.trials.wound import exit_

OUTWARDS = np.array([0.249, 0.548, 0.798]) / np.linalg.norm([0.249, 0.548, 0.798])
"""Direction (3,) in which the needle is pulled from the wound, of unit length; by eye."""
LONGEST_PULL = 0.115
"""How far [m] from the wound the left driver still reaches while it pulls."""


def pull_to(bench: Bench, distance: float) -> None:
    """Pull the needle straight out to `distance` [m] from the exit, the thread following through the stitch."""
    if bench.hold is None:
        return
    pull_by(bench, exit_(bench.suture) + distance * OUTWARDS - point_at(bench.needle, np.pi))


def pull_by(bench: Bench, way: np.ndarray) -> None:
    """Take the left driver straight along (3,) [m], the thread free to follow."""
    target = bench.tools["left"].copy()
    target[:3, 3] += way
    anchor, bench.anchor = bench.anchor, None
    bench.go("left", target)
    bench.anchor = anchor
