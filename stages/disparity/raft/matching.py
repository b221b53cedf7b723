"""RAFT-Stereo as a matcher: both directions, so that there is a confidence, as for the other matcher."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import torch

from stages.disparity.raft.architecture import SMALL
from stages.disparity.raft.checkpoint import load_network
from stages.disparity.raft.network import RaftStereo
from stages.kit.stereo.consistency import confidence_of, left_right_difference
from stages.kit.stereo.disparity_map import DisparityMap
from stages.kit.stereo.semi_global import gray_of, mirrored

UPDATES, SMALL_UPDATES = 32, 5
"""Updates of the disparity by default: of the authors' networks, and of the small one, which is trained with four."""


def open_raft(
    weights: Path, iterations: int | None, agreement: float, device: str
) -> tuple[Callable[[np.ndarray, np.ndarray, tuple[int, int]], DisparityMap], str]:
    """Return the matcher (left and right (H, W, 3) uint8 RGB, limits of the search) and what it is.

    The small network has seen small disparities alone and begins where the search does; the others need no limits.
    Raises BadInput for a checkpoint that does not fit.
    """
    network = load_network(weights).to(device)
    small, scale = network.sizes == SMALL, 2**network.sizes.downsample
    updates = iterations or (SMALL_UPDATES if small else UPDATES)

    def matcher(left: np.ndarray, right: np.ndarray, limits: tuple[int, int]) -> DisparityMap:
        return match(network, left, right, updates, agreement, device, limits[0] if small else 0)

    return matcher, f"RAFT-Stereo, {Path(weights).name}, {updates} updates at 1/{scale} of the size, both directions"


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
    kept = (difference <= agreement) & (forward + lowest > 0)
    disparity = np.where(kept, forward + lowest, np.nan).astype(np.float32)
    difference[~kept] = np.inf
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
    pictures = [torch.from_numpy(np.ascontiguousarray(one)).permute(2, 0, 1).float() for one in (left, right)]
    return network(*(one.to(device) for one in pictures), iterations).cpu().numpy()
