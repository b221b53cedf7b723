"""RAFT-Stereo as a matcher: both directions, so that there is a confidence, as for the other matcher."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import torch
from scenewright.stages.disparity.consistency import confidence_of, left_right_difference
from scenewright.stages.disparity.raft.architecture import SMALL
from scenewright.stages.disparity.raft.checkpoint import load_network
from scenewright.stages.disparity.raft.network import RaftStereo
from scenewright.stages.disparity.search_range import usual_range
from scenewright.stages.disparity.semi_global import gray_of, mirrored
from scenewright.stages.kit.stereo.disparity_map import DisparityMap

UPDATES, SMALL_UPDATES = 32, 5
"""Updates of the disparity by default: of the authors' networks, and of the small one, which is trained with four."""

SMALL_REACH, BEFORE = 80.0, 6
"""Largest range of disparities that is put to the small network, and what is left before it [px]."""


def open_raft(
    weights: Path, iterations: int | None, agreement: float, device: str
) -> tuple[Callable[[np.ndarray, np.ndarray, tuple[int, int]], DisparityMap], str]:
    """Return the matcher (left and right (H, W, 3) uint8 RGB, limits of the search that it does not need) and what it
    is. Raises BadInput for a checkpoint that does not fit."""
    network = load_network(weights).to(device)
    small, scale = network.sizes == SMALL, 2**network.sizes.downsample
    updates = iterations or (SMALL_UPDATES if small else UPDATES)

    def matcher(left: np.ndarray, right: np.ndarray, limits: tuple[int, int]) -> DisparityMap:
        if small:
            return match_within_reach(network, left, right, updates, agreement, device)
        return match(network, left, right, updates, agreement, device)

    return matcher, f"RAFT-Stereo, {Path(weights).name}, {updates} updates at 1/{scale} of the size, both directions"


def match_within_reach(
    network: RaftStereo, left: np.ndarray, right: np.ndarray, iterations: int, agreement: float, device: str
) -> DisparityMap:
    """Match a pair (H, W, 3) uint8 RGB with a network that knows disparities up to SMALL_REACH alone: the right picture
    is moved by the least disparity, and both are made smaller where the range is larger still."""
    lowest, shrink = start_of(left, right)
    eyes = [smaller(picture, shrink) for picture in (left, right)]
    shrunk = match(network, eyes[0], eyes[1], iterations, agreement, device, lowest)
    return DisparityMap(
        *(larger(values, left.shape, by) for values, by in ((shrunk.disparity, shrink), (shrunk.confidence, 1)))
    )


def start_of(left: np.ndarray, right: np.ndarray) -> tuple[int, int]:
    """Return (lowest disparity of the smaller pair [px], how many times smaller it is) for a network that knows
    disparities up to SMALL_REACH alone."""
    low, high = usual_range(gray_of(left), gray_of(right))
    shrink = max(1, int(np.ceil((high - low) / SMALL_REACH)))
    return max(0, int(low / shrink) - BEFORE), shrink


def smaller(picture: np.ndarray, shrink: int) -> np.ndarray:
    """Return a picture (H, W, 3) at 1 / shrink of its size."""
    if shrink == 1:
        return picture
    size = (max(1, picture.shape[1] // shrink), max(1, picture.shape[0] // shrink))
    return cv2.resize(picture, size, interpolation=cv2.INTER_AREA)


def larger(values: np.ndarray, shape: tuple[int, ...], by: float) -> np.ndarray:
    """Return a map (h, w) at the size (H, W, ...) of a picture, its values `by` times as large."""
    if values.shape == shape[:2]:
        return values
    return by * cv2.resize(values, shape[1::-1], interpolation=cv2.INTER_LINEAR)


def match(
    network: RaftStereo,
    left: np.ndarray,
    right: np.ndarray,
    iterations: int,
    agreement: float,
    device: str,
    lowest: int = 0,
) -> DisparityMap:
    """Match a rectified pair (H, W, 3) uint8 RGB of one size, whose disparities begin at `lowest` [px]: the right
    picture is moved by so much before. Raises ValueError for two sizes."""
    if left.shape != right.shape:
        raise ValueError(f"the eyes have different sizes: {left.shape} and {right.shape}")
    moved = moved_right(right, lowest)
    forward = estimated(network, left, moved, iterations, device)
    backward = estimated(network, mirrored(moved), mirrored(left), iterations, device)[:, ::-1]
    difference = left_right_difference(forward, backward)
    is_valid = (difference <= agreement) & (forward + lowest > 0)
    disparity = np.where(is_valid, forward + lowest, np.nan).astype(np.float32)
    difference[~is_valid] = np.inf
    return DisparityMap(disparity, confidence_of(difference, disparity, gray_of(left)))


def moved_right(picture: np.ndarray, columns: int) -> np.ndarray:
    """Return a picture (H, W, 3) moved to the right; its first column fills what it leaves."""
    if columns == 0:
        return picture
    columns = min(columns, picture.shape[1] - 1)
    first = np.repeat(picture[:, :1], columns, axis=1)
    return np.concatenate([first, picture[:, :-columns]], axis=1)


def estimated(network: RaftStereo, left: np.ndarray, right: np.ndarray, iterations: int, device: str) -> np.ndarray:
    """Return what the network makes of a pair: disparities (H, W) float32 [px]."""
    pictures = [torch.from_numpy(np.ascontiguousarray(picture)).permute(2, 0, 1).float() for picture in (left, right)]
    return network(*(picture.to(device) for picture in pictures), iterations).cpu().numpy()
