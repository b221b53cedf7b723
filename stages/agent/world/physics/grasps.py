"""Antipodal grasps on what the cameras saw of a thing: noisy points of the sides that were in view, none of the back.

The kit's `sample_grasps` asks both fingers for a square contact within 3 mm, as surfaces of models have it. Here one
side that was seen to face a finger is enough: of the other one it is believed that it is as the first.
"""

from __future__ import annotations

import numpy as np
from scenewright.stages.kit.acting.hand.grip import FINGER_BAND, FINGER_DEPTH, PITCHES, hand_axes
from scenewright.stages.kit.geometry.boxes import minimum_rectangle
from scenewright.stages.kit.simulation.robot_description import RobotDescription

MARGIN, TIGHT = 0.012, 0.005
"""Room between the open fingers and the thing, both sides together [m]: as wanted, and where nothing leaves as much. A
near look tells the middle of what is 7 cm wide to 3 mm."""
ENDS = 0.008
"""Points this near to the outermost are where a finger touches [m]."""
FACES = 0.5
"""Least mean cosine between normals there and the closing direction on the side that was seen better; grasps of which
neither side was seen come last, across the narrow side first."""
ALIKE, ALIKE_WIDE = 0.1, 0.006
"""Cosines, and widths [m], that differ by less are as good as each other."""
LEAST = 10
"""Points between the fingers."""
HEADINGS = 16
"""Headings of the hand that are tried all around, beside those along the sides of what was seen; by eye."""
FROM_ABOVE = PITCHES[::-1]
"""How steeply the hand comes, from above first [rad]: the flatter, the farther the arm reaches over a table."""
FORWARD_PITCHES = (0.15, 0.0, 0.35)
"""Pitches of the hand that goes into a shelf [rad], in the order in which they are tried."""
LEVEL = 0.5
"""Pitch below which a hand sees nothing of a thing's top [rad]: its middle lies half its width behind its front."""
BEFORE_PALM = 0.004
"""Room that such a hand leaves between its palm and the thing [m]."""
STEEP = 1.5
"""Pitch from which on a hand comes from above [rad]."""
HEIGHTS = (0.5, 0.65, 0.8, 0.35)
"""Shares of the thing's height at which an aslant hand grips it, that of its middle first."""
OFF = 0.012
"""Distances from the middle that differ by less are as good as each other [m]."""
OF_ONE_PITCH = 8
"""Grasps that come equally steeply, at most: where the arm cannot come from above, the others have their turn."""
ASIDE = 0.3
"""Least cosine between where an aslant hand comes from and where the robot stands: it does not reach around a thing."""
STRAIGHT = 0.8
"""The same of a hand that goes into a shelf, which has walls, and of a flat one, which sees no middle from aside."""


def antipodal_grasps(
    points: np.ndarray,
    normals: np.ndarray,
    robot: RobotDescription,
    floor: float,
    pitches: tuple[float, ...] = FROM_ABOVE,
    margin: float = MARGIN,
) -> list[np.ndarray]:
    """Return map_from_tool (4, 4) of grasps of points (N, 3) with normals, of the first pitch first, where the fingers
    meet the surface squarely and near the middle of the thing before others: what is held by its end turns.

    `floor` [m]: height of what the thing stands on, over which the finger tips stay; `margin` [m]: room between it and
    the open fingers.
    """
    low, high = np.percentile(points, 2, axis=0), np.percentile(points, 98, axis=0)
    sides = minimum_rectangle(points[:, :2])[2] + np.pi / 2 * np.arange(4)  # a box that turned is wider than the hand
    headings = [*(2 * np.pi * np.arange(HEADINGS) / HEADINGS), *sides]
    ranked_grasps = []
    for rank, pitch in enumerate(pitches):
        deepest = max(high[2] - FINGER_DEPTH, (low[2] + high[2]) / 2 - 0.005)
        heights = [deepest] if pitch > STEEP else [low[2] + share * (high[2] - low[2]) for share in HEIGHTS]
        for height in heights:
            at = np.array(
                [*_middle_above(points, height), max(height, floor + 0.004 + robot.tip_overhang * np.sin(pitch))]
            )
            for number, heading in enumerate(headings):
                grasp = _grasp_at(points, normals, at, heading, pitch, robot, margin)
                if grasp is not None:
                    pose, square, width = grasp
                    off = round(abs(height - (low[2] + high[2]) / 2) / OFF)
                    kind = (square < FACES, rank, -round(square / ALIKE), off, round(width / ALIKE_WIDE))
                    ranked_grasps.append((kind, number * 7 % len(headings), pose))
    ranked_grasps.sort(key=lambda entry: entry[:2])
    return [pose for *_, pose in ranked_grasps]


