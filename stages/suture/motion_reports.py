"""What the arms' kinematics report of the needle's motion, with their error."""

from __future__ import annotations

import numpy as np
from scenewright.stages.suture.needle.filter import STEP_SHIFT, STEP_TURN
from scipy.spatial.transform import Rotation


def reported_motion(motion: np.ndarray, centre: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Return a true motion (4, 4) as it is reported: turned and shifted a little about the needle's `centre` (3,)."""
    turn = Rotation.from_rotvec(random.normal(0.0, STEP_TURN, 3)).as_matrix()
    error = np.eye(4)
    error[:3, :3] = turn
    error[:3, 3] = centre - turn @ centre + random.normal(0.0, STEP_SHIFT, 3)
    return error @ motion


def motions_to_last(steps: list[np.ndarray]) -> list[np.ndarray]:
    """Return, for each of N + 1 frames, the motion (4, 4) to the last one, from the N steps between them."""
    to_last = [np.eye(4)]
    for step in reversed(steps):
        to_last.append(to_last[-1] @ step)
    return to_last[::-1]
