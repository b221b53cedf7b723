"""What segmentation and stereo make of the truth: masks with structured errors, disparity with noise and outliers.

A learned mask is wrong in lumps, not in single pixels: it takes a stretch of thread or a jaw's bright edge for the
needle, loses the needle where it glares, ends short of the tip, and its outline wanders. Disparity is wrong in part
from pixel to pixel and in part over patches, and along the needle's rim it takes what lies behind.
"""

from __future__ import annotations

import cv2
import numpy as np
from scenewright.stages.suture.world.render import Eye, StereoView
from scenewright.stages.suture.world.tubes import LEFT_DRIVER, NEEDLE, RIGHT_DRIVER, THREAD


def spoiled_mask(eye: Eye, random: np.random.Generator) -> np.ndarray:
    """Return a needle mask (H, W) bool of `eye` with the structured errors of a learned one."""
    mask = eye.mask(NEEDLE)
    if not mask.any():
        return mask
    window = _around(mask, 60)
    crop = mask[window].astype(np.uint8)
    near = cv2.dilate(crop, np.ones((51, 51), np.uint8)) > 0
    spoiled = _wandering_outline(crop, random)
    pixels = np.argwhere(crop > 0)
    for _ in range(int(random.integers(0, 4))):
        _disk(spoiled, pixels[random.integers(len(pixels))], random.uniform(3.0, 9.0), 0)
    thread = eye.mask(THREAD)[window] & near
    if random.random() < 0.6 and thread.any():
        _add_stretch(spoiled, thread, random.uniform(8.0, 24.0), random)
    drivers = eye.mask(LEFT_DRIVER, RIGHT_DRIVER)[window].astype(np.uint8)
    rim = (drivers > 0) & (cv2.erode(drivers, np.ones((5, 5), np.uint8)) == 0) & near
    for _ in range(2):
        if random.random() < 0.5 and rim.any():
            _add_stretch(spoiled, rim, random.uniform(6.0, 18.0), random)
    result = np.zeros_like(mask)
    result[window] = spoiled > 0
    return result


def _around(mask: np.ndarray, margin: int) -> tuple[slice, slice]:
    """Return the window of a mask and of `margin` pixels around it."""
    (top, left), (bottom, right) = (end(np.argwhere(mask), axis=0) for end in (np.min, np.max))
    return np.s_[max(top - margin, 0) : bottom + margin, max(left - margin, 0) : right + margin]


def _wandering_outline(crop: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Return the mask whose outline is moved by up to about a pixel, smoothly along it."""
    outside = cv2.distanceTransform(1 - crop, cv2.DIST_L2, 3)
    inside = cv2.distanceTransform(crop, cv2.DIST_L2, 3)
    wander = cv2.GaussianBlur(random.standard_normal(crop.shape).astype(np.float32), (0, 0), 3.0)
    wander = wander * (0.5 / max(float(wander.std()), 1e-9))
    return ((outside - inside + wander) < 0.5).astype(np.uint8)


def _disk(mask: np.ndarray, centre: np.ndarray, radius: float, value: int) -> None:
    cv2.circle(mask, (int(centre[1]), int(centre[0])), round(radius), value, -1)


def _add_stretch(mask: np.ndarray, source: np.ndarray, radius: float, random: np.random.Generator) -> None:
    """Add to `mask` what of `source` lies within `radius` [px] of one of its pixels."""
    pixels = np.argwhere(source)
    disk = np.zeros(mask.shape, dtype=np.uint8)
    _disk(disk, pixels[random.integers(len(pixels))], radius, 1)
    mask[(disk > 0) & source] = 1


def spoiled_thread(eye: Eye, random: np.random.Generator) -> np.ndarray:
    """Return a thread mask (H, W) bool of `eye` that has lost a fifth of its patches."""
    thread = eye.mask(THREAD)
    coarse = random.random((thread.shape[0] // 16 + 1, thread.shape[1] // 16 + 1)) < 0.2
    lost = np.repeat(np.repeat(coarse, 16, axis=0), 16, axis=1)[: thread.shape[0], : thread.shape[1]]
    return thread & ~lost


def spoiled_drivers(eye: Eye, random: np.random.Generator) -> np.ndarray:
    """Return where (H, W) bool the robot's kinematics say that drivers are: off by some 3 px, grown by 2 px."""
    drivers = eye.mask(LEFT_DRIVER, RIGHT_DRIVER).astype(np.uint8)
    shift = np.hstack([np.eye(2), random.normal(0.0, 3.0, (2, 1))]).astype(np.float32)
    moved = cv2.warpAffine(drivers, shift, (drivers.shape[1], drivers.shape[0]), flags=cv2.INTER_NEAREST)
    return cv2.dilate(moved, np.ones((5, 5), np.uint8)) > 0


def noisy_disparity(view: StereoView, noise: float, random: np.random.Generator) -> np.ndarray:
    """Return a disparity map (H, W) float32 [px] with errors of standard deviation `noise` [px] about the needle.

    Half of the variance is white, half is even over about 4 px. A quarter of the needle's rim, in patches, takes the
    disparity of what is behind or before it; where the geometry alone was rendered the pad is 12 mm behind.
    """
    disparity = view.disparity.copy()
    needle = view.left.mask(NEEDLE)
    if not needle.any():
        return disparity
    window = _around(needle, 40)
    crop, inside = disparity[window], needle[window]
    depth_behind = np.nanmedian(view.left.depth[needle]) + 0.012
    behind = view.rig.focal * view.rig.baseline / depth_behind
    crop = np.where(np.isnan(crop), np.float32(behind), crop)
    rim = inside & (cv2.erode(inside.astype(np.uint8), np.ones((3, 3), np.uint8)) == 0)
    patches = cv2.GaussianBlur(random.standard_normal(crop.shape).astype(np.float32), (0, 0), 4.0)
    wrong = rim & (patches > np.quantile(patches, 0.75))
    others = cv2.blur(np.where(inside, 0.0, crop), (9, 9)) / np.maximum(
        cv2.blur((~inside).astype(np.float64), (9, 9)), 1e-6
    )
    crop = np.where(wrong & (others > 0), others, crop)
    even: np.ndarray = cv2.GaussianBlur(random.standard_normal(crop.shape).astype(np.float32), (0, 0), 2.0)
    even = even / max(float(even.std()), 1e-9)
    crop = crop + noise * np.sqrt(0.5) * (even + random.standard_normal(crop.shape))
    disparity[window] = crop.astype(np.float32)
    return disparity
