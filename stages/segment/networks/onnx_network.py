"""An ONNX network: images in, arrays by role out."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

import numpy as np
from scenewright.schemas.errors import BadInput, MissingDependency
from scenewright.stages.segment.networks.fitting import DEFAULT_SIZE, STEP, Fitted, fit
from scenewright.stages.segment.networks.metadata import class_names, literal, picture_size
from scenewright.stages.segment.networks.sidecar import (
    BY_FOLDER,
    IMAGENET,
    Sidecar,
    find_layout,
    roles_of,
    unknown,
    with_values,
)

KINDS = {"tensor(float)": np.float32, "tensor(float16)": np.float16}
"""ONNX Runtime's name of what goes in -> its type here."""


class OnnxNetwork:
    """A loaded ONNX network. Raises MissingDependency without ONNX Runtime, BadInput when it is none of the known."""

    def __init__(self, path: Path, sidecar: Sidecar | None, device: str) -> None:
        self.path = Path(path)
        runtime = _runtime()
        providers = ["CPUExecutionProvider"]
        if device == "cuda" and "CUDAExecutionProvider" in runtime.get_available_providers():
            providers.insert(0, "CUDAExecutionProvider")
        options = runtime.SessionOptions()
        options.log_severity_level = 4  # errors reach us as exceptions
        options.add_session_config_entry("session.intra_op.allow_spinning", "0")  # other steps want the cores too
        try:
            self._session = runtime.InferenceSession(str(self.path), options, providers=providers)
        except Exception as error:  # its exceptions have no common base but this
            raise BadInput(
                f"{self.path.name}: no ONNX network that can be run ({_first_line(error)})", hint=BY_FOLDER
            ) from None
        self._input = self._find_input()
        batch = len(self._input.shape) == 4
        own_size = self._own_size()
        if sidecar and sidecar.size and own_size not in (None, sidecar.size):
            raise BadInput(
                f"{self.path.name}: takes images of {own_size}, the sidecar says {sidecar.size}",
                hint="leave `size` out of the sidecar",
            )
        self.size = sidecar.size if sidecar and sidecar.size else own_size
        trial = Sidecar(layout="panoptic", outputs={}, batch=batch)
        outputs = self._raw(fit(np.zeros((*DEFAULT_SIZE[::-1], 3), np.uint8), trial, self.size))
        shapes = {name: array.shape for name, array in outputs.items()}
        whole_numbers = [name for name, array in outputs.items() if array.dtype.kind in "iu"]
        layout = sidecar or find_layout(shapes, len(self.names()), whole_numbers)
        if layout is None:
            raise unknown(self.path, shapes)
        if layout.layout == "semantic":
            layout = with_values(layout, **IMAGENET)
        self.sidecar = layout.model_copy(update={"batch": batch})
        self.is_guessed = sidecar is None
        self.shapes = roles_of(self.path, layout, shapes)
        self.classes: int | None = None

    def fit(self, color: np.ndarray) -> Fitted:
        """Return an image (H, W, 3) uint8 RGB as the network takes it."""
        size = self.size
        if size is None and self.sidecar.resize == "letterbox":
            size = (-(-color.shape[1] // STEP) * STEP, -(-color.shape[0] // STEP) * STEP)
        return fit(color, self.sidecar, size)

    def __call__(self, fitted: Fitted) -> dict[str, np.ndarray]:
        """Return what the network makes of an image, by role. Raises BadInput when it fails."""
        outputs = self._raw(fitted)
        return {role: outputs[name] for role, name in self.sidecar.outputs.items()}

    def names(self) -> dict[int, str]:
        """Return the names of its classes that the file's metadata holds (as YOLO exports write them), else nothing."""
        return class_names(self._metadata("names"))

    def _metadata(self, key: str) -> Any:
        return literal(self._session.get_modelmeta().custom_metadata_map.get(key, ""))

    def _raw(self, fitted: Fitted) -> dict[str, np.ndarray]:
        try:
            tensor = fitted.tensor.astype(KINDS[self._input.type], copy=False)
            values = self._session.run(None, {self._input.name: tensor})
        except Exception as error:  # see above
            height, width = fitted.tensor.shape[-2:]
            raise BadInput(
                f"{self.path.name}: cannot be run on an image of {width}x{height} ({_first_line(error)})",
                hint=f"where it was made for another size, `size` in a sidecar says it. Else {BY_FOLDER}",
            ) from None
        names = [output.name for output in self._session.get_outputs()]
        return {name: np.asarray(value) for name, value in zip(names, values, strict=True)}

    def _find_input(self) -> Any:
        inputs = self._session.get_inputs()
        shape = list(inputs[0].shape) if inputs else []
        channels = shape[-3] if len(shape) in (3, 4) else 0
        is_image = len(inputs) == 1 and inputs[0].type in KINDS and (channels == 3 or not isinstance(channels, int))
        if not is_image:
            taken = ", ".join(f"{entry.name} {entry.type} {entry.shape}" for entry in inputs)
            raise BadInput(
                f"{self.path.name}: takes {taken or 'nothing':.200}, not one image (1, 3, height, width) of floats",
                hint=f"export it with that input alone. Else {BY_FOLDER}",
            )
        if len(shape) == 4 and isinstance(shape[0], int) and shape[0] != 1:
            raise BadInput(
                f"{self.path.name}: takes {shape[0]} images at a time",
                hint="export it for one (yolo export ... batch=1)",
            )
        return inputs[0]

    def _own_size(self) -> tuple[int, int] | None:
        height, width = self._input.shape[-2:]
        if isinstance(width, int) and isinstance(height, int):
            return (width, height)
        return picture_size(self._metadata("imgsz"))  # what a YOLO export of any size was made for


def _runtime() -> Any:
    try:
        return importlib.import_module("onnxruntime")
    except ImportError as error:
        raise MissingDependency(f"--backend onnx: {error}", hint="pip install onnxruntime (make extras)") from None


def _first_line(error: Exception) -> str:
    return (str(error).strip().splitlines() or [type(error).__name__])[0][:200]
