"""Screens that stand: a flat panel, wider than high, over a narrow neck and a foot, which tables often take.

Ours. Forms were seen on generated rooms alone: no recorded log at hand has given one.
"""

from __future__ import annotations

import numpy as np
from scenewright.stages.cad.carcasses import ACROSS, Patches, flat_places
from scenewright.stages.cad.families.forms import UNSURE, Form, Piece, Reading, box_piece
from scenewright.stages.cad.families.reading import along_x, bounds, in_own_frame
from scenewright.stages.kit.geometry.steadiness import stands_steadily
from scenewright.stages.kit.geometry.transforms import transform_from_yaw

SCREEN = "monitor"
FLAT, THICKEST, THIN = 0.03, 0.12, 0.03
"""The face of a panel is within this of its plane, all of it is no thicker, and one seen from one side as thick [m]."""
SOLID = 0.6
"""Share of its rectangle that the face of a panel covers."""
SMALLEST = (0.25, 0.12)
"""Least width and height of a panel [m]; by eye."""
LIFTED, NARROW = (0.02, 0.3), 0.5
"""A panel begins so high over what it stands on [m], and what is below it is narrower than this share of it."""
ROW = 0.02
"""Height of the rows in which a face is looked at [m]: a voxel."""
LEAST_NECK = 0.002
"""Surface of a neck that was seen [m²]."""
NECK = (0.06, 0.03)
"""Width and depth of a neck that nobody saw [m]; by eye."""
FEET = ((0.4, 0.2), (0.5, 0.25))
"""What is tried of a foot: width as a share of the panel's, depth [m], which those of screens on desks have. It is
no higher than seen space is known, so nobody asks whether it has room."""


def read(reading: Reading) -> Form | str:
    """Return the screen that a surface shows, or why there is none."""
    own = along_x(in_own_frame(reading))
    sign, level, face = _face(own.patches)
    if face is None:
        return "it has no flat upright face"
    own = own if sign < 0 else own.turned(own.turn @ transform_from_yaw(np.pi, np.zeros(3))[:3, :3])
    level = level if sign < 0 else -level
    panel_patches = _wide_rows(own.patches.chosen(face))
    x, z = (bounds(panel_patches.points[:, axis], panel_patches.areas) for axis in (0, 2))
    width, height = x[1] - x[0], z[1] - z[0]
    if width < SMALLEST[0] or height < SMALLEST[1] or width < height:
        return "its face is small, or higher than wide"
    if panel_patches.areas.sum() < SOLID * width * height:
        return "its face is not solid"
    if not LIFTED[0] < z[0] - own.base < LIFTED[1]:
        return "its face is not lifted"
    beside = own.patches.chosen(own.patches.points[:, 2] > z[0])
    depth = bounds(beside.points[:, 1], beside.areas)
    if depth[1] - depth[0] > THICKEST:
        return "it is not flat"
    panel = box_piece("panel", np.array([x[0], level, z[0]]), np.array([x[1], _rear(beside, level), z[1]]))
    neck = _neck(own, panel)
    if isinstance(neck, str):
        return neck
    foot = _foot(own, panel, neck)
    if foot is None:
        return "no foot holds it"
    return Form("screen", (SCREEN,), (panel, neck, foot), own.turn)


def _face(patches: Patches) -> tuple[float, float, np.ndarray | None]:
    """Return which way along y the largest flat upright face looks, where it is [m], and its patches (N,) bool."""
    found: list[tuple[float, float, float]] = []
    for sign in (-1.0, 1.0):
        looks = sign * patches.normals[:, 1] > ACROSS
        found += [(area, sign, y) for y, area in flat_places(patches.points[looks, 1], patches.areas[looks])]
    if not found:
        return 0.0, 0.0, None
    _, sign, level = max(found)
    return sign, level, (sign * patches.normals[:, 1] > ACROSS) & (np.abs(patches.points[:, 1] - level) < FLAT)


def _rear(patches: Patches, level: float) -> float:
    """Return where a panel ends whose face is at `level` [m]: where most of it looks to the rear, if that was seen."""
    behind = (patches.normals[:, 1] > ACROSS) & (patches.points[:, 1] > level + 0.5 * THIN)
    places = flat_places(patches.points[behind, 1], patches.areas[behind])
    return max(places, key=lambda place: place[1])[0] if places else level + THIN


def _wide_rows(face: Patches) -> Patches:
    """Return what a face has in rows in which it is wide: a neck may lie in its plane."""
    row = np.floor(face.points[:, 2] / ROW).astype(int)
    row -= row.min()
    first, last = np.full(row.max() + 1, np.inf), np.full(row.max() + 1, -np.inf)
    np.minimum.at(first, row, face.points[:, 0])
    np.maximum.at(last, row, face.points[:, 0])
    return face.chosen((last - first)[row] > NARROW * np.ptp(face.points[:, 0]))


def _neck(reading: Reading, panel: Piece) -> Piece | str:
    """Return what carries a panel: the narrow surface below it, or, where masks name a screen, what nobody saw."""
    low, high = panel.corners.min(axis=0), panel.corners.max(axis=0)
    middle, points = 0.5 * (low + high), reading.patches.points
    below = reading.patches.chosen((points[:, 2] < low[2] - 0.5 * FLAT) & (points[:, 2] > reading.base + UNSURE))
    if below.areas.sum() < LEAST_NECK:
        if reading.class_name != SCREEN:
            return "nobody saw a neck, and masks do not name it a screen"
        behind, half = np.array([middle[0], high[1]]), 0.5 * np.array(NECK)
        ends = np.array([*(behind - half), reading.base]), np.array([*(behind + half), middle[2]])
        return box_piece("neck", *ends, seen=False)
    x, y = (bounds(below.points[:, axis], below.areas) for axis in (0, 1))
    if x[1] - x[0] > NARROW * (high[0] - low[0]):
        return "what is below its face is as wide"
    ends = np.array([x[0], min(y[0], high[1]), reading.base]), np.array([x[1], max(y[1], low[1]), middle[2]])
    return box_piece("neck", *ends)


def _foot(reading: Reading, panel: Piece, neck: Piece) -> Piece | None:
    """Return the foot about a neck on which a screen stands; None where none of those tried holds it."""
    middle = 0.5 * (neck.corners.min(axis=0) + neck.corners.max(axis=0))
    width = float(np.ptp(panel.corners[:, 0]))
    for share, depth in FEET:
        half = 0.5 * np.array([share * width, depth])
        ends = np.array([*(middle[:2] - half), reading.base]), np.array([*(middle[:2] + half), reading.base + UNSURE])
        foot = box_piece("foot", *ends, seen=False)
        if stands_steadily([panel.corners, neck.corners, foot.corners], reading.base):
            return foot
    return None
