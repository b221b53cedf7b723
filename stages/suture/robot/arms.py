"""Where the two arms stand over the wound pad.

World frame: the origin on the pad under the middle of the wound; x from the right driver towards the left one, y along
the wound towards the cameras, z up [m]. (Seen from the cameras x runs to the left.) The thesis gives no distances; the
remote centres stand where both arms reach the wound, the place of handover and the corner of pose correction.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scenewright.stages.kit.geometry.transforms import inverse, rotation_between, transform_from
from scenewright.stages.suture.robot.inverse import reachable

REMOTE_CENTRES = {"right": np.array([-0.12, 0.0, 0.15]), "left": np.array([0.12, 0.0, 0.15])}
"""Arm -> its remote centre in the world frame [m]; the thesis does not say where its arms stand."""
AIM = np.array([0.0, 0.0, 0.02])
"""Point at which a tool at rest points [m]."""


@dataclass(frozen=True)
class Arm:
    """One patient-side manipulator: `world_from_base` (4, 4)."""

    name: str
    world_from_base: np.ndarray

    def reaches(self, world_from_tip: np.ndarray) -> np.ndarray:
        """Whether the arm can put its tip at poses (..., 4, 4) within its joint limits."""
        return reachable(inverse(self.world_from_base) @ world_from_tip)


def standing(name: str) -> Arm:
    """Return the arm `right` or `left` at its place; KeyError for another name."""
    centre = REMOTE_CENTRES[name]
    return Arm(name, transform_from(rotation_between(np.array([0.0, 0.0, -1.0]), AIM - centre), centre))


ARMS = {name: standing(name) for name in REMOTE_CENTRES}
