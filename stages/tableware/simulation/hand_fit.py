"""Whether a robot's hand is the one that dishes are held with: what `holds` assumes of opening, tips and knuckles."""

from __future__ import annotations

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.simulation.robot_description import RobotDescription, load_robot
from scenewright.stages.kit.simulation.robot_shapes import points_at_tool
from scenewright.stages.tableware.simulation.holds import HAND, JAW_HEIGHT, PAD

SLACK = 0.001
"""How far a measure may be off [m]."""


def fitting_robot(robot: str) -> RobotDescription:
    """Return the description of a robot whose hand dishes can be held with. Raises as `load_robot` does, and BadInput
    with the first measure that is another."""
    description = load_robot(robot)
    thickness, half_width, beyond = tips(description)
    for what, found, wanted, bad in (
        ("opens", description.opening, HAND.opening, description.opening < HAND.opening - SLACK),
        ("has fingertips as thick as", thickness, PAD, thickness > PAD + SLACK),
        ("has fingers half as wide as", half_width, HAND.finger, half_width > HAND.finger + SLACK),
        ("reaches beyond its tool frame by", beyond, 0.0, beyond > SLACK),
    ):
        if bad:
            raise BadInput(
                f"--robot {robot}: its hand {what} {1000 * found:.0f} mm; holds of dishes are made for "
                f"{1000 * wanted:.0f} mm",
                hint="put a hand like that of data/robots/ur5.urdf on the arm",
            )
    return description


def tips(robot: RobotDescription) -> tuple[float, float, float]:
    """Return of the closed fingers, within JAW_HEIGHT of their tips: the thickness of one, half the width, and how far
    they reach beyond the tool frame [m]."""
    thickness = half_width = 0.0
    beyond = -np.inf
    for points in points_at_tool(robot, robot.finger_links, 0.0):
        beyond = max(beyond, float(points[:, 2].max()))
        near = points[points[:, 2] > points[:, 2].max() - JAW_HEIGHT + SLACK]
        thickness = max(thickness, float(np.ptp(near[:, 1])))
        half_width = max(half_width, float(np.abs(near[:, 0]).max()))
    return thickness, half_width, beyond
