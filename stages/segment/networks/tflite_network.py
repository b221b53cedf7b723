"""A TensorFlow Lite network: images in, arrays by role out. Its file is data: nothing of it is executed but its
tensors' operations."""

from __future__ import annotations

import importlib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from scenewright.schemas.errors import BadInput, MissingDependency
from scenewright.stages.segment.networks.fitting import DEFAULT_SIZE, Fitted, fit
from scenewright.stages.segment.networks.metadata import appended, class_names, picture_size
from scenewright.stages.segment.networks.sidecar import (
    BY_FOLDER,
    Sidecar,
    channels_axis,
    find_layout,
    roles_of,
    unknown,
    with_values,
)

TENSORFLOW = {"mean": (0.5, 0.5, 0.5), "deviation": (0.5, 0.5, 0.5)}
"""Semantic networks of TensorFlow that take floats take -1..1 (DeepLab)."""
BYTES = {"scale": 1.0, "mean": (0.0, 0.0, 0.0), "deviation": (1.0, 1.0, 1.0)}
KINDS = (np.float32, np.uint8, np.int8)
"""Types of what goes in."""


class TfliteNetwork:
    """A loaded TensorFlow Lite network.

    Raises MissingDependency without its runtime, BadInput when it is none of the known.
    """

    def __init__(self, path: Path, sidecar: Sidecar | None) -> None:
        self.path = Path(path)
        runtime = _runtime()
        self._interpreter: Any = self._opened(runtime, sidecar)
        self._input = self._interpreter.get_input_details()[0]
        shape = [int(side) for side in self._input["shape"]]
        self._axis = 1 if shape[1] == 3 and shape[3] != 3 else 3
        self.size = (shape[3], shape[2]) if self._axis == 1 else (shape[2], shape[1])
        details = {entry["name"]: entry for entry in self._interpreter.get_output_details()}
        shapes = {name: self._turned_shape(tuple(int(n) for n in entry["shape"])) for name, entry in details.items()}
        whole_numbers = [
            name
            for name, entry in details.items()
            if np.dtype(entry["dtype"]).kind in "iu" and not entry["quantization"][0]
        ]
        layout = sidecar or find_layout(shapes, len(self.names()), whole_numbers)
        if layout is None:
            raise unknown(self.path, shapes)
        if layout.layout == "semantic":
            layout = with_values(layout, **TENSORFLOW)
        self.sidecar = layout
        self.is_guessed = sidecar is None
        self.shapes = roles_of(self.path, layout, shapes)
        self.classes = self._hidden_classes() if layout.layout == "semantic" else None
        self(self.fit(np.zeros((*DEFAULT_SIZE[::-1], 3), np.uint8)))

    def fit(self, color: np.ndarray) -> Fitted:
        """Return an image (H, W, 3) uint8 RGB as the network takes it.

        What takes whole numbers takes bytes as they are, unless a sidecar says what they stand for.
        """
        kind = self._input["dtype"]
        if kind == np.float32:
            return fit(color, self.sidecar, self.size)
        scale, zero = self._input["quantization"]
        told = not self.is_guessed and {"scale", "mean", "deviation"} & self.sidecar.model_fields_set
        if told and scale:
            fitted = fit(color, self.sidecar, self.size)
            numbers = np.round(fitted.tensor / scale) + zero
        else:
            fitted = fit(color, self.sidecar.model_copy(update=BYTES), self.size)
            numbers = fitted.tensor + np.iinfo(kind).min
        return replace(fitted, tensor=np.clip(numbers, np.iinfo(kind).min, np.iinfo(kind).max).astype(kind))

    def __call__(self, fitted: Fitted) -> dict[str, np.ndarray]:
        """Return what the network makes of an image, by role: floats where the file says what its numbers stand for,
        channels first. Raises BadInput when it fails."""
        tensor = fitted.tensor if self._axis == 1 else np.ascontiguousarray(fitted.tensor.transpose(0, 2, 3, 1))
        try:
            self._interpreter.set_tensor(self._input["index"], tensor)
            self._interpreter.invoke()
        except (ValueError, RuntimeError) as error:
            raise BadInput(f"{self.path.name}: cannot be run ({_first_line(error)})", hint=BY_FOLDER) from None
        details = {entry["name"]: entry for entry in self._interpreter.get_output_details()}
        return {role: self._read(details[name]) for role, name in self.sidecar.outputs.items()}

    def names(self) -> dict[int, str]:
        """Return the names of its classes that the file's metadata holds, else nothing."""
        return class_names(appended(self.path).get("names"))

    def _read(self, entry: Any) -> np.ndarray:
        values = np.asarray(self._interpreter.get_tensor(entry["index"]))
        scale, zero = entry["quantization"]
        if scale and values.dtype.kind in "iu":
            values = (values.astype(np.float32) - np.float32(zero)) * np.float32(scale)
        turned = self._turned_shape(values.shape) != values.shape
        return np.ascontiguousarray(values.transpose(0, 3, 1, 2)) if turned else values

    def _turned_shape(self, shape: tuple[int, ...]) -> tuple[int, ...]:
        """Return the shape of an output with its channels first."""
        last = len(shape) == 4 and channels_axis(shape, self.size, self._axis) == 3
        return (shape[0], shape[3], shape[1], shape[2]) if last else shape

    def _hidden_classes(self) -> int | None:
        """Return of how many scores the number of a pixel's class is the largest, where the file tells."""
        shape = self.shapes["classes"]
        if len(shape) != 3:
            return None
        counts = {
            int(entry["shape"][3])
            for entry in self._interpreter.get_tensor_details()
            if entry["index"] != self._input["index"] and len(entry["shape"]) == 4
            if tuple(entry["shape"][:3]) == shape
        }
        return counts.pop() if len(counts) == 1 else None

    def _opened(self, runtime: Any, sidecar: Sidecar | None) -> Any:
        hint = f"give a .tflite file that holds a network. Or {BY_FOLDER}"
        try:
            interpreter = runtime.Interpreter(str(self.path), num_threads=1)
            inputs = interpreter.get_input_details()
            shape = list(inputs[0]["shape"]) if len(inputs) == 1 else []
            is_image = len(shape) == 4 and 3 in (shape[1], shape[3]) and inputs[0]["dtype"] in KINDS
            if is_image and (free := list(inputs[0].get("shape_signature", shape)))[1:].count(-1):
                interpreter.resize_tensor_input(inputs[0]["index"], self._sized(free, sidecar))
            interpreter.allocate_tensors()
        except (ValueError, RuntimeError) as error:
            raise BadInput(
                f"{self.path.name}: no TensorFlow Lite network that can be run ({_first_line(error)})", hint=hint
            ) from None
        taken = ", ".join(f"{entry['name']} {list(entry['shape'])}" for entry in inputs)
        if not is_image:
            raise BadInput(
                f"{self.path.name}: takes {taken or 'nothing':.200}, not one image (1, height, width, 3)",
                hint=f"export it with that input alone. Else {BY_FOLDER}",
            )
        if shape[0] != 1:
            raise BadInput(
                f"{self.path.name}: takes {shape[0]} images at a time",
                hint="export it for one (yolo export ... batch=1)",
            )
        return interpreter

    def _sized(self, free: list[int], sidecar: Sidecar | None) -> list[int]:
        """Return the input's shape with sides in place of those that are free."""
        told = sidecar.size if sidecar else None
        wide, high = told or picture_size(appended(self.path).get("imgsz")) or DEFAULT_SIZE
        return [1, 3, high, wide] if free[1] == 3 else [1, high, wide, 3]


def _runtime() -> Any:
    try:
        return importlib.import_module("ai_edge_litert.interpreter")
    except ImportError:
        raise MissingDependency(
            "a .tflite network needs ai-edge-litert", hint="pip install ai-edge-litert (make extras)"
        ) from None


def _first_line(error: Exception) -> str:
    return (str(error).strip().splitlines() or [type(error).__name__])[0][:120]
