"""An ONNX network: images in, arrays by role out."""

from __future__ import annotations

import ast
import importlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from scenewright.schemas.errors import BadInput, MissingDependency
from scenewright.stages.segment.backends.onnx.sidecar import SHAPES, Sidecar, find_layout, misfit, only_boxes

DEFAULT_SIZE = (640, 640)
"""Width and height [pixels] of the trial image when a network takes any size."""
LONGEST_METADATA = 100_000
"""Characters."""
PAD_VALUE = 114
"""Grey with which a picture is padded, as YOLO networks were trained (0..255)."""
STEP = 32
"""Sides of a picture are multiples of this [pixels] for YOLO networks that take any size."""
HINT = "say what goes in and what comes out with --sidecar FILE.toml (docs/SEGMENTATION.md)"
BY_FOLDER = "run it in a script of your own and give its masks with --backend masks (docs/MASKS.md)"
KINDS = {"tensor(float)": np.float32, "tensor(float16)": np.float16}
"""ONNX Runtime's name of what goes in -> its type here."""


@dataclass(frozen=True)
class Fitted:
    """An image as a network takes it, and the way back: input pixel = image pixel x scale."""

    tensor: np.ndarray
    """(1, 3, h, w) or (3, h, w) float32."""
    scale_x: float
    scale_y: float


def fit(color: np.ndarray, sidecar: Sidecar, size: tuple[int, int] | None) -> Fitted:
    """Return an image (H, W, 3) uint8 RGB as the network's input; `size` (width, height), None: the image's own."""
    height, width = color.shape[:2]
    wide, high = size or (width, height)
    scale_x, scale_y = wide / width, high / height
    if sidecar.resize == "letterbox":
        scale_x = scale_y = min(scale_x, scale_y)
    inner = (max(1, round(width * scale_x)), max(1, round(height * scale_y)))
    image = color if inner == (width, height) else cv2.resize(color, inner, interpolation=cv2.INTER_LINEAR)
    if inner != (wide, high):
        padded = np.full((high, wide, 3), PAD_VALUE, dtype=np.uint8)
        padded[: inner[1], : inner[0]] = image
        image = padded
    if sidecar.order == "bgr":
        image = image[..., ::-1]
    values = image.astype(np.float32) * np.float32(sidecar.scale)
    normalised = (values - np.array(sidecar.mean, np.float32)) / np.array(sidecar.deviation, np.float32)
    tensor = np.ascontiguousarray(normalised.transpose(2, 0, 1))
    return Fitted(tensor[None] if sidecar.batch else tensor, inner[0] / width, inner[1] / height)


