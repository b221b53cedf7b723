"""Picture files: the log's own bytes for colour, lossless 16-bit PNG for depth."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from scenewright.stages.kit.formats.foxglove import PNG_START

PNG_COMPRESSION = 3
"""zlib level of depth images: 9 takes five times longer and saves a few per cent."""


def picture_suffix(encoded: bytes) -> str:
    """Return `.png` or `.jpg`, by the first bytes."""
    return ".png" if encoded.startswith(PNG_START) else ".jpg"


def write_depth_png(path: Path, depth: np.ndarray) -> None:
    """Write an (H, W) uint16 depth image as 16-bit PNG."""
    done, data = cv2.imencode(".png", depth, [cv2.IMWRITE_PNG_COMPRESSION, PNG_COMPRESSION])
    if not done:
        raise ValueError(f"depth image of shape {depth.shape} cannot be encoded")
    path.write_bytes(data.tobytes())
