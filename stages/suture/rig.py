"""A rectified stereo pair, and the needle whose pose it is to find.

Frames are OpenCV's (x right, y down, z forward); the left camera's frame is the frame of every point. The right
camera stands `baseline` metres along +x, so a point at depth z has the disparity `focal * baseline / z` [px] between
its left and its right column. Pixel centres are at whole numbers.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

NEEDLE_RADIUS = 0.012
"""Radius [m] of the GS-21 half circle: its arc of pi * 12 mm is the 37 mm that the package states."""


@dataclass(frozen=True)
class StereoRig:
    """A rectified pair: image size [px], focal length [px], principal point (column, row) [px], baseline [m]."""

    width: int
    height: int
    focal: float
    centre: tuple[float, float]
    baseline: float

    def left(self, points: np.ndarray) -> np.ndarray:
        """Return pixels (N, 2) of points (N, 3) [m] in the left image; NaN for points that are not in front."""
        return self._project(points, 0.0)

    def right(self, points: np.ndarray) -> np.ndarray:
        """Return pixels (N, 2) of points (N, 3) [m, left camera's frame] in the right image; NaN if not in front."""
        return self._project(points, self.baseline)

    def _project(self, points: np.ndarray, shift: float) -> np.ndarray:
        points = np.asarray(points, dtype=float)
        depth = np.where(points[:, 2] > 0, points[:, 2], np.nan)
        column = self.focal * (points[:, 0] - shift) / depth + self.centre[0]
        row = self.focal * points[:, 1] / depth + self.centre[1]
        return np.stack([column, row], axis=1)

    def triangulate(self, left_xy: np.ndarray, disparity: np.ndarray) -> np.ndarray:
        """Return points (N, 3) [m] of left pixels (N, 2) and disparities (N,) [px]; NaN where none is positive."""
        left_xy = np.asarray(left_xy, dtype=float)
        positive = np.where(np.asarray(disparity) > 0, disparity, np.nan).astype(float)
        depth = self.focal * self.baseline / positive
        x = (left_xy[:, 0] - self.centre[0]) / self.focal * depth
        y = (left_xy[:, 1] - self.centre[1]) / self.focal * depth
        return np.stack([x, y, depth], axis=1)


TWO_CAMERAS = StereoRig(1280, 960, 1600.0, (639.5, 479.5), 0.060)
"""Two industrial cameras like the thesis's (1280 x 960, 3.75 um pixels, 6 mm lenses), 60 mm apart; the thesis does
not state the baseline or the lens: ours are assumptions. They look at a workspace 30 to 40 cm away."""

ENDOSCOPE = StereoRig(1280, 960, 1035.0, (639.5, 479.5), 0.006)
"""A stereo endoscope: the focal length of a published calibration of one, a baseline of 6 mm, 10 to 15 cm away."""


@dataclass(frozen=True)
class NeedlePose:
    """`camera_from_needle` (4, 4), metres: where the needle is in the left camera's frame.

    Needle frame: origin at the circle's centre, z along the circle's normal; the arc runs from the tip (angle 0, on
    +x) by right-handed rotation about z to the swage (angle pi, on -x), where the thread is fastened.
    """

    camera_from_needle: np.ndarray

    @property
    def centre(self) -> np.ndarray:
        """The circle's centre (3,) [m]."""
        return self.camera_from_needle[:3, 3]

    @property
    def normal(self) -> np.ndarray:
        """The circle's unit normal (3,)."""
        return self.camera_from_needle[:3, 2]

    @property
    def tip(self) -> np.ndarray:
        """The sharp end (3,) [m]."""
        return self.points(np.zeros(1))[0]

    @property
    def swage(self) -> np.ndarray:
        """The end that carries the thread (3,) [m]."""
        return self.points(np.array([np.pi]))[0]

    def points(self, angles: np.ndarray, radius: float | np.ndarray = NEEDLE_RADIUS) -> np.ndarray:
        """Return the points (N, 3) [m] at `angles` (N,) [rad] of the circle of `radius` [m], one or (N,); the needle is
        0 to pi."""
        angles = np.asarray(angles, dtype=float)
        on_circle = np.stack([radius * np.cos(angles), radius * np.sin(angles), np.zeros_like(angles)], axis=1)
        return on_circle @ self.camera_from_needle[:3, :3].T + self.camera_from_needle[:3, 3]

    def swapped(self) -> NeedlePose:
        """Return the pose of the same arc with tip and swage exchanged: x and z turn about y by pi."""
        turned = self.camera_from_needle.copy()
        turned[:3, 0] *= -1
        turned[:3, 2] *= -1
        return NeedlePose(turned)

    def degrees_from_edge_on(self) -> float:
        """Return the angle [deg] between the circle's plane and the left eye's line of sight to its centre."""
        sight = self.centre / np.linalg.norm(self.centre)
        return float(np.degrees(np.arcsin(np.clip(abs(sight @ self.normal), 0.0, 1.0))))
