"""A semantic segmenter with the 21 classes of PASCAL VOC as a TensorFlow Lite file (DeepLab v3, Chen et al. 2017)."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from scenewright.schemas.errors import BadInput, MissingDependency

VOC_NAMES = (
    "background",
    "aeroplane",
    "bicycle",
    "bird",
    "boat",
    "bottle",
    "bus",
    "car",
    "cat",
    "chair",
    "cow",
    "diningtable",
    "dog",
    "horse",
    "motorbike",
    "person",
    "pottedplant",
    "sheep",
    "sofa",
    "train",
    "tvmonitor",
)
"""PASCAL VOC's classes and the background, in the order of the networks' outputs."""
FROM_VOC = {
    "bottle": "bottle",
    "chair": "chair",
    "diningtable": "table",
    "person": "person",
    "pottedplant": "plant",
    "sofa": "sofa",
    "tvmonitor": "monitor",
}
"""Class of data/vocabulary.toml by VOC's name; what has none is out of doors or alive."""
HINT = "give a DeepLab with PASCAL VOC's classes as .tflite: scenewright models"


class SemanticSegmenter:
    """A network that names every pixel. Its file is data: nothing of it is executed but its tensors' operations.

    Raises MissingDependency without its runtime, BadInput when the file is no such network.
    """

    def __init__(self, weights: Path) -> None:
        try:
            runtime = importlib.import_module("ai_edge_litert.interpreter")
        except ImportError:
            raise MissingDependency(
                "a .tflite network needs ai-edge-litert", hint="pip install ai-edge-litert (make extras)"
            ) from None
        try:
            self._interpreter: Any = runtime.Interpreter(str(weights), num_threads=1)
            self._interpreter.allocate_tensors()
            (input_tensor,), (result,) = self._interpreter.get_input_details(), self._interpreter.get_output_details()
        except (ValueError, RuntimeError) as error:
            reason = (str(error).splitlines() or [""])[0][:120]
            raise BadInput(f"{weights.name} is no TensorFlow Lite network: {reason}", hint=HINT) from None
        shape, classes = tuple(input_tensor["shape"]), tuple(result["shape"])
        pictures = len(shape) == 4 and shape[0] == 1 and shape[3] == 3 and input_tensor["dtype"] == np.uint8
        if not pictures or len(classes) != 3 or classes[0] != 1 or result["dtype"] not in (np.int64, np.int32):
            raise BadInput(f"{weights.name} does not take pictures (uint8) and give out classes", hint=HINT)
        self._input_index, self._output_index = input_tensor["index"], result["index"]
        self._size = (int(shape[2]), int(shape[1]))

    def classify(self, color: np.ndarray) -> np.ndarray:
        """Return the class (H, W) uint8 of every pixel, an index into VOC_NAMES, of an image (H, W, 3) uint8 RGB.

        Raises BadInput when the network gives out classes beyond VOC's.
        """
        height, width = color.shape[:2]
        small = cv2.resize(
            color, self._size, interpolation=cv2.INTER_AREA if width > self._size[0] else cv2.INTER_LINEAR
        )
        self._interpreter.set_tensor(self._input_index, small[None])
        self._interpreter.invoke()
        classes = np.asarray(self._interpreter.get_tensor(self._output_index))[0]
        if classes.min() < 0 or classes.max() >= len(VOC_NAMES):
            raise BadInput("the semantic network gives out classes beyond PASCAL VOC's 21", hint=HINT)
        return cv2.resize(classes.astype(np.uint8), (width, height), interpolation=cv2.INTER_NEAREST)