def _middle_above(points: np.ndarray, height: float) -> np.ndarray:
    """Return the middle (2,) of what was seen of a thing from a height upwards: with its top, since the far one of its
    sides was not seen, and without what is wider below."""
    above = points[:, 2] > height - OFF
    upper_points = points[above, :2] if above.sum() >= LEAST else points[:, :2]
    return np.percentile(upper_points, [2, 98], axis=0).mean(axis=0)


def _grasp_at(
    points: np.ndarray,
    normals: np.ndarray,
    at: np.ndarray,
    heading: float,
    pitch: float,
    robot: RobotDescription,
    margin: float,
) -> tuple[np.ndarray, float, float] | None:
    """Return map_from_tool (4, 4) with the tool at a point, how squarely the fingers meet the surface, and the width
    [m] there; None where it is too wide or in the way of the palm."""
    axes = hand_axes(heading, pitch)
    _, closing, approach = np.ascontiguousarray(axes.T)
    aside, along, depth = ((points - at) @ axes).T
    level, near, deepest = pitch < LEVEL, np.abs(aside) < FINGER_BAND, FINGER_DEPTH - BEFORE_PALM
    front = float(np.percentile(depth[near], 3)) if level and near.any() else 0.0
    way_in = near & (depth < robot.tip_overhang + (front + deepest if level else 0.0))
    between = way_in if level else way_in & (depth > -FINGER_BAND)  # a level hand may see but a front
    if between.sum() < LEAST:
        return None
    shift = np.percentile(along[way_in], [3, 97]).mean()
    along = along - shift
    first, last = np.percentile(along[between], [3, 97])
    deeper = 0.0
    if level:
        deeper = max(0.0, front + min((last - first) / 2, deepest))
        depth = depth - deeper
    under_palm = (np.abs(along) < robot.palm[0] / 2) & (np.abs(aside) < robot.palm[1] / 2)
    room = (robot.opening - margin) / 2
    if np.abs(along[way_in]).max() > room or (under_palm & (depth < -FINGER_DEPTH - BEFORE_PALM)).sum() > LEAST:
        return None
    facing = np.abs(normals @ closing)
    ends = [between & (along < first + ENDS), between & (along > last - ENDS)]
    square = max((float(facing[end].mean()) for end in ends if end.any()), default=0.0)
    pose = np.eye(4)
    pose[:3, :3] = axes
    pose[:3, 3] = at + shift * closing + deeper * approach
    return pose, square, float(last - first)


def within_reach(grasps: list[np.ndarray], heading: float, least: float = ASIDE) -> list[np.ndarray]:
    """Return those of grasps (4, 4) that an arm may get at that stands before the thing, a few of each pitch in their
    order. `heading` [rad]: from the base to the thing; `least`: cosine between that and where a hand comes from."""
    reachable: list[np.ndarray] = []
    of_pitch: dict[float, int] = {}
    for pose in grasps:
        along = pose[:2, 2]
        pitch, level = round(float(pose[2, 2]), 2), float(np.hypot(*along))
        most = max(least, STRAIGHT) if level > np.cos(LEVEL) else least
        aside = level > 0.1 and float(along @ (np.cos(heading), np.sin(heading))) < most * level
        if not aside and of_pitch.get(pitch, 0) < OF_ONE_PITCH:
            of_pitch[pitch] = of_pitch.get(pitch, 0) + 1
            reachable.append(pose)
    return reachable
