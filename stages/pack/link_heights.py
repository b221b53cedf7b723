"""How low the links of the arm come, so that a motion over low things needs no collision check of meshes.

A table over distance from the axis and height of the tool, for the planar configurations of `arm`: lowest point of the
meshes of links 3 to 7. An entry answers for its cell with `MARGIN`; tests compare it with pybullet's checks.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from functools import cache
from math import ceil, floor

import numpy as np
from scenewright.stages.kit.simulation.shapes import link_shapes
from scenewright.stages.kit.simulation.urdf_split import read_urdf, with_absolute_meshes, without_visuals
from scenewright.stages.pack.arm import FixedArm, Limits, planar_joints

STEP = 0.02
"""Distance between two entries [m]; by eye."""
MARGIN = 0.02
"""Largest change of the lowest point between two entries [m]."""
RADII = np.arange(0.20, 0.83, STEP)
"""Distances of the tool from the arm's axis [m]."""
HEIGHTS = np.arange(0.04, 0.56, STEP)
"""Heights of the tool [m]."""
BASE_RADIUS = 0.27
"""Links 0 to 2 stay within this distance of the axis, up to the shoulder [m]; link 3 begins there."""


@cache
def _hulls(robot: str) -> tuple[np.ndarray, ...]:
    description = FixedArm("fr3", robot).description
    root = read_urdf(description.urdf)
    children = {
        joint.get("name"): child.get("link") for joint in root.findall("joint") for child in joint.findall("child")
    }
    names = [str(children[joint]) for joint in description.arm_joints[2:]]
    keep = [link for link in root.findall("link") if link.get("name") in names]
    kept_robot = ElementTree.Element("robot", {"name": "links"})
    kept_robot.extend(keep)
    shapes = link_shapes(without_visuals(with_absolute_meshes(kept_robot, description.urdf.parent)))
    return tuple(np.concatenate([mesh.convex_hull.vertices for mesh in shapes[name]]) for name in names)


@cache
def lowest_points(robot: str, limits: Limits) -> np.ndarray:
    """Return (R, Z) world z [m] of the lowest point of links 3 to 7 over RADII and HEIGHTS, less the margin.

    -inf where the planar arm does not reach or folds further than its joints can.
    """
    arm = FixedArm(limits, robot)
    hulls = _hulls(robot)
    table = np.full((len(RADII), len(HEIGHTS)), -np.inf)
    for row, radius in enumerate(RADII):
        for column, height in enumerate(HEIGHTS):
            joints = planar_joints(arm, np.array([radius]), np.array([height]))
            if joints is None:
                continue
            frames = arm.frames(joints[0])
            lows = [
                (points @ frame[2, :3]).min() + frame[2, 3] for points, frame in zip(hulls, frames[2:7], strict=True)
            ]
            table[row, column] = min(lows) - MARGIN
    return table


def lowest_within(arm: FixedArm, radii: tuple[float, float], heights: tuple[float, float]) -> float:
    """Return a lower bound [m] of the links' height over a range of distances and heights of the tool.

    -inf when the range leaves the table or holds a position that the planar arm cannot take.
    """
    table = lowest_points(arm.robot, arm.limits)
    rows = (radii[0] - RADII[0]) / STEP, (radii[1] - RADII[0]) / STEP
    columns = (heights[0] - HEIGHTS[0]) / STEP, (heights[1] - HEIGHTS[0]) / STEP
    if rows[0] < 0 or columns[0] < 0 or rows[1] > len(RADII) - 1 or columns[1] > len(HEIGHTS) - 1:
        return -np.inf
    return float(table[floor(rows[0]) : ceil(rows[1]) + 1, floor(columns[0]) : ceil(columns[1]) + 1].min())


def lowest_on_path(arm: FixedArm, radii: np.ndarray, heights: np.ndarray) -> float:
    """Return a lower bound [m] of the links' height along tool positions (N,), (N,); -inf when one is off the table."""
    table = lowest_points(arm.robot, arm.limits)
    row = (radii - RADII[0]) / STEP
    column = (heights - HEIGHTS[0]) / STEP
    if row.min() < 0 or column.min() < 0 or row.max() >= len(RADII) - 1 or column.max() >= len(HEIGHTS) - 1:
        return -np.inf
    i, j = row.astype(int), column.astype(int)
    # Beyond the last row that can be reached the arm is stretched: the nearer entry answers.
    corners = np.stack([table[i, j], table[i + 1, j], table[i, j + 1], table[i + 1, j + 1]])
    finite = np.where(np.isfinite(corners), corners, np.inf).min(axis=0)
    return float(finite.min()) if np.isfinite(finite).all() else -np.inf
