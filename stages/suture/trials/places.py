"""Where the drivers go and how they are turned there, in the world frame of stages/suture/robot/arms.py [m]."""

from __future__ import annotations

import numpy as np
from scenewright.stages.kit.geometry.transforms import transform_from
from scenewright.stages.suture.motion import primitives
from scenewright.stages.suture.motion.needle import UP_THE_WOUND, about
from scenewright.stages.suture.trials.wound import exit_

NOMINAL = primitives.jaws(np.array([0.0, 0.0, -1.0]))
"""The right driver's orientation when a needle that it holds by the swage as planned is ready for insertion."""
GRASPING = primitives.jaws(np.array([-1.0, 0.0, 0.0]))
"""The left driver's orientation at extraction."""
TAKING = primitives.jaws(np.array([1.0, 0.0, 0.0]))
"""The right driver's orientation at handover."""
PRESENTING = about(UP_THE_WOUND, -np.pi / 4) @ GRASPING
"""The left driver's orientation in which a needle extracted as planned is taken by level jaws so that, these turned by
90 degrees about y, it is ready for insertion."""
BESIDE = np.array([0.030, 0.004, 0.020])
"""Way from the exit to where the left driver is clear of the needle [m]; by eye."""


def beside_wound(suture: int) -> np.ndarray:
    """Return where the left driver (4, 4) waits for its turn, clear of the needle that comes out."""
    return transform_from(primitives.sweep(exit_(suture), 0.0)[0, :3, :3], exit_(suture) + BESIDE)
