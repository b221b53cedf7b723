"""Lamps that stand: a shade that is round seen from above, over a thin pole and a foot, of which depth shows little.

Ours. No recorded log at hand shows a lamp as a thing: forms were seen on generated rooms alone.
"""

from __future__ import annotations

import numpy as np
from scenewright.stages.cad.carcasses import Patches
from scenewright.stages.cad.families.forms import Form, Piece, Reading
from scenewright.stages.cad.families.reading import bounds
from scenewright.stages.kit.geometry.steadiness import stands_steadily

LAMP = "lamp"
UPRIGHT = 0.8
"""Surface whose normal has no larger part along z is of a side, and points to the axis or away from it."""
ROUND = 0.25
"""Median distance at which normals pass the axis, as a share of the radius: of a square it is 0.45, of a circle 0."""
SLICE = 0.03
"""Profiles are read in slices of this height [m]: a voxel and a half."""
NARROW = 0.5
"""Below the shade all is narrower than this share of its greatest radius, but for a foot."""
LEAST_SHADE, LEAST_POLE = 0.08, 0.5
"""Least height of a shade [m], and of a pole, as a share of its shade's height; by eye."""
HIGHEST_SHADE = 1.7
"""A shade that begins higher hangs [m over what it would stand on]; by eye."""
THINNEST = 0.012
"""Radius of a pole that nobody saw [m]: tubes of lamps are 2 to 3 cm wide."""
FEET, FOOT = (0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0), 0.03
"""Radii of a foot that nobody saw, as shares of the shade's, and its height [m]."""
SIDES = 16
TURNS = np.linspace(0.0, 2.0 * np.pi, SIDES, endpoint=False)


def read(reading: Reading) -> Form | str:
    """Return the lamp that a surface shows, or why there is none."""
    patches = reading.patches
    sides = patches.chosen(np.abs(patches.normals[:, 2]) <= UPRIGHT)
    found = axis_of(sides)
    if found is None:
        return "it is not round"
    axis, radius = found
    slices = profile(sides, axis)
    first = shade_from(slices)
    edge = slices[first][0] - 0.5 * SLICE
    shown = sides.chosen(sides.points[:, 2] >= edge)
    low, top = bounds(shown.points[:, 2], shown.areas)
    if top - low < LEAST_SHADE or len(slices) - first < 2:
        return "it has no shade"
    if low - reading.base < LEAST_POLE * (top - low):
        return "its shade is not over a pole"
    if low - reading.base > HIGHEST_SHADE:
        return "it would hang"
    below = [(height, width) for height, width in slices if reading.base + FOOT < height < edge]
    if not below and reading.class_name != LAMP:
        return "nobody saw a pole, and masks do not name it a lamp"
    heights, radii = np.array(slices[first:]).T
    line = np.polyfit(heights, radii, 1)
    widths = np.maximum(np.polyval(line, (low, top)), THINNEST)
    shade = disc("shade", axis, (low, widths[0]), (top, widths[1]))
    width = max(THINNEST, float(np.median([width for _, width in below]))) if below else THINNEST
    if width > NARROW * radius:
        return "what is below its shade is no pole"
    pole = disc("pole", axis, (reading.base, width), (low, width), seen=bool(below))
    if not reading.has_room(pole):
        pole = disc("pole", axis, (reading.base, THINNEST), (low, THINNEST), seen=False)
    if not reading.has_room(pole):
        return "its pole has no room"
    foot = _foot(reading, axis, float(max(widths)), [shade, pole])
    if foot is None:
        return "its foot has no room"
    return Form(LAMP, (LAMP,), (shade, pole, foot), reading.turn)


def axis_of(sides: Patches) -> tuple[np.ndarray, float] | None:
    """Return the upright axis (2,) of a surface of revolution and its greatest radius [m], by where normals meet; None
    of a surface that is none, or too little. `sides`: patches that are not level."""
    if len(sides.areas) < SIDES:
        return None
    along = sides.normals[:, :2] / np.linalg.norm(sides.normals[:, :2], axis=1, keepdims=True)
    across = np.column_stack([-along[:, 1], along[:, 0]])
    offsets = np.einsum("ij,ij->i", across, sides.points[:, :2])
    weights = np.sqrt(sides.areas)
    axis, _, rank, _ = np.linalg.lstsq(weights[:, None] * across, weights * offsets, rcond=1e-3)
    if rank < 2:
        return None
    radii = np.linalg.norm(sides.points[:, :2] - axis, axis=1)
    radius = float(np.quantile(radii, 0.9))
    passed = np.abs(across @ axis - offsets)
    return (axis, radius) if np.median(passed) <= ROUND * radius else None


def profile(sides: Patches, axis: np.ndarray) -> list[tuple[float, float]]:
    """Return (height, radius) [m] of the slices in which there is surface, from below."""
    radii = np.linalg.norm(sides.points[:, :2] - axis, axis=1)
    number = np.floor(sides.points[:, 2] / SLICE).astype(int)
    return [((k + 0.5) * SLICE, float(np.median(radii[number == k]))) for k in np.unique(number)]


def shade_from(slices: list[tuple[float, float]]) -> int:
    """Return the number of the slice of a profile with which the topmost wide part of it begins."""
    heights, radii = np.array(slices).T
    wide = radii > NARROW * radii.max()
    first = len(wide) - 1
    while first > 0 and wide[first - 1] and heights[first] - heights[first - 1] < 2.5 * SLICE:
        first -= 1
    return first


def disc(
    name: str, axis: np.ndarray, low: tuple[float, float], high: tuple[float, float], *, seen: bool = True
) -> Piece:
    """Return a round piece about an upright axis (2,): (height, radius) [m] of its ends."""
    ring = np.column_stack([np.cos(TURNS), np.sin(TURNS)])
    ends = [np.column_stack([axis + radius * ring, np.full(SIDES, height)]) for height, radius in (low, high)]
    return Piece(name, np.concatenate(ends), seen)


def _foot(reading: Reading, axis: np.ndarray, radius: float, above: list[Piece]) -> Piece | None:
    """Return the foot: as wide as it was seen, else the least on which the lamp stands; None without room."""
    patches = reading.patches
    near = patches.points[:, 2] < reading.base + 2 * FOOT
    there = np.linalg.norm(patches.points[near, :2] - axis, axis=1)
    seen = [float(np.quantile(there, 0.9))] if len(there) >= SIDES else []
    for width in (*seen, *(share * radius for share in FEET)):
        foot = disc("foot", axis, (reading.base, width), (reading.base + FOOT, width), seen=width in seen)
        if stands_steadily([foot.corners, *(piece.corners for piece in above)], reading.base):
            return foot if reading.has_room(foot) else None
    return None
