"""TensorFlow Lite networks whose outputs are given: the runtime's interface around arrays."""

from __future__ import annotations

import sys
import zipfile
from collections.abc import Mapping
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from scenewright.stages.segment.networks.sidecar import Sidecar
from scenewright.stages.segment.networks.tflite_network import TfliteNetwork

SIZE = (64, 48)
"""Width and height of the input of most networks here, and of their image."""


def quantised(values: np.ndarray, scale: float, zero: int) -> np.ndarray:
    """The int8 of floats that a file with this scale and zero point holds."""
    return np.clip(np.round(values / scale) + zero, -128, 127).astype(np.int8)


class Interpreter:
    """The runtime's interface with given tensors."""

    def __init__(
        self,
        outputs: Mapping[str, np.ndarray],
        *,
        shape: tuple[int, ...] = (1, SIZE[1], SIZE[0], 3),
        kind: Any = np.uint8,
        quantization: tuple[float, int] = (0.0, 0),
        scales: Mapping[str, tuple[float, int]] | None = None,
        classes: int = 0,
    ) -> None:
        self.outputs, self.scales, self.classes = outputs, scales or {}, classes
        self.input = {"index": 0, "name": "image", "shape": np.array(shape), "dtype": kind}
        self.input |= {"quantization": quantization, "shape_signature": np.array(shape)}
        self.seen: np.ndarray | None = None

    def allocate_tensors(self) -> None: ...
    def invoke(self) -> None: ...

    def resize_tensor_input(self, index: int, shape: list[int]) -> None:
        self.input["shape"] = np.array(shape)

    def get_input_details(self) -> list[dict[str, Any]]:
        return [self.input]

    def get_output_details(self) -> list[dict[str, Any]]:
        return [
            {
                "index": number,
                "name": name,
                "shape": np.array(array.shape),
                "dtype": array.dtype.type,
                "quantization": self.scales.get(name, (0.0, 0)),
            }
            for number, (name, array) in enumerate(self.outputs.items(), start=1)
        ]

    def get_tensor_details(self) -> list[dict[str, Any]]:
        first = next(iter(self.outputs.values())).shape
        hidden = [{"index": 90, "shape": np.array([*first[:3], self.classes])}] if self.classes else []
        return [self.input, *self.get_output_details(), *hidden]

    def set_tensor(self, index: int, tensor: np.ndarray) -> None:
        assert tensor.shape == tuple(self.input["shape"]) and tensor.dtype == self.input["dtype"]
        self.seen = tensor

    def get_tensor(self, index: int) -> np.ndarray:
        return list(self.outputs.values())[index - 1]


def run_by(monkeypatch: pytest.MonkeyPatch, interpreters: Mapping[str, Interpreter] | Interpreter) -> None:
    """Have the runtime give these interpreters: one, or by the stem of the file."""
    module = ModuleType("ai_edge_litert.interpreter")

    def open_it(path: str, num_threads: int) -> Interpreter:
        if isinstance(interpreters, Interpreter):
            return interpreters
        if Path(path).stem not in interpreters:
            raise ValueError("Model provided has model identifier 'xxxx', should be 'TFL3'\nsecond line")
        return interpreters[Path(path).stem]

    vars(module)["Interpreter"] = open_it
    monkeypatch.setitem(sys.modules, "ai_edge_litert", ModuleType("ai_edge_litert"))
    monkeypatch.setitem(sys.modules, "ai_edge_litert.interpreter", module)


def written(path: Path, metadata: Mapping[str, str] | None = None) -> Path:
    """A file with an archive of texts behind it, as exporters append it."""
    path.write_bytes(b"TFL3")
    if metadata:
        with zipfile.ZipFile(path, "a") as archive:
            for name, text in metadata.items():
                archive.writestr(name, text)
    return path


def opened(
    monkeypatch: pytest.MonkeyPatch, outputs: Mapping[str, np.ndarray], sidecar: Sidecar | None = None, **options: Any
) -> TfliteNetwork:
    """A network with given outputs, without a file."""
    run_by(monkeypatch, Interpreter(outputs, **options))
    return TfliteNetwork(Path("net.tflite"), sidecar)


def yolo(*, shares: bool = True, last: bool = True, side: int = 64) -> dict[str, np.ndarray]:
    """Predictions (1, 4 + 80 + 2, 200) and prototypes of an input of `side`: a cup left of the middle, boxed twice, and
    a chair right of it, from a quarter of the height on; the first prototype is the left half, the second the right."""
    rows = np.zeros((1, 86, 200), dtype=np.float32)
    rows[0, :2, 5:] = np.linspace(1, side, 195)  # cells cover the input
    for k, (box, number, score, coefficients) in enumerate(
        (
            ((16, 32, 32, 64), 41, 0.75, (8, -8)),
            ((17, 32, 32, 64), 41, 0.75, (8, -8)),
            ((48, 40, 32, 48), 56, 0.5, (-8, 8)),
            ((32, 32, 64, 64), 0, 0.125, (8, 8)),
        )
    ):
        rows[0, :4, k], rows[0, 4 + number, k], rows[0, -2:, k] = box, score, coefficients
    rows[0, :4] *= (1 / side) if shares else 1
    prototypes = np.full((1, 2, side // 4, side // 4), -1, dtype=np.float32)
    prototypes[0, 0, :, : side // 8] = prototypes[0, 1, :, side // 8 :] = 1
    return {"rows": rows, "prototypes": prototypes.transpose(0, 2, 3, 1).copy() if last else prototypes}
