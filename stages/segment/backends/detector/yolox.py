"""Object detection with an ONNX network of the YOLOX layout (Ge et al. 2021), run by OpenCV's dnn module."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.segment.coco import COCO_NAMES
from scenewright.stages.segment.networks.fitting import PAD_VALUE
from scenewright.stages.segment.networks.tiles import INNER_MARGIN, Window, grid_windows
from scenewright.stages.segment.suppression import suppress

STRIDES = (8, 16, 32)
"""Input pixels per cell of each of the network's three grids (YOLOX, Ge et al. 2021)."""
INPUT_SIZES = (416, 640)
"""Square inputs of the published YOLOX models (nano and tiny; small to extra large)."""


@dataclass(frozen=True)
class Detections:
    """Boxes found in one image, best first."""

    boxes: np.ndarray
    """(N, 4) x0, y0, x1, y1 [pixels]."""
    scores: np.ndarray
    """(N,) 0..1."""
    classes: np.ndarray
    """(N,) indices into COCO_NAMES."""


def letterbox(image: np.ndarray, size: int) -> tuple[np.ndarray, float]:
    """Return the image (H, W, 3) uint8 fitted into the top left of a grey (size, size, 3) square, and its scale."""
    height, width = image.shape[:2]
    scale = min(size / height, size / width)
    fitted = cv2.resize(image, (int(width * scale), int(height * scale)), interpolation=cv2.INTER_LINEAR)
    square = np.full((size, size, 3), PAD_VALUE, dtype=np.uint8)
    square[: fitted.shape[0], : fitted.shape[1]] = fitted
    return square, scale


def decode(raw: np.ndarray, size: int) -> tuple[np.ndarray, np.ndarray]:
    """Return boxes (N, 4) x0, y0, x1, y1 in pixels of the square input and scores (N, C) from the raw output.

    `raw` (N, 5 + C) float: per cell of the grids of stride 8, 16, 32 (row by row) the centre's offset from the cell
    in cells, the logarithm of width and height in cells, objectness, and a score per class.
    """
    cells, strides = [], []
    for stride in STRIDES:
        side = size // stride
        v, u = np.mgrid[0:side, 0:side]
        cells.append(np.stack([u.ravel(), v.ravel()], axis=1))
        strides.append(np.full((side * side, 1), stride))
    grid, step = np.concatenate(cells).astype(np.float32), np.concatenate(strides).astype(np.float32)
    center = (raw[:, :2] + grid) * step
    # A damaged network must not overflow: no box is wider than e^8 cells.
    half = np.exp(np.minimum(raw[:, 2:4], 8.0)) * step / 2
    return np.concatenate([center - half, center + half], axis=1), raw[:, 4:5] * raw[:, 5:]


def tile_windows(width: int, height: int, side: int) -> list[Window]:
    """Return windows (x0, y0, x1, y1) of `side` pixels that cover an image, neighbours overlapping by at least a
    third of a side; none when the image is not larger than a tile."""
    if width <= side and height <= side:
        return []
    starts = []
    for length in (width, height):
        if length <= side:
            starts.append([0])
            continue
        count = int(np.ceil((length - side) / (side * 2 / 3))) + 1
        starts.append([int(round(x)) for x in np.linspace(0, length - side, count)])
    return [(x, y, min(x + side, width), min(y + side, height)) for y in starts[1] for x in starts[0]]


class Detector:
    """A YOLOX network. Raises BadInput when the file is no such network."""

    def __init__(
        self, weights: Path, *, score_threshold: float, suppression_overlap: float, tile_side: int, tiles: int = 0
    ) -> None:
        """`tile_side` [pixels]: of tiles at full resolution, 0 = none; `tiles`: how many a side there are otherwise."""
        weights = Path(weights)
        self.score_threshold = score_threshold
        self.suppression_overlap = suppression_overlap
        self.tile_side, self.tiles = tile_side, tiles
        hint = (
            "give an ONNX export of a YOLOX model (COCO-80) with --weights, or --backend onnx for one that gives masks"
        )
        try:
            self._network = cv2.dnn.readNetFromONNX(str(weights))
        except (cv2.error, MemoryError) as error:
            raise BadInput(f"{weights.name} is not an ONNX network that OpenCV can read", hint=hint) from error
        self.size = self._find_size()
        if not self.size:
            raise BadInput(f"{weights.name} does not have the inputs and outputs of YOLOX (COCO-80)", hint=hint)

    def _find_size(self) -> int:
        for size in INPUT_SIZES:
            try:
                self._network.setInput(np.zeros((1, 3, size, size), dtype=np.float32))
                shape = np.asarray(self._network.forward()).shape
            except cv2.error:
                continue
            if shape == (1, sum((size // stride) ** 2 for stride in STRIDES), 5 + len(COCO_NAMES)):
                return size
        return 0

    def detect(self, color: np.ndarray) -> Detections:
        """Return what is found in an image (H, W, 3) uint8 RGB: in the whole, and in tiles if it was asked to."""
        height, width = color.shape[:2]
        areas = grid_windows(width, height, self.tiles)
        if self.tile_side:
            areas += tile_windows(width, height, self.tile_side)
        windows = [self._detect_window(color, area) for area in areas]
        boxes, scores, classes = (np.concatenate([part[k] for part in windows]) for k in range(3))
        unsuppressed = suppress(boxes, scores, classes, self.suppression_overlap)
        return Detections(boxes[unsuppressed], scores[unsuppressed], classes[unsuppressed])

    def _detect_window(self, color: np.ndarray, window: Window) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        height, width = color.shape[:2]
        x0, y0, x1, y1 = window
        # The network was trained on blue-green-red values 0..255.
        square, scale = letterbox(np.ascontiguousarray(color[y0:y1, x0:x1, ::-1]), self.size)
        self._network.setInput(square.astype(np.float32).transpose(2, 0, 1)[None].copy())
        boxes, scores = decode(np.asarray(self._network.forward())[0], self.size)
        best = scores.argmax(axis=1)
        score = scores[np.arange(len(best)), best]
        keep = score >= self.score_threshold
        limits = np.array([x1 - x0, y1 - y0] * 2, dtype=np.float32)
        boxes = np.clip(boxes[keep] / scale, 0, limits) + np.array([x0, y0, x0, y0], dtype=np.float32)
        # A box cut off by the side of a tile that is not the image's own says nothing of the thing's extent.
        margin = INNER_MARGIN * (x1 - x0)
        cut = (
            ((boxes[:, 0] < x0 + margin) & (x0 > 0))
            | ((boxes[:, 1] < y0 + margin) & (y0 > 0))
            | ((boxes[:, 2] > x1 - margin) & (x1 < width))
            | ((boxes[:, 3] > y1 - margin) & (y1 < height))
        )
        return boxes[~cut], score[keep][~cut], best[keep][~cut]
