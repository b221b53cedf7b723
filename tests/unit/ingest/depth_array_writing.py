"""Writes depth and disparity as the float arrays that other programs leave."""

from __future__ import annotations

from pathlib import Path

import numpy as np


def write_pfm(path: Path, image: np.ndarray) -> None:
    """Write an (H, W) float array as a Portable Float Map."""
    height, width = image.shape
    path.write_bytes(f"Pf\n{width} {height}\n-1.0\n".encode() + np.flipud(image).astype("<f4").tobytes())


def write_colmap_array(path: Path, image: np.ndarray) -> None:
    """Write an (H, W) float array as COLMAP writes its dense depth maps."""
    height, width = image.shape
    path.write_bytes(f"{width}&{height}&1&".encode() + image.astype("<f4").tobytes())
