"""A classifier of crops as one more witness of names, for what no mask names: a .tflite of ImageNet, for example.

It says a label whatever it is shown, and is wrong about furniture; so only small things are asked, it fills no more
than what the masks leave to no name, and half of that.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.schemas.outside import LARGEST_SETTINGS, file_text
from scenewright.stages.kit.class_extents import LARGEST_EXTENT
from scenewright.stages.kit.needed import needed
from scenewright.stages.kit.open_words.reading.names import class_named

LARGEST = 1.0
"""Things with a longer edge are not asked for [m]: furniture, by the network's notes (MobileNetV2 of ImageNet)."""
BELIEVED = 0.5
"""Share of what no mask names that it may fill; by eye."""
LEAST = 0.05
"""Labels less likely than this over a thing's crops are left out."""


class CropClassifier:
    """A network with a score per class. Raises BadInput for another, MissingDependency without its runtime."""

    def __init__(self, path: Path, labels: Path) -> None:
        runtime = needed("ai_edge_litert.interpreter", "a classifier of crops", "models")
        try:
            self._network: Any = runtime.Interpreter(model_path=str(path))
            self._network.allocate_tensors()
        except (ValueError, RuntimeError) as error:
            reason = str(error).splitlines()[0]
            raise BadInput(f"{path}: cannot be opened ({reason:.100})", hint="give a .tflite") from None
        self._input, self._output = self._network.get_input_details()[0], self._network.get_output_details()[0]
        self.labels = labels_of(labels)
        shape, count = [int(n) for n in self._input["shape"]], int(self._output["shape"][-1])
        if len(shape) != 4 or shape[3] != 3 or self._input["dtype"] != np.uint8 or count != len(self.labels):
            raise BadInput(
                f"{path}: takes {shape} and gives {count} scores for {len(self.labels)} labels",
                hint="give a classifier of RGB bytes (1, side, side, 3), and its labels in order",
            )
        self.side = shape[1]

    def scores(self, crops: np.ndarray) -> np.ndarray:
        """Return (N, classes) float32 probabilities of crops (N, side, side, 3) uint8 RGB."""
        rows = [np.zeros((0, len(self.labels)), np.float32)]
        for crop in crops:
            self._network.set_tensor(self._input["index"], crop[None])
            self._network.invoke()
            values = np.asarray(self._network.get_tensor(self._output["index"]), np.float32)
            rows.append(values / np.maximum(values.sum(axis=1, keepdims=True), 1e-9))
        return np.concatenate(rows)


def labels_of(path: Path) -> tuple[str, ...]:
    """Return the names of a classifier's outputs. Raises BadInput for a missing or empty file."""
    text = file_text(path, LARGEST_SETTINGS, hint="a row a class, its name last")
    try:
        rows = [row[-1].strip().replace("_", " ").lower() for row in csv.reader(text.splitlines()) if row]
    except csv.Error as error:
        raise BadInput(f"{path}: no labels ({error})", hint="a row a class, its name last") from None
    if not rows:
        raise BadInput(f"{path}: no labels", hint="a row a class, its name last")
    return tuple(rows)


def with_classifier(
    shares: Mapping[str, float], scores: np.ndarray, labels: tuple[str, ...], extent: float
) -> dict[str, float]:
    """Return posteriors of names with a classifier heard: scores (crops, classes) of one thing, whose longest edge is
    `extent` [m]. A label whose class is never so large is left out."""
    left = 1.0 - sum(shares.values())
    if extent > LARGEST or not len(scores) or left <= 0:
        return dict(shares)
    mean = scores.mean(axis=0)
    heard = dict(shares)
    for k in np.flatnonzero(mean >= LEAST):
        label = labels[k]
        head = class_named(label) or class_named(label.split(" ")[-1])  # a coffee mug is a mug
        if extent <= LARGEST_EXTENT.get(head, np.inf):
            heard[label] = round(heard.get(label, 0.0) + BELIEVED * left * float(mean[k]), 4)
    return heard
