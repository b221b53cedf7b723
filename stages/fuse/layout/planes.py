"""Planes of a surface: candidates for floor, ceiling and walls, those with most surface first."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

LEVEL = 0.9
"""Cosine to the vertical that the normals of level surface have at least."""
UPRIGHT = 0.3
"""Cosine to the vertical that the normals of upright surface stay under."""
DIRECTIONS = 120
"""Directions of upright planes that are told apart: every three degrees."""
OFFSET = 0.05
"""Width of the bins of a plane's distance from the origin [m]."""
BAND = 0.04
"""Largest distance of surface from the plane that it is of [m]."""
FACING = float(np.cos(np.radians(25)))
"""Cosine to a plane's normal over which surface faces as it does."""
LEAST_AREA = 0.35
"""Planes with less surface are no candidates [m^2]."""
CELL = 0.1
"""Edge of the cells of a plane [m]."""


@dataclass(frozen=True)
class Plane:
    """normal . p = offset [m]; the normal (3,) points to where the surface was seen from, z is up."""

    normal: np.ndarray
    offset: float
    members: np.ndarray
    """Numbers of the vertices that lie on it and face as it does."""

    @property
    def is_level(self) -> bool:
        """Whether it is a floor, a top or a ceiling, and no wall or front."""
        return bool(abs(self.normal[2]) > LEVEL)

    @property
    def axes(self) -> np.ndarray:
        """Two directions (2, 3) within it; of an upright plane the second is up."""
        if self.is_level:
            return np.eye(3)[:2]
        return np.array([[-self.normal[1], self.normal[0], 0.0], [0.0, 0.0, 1.0]])

    def distance(self, points: np.ndarray) -> np.ndarray:
        """Return how far points (N, 3) [m] are before the plane, negative behind it."""
        return np.asarray(points @ self.normal - self.offset)

    def cells(self, points: np.ndarray) -> np.ndarray:
        """Return the cells (N, 2) of the plane before or behind which points (N, 3) lie."""
        return np.floor(points @ self.axes.T / CELL).astype(np.int64)

    def at(self, cells: np.ndarray, distance: float) -> np.ndarray:
        """Return the points (N, 3) at a distance [m] before the middles of cells (N, 2)."""
        return (self.offset + distance) * self.normal + (cells + 0.5) * CELL @ self.axes


def upright_planes(vertices: np.ndarray, normals: np.ndarray, areas: np.ndarray) -> list[Plane]:
    """Return the planes with at least LEAST_AREA of upright surface; each vertex is of one plane.

    vertices, normals (V, 3), z up; areas (V,): surface that each vertex stands for [m^2].
    """
    upright = np.flatnonzero(np.abs(normals[:, 2]) < UPRIGHT)
    planes: list[Plane] = []
    while len(upright):
        points, weight = vertices[upright, :2].astype(float), areas[upright]
        facing = normals[upright, :2] / np.linalg.norm(normals[upright, :2], axis=1, keepdims=True)
        normal, offset = _fitted(points, facing, weight, *_fullest(points, facing, weight))
        on_plane = (facing @ normal > FACING) & (np.abs(points @ normal - offset) < BAND)
        if weight[on_plane].sum() < LEAST_AREA:
            break
        planes.append(Plane(np.append(normal, 0.0), offset, upright[on_plane]))
        upright = upright[~on_plane]
    return planes


def level_planes(vertices: np.ndarray, normals: np.ndarray, areas: np.ndarray, *, up: bool) -> list[Plane]:
    """Return the planes with at least LEAST_AREA of level surface that faces up, or down; arguments as above."""
    sign = 1.0 if up else -1.0
    level = np.flatnonzero(sign * normals[:, 2] > LEVEL)
    planes: list[Plane] = []
    while len(level):
        height, weight = vertices[level, 2].astype(float), areas[level]
        bins = np.floor((height - height.min()) / (BAND / 2)).astype(int)
        area = np.convolve(np.bincount(bins, weights=weight), np.ones(3), mode="same")
        middle = height.min() + (int(area.argmax()) + 0.5) * BAND / 2
        near = np.abs(height - middle) < BAND
        middle = float(np.average(height[near], weights=weight[near]))
        near = np.abs(height - middle) < BAND
        if weight[near].sum() < LEAST_AREA:
            break
        planes.append(Plane(np.array([0.0, 0.0, sign]), sign * middle, level[near]))
        level = level[~near]
    return planes


def _fullest(points: np.ndarray, facing: np.ndarray, weight: np.ndarray) -> tuple[np.ndarray, float]:
    """Return normal (2,) and offset of the fullest bin of direction and distance, smoothed over its neighbours."""
    angle = np.arctan2(facing[:, 1], facing[:, 0])
    low = -float(np.linalg.norm(points, axis=1).max()) - OFFSET
    columns = int(-2 * low / OFFSET) + 3
    histogram = np.zeros((DIRECTIONS, columns))
    for shift in (-1, 0, 1):
        direction = (np.rint(angle * DIRECTIONS / (2 * np.pi)).astype(int) + shift) % DIRECTIONS
        turn = direction * 2 * np.pi / DIRECTIONS
        distance = points[:, 0] * np.cos(turn) + points[:, 1] * np.sin(turn)
        place = ((distance - low) / OFFSET).astype(int)
        histogram += np.bincount(direction * columns + place, weights=weight, minlength=histogram.size).reshape(
            histogram.shape
        )
    both = histogram[:, :-1] + histogram[:, 1:]
    direction, place = np.unravel_index(int(both.argmax()), both.shape)
    turn = direction * 2 * np.pi / DIRECTIONS
    return np.array([np.cos(turn), np.sin(turn)]), low + (float(place) + 1) * OFFSET


def _fitted(
    points: np.ndarray, facing: np.ndarray, weight: np.ndarray, normal: np.ndarray, offset: float
) -> tuple[np.ndarray, float]:
    """Return the plane that the surface around a first one lies on: total least squares, three times."""
    for width in (2 * BAND, 1.5 * BAND, BAND):
        near = (facing @ normal > FACING) & (np.abs(points @ normal - offset) < width)
        if near.sum() < 3:
            break
        share = weight[near] / weight[near].sum()
        middle = share @ points[near]
        centred = points[near] - middle
        across = np.linalg.eigh((centred * share[:, None]).T @ centred)[1][:, 0]
        normal = across * (1.0 if across @ normal >= 0 else -1.0)
        offset = float(middle @ normal)
    return normal, offset
