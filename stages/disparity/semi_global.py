"""Semi-global matching (Hirschmueller, PAMI 2008) by OpenCV, in both directions, with what it leaves out put back.

The matcher cannot see matches of the left image's first columns: the pair is padded there. It is run on the mirrored
pair too, which gives the disparities of the right image; where both agree, the match counts.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np
from scenewright.stages.disparity.consistency import confidence_of, left_right_difference
from scenewright.stages.disparity.search_range import search_range
from scenewright.stages.disparity.subpixel import smoothed, unlocked
from scenewright.stages.kit.stereo.disparity_map import DisparityMap

Effort = Literal["low", "medium", "high"]


@dataclass(frozen=True)
class SemiGlobalSettings:
    """Settings of the matcher. Penalties are for each pixel of the block, as OpenCV's examples state them."""

    effort: Effort = "medium"
    """Directions that costs are gathered along: `low` 3, `medium` 4, `high` 8."""
    block_size: int = 3
    """Odd width of the squares that are compared [px]."""
    small_penalty: int = 8
    """Cost of a step of one pixel (P1)."""
    large_penalty: int = 32
    """Cost of a larger step (P2)."""
    uniqueness: int = 5
    """Per cent by which the best cost must win over the second."""
    filter_cap: int = 31
    """Slopes along the row are compared up to this many grey levels."""
    agreement: float = 1.0
    """The two directions may differ by this much [px]."""
    speckle_size: int = 100
    """Islands of fewer pixels are taken out."""
    speckle_range: float = 2.0
    """Step between neighbours [px] that parts islands."""
    refine: bool = True
    """Undo the pull to whole pixels, and smooth within surfaces."""


def match(
    left: np.ndarray,
    right: np.ndarray,
    settings: SemiGlobalSettings | None = None,
    limits: tuple[int, int] | None = None,
) -> DisparityMap:
    """Match a rectified pair, (H, W) uint8 or (H, W, 3) uint8 RGB of one size.

    `limits` are the lowest disparity and the number of disparities (a multiple of 16) [px]; None: as the pair needs.
    Raises ValueError for pictures of different sizes.
    """
    settings = settings or SemiGlobalSettings()
    if left.shape != right.shape:
        raise ValueError(f"the eyes have different sizes: {left.shape} and {right.shape}")
    grays = [gray_of(left), gray_of(right)]
    low, levels = limits or search_range(*grays)
    forward = directed(grays[0], grays[1], settings, low, levels)
    backward = directed(mirrored(grays[1]), mirrored(grays[0]), settings, low, levels)[:, ::-1]
    difference = left_right_difference(forward, backward)
    agrees = difference <= settings.agreement
    disparity = without_speckles(np.where(agrees, forward, np.nan).astype(np.float32), settings)
    if settings.refine:
        disparity = smoothed(unlocked(disparity))
    disparity[~(disparity > 0)] = np.nan
    difference[~np.isfinite(disparity)] = np.inf
    return DisparityMap(disparity, confidence_of(difference, disparity, grays[0]))


def gray_of(picture: np.ndarray) -> np.ndarray:
    """Return a picture (H, W) or (H, W, 3) RGB as (H, W) uint8."""
    return picture if picture.ndim == 2 else cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY)


def mirrored(picture: np.ndarray) -> np.ndarray:
    """Return a picture with left and right exchanged."""
    return np.ascontiguousarray(picture[:, ::-1])


def directed(left: np.ndarray, right: np.ndarray, settings: SemiGlobalSettings, low: int, levels: int) -> np.ndarray:
    """Return disparities (H, W) float32 [px] of the left picture, NaN where the matcher has none."""
    area = settings.block_size**2
    modes = {"low": cv2.StereoSGBM_MODE_SGBM_3WAY, "medium": cv2.StereoSGBM_MODE_HH4, "high": cv2.StereoSGBM_MODE_HH}
    matcher = cv2.StereoSGBM.create(
        minDisparity=low,
        numDisparities=levels,
        blockSize=settings.block_size,
        P1=settings.small_penalty * area,
        P2=settings.large_penalty * area,
        disp12MaxDiff=-1,
        preFilterCap=settings.filter_cap,
        uniquenessRatio=settings.uniqueness,
        mode=modes[settings.effort],
    )
    border = low + levels
    padded = [cv2.copyMakeBorder(picture, 0, 0, border, 0, cv2.BORDER_REPLICATE) for picture in (left, right)]
    fixed = matcher.compute(*padded)[:, border:]
    return np.where(fixed >= 16 * low, fixed.astype(np.float32) / 16.0, np.nan).astype(np.float32)


def without_speckles(disparity: np.ndarray, settings: SemiGlobalSettings) -> np.ndarray:
    """Return disparities (H, W) float32 without islands smaller than the settings allow."""
    matched = np.isfinite(disparity)
    if settings.speckle_size == 0:
        return disparity
    fixed = np.where(matched, np.rint(16 * np.where(matched, disparity, 0.0)), -16).astype(np.int16)
    cv2.filterSpeckles(fixed, -16, settings.speckle_size, 16 * settings.speckle_range)
    return np.where(fixed >= 0, disparity, np.nan).astype(np.float32)
