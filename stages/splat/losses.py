"""What is wrong with a picture, and the derivatives of that by the picture."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from scenewright.stages.kit.rendering.splatting.rasterizer import Picture

WINDOW, SIGMA = 11, 1.5
"""Side [px] and standard deviation [px] of the window of the structural similarity (Wang et al. 2004)."""
C1, C2 = 0.01**2, 0.03**2
"""Constants of the structural similarity, of colours from 0 to 1 (Wang et al. 2004)."""


@dataclass(frozen=True)
class LossWeights:
    """How much each part of the loss counts."""

    similarity: float
    """Share of 1 - SSIM; the rest is the mean absolute difference of colour."""
    depth: float = 0.0
    """Of the mean relative difference of depth, where there is measured depth."""
    cover: float = 0.0
    """Of the mean of 1 - alpha: in a room every pixel shows something."""


def loss_of(
    picture: Picture, color: np.ndarray, depth: np.ndarray | None, weights: LossWeights
) -> tuple[float, Picture]:
    """Return the loss against colour (H, W, 3) in 0..1 and depth (H, W) [m], 0 unknown, and its derivatives.

    The depth compared is the sum of weight x depth with alpha x measured depth, so that no division is needed.
    """
    pixels = color.shape[0] * color.shape[1]
    difference = picture.color - color
    similarity, by_similarity = structural_similarity(picture.color, color)
    share = weights.similarity
    loss = (1 - share) * float(np.abs(difference).mean()) + share * (1 - similarity)
    by_color = ((1 - share) / difference.size) * np.sign(difference) - share * by_similarity
    by_depth, by_alpha = np.zeros_like(picture.depth), np.zeros_like(picture.alpha)
    if weights.depth and depth is not None:
        has_depth = depth > 0
        measured = np.where(has_depth, depth, 1.0)
        relative = np.where(has_depth, (picture.depth - picture.alpha * measured) / measured, 0.0)
        loss += weights.depth * float(np.abs(relative).sum()) / pixels
        signs = (weights.depth / pixels) * np.sign(relative)
        by_depth, by_alpha = signs / measured, -signs
    if weights.cover:
        loss += weights.cover * float((1 - picture.alpha).mean())
        by_alpha = by_alpha - weights.cover / pixels
    by_color, by_depth, by_alpha = (part.astype(np.float32) for part in (by_color, by_depth, by_alpha))
    return loss, Picture(by_color, by_depth, by_alpha, np.zeros_like(picture.features))


def structural_similarity(picture: np.ndarray, truth: np.ndarray) -> tuple[float, np.ndarray]:
    """Return the mean SSIM of two (H, W, C) float32 pictures, and its derivative by the first.

    Windows are Gaussian and padded with zeros, so that blurring is its own adjoint.
    """
    x, y = np.ascontiguousarray(picture, np.float32), np.ascontiguousarray(truth, np.float32)
    mx, my, xx, yy, xy = _blur(x), _blur(y), _blur(x * x), _blur(y * y), _blur(x * y)
    a1, a2 = 2 * mx * my + C1, 2 * (xy - mx * my) + C2
    b1, b2 = mx * mx + my * my + C1, (xx - mx * mx) + (yy - my * my) + C2
    below = 1.0 / (b1 * b2)
    similarity = a1 * a2 * below
    by_mean = 2 * my * (a2 - a1) * below + 2 * mx * similarity * (1 / b2 - 1 / b1)
    back = _blur(by_mean) - 2 * x * _blur(similarity / b2) + y * _blur(2 * a1 * below)
    return float(similarity.mean()), back / similarity.size


def signal_to_noise(picture: np.ndarray, truth: np.ndarray) -> float:
    """Return the PSNR of a picture in 0..1 against the truth [dB], at most 99."""
    error = float(np.mean((np.clip(picture, 0, 1) - truth) ** 2, dtype=float))
    return 99.0 if error < 10**-9.9 else -10 * float(np.log10(error))


def _blur(image: np.ndarray) -> np.ndarray:
    return cv2.GaussianBlur(image, (WINDOW, WINDOW), SIGMA, borderType=cv2.BORDER_CONSTANT)
