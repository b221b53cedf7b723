"""Grasps of an upright wall by its rim, from above: how a tray or a bowl is lifted that is too wide for the fingers."""

from __future__ import annotations

import numpy as np
from scenewright.stages.kit.acting.hand.grip import Grasp
from scenewright.stages.kit.geometry.transforms import apply, inverse

DEPTH = 0.024
"""How far the tool point goes below the rim [m]."""
FOOT_ROOM = 0.012
"""The tool point stays this far over the lowest point of the thing: the finger tips reach below it [m]."""
LEAST_DEPTH = 0.012
"""A rim is grasped only where the fingers reach at least so far below it [m]; by eye."""
THICKEST = 0.03
"""Walls are at most this thick [m]."""
FINGER_ROOM = 0.045
"""Free width behind the wall for the inner finger [m]."""
OFFSETS = (-0.09, -0.06, -0.03, 0.03, 0.06, 0.09)
"""Straight walls are taken beside their middle too [m]: the palm has to pass what stands on the tray."""
FLOOR = 0.008
"""Height below which a flat thing's points are its floor [m]."""
BREADTH = 0.011
"""Half the breadth of a finger tip [m]."""
WALL_SPAN = 0.035
"""The course of a wall is read this far to both sides of the fingers [m]."""
MOST_ASKEW = 0.12
"""Angle between the closing fingers and the wall's normal, above which they turn the thing until it fits [rad]."""


def rim_grasps(
    points: np.ndarray,
    world_from_body: np.ndarray,
    random: np.random.Generator,
    headings: int = 24,
    uncertainty: float = 0.0,
) -> list[Grasp]:
    """Return grasps straight from above with one finger outside and one inside of the outermost wall. Where there are
    any square to the wall, only those.

    `points` (N, 3) are of the surface, body frame. Per heading through the middle (along the body's axes also
    beside it) the wall is where the outermost points near the rim are; it must be thin and free behind. The rim may be
    up to `uncertainty` [m] higher than the points say, as voxels miss thin walls and handles.
    """
    world = apply(world_from_body, points)
    low, high = world.min(axis=0), world.max(axis=0)
    rim = high[2] + max(0.0, min(uncertainty, DEPTH + FOOT_ROOM - (high[2] - low[2])))
    depth = min(DEPTH, rim - low[2] - FOOT_ROOM)
    if depth < LEAST_DEPTH:
        return []
    top = world[world[:, 2] > max(high[2] - depth - 0.004, min(rim - depth, low[2] + FLOOR))]
    middle = (low + high)[:2] / 2
    yaw = float(np.arctan2(world_from_body[1, 0], world_from_body[0, 0]))
    even = yaw + 2 * np.pi * np.arange(headings) / headings
    grasps: list[Grasp] = []
    square: list[bool] = []
    beside = [(heading, offset) for heading in even[:: headings // 4] for offset in OFFSETS]
    for heading, offset in [*((heading, 0.0) for heading in even), *beside]:
        outward = np.array([np.cos(heading), np.sin(heading)])
        across = np.array([-outward[1], outward[0]])
        relative = top[:, :2] - middle
        # Beyond the middle too: a bar that lies across it beside the middle would pass for a wall where it is cut.
        beside_it = np.abs(relative @ across - offset) < BREADTH
        along = (relative @ outward)[beside_it]
        if np.sum(along > 0) < 6:
            continue
        of_wall = along > along.max() - THICKEST
        if top[beside_it, 2][of_wall].max() < high[2] - depth + LEAST_DEPTH:
            continue  # fingers that are as deep as the highest of it leaves room for close over a low wall
        wall = along[of_wall]
        thickness = float(along.max() - wall.min())
        behind = (along < wall.min() - 0.002) & (along > wall.min() - FINGER_ROOM)
        if thickness > THICKEST - 0.002 or behind.any():
            continue
        closing = np.array([*outward, 0.0])
        approach = np.array([0.0, 0.0, -1.0])
        pose = np.eye(4)
        pose[:3, :3] = np.column_stack([np.cross(closing, approach), closing, approach])
        pose[:2, 3] = middle + outward * (along.max() - thickness / 2) + across * offset
        pose[2, 3] = rim - depth
        is_square = askew(relative @ across - offset, relative @ outward) < MOST_ASKEW
        for turned in (pose, pose @ np.diag([-1.0, -1.0, 1.0, 1.0])):
            grasps.append(Grasp(inverse(world_from_body) @ turned, thickness, np.pi / 2))
            square.append(is_square)
    return [grasps[index] for index in random.permutation(len(grasps)).tolist() if square[index] or not any(square)]


def askew(across: np.ndarray, outward: np.ndarray) -> float:
    """Return by what angle [rad] the outermost wall near `across` = 0 is not square to the outward axis.

    `across` and `outward` (N,) [m] are coordinates of points along the wall and away from the middle.
    """
    edges = np.linspace(-WALL_SPAN, WALL_SPAN, 8)
    middles, farthest = [], []
    for low, high in zip(edges[:-1], edges[1:], strict=True):
        inside = (across >= low) & (across < high) & (outward > 0)
        if inside.any():
            middles.append((low + high) / 2)
            farthest.append(outward[inside].max())
    if len(middles) < 3:
        return 0.0
    return float(abs(np.arctan(np.polyfit(middles, farthest, 1)[0])))
