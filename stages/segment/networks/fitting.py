"""An image as a network takes it, and the way back."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from scenewright.stages.segment.networks.sidecar import Sidecar

DEFAULT_SIZE = (640, 640)
"""Width and height [pixels] of the trial image when a network takes any size."""
PAD_VALUE = 114
"""Grey with which a picture is padded, as YOLO networks were trained (0..255)."""
STEP = 32
"""Sides of a picture are multiples of this [pixels] for YOLO networks that take any size."""


@dataclass(frozen=True)
class Fitted:
    """An image as a network takes it, and the way back: input pixel = image pixel x scale."""

    tensor: np.ndarray
    """(1, 3, h, w) or (3, h, w) float32."""
    scale_x: float
    scale_y: float


def fit(color: np.ndarray, sidecar: Sidecar, size: tuple[int, int] | None) -> Fitted:
    """Return an image (H, W, 3) uint8 RGB as the network's input; `size` (width, height), None: the image's own."""
    height, width = color.shape[:2]
    wide, high = size or (width, height)
    scale_x, scale_y = wide / width, high / height
    if sidecar.resize == "letterbox":
        scale_x = scale_y = min(scale_x, scale_y)
    inner = (max(1, round(width * scale_x)), max(1, round(height * scale_y)))
    image = color if inner == (width, height) else cv2.resize(color, inner, interpolation=cv2.INTER_LINEAR)
    if inner != (wide, high):
        padded = np.full((high, wide, 3), PAD_VALUE, dtype=np.uint8)
        padded[: inner[1], : inner[0]] = image
        image = padded
    if sidecar.order == "bgr":
        image = image[..., ::-1]
    values = image.astype(np.float32) * np.float32(sidecar.scale)
    normalised = (values - np.array(sidecar.mean, np.float32)) / np.array(sidecar.deviation, np.float32)
    tensor = np.ascontiguousarray(normalised.transpose(2, 0, 1))
    return Fitted(tensor[None] if sidecar.batch else tensor, inner[0] / width, inner[1] / height)
