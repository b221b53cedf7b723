"""What an estimator of the needle's pose is given, and what it answers."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.suture.rig import NeedlePose, StereoRig

AROUND = 31
"""Side [px] of the square with whose mean a pixel is compared."""
VIOLET, DARK = 0.018, 15.0
"""How much more violet than around a thread is, as a share of the brightness; what is added to the brightness so that
noise in the dark is not violet."""


@dataclass(frozen=True)
class NeedleObservation:
    """Masks (H, W) bool of both eyes, and whatever else is known.

    `disparity` (H, W) float32 [px], left eye, NaN unknown; `left_thread`, `right_thread` where thread is seen;
    `left_hidden`, `right_hidden` where something (a driver) may hide the needle; `pictures` (H, W, 3) uint8 RGB of both
    eyes, by which a needle is told from an edge. All but the masks may be None.
    """

    rig: StereoRig
    left_mask: np.ndarray
    right_mask: np.ndarray
    disparity: np.ndarray | None = None
    left_thread: np.ndarray | None = None
    right_thread: np.ndarray | None = None
    left_hidden: np.ndarray | None = None
    right_hidden: np.ndarray | None = None
    pictures: tuple[np.ndarray, np.ndarray] | None = None

    def check(self) -> None:
        """Raise BadInput where the rig or the images' sizes cannot be."""
        if not self.rig.baseline > 0:
            raise BadInput(
                f"the stereo rig's baseline is {self.rig.baseline} m: two eyes at one place measure no depth",
                hint="check the calibration's baseline and the order of the eyes",
            )
        size = (self.rig.height, self.rig.width)
        arrays = {
            "left needle mask": self.left_mask,
            "right needle mask": self.right_mask,
            "disparity": self.disparity,
            "left thread mask": self.left_thread,
            "right thread mask": self.right_thread,
            "left mask of what hides": self.left_hidden,
            "right mask of what hides": self.right_hidden,
        }
        if self.pictures is not None:
            arrays |= {"left image": self.pictures[0][..., 0], "right image": self.pictures[1][..., 0]}
        for name, array in arrays.items():
            if array is not None and array.shape != size:
                raise BadInput(
                    f"the {name} is {array.shape}, the rig's images are {size} (rows, columns)",
                    hint="give masks of the rectified images at full size",
                )


@dataclass(frozen=True)
class NeedleEstimate:
    """A needle's pose and how sure it is, or why there is none.

    `covariance` (6, 6): of the centre's error [m] (camera frame) and of the rotation vector [rad] (camera frame) that
    turns the estimate into the truth. `tip_probability`: that tip and swage are not exchanged. `abstained`: empty, or
    one sentence that says why the pose should not be used; `pose` is then the best guess or None. `presence_features`:
    what the test of presence looked at; empty where there was nothing to test, and of estimators without one.
    """

    pose: NeedlePose | None
    covariance: np.ndarray
    tip_probability: float
    abstained: str
    presence_features: tuple[float, ...] = ()

    @staticmethod
    def none(reason: str) -> NeedleEstimate:
        """Return the abstention that has not even a guess."""
        return NeedleEstimate(None, np.full((6, 6), np.inf), 0.5, reason)


def violet(image: np.ndarray) -> np.ndarray:
    """Return where (H, W) bool an RGB picture (H, W, 3) uint8 shows violet thread.

    A thread of three pixels takes on the colour of what is behind it, so colours are compared with those around: for
    its brightness thread is less green than their mean, and more blue against green. Steel is not the first, red and
    the pad are not the second.
    """
    red, green, blue = (cv2.GaussianBlur(image, (0, 0), 0.8).astype(np.float32)[..., k] for k in range(3))
    brightness = red + green + blue + DARK
    purple, blueness = ((red + blue) / 2.0 - green) / brightness, (blue - green) / brightness
    around = (AROUND, AROUND)
    return np.minimum(purple - cv2.blur(purple, around), blueness - cv2.blur(blueness, around)) > VIOLET
