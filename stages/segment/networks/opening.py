"""A network by the ending of its file."""

from __future__ import annotations

from pathlib import Path
from typing import Protocol

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.segment.networks.fitting import Fitted
from scenewright.stages.segment.networks.onnx_network import OnnxNetwork
from scenewright.stages.segment.networks.sidecar import Sidecar
from scenewright.stages.segment.networks.tflite_network import TfliteNetwork


class Network(Protocol):
    """A loaded network of a known layout."""

    path: Path
    sidecar: Sidecar
    is_guessed: bool
    """Whether nobody said what goes in and what comes out."""
    shapes: dict[str, tuple[int, ...]]
    """Role -> shape of what it gives for one image."""
    classes: int | None
    """Number of classes where their numbers come out and the file tells of how many."""

    @property
    def size(self) -> tuple[int, int] | None:
        """Width and height that it takes [pixels]; None: any."""
        ...

    def names(self) -> dict[int, str]:
        """Return the names of its classes that the file holds, else nothing."""
        ...

    def fit(self, color: np.ndarray) -> Fitted:
        """Return an image (H, W, 3) uint8 RGB as the network takes it."""
        ...

    def __call__(self, fitted: Fitted) -> dict[str, np.ndarray]:
        """Return what the network makes of an image, by role. Raises BadInput when it fails."""
        ...


def open_network(path: Path, sidecar: Sidecar | None = None, device: str = "cpu") -> Network:
    """Return the network of an .onnx or a .tflite file.

    Raises MissingDependency without what runs it, BadInput when it is of another kind or damaged.
    """
    path = Path(path)
    if path.suffix == ".tflite":
        return TfliteNetwork(path, sidecar)
    if path.suffix == ".onnx":
        return OnnxNetwork(path, sidecar, device)
    raise BadInput(f"{path.name}: a network is an .onnx or a .tflite file", hint="export it as one of the two")
