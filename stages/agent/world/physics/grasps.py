"""Antipodal grasps on what the cameras saw of a thing: noisy points of the sides that were in view, none of the back.

The kit's `sample_grasps` asks both fingers for a square contact within 3 mm, as surfaces of models have it. Here one
side that was seen to face a finger is enough: of the other one it is believed that it is as the first.
"""

from __future__ import annotations

import numpy as np

FINGER_DEPTH = 0.032
"""How far the tool point goes in behind the front of a thing [m]."""
FINGER_BAND = 0.011
"""Half the breadth of a finger tip [m]."""
MARGIN = 0.012
"""Room between the open fingers and the thing, both sides together [m]."""
ENDS = 0.008
"""Points this near to the outermost are where a finger touches [m]."""
FACES = 0.25
"""Least mean cosine between normals there and the closing direction on the side that was seen better."""
LEAST = 10
"""Points between the fingers."""
HEADINGS = 16
PITCHES = (np.pi / 2, 1.1, 0.7)
"""How steeply the hand comes, from above first [rad]."""
ALIKE = 0.006
"""Widths that differ by less are as good as each other [m]."""
OF_ONE_PITCH = 8
"""Grasps that come equally steeply, at most: where the arm cannot come from above, the others have their turn."""
ASIDE = 0.3
"""Least cosine between where an aslant hand comes from and where the robot stands: it does not reach around a thing."""
TIP_BEFORE = 0.008
"""The tool point lies this far behind the finger tips [m]."""


def antipodal_grasps(points: np.ndarray, normals: np.ndarray, opening: float, floor: float) -> list[np.ndarray]:
    """Return map_from_tool (4, 4) of grasps of points (N, 3) with normals, from above and narrow ones first.

    `opening` of the gripper [m]; `floor` [m]: height of what the thing stands on, over which the finger tips stay.
    """
    low, high = np.percentile(points, 2, axis=0), np.percentile(points, 98, axis=0)
    middle = (low + high) / 2
    made = []
    for rank, pitch in enumerate(PITCHES):
        for number in range(HEADINGS):
            heading = 2 * np.pi * number / HEADINGS
            approach = np.array([np.cos(heading) * np.cos(pitch), np.sin(heading) * np.cos(pitch), -np.sin(pitch)])
            closing = np.array([-np.sin(heading), np.cos(heading), 0.0])
            across = np.cross(closing, approach)
            relative = points - middle
            between = np.abs(relative @ across) < FINGER_BAND
            if between.sum() < LEAST:
                continue
            along, inward = relative[between] @ closing, normals[between] @ closing
            first, last = np.percentile(along, [3, 97])
            width = float(last - first)
            if width > opening - MARGIN:
                continue
            faces = [np.abs(inward[end]).mean() for end in (along < first + ENDS, along > last - ENDS) if end.any()]
            if max(faces, default=0.0) < FACES:
                continue
            depth = relative[between] @ approach
            front, back = np.percentile(depth, [3, 97])
            at = middle + min(front + FINGER_DEPTH, (front + back) / 2 + 0.005) * approach
            at += (first + last) / 2 * closing
            lowest = floor + 0.004 + TIP_BEFORE * np.sin(pitch)
            at[2] = max(at[2], lowest)
            pose = np.eye(4)
            pose[:3, :3] = np.column_stack([across, closing, approach])
            pose[:3, 3] = at
            made.append((rank, round(width / ALIKE), number * 7 % HEADINGS, pose))
    made.sort(key=lambda entry: entry[:3])
    return [pose for *_, pose in made]


def within_reach(grasps: list[np.ndarray], heading: float) -> list[np.ndarray]:
    """Return those of grasps (4, 4) that an arm may get at that stands before the thing, a few of each pitch in their
    order. `heading` [rad]: from the base to the thing."""
    kept: list[np.ndarray] = []
    of_pitch: dict[float, int] = {}
    for pose in grasps:
        along = pose[:2, 2]
        pitch, level = round(float(pose[2, 2]), 2), float(np.hypot(*along))
        aside = level > 0.1 and float(along @ (np.cos(heading), np.sin(heading))) < ASIDE * level
        if not aside and of_pitch.get(pitch, 0) < OF_ONE_PITCH:
            of_pitch[pitch] = of_pitch.get(pitch, 0) + 1
            kept.append(pose)
    return kept
