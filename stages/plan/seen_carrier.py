"""What a tray or plate looks like from near by: its floor, and the rim that a hand takes it by.

A map of 2 cm voxels keeps a tray's floor and loses its rim, so that the model chosen for it may be another tray. Before
it a robot sees the rim. Seen from above a carrier is a height over every cell of its rectangle; what is under that is
taken to be solid, what was not seen to be floor.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass

import numpy as np
from scenewright.stages.kit.geometry.box_cover import merge_cells
from scenewright.stages.kit.geometry.boxes import minimum_rectangle
from scenewright.stages.kit.geometry.transforms import apply, inverse, transform_from_yaw
from scenewright.stages.plan.scaled_body import add_box
from scipy.ndimage import convolve

CELL = 0.005
"""Edge of a cell of the height map [m]."""
LEAST_POINTS, LEAST_SHARE = 2, 0.4
"""Least points of a cell, and their share of what cells have in the middle: beside an edge single pixels take the
depth of what lies behind."""
TOP = 80
"""Percentile of the heights of a cell's points that is its height: a thin wall has floor beside it."""
WALL = 0.008
"""Height over the floor from which on cells are the rim [m]."""
FLOOR = 0.004
"""A floor is this thick; its lower side is not seen [m]."""
STEP = 0.006
"""Heights of the rim are told apart by this [m]."""
BESIDE_LOAD = 0.015
"""Distance from what stands on it within which pixels may have that thing's depth [m]."""
LEAST_CELLS = 100
"""Least cells of a floor that was seen."""


@dataclass(frozen=True)
class SeenCarrier:
    """A carrier as heights over its rectangle."""

    pose: np.ndarray
    """(4, 4) to the frame of the points: below the middle of the rectangle, axes along its sides."""
    boxes: tuple[tuple[np.ndarray, np.ndarray], ...]
    """Centre and edge lengths (3,) of what it is made of, own frame [m]; its floor first."""

    @property
    def size(self) -> np.ndarray:
        """Length and breadth (2,) [m]."""
        return self.boxes[0][1][:2]


def seen_carrier(points: np.ndarray, load: np.ndarray, yaw: float) -> SeenCarrier | None:
    """Return the carrier that points (N, 3) of its upper side show, None where they are too few.

    `load` (K, 3): x, y and radius of the feet of what stands on it; `yaw` [rad]: how it is believed to be turned.
    """
    points = _dense(points)
    if len(points) < LEAST_CELLS:
        return None
    middle, size, turn = minimum_rectangle(points[:, :2])
    quarters = round((yaw - turn) / (np.pi / 2))
    turn += quarters * np.pi / 2
    size = size if quarters % 2 == 0 else size[::-1]
    near_load = np.zeros(len(points), dtype=bool)
    for x, y, radius in load:
        near_load |= np.hypot(points[:, 0] - x, points[:, 1] - y) < radius + BESIDE_LOAD
    points_in_box = apply(inverse(transform_from_yaw(turn, np.array([*middle, 0.0]))), points)
    heights = _heights(points_in_box, size)
    finite_heights = heights[np.isfinite(heights)]
    if len(finite_heights) < LEAST_CELLS:
        return None
    level = float(np.median(finite_heights))
    heights = _heights(points_in_box[~near_load | (points_in_box[:, 2] < level + WALL)], size)
    wall = _without_single(np.nan_to_num(heights, nan=-np.inf) > level + WALL)
    low = level - FLOOR
    floor = (np.array([0.0, 0.0, FLOOR / 2]), np.array([*size, FLOOR]))
    counts = np.where(wall, np.rint((np.nan_to_num(heights) - level) / STEP), 0).astype(int)
    columns = [(x, y, z) for x, y in np.argwhere(wall) for z in range(counts[x, y])]
    boxes = [floor]
    edges = size / counts.shape
    for first, last in merge_cells(np.array(columns)) if columns else ():
        start = np.array([*(first[:2] * edges - size / 2), FLOOR + first[2] * STEP])
        end = np.array([*((last[:2] + 1) * edges - size / 2), FLOOR + (last[2] + 1) * STEP])
        boxes.append(((start + end) / 2, end - start))
    return SeenCarrier(transform_from_yaw(turn, np.array([*middle, low])), tuple(boxes))


def _dense(points: np.ndarray) -> np.ndarray:
    """Return the points (N, 3) whose cells on the ground hold enough of them."""
    cells = np.floor(points[:, :2] / CELL).astype(int)
    _, number, counts = np.unique(cells, axis=0, return_inverse=True, return_counts=True)
    least = max(LEAST_POINTS, LEAST_SHARE * float(np.median(counts))) if len(counts) else LEAST_POINTS
    return points[counts[number.reshape(-1)] >= least]


def _heights(points: np.ndarray, size: np.ndarray) -> np.ndarray:
    """Return the height [m] of each cell (X, Y) of a rectangle (2,) about the origin, nan where too little was seen."""
    shape = np.maximum(1, np.rint(size / CELL)).astype(int)
    cells = np.clip(np.floor((points[:, :2] + size / 2) / size * shape), 0, shape - 1).astype(int)
    flat = cells[:, 0] * shape[1] + cells[:, 1]
    heights = np.full(int(np.prod(shape)), np.nan)
    order = np.argsort(flat, kind="stable")
    numbers, starts = np.unique(flat[order], return_index=True)
    for number, group in zip(numbers, np.split(points[order, 2], starts[1:]), strict=True):
        if len(group) >= LEAST_POINTS:
            heights[number] = np.percentile(group, TOP)
    return heights.reshape(shape)


def _without_single(wall: np.ndarray) -> np.ndarray:
    """Return the cells (X, Y) bool without those that have fewer than two neighbours."""
    around = convolve(wall.astype(int), np.ones((3, 3), int), mode="constant") - wall
    return wall & (around >= 2)


def carrier_text(name: str, carrier: SeenCarrier, mass: float) -> str:
    """Return URDF text of one link of boxes, its mass [kg] in its floor."""
    robot = ElementTree.Element("robot", {"name": name})
    link = ElementTree.SubElement(robot, "link", {"name": name})
    long, wide, high = (mass * edge**2 / 12 for edge in carrier.boxes[0][1])
    inertial = ElementTree.SubElement(link, "inertial")
    ElementTree.SubElement(inertial, "mass", {"value": f"{mass:.6g}"})
    turning = {"ixx": wide + high, "iyy": long + high, "izz": long + wide, "ixy": 0.0, "ixz": 0.0, "iyz": 0.0}
    ElementTree.SubElement(inertial, "inertia", {axis: f"{value:.9g}" for axis, value in turning.items()})
    for center, size in carrier.boxes:
        add_box(link, center, size)
    ElementTree.indent(robot)  # pybullet breaks lines of more than a kilobyte, within a word if need be
    return ElementTree.tostring(robot, encoding="unicode")