class Network:
    """A loaded ONNX network. Raises MissingDependency without ONNX Runtime, BadInput when it is none of the known."""

    def __init__(self, path: Path, sidecar: Sidecar | None, device: str) -> None:
        self.path = Path(path)
        runtime = _runtime()
        if not self.path.is_file():
            raise BadInput(f"{path}: no ONNX file", hint="give an .onnx file with --weights")
        providers = ["CPUExecutionProvider"]
        if device == "cuda" and "CUDAExecutionProvider" in runtime.get_available_providers():
            providers.insert(0, "CUDAExecutionProvider")
        options = runtime.SessionOptions()
        options.log_severity_level = 4  # errors reach us as exceptions
        options.add_session_config_entry("session.intra_op.allow_spinning", "0")  # other steps want the cores too
        try:
            self._session = runtime.InferenceSession(str(self.path), options, providers=providers)
        except Exception as error:  # its exceptions have no common base but this
            raise BadInput(f"{self.path.name}: no ONNX network that can be run ({_first_line(error)})") from None
        self._input = self._find_input()
        batch = len(self._input.shape) == 4
        own_size = self._own_size()
        if sidecar and sidecar.size and own_size not in (None, sidecar.size):
            raise BadInput(
                f"{self.path.name}: takes pictures of {own_size}, the sidecar says {sidecar.size}",
                hint="leave `size` out of the sidecar",
            )
        self.size = sidecar.size if sidecar and sidecar.size else own_size
        trial = Sidecar(layout="panoptic", outputs={}, batch=batch)
        shapes = {
            name: array.shape
            for name, array in self._raw(fit(np.zeros((*DEFAULT_SIZE[::-1], 3), np.uint8), trial, self.size)).items()
        }
        layout = sidecar or find_layout(shapes, len(self.names()))
        if layout is None:
            raise self._unknown(shapes)
        missing = [name for name in layout.outputs.values() if name not in shapes]
        if missing:
            raise BadInput(f"{self.path.name}: has no output {missing[0]!r:.60}", hint=f"it has: {', '.join(shapes)}")
        self.sidecar = layout.model_copy(update={"batch": batch})
        self.is_guessed = sidecar is None
        self.shapes = {role: shapes[name] for role, name in layout.outputs.items()}
        wrong = misfit(layout.layout, self.shapes)
        if wrong:
            shapes_text = ", ".join(f"{role} {shape}" for role, shape in self.shapes.items())
            raise BadInput(
                f"{self.path.name}: gives {shapes_text:.200}; {wrong}",
                hint="correct `layout` or `outputs` in the sidecar",
            )

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
        listed = self._metadata("names")
        rows = dict(enumerate(listed)) if isinstance(listed, list | tuple) else listed
        if not isinstance(rows, dict):
            return {}
        return {k: v for k, v in rows.items() if isinstance(k, int) and isinstance(v, str)}

    def _metadata(self, key: str) -> Any:
        """Return a value that the file's metadata writes as Python does; None: there is none, or it is none."""
        text = self._session.get_modelmeta().custom_metadata_map.get(key, "")
        if not text or len(text) > LONGEST_METADATA:
            return None
        try:
            return ast.literal_eval(text)
        except (ValueError, SyntaxError, RecursionError, MemoryError):
            return None

    def _unknown(self, shapes: dict[str, tuple[int, ...]]) -> BadInput:
        """Return the error for outputs of no known layout."""
        shapes_text = ", ".join(f"{name} {shape}" for name, shape in shapes.items())
        if only_boxes(shapes):
            return BadInput(
                f"{self.path.name}: gives boxes without masks ({shapes_text:.200})",
                hint="export a segmentation network instead (yolo export model=yolo11n-seg.pt format=onnx); of "
                "networks that give boxes, --backend detector takes YOLOX",
            )
        if len(shapes) == 1 and all(len(shape) == 4 and shape[1] > 1 for shape in shapes.values()):
            return BadInput(
                f"{self.path.name}: gives a class for each pixel, no instances ({shapes_text:.200})",
                hint="run it in a script of your own, write the argmax as PNGs with a classes.json, and give the "
                "folder with --backend masks (docs/MASKS.md)",
            )
        layouts = "; ".join(f"{name}: {text}" for name, text in SHAPES.items())
        return BadInput(
            f"{self.path.name}: its outputs ({shapes_text:.200}) are of no known layout",
            hint=f"if it is one of these, {HINT}: {layouts}. Else {BY_FOLDER}",
        )

    def _raw(self, fitted: Fitted) -> dict[str, np.ndarray]:
        try:
            tensor = fitted.tensor.astype(KINDS[self._input.type], copy=False)
            values = self._session.run(None, {self._input.name: tensor})
        except Exception as error:  # see above
            height, width = fitted.tensor.shape[-2:]
            raise BadInput(
                f"{self.path.name}: cannot be run on a picture of {width}x{height} ({_first_line(error)})",
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
                f"{self.path.name}: takes {shape[0]} pictures at a time",
                hint="export it for one (yolo export ... batch=1)",
            )
        return inputs[0]

    def _own_size(self) -> tuple[int, int] | None:
        height, width = self._input.shape[-2:]
        if isinstance(width, int) and isinstance(height, int):
            return (width, height)
        told = self._metadata("imgsz")  # what a YOLO export of any size was made for
        if isinstance(told, list | tuple) and len(told) == 2 and all(type(n) is int and 0 < n <= 16384 for n in told):
            return (told[1], told[0])
        return None


def _runtime() -> Any:
    try:
        return importlib.import_module("onnxruntime")
    except ImportError as error:
        raise MissingDependency(f"--backend onnx: {error}", hint="pip install onnxruntime (make extras)") from None


def _first_line(error: Exception) -> str:
    return (str(error).strip().splitlines() or [type(error).__name__])[0][:200]
