"""A hand as upright blocks: conservative boxes around its shapes, fingers open, the tool pointing straight down."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scenewright.stages.kit.simulation.robot_description import RobotDescription
from scenewright.stages.kit.simulation.robot_shapes import points_at_tool

MILLIMETRE = 0.001


@dataclass(frozen=True)
class HandShape:
    """Of palm and of a finger: half width (across), half length (along which the fingers close), lowest and highest
    point over the tool point; how far a finger's middle is from the hand's, and the tips below the tool point [m]."""

    palm: tuple[float, float, float, float] = (0.032, 0.104, 0.038, 0.133)
    finger: tuple[float, float, float, float] = (0.011, 0.014, -0.008, 0.047)
    finger_offset: float = 0.053
    tip_below: float = 0.008


PUBLISHED = HandShape()
"""The hand of the published environment: the Franka's, measured on its meshes with the fingers 8 cm apart."""


def measured(robot: RobotDescription) -> HandShape:
    """Return a hand's blocks by its collision shapes, rounded outwards to millimetres."""
    points = points_at_tool(robot, (robot.hand_link, *robot.finger_links), robot.opening)
    palm, *fingers = [found if len(found) else np.zeros((1, 3)) for found in points]
    inner = min(float(np.abs(finger[:, 1]).min()) for finger in fingers)
    outer = max(float(np.abs(finger[:, 1]).max()) for finger in fingers)
    finger = np.concatenate(fingers)
    return HandShape(
        (_up(np.abs(palm[:, 0]).max()), _up(np.abs(palm[:, 1]).max()), -_up(palm[:, 2].max()), _up(-palm[:, 2].min())),
        (_up(np.abs(finger[:, 0]).max()), _up((outer - inner) / 2), -_up(finger[:, 2].max()), _up(-finger[:, 2].min())),
        (outer + inner) / 2,
        robot.tip_overhang,
    )


def _up(value: float) -> float:
    return float(np.ceil(value / MILLIMETRE - 1e-6)) * MILLIMETRE
