"""Curves of which everything is known, seen by a stereo rig."""

from __future__ import annotations

import cv2
import numpy as np
from scenewright.stages.suture.rig import StereoRig

RIG = StereoRig(640, 480, 800.0, (319.5, 239.5), 0.060)


def masks_of(points: np.ndarray, rig: StereoRig = RIG, thickness: int = 2) -> list[np.ndarray]:
    """Return both eyes' masks (H, W) bool of the curve through points (N, 3) [m, left camera's frame]."""
    masks = []
    for pixels in (rig.left(points), rig.right(points)):
        image = np.zeros((rig.height, rig.width), dtype=np.uint8)
        fixed = np.round(pixels * 16).astype(np.int32).reshape(-1, 1, 2)
        cv2.polylines(image, [fixed], False, 255, thickness, cv2.LINE_AA, shift=4)
        masks.append(image > 127)
    return masks


def line(start: tuple[float, float, float], end: tuple[float, float, float]) -> np.ndarray:
    """Return 200 points of a straight line [m]."""
    return np.linspace(start, end, 200)


def helix(turns: float = 2.3, radius: float = 0.018, rise: float = 0.03, depth: float = 0.30) -> np.ndarray:
    """Return 1500 points of a helix about an axis that leans, so that its picture crosses itself [m]."""
    angle = np.linspace(0.0, 2 * np.pi * turns, 1500)
    along = rise * angle / (2 * np.pi) - rise * turns / 2.0
    across = radius * np.cos(angle)
    return np.stack([across + 0.35 * along, along * 0.9, depth + radius * 0.8 * np.sin(angle)], axis=1)


def length_of(points: np.ndarray) -> float:
    """Return the length of a polyline (N, 3) [m]."""
    return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())


def distances(points: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """Return the distance (N,) of each point to the nearest of the true ones."""
    return np.sqrt(((points[:, None] - truth[None]) ** 2).sum(axis=2)).min(axis=1)
