"""The matchers. OpenCV's get the range of disparities that ours finds: by themselves they search 16 pixels."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import cv2
import numpy as np
from scenewright.stages.disparity import (
    DisparityParameters,
    SemiGlobalSettings,
    gray_of,
    load_network,
    match,
    moved_right,
    open_raft,
)
from scenewright.stages.disparity.raft.matching import estimated, larger, smaller, start_of
from scenewright.stages.kit.stereo.disparity_map import DisparityMap

Arm = Callable[[np.ndarray, np.ndarray, tuple[int, int]], DisparityMap]
TRUSTED: float = DisparityParameters().minimum_confidence  # type: ignore[call-arg]


def opencv_map(matcher: cv2.StereoMatcher, left: np.ndarray, right: np.ndarray, low: int) -> DisparityMap:
    """Return what one of OpenCV's matchers finds; it knows no confidence."""
    fixed = matcher.compute(gray_of(left), gray_of(right))
    known = fixed >= max(16 * low, 1)
    disparity = np.where(known, fixed.astype(np.float32) / 16, np.nan).astype(np.float32)
    return DisparityMap(disparity, known.astype(np.float32))


def opencv_default(left: np.ndarray, right: np.ndarray, limits: tuple[int, int]) -> DisparityMap:
    """StereoSGBM with every default but the range."""
    return opencv_map(cv2.StereoSGBM.create(minDisparity=limits[0], numDisparities=limits[1]), left, right, limits[0])


def opencv_usual(left: np.ndarray, right: np.ndarray, limits: tuple[int, int]) -> DisparityMap:
    """StereoSGBM with the settings that OpenCV's own stereo example uses."""
    matcher = cv2.StereoSGBM.create(
        minDisparity=limits[0],
        numDisparities=limits[1],
        blockSize=3,
        P1=8 * 9,
        P2=32 * 9,
        disp12MaxDiff=1,
        preFilterCap=63,
        uniquenessRatio=10,
        speckleWindowSize=100,
        speckleRange=32,
    )
    return opencv_map(matcher, left, right, limits[0])


def opencv_blocks(left: np.ndarray, right: np.ndarray, limits: tuple[int, int]) -> DisparityMap:
    """StereoBM with every default but the range."""
    matcher = cv2.StereoBM.create(limits[1])
    matcher.setMinDisparity(limits[0])
    return opencv_map(matcher, left, right, limits[0])


def ours(**settings: object) -> Arm:
    """Return our matcher, which finds its range itself."""
    chosen = SemiGlobalSettings(**settings)  # type: ignore[arg-type]
    return lambda left, right, limits: match(left, right, chosen)


def network(weights: Path, updates: int) -> Arm:
    """Return RAFT-Stereo with a checkpoint as the step `disparity` runs it, both directions."""
    return open_raft(weights, updates, SemiGlobalSettings().agreement, "cpu")[0]


def one_way(weights: Path, updates: int) -> Arm:
    """Return the same without the check against the other direction: a disparity for every pixel."""
    loaded = load_network(weights)

    def arm(left: np.ndarray, right: np.ndarray, limits: tuple[int, int]) -> DisparityMap:
        lowest, shrink = start_of(left, right)
        eyes = smaller(left, shrink), moved_right(smaller(right, shrink), lowest)
        found = larger(estimated(loaded, *eyes, updates, "cpu") + lowest, left.shape, shrink)
        return DisparityMap(found, np.ones_like(found))

    return arm


def trusted(maps: Mapping[str, DisparityMap]) -> DisparityMap:
    """Return what of ours gives depth."""
    found = maps["ours"]
    return DisparityMap(np.where(found.confidence >= TRUSTED, found.disparity, np.nan), found.confidence)


def filled(maps: Mapping[str, DisparityMap]) -> DisparityMap:
    """Return ours with its holes filled by the network, as far as its two directions agree."""
    sure, other = maps["ours"], maps["small"]
    disparity = np.where(sure.known, sure.disparity, other.disparity)
    return DisparityMap(disparity, np.where(sure.known, sure.confidence, other.confidence))


def constant(maps: Mapping[str, DisparityMap]) -> DisparityMap:
    """The middle of what ours finds, everywhere: what a network must beat to have learned anything."""
    found = np.full_like(maps["ours"].disparity, np.nanmedian(maps["ours"].disparity))
    return DisparityMap(found, np.ones_like(found))


CLASSICAL: dict[str, tuple[str, Arm]] = {
    "opencv_default": ("OpenCV StereoSGBM, defaults", opencv_default),
    "opencv_usual": ("OpenCV StereoSGBM, its example's settings", opencv_usual),
    "opencv_blocks": ("OpenCV StereoBM, defaults", opencv_blocks),
    "ours_low": ("ours, effort low", ours(effort="low")),
    "ours": ("**ours**", ours()),
    "ours_high": ("ours, effort high", ours(effort="high")),
    "ours_unrefined": ("ours without sub-pixel refinement", ours(refine=False)),
}
DERIVED: dict[str, tuple[str, tuple[str, ...], Callable[[Mapping[str, DisparityMap]], DisparityMap]]] = {
    "ours_trusted": (f"ours where confidence is {TRUSTED:g} or more", ("ours",), trusted),
    "filled": ("ours, holes filled by small RAFT-Stereo", ("ours", "small"), filled),
    "constant": ("the median of ours, everywhere", ("ours",), constant),
}
"""Arm -> what it is, the arms that it is made of (its time is theirs), and how."""
NETWORK = {
    "small": "small RAFT-Stereo, both directions",
    "small_one_way": "small RAFT-Stereo, one direction, unchecked",
}
WORDS = {name: words for name, (words, _) in CLASSICAL.items()}
WORDS |= {"ours_trusted": DERIVED["ours_trusted"][0]} | NETWORK | {name: words for name, (words, *_) in DERIVED.items()}
"""Arm -> what it is, in the order of the tables."""


def arms_of(weights: Path | None, updates: int) -> dict[str, Arm]:
    """Return the arms that look at pictures, by name; with a checkpoint those too that show what it does."""
    arms = {name: arm for name, (_, arm) in CLASSICAL.items()}
    if weights is None:
        return arms
    return arms | {"small": network(weights, updates), "small_one_way": one_way(weights, updates)}
