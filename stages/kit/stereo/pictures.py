"""Disparity and confidence as pictures for people."""

from __future__ import annotations

import cv2
import numpy as np

UNKNOWN = (20, 20, 20)
"""Colour of pixels without a disparity (sRGB, of 255)."""


def disparity_colors(disparity: np.ndarray, limits: tuple[float, float] | None = None) -> np.ndarray:
    """Return a picture (H, W, 3) uint8 RGB of disparities (H, W) [px]: blue far, red near, unknown nearly black.

    `limits` [px] are those of the colours; None: the first and the 99th percentile of what is known.
    """
    matched = np.isfinite(disparity)
    if limits is None:
        limits = tuple(np.percentile(disparity[matched], [1, 99])) if matched.any() else (0.0, 1.0)  # type: ignore[assignment]
    low, high = limits
    scaled = np.clip((np.where(matched, disparity, low) - low) / max(high - low, 1e-6), 0, 1)
    colors = cv2.applyColorMap(np.rint(255 * scaled).astype(np.uint8), cv2.COLORMAP_TURBO)[..., ::-1].copy()
    colors[~matched] = UNKNOWN
    return colors


def confidence_colors(confidence: np.ndarray) -> np.ndarray:
    """Return a picture (H, W, 3) uint8 RGB of confidences (H, W), 0 dark to 1 bright."""
    scaled = np.rint(255 * np.clip(confidence, 0, 1)).astype(np.uint8)
    return cv2.applyColorMap(scaled, cv2.COLORMAP_VIRIDIS)[..., ::-1].copy()
