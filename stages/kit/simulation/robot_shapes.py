"""Collision shapes of a robot's links by its description, and where those of its hand are from the tool."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import trimesh
from scenewright.stages.kit.formats.link_poses import link_poses
from scenewright.stages.kit.formats.urdf_file import parse_urdf
from scenewright.stages.kit.geometry.transforms import apply, inverse
from scenewright.stages.kit.simulation.robot_description import RobotDescription
from scenewright.stages.kit.simulation.shapes import link_shapes
from scenewright.stages.kit.simulation.urdf_split import read_urdf, with_absolute_meshes


def robot_shapes(robot: RobotDescription) -> dict[str, list[trimesh.Trimesh]]:
    """Return link -> its collision meshes, link frame [m]. Raises BadInput for a URDF that can't be read."""
    return link_shapes(with_absolute_meshes(read_urdf(robot.urdf), robot.urdf.parent))


def points_at_tool(robot: RobotDescription, links: Sequence[str], opening: float) -> list[np.ndarray]:
    """Return the corners (N, 3) of each link's collision meshes in the tool's frame [m], the fingers `opening` [m]
    apart. Raises as `robot_shapes`."""
    shapes = robot_shapes(robot)
    poses = link_poses(parse_urdf(robot.urdf), dict.fromkeys(robot.finger_joints, opening / 2))
    tool_from_world = inverse(poses[robot.tool_link])
    empty = [np.zeros((0, 3))]
    return [
        np.concatenate([apply(tool_from_world @ poses[link], mesh.vertices) for mesh in shapes[link]] or empty)
        for link in links
    ]
