"""Needle masks drawn from geometry alone, for the tests of the estimators."""

from __future__ import annotations

import cv2
import numpy as np
from scenewright.stages.kit.geometry.transforms import transform_from
from scenewright.stages.suture.needle.observation import NeedleObservation
from scenewright.stages.suture.rig import TWO_CAMERAS, NeedlePose, StereoRig
from scenewright.stages.suture.world.tubes import needle_radii
from scipy.spatial.transform import Rotation


def pose_at(tilt_degrees: float = 50.0, roll_degrees: float = 70.0, depth: float = 0.35) -> NeedlePose:
    """Return a pose whose plane is `tilt_degrees` from facing the cameras."""
    rotation = Rotation.from_euler("zxz", [20.0, tilt_degrees, roll_degrees], degrees=True).as_matrix()
    return NeedlePose(transform_from(rotation, np.array([0.03, 0.004, depth])))


def drawn_mask(rig: StereoRig, pose: NeedlePose, eye: int, first: float = 0.0, last: float = np.pi) -> np.ndarray:
    """Return one eye's mask of the arc from angle `first` to `last`, a wire that tapers to its tip."""
    angles = np.linspace(first, last, 200)
    points = pose.points(angles)
    pixels = rig.right(points) if eye else rig.left(points)
    canvas = np.zeros((rig.height, rig.width), dtype=np.uint8)
    radii = needle_radii(angles) * rig.focal / pose.centre[2]
    for (column, row), radius in zip(np.round(pixels * 16).astype(int), np.round(radii * 16).astype(int), strict=True):
        cv2.circle(canvas, (int(column), int(row)), int(radius), 1, -1, cv2.LINE_8, 4)
    return canvas > 0


def disparity_of(rig: StereoRig, pose: NeedlePose, mask: np.ndarray) -> np.ndarray:
    """Return the exact disparity of the circle's nearest point at every pixel of the left mask."""
    points = pose.points(np.linspace(0.0, np.pi, 2000))
    pixels = rig.left(points)
    rows, columns = np.nonzero(mask)
    gaps = (pixels[None, :, 0] - columns[:, None]) ** 2 + (pixels[None, :, 1] - rows[:, None]) ** 2
    disparity = np.full(mask.shape, np.nan, dtype=np.float32)
    disparity[rows, columns] = rig.focal * rig.baseline / points[np.argmin(gaps, axis=1), 2]
    return disparity


def observed(pose: NeedlePose, rig: StereoRig = TWO_CAMERAS) -> NeedleObservation:
    """Return the clean observation of a needle at `pose`."""
    left = drawn_mask(rig, pose, 0)
    return NeedleObservation(rig, left, drawn_mask(rig, pose, 1), disparity_of(rig, pose, left))
