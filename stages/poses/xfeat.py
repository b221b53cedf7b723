"""XFeat (Potje, Cadar, Araujo, Martins and Nascimento, CVPR 2024): learned corners, where somebody brings the network.

The network gives maps an eighth of the picture's size. What follows is the published way from these to corners: a
softmax over the 64 places of a cell and one for none, the best place within two pixels, descriptors between cells.
"""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from scenewright.schemas.errors import BadInput

CELL = 8
"""Side of a cell of the maps [px]."""
MULTIPLE = 32
"""Sides of the picture that the network takes are multiples of this [px]."""
DIMENSIONS = 64
"""Of a descriptor."""
LEAST_SCORE = 0.05
"""Least probability of a place to be a corner; published."""
MOST = 2000
"""Corners that are described per frame."""
OUTPUTS = ("descriptors", "keypoint_logits", "reliability")


class XFeat:
    """The network; called with a picture, it gives its corners."""

    def __init__(self, weights: Path) -> None:
        """Read an ONNX export whose outputs are those of OUTPUTS. Raises BadInput when the file is none."""
        hint = "give the export that `scenewright models` names as xfeat, or leave --features out"
        try:
            self._network = cv2.dnn.readNetFromONNX(str(weights))
        except (cv2.error, MemoryError) as error:
            raise BadInput(f"{weights.name} is not an ONNX network that OpenCV can read", hint=hint) from error
        side = 2 * MULTIPLE
        try:
            maps = self._maps(np.zeros((side, side, 3), np.uint8))
        except cv2.error:
            maps = []
        cells = (side // CELL, side // CELL)
        if [found.shape for found in maps] != [(channels, *cells) for channels in (DIMENSIONS, CELL * CELL + 1, 1)]:
            raise BadInput(f"{weights.name} does not have the input and outputs of XFeat", hint=hint)

    def _maps(self, picture: np.ndarray) -> list[np.ndarray]:
        self._network.setInput(np.ascontiguousarray(picture.transpose(2, 0, 1)[None], np.float32) / np.float32(255))
        return [np.asarray(found)[0] for found in self._network.forward(list(OUTPUTS))]

    def __call__(self, color: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return pixels (N, 2) float32 and descriptors (N, 64) float32 of length 1 of a picture (H, W, 3) uint8 RGB,
        both sides of at least MULTIPLE pixels."""
        height, width = (side // MULTIPLE * MULTIPLE for side in color.shape[:2])
        picture = cv2.resize(color, (width, height), interpolation=cv2.INTER_LINEAR)
        descriptors, logits, reliability = self._maps(picture)
        corners = _corners(logits)
        highest = cv2.dilate(corners, np.ones((5, 5), np.uint8))
        rows, columns = np.nonzero((corners > LEAST_SCORE) & (corners == highest))
        places = np.stack([columns, rows], axis=1)
        scores = corners[rows, columns] * _sampled(reliability, places)[:, 0]
        places = places[np.argsort(-scores, kind="stable")[:MOST]]
        found = _sampled(descriptors, places)
        found /= np.maximum(np.linalg.norm(found, axis=1, keepdims=True), 1e-9)
        scale = np.array([color.shape[1] / width, color.shape[0] / height])
        return ((places + 0.5) * scale - 0.5).astype(np.float32), found.astype(np.float32)


def _corners(logits: np.ndarray) -> np.ndarray:
    """Return the probability (8 H, 8 W) of every pixel to be a corner from the logits (65, H, W) of its cell."""
    shares = np.exp(logits - logits.max(axis=0))
    shares = (shares / shares.sum(axis=0))[:-1]
    rows, columns = shares.shape[1:]
    unfolded = shares.reshape(CELL, CELL, rows, columns).transpose(2, 0, 3, 1)
    return np.ascontiguousarray(unfolded.reshape(rows * CELL, columns * CELL))


def _sampled(maps: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Return (N, C) values of maps (C, H, W) at pixels (N, 2) of the picture, linear between the cells' middles."""
    height, width = maps.shape[1:]
    at = np.clip((places + 0.5) / CELL - 0.5, 0, (width - 1, height - 1))
    low = np.minimum(np.floor(at).astype(int), (max(width - 2, 0), max(height - 2, 0)))
    a, b = (at - low).T
    (x, y), flat = low.T, maps.transpose(1, 2, 0)
    top = flat[y, x] * (1 - a)[:, None] + flat[y, x + 1] * a[:, None]
    bottom = flat[y + 1, x] * (1 - a)[:, None] + flat[y + 1, x + 1] * a[:, None]
    return np.asarray(top * (1 - b)[:, None] + bottom * b[:, None])
