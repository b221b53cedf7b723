"""Upright planes of a surface: candidates for walls, the one with most surface first."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

UPRIGHT = 0.3
"""Cosine to the vertical that the normals of upright surface stay under."""
DIRECTIONS = 120
"""Directions of planes that are told apart: every three degrees."""
OFFSET = 0.05
"""Width of the bins of a plane's distance from the origin [m]."""
BAND = 0.04
"""Largest distance of surface from the plane that it is of [m]."""
FACING = float(np.cos(np.radians(25)))
"""Cosine to a plane's normal over which surface faces as it does."""
LEAST_AREA = 0.35
"""Planes with less surface are no candidates [m^2]."""


@dataclass(frozen=True)
class UprightPlane:
    """normal . p = offset [m]; the normal (2,) is horizontal and points to where it was seen from."""

    normal: np.ndarray
    offset: float
    members: np.ndarray
    """Numbers of the vertices that lie on it and face as it does."""

    def distance(self, points: np.ndarray) -> np.ndarray:
        """Return how far points (N, 2 or 3) [m] are before the plane, negative behind it."""
        return points[:, :2] @ self.normal - self.offset

    def along(self, points: np.ndarray) -> np.ndarray:
        """Return the place (N,) [m] of points (N, 2 or 3) along the plane."""
        return points[:, :2] @ np.array([-self.normal[1], self.normal[0]])


def upright_planes(vertices: np.ndarray, normals: np.ndarray, areas: np.ndarray) -> list[UprightPlane]:
    """Return the planes with at least LEAST_AREA of upright surface; each vertex is of one plane.

    vertices, normals (V, 3), z up; areas (V,): surface that each vertex stands for [m^2].
    """
    upright = np.flatnonzero(np.abs(normals[:, 2]) < UPRIGHT)
    planes: list[UprightPlane] = []
    while len(upright):
        points, weight = vertices[upright, :2].astype(float), areas[upright]
        facing = normals[upright, :2] / np.linalg.norm(normals[upright, :2], axis=1, keepdims=True)
        normal, offset = _fitted(points, facing, weight, *_fullest(points, facing, weight))
        on_plane = (facing @ normal > FACING) & (np.abs(points @ normal - offset) < BAND)
        if weight[on_plane].sum() < LEAST_AREA:
            break
        planes.append(UprightPlane(normal, offset, upright[on_plane]))
        upright = upright[~on_plane]
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
