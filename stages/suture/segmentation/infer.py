"""Masks of needle and thread out of a picture."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import torch
from scenewright.schemas.errors import BadInput
from scenewright.stages.suture.segmentation.checkpoint import BUNDLED, load_network
from scenewright.stages.suture.segmentation.model import STRIDE, SutureNetwork

THRESHOLD = 0.5
"""Probability above which a pixel is mask."""
SMALLEST_NEEDLE, SMALLEST_THREAD, SMALLEST_DRIVER = 25, 8, 200
"""Pieces of mask of fewer pixels are taken out."""


@dataclass(frozen=True)
class Masks:
    """Where (H, W) bool needle and thread are seen, the probabilities (H, W) float32 that the network gave them, and
    where (H, W) bool a driver is seen, which may hide either."""

    needle: np.ndarray
    thread: np.ndarray
    needle_probability: np.ndarray
    thread_probability: np.ndarray
    driver: np.ndarray


@dataclass(frozen=True)
class Segmenter:
    """The network and what its checkpoint says of itself."""

    network: SutureNetwork
    description: str

    @classmethod
    def load(cls, path: Path = BUNDLED) -> Segmenter:
        """Read a checkpoint. Raises BadInput for a file that is none of ours."""
        return cls(*load_network(path))

    def probabilities(self, rgb: np.ndarray) -> np.ndarray:
        """Return the probabilities (3, H, W) float32 of needle, thread and driver in a picture (H, W, 3) uint8 RGB.

        Computed on one thread, so that the answer does not depend on the number of cores. Raises BadInput for anything
        that is not such a picture.
        """
        if rgb.ndim != 3 or rgb.shape[2] != 3 or rgb.dtype != np.uint8 or 0 in rgb.shape:
            raise BadInput(
                f"the image is {rgb.shape} {rgb.dtype}, expected (rows, columns, 3) uint8 RGB",
                hint="give a colour image of 8 bits",
            )
        rows, columns = rgb.shape[:2]
        wide = np.pad(rgb, ((0, -rows % STRIDE), (0, -columns % STRIDE), (0, 0)), mode="edge")
        threads = torch.get_num_threads()
        torch.set_num_threads(1)
        try:
            with torch.inference_mode():
                logits = self.network(normalised(torch.from_numpy(wide[None])))
                result = torch.sigmoid(logits)[0, :, :rows, :columns]
        finally:
            torch.set_num_threads(threads)
        return np.ascontiguousarray(result.numpy())

    def masks(self, rgb: np.ndarray) -> Masks:
        """Return the masks in a picture (H, W, 3) uint8 RGB; BadInput as `probabilities`."""
        needle, thread, driver = self.probabilities(rgb)
        clean_needle = without_specks(needle > THRESHOLD, SMALLEST_NEEDLE)
        clean_thread = without_specks(thread > THRESHOLD, SMALLEST_THREAD)
        clean_driver = without_specks(driver > THRESHOLD, SMALLEST_DRIVER)
        return Masks(clean_needle, clean_thread, needle, thread, clean_driver)


def normalised(pictures: torch.Tensor) -> torch.Tensor:
    """Return pictures (N, H, W, 3) uint8 as the network takes them, (N, 3, H, W) float32 from -1 to 1."""
    return (pictures.permute(0, 3, 1, 2).float() / 127.5 - 1.0).contiguous(memory_format=torch.channels_last)


def without_specks(mask: np.ndarray, smallest: int) -> np.ndarray:
    """Return the mask (H, W) bool without its 8-connected pieces of fewer than `smallest` pixels."""
    _, labels, statistics, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8), connectivity=8)
    is_large = statistics[:, cv2.CC_STAT_AREA] >= smallest
    is_large[0] = False
    return is_large[labels]
