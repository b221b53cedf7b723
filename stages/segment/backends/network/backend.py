"""The backend: frame in, masks out, on the processor and with nothing else installed."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from scenewright.schemas.errors import UsageError
from scenewright.schemas.scene_parts import Camera
from scenewright.schemas.sequence import SequenceFile
from scenewright.schemas.vocabulary import UNNAMED, Vocabulary, load_vocabulary
from scenewright.stages.kit.formats.frames import Frame, FrameReader
from scenewright.stages.segment.backends.network.features import (
    STRIDE,
    Mount,
    features,
    input_camera,
    mount_of_pose,
    resized,
)
from scenewright.stages.segment.backends.network.grouping import GroupingSettings, Named, group, raise_to_depth
from scenewright.stages.segment.backends.network.model import fold_normalization
from scenewright.stages.segment.backends.network.weights import BUNDLED, Checkpoint, load_checkpoint
from scenewright.stages.segment.choice import BackendRequest
from scenewright.stages.segment.geometric import GeometricFrame
from scenewright.stages.segment.panoptic import PanopticFrame

LEAST_CONTRAST = 4.0
"""Standard deviation of the brightest channel (0..255) under which a picture shows nothing."""


@dataclass(frozen=True)
class Predictor:
    """A checkpoint with what it takes to use it on images."""

    checkpoint: Checkpoint
    classes: tuple[Named, ...]
    settings: GroupingSettings
    unnamed: int | None
    """Index of class `object`, which things get that are not recognised."""

    def predict(self, depth: np.ndarray, color: np.ndarray | None, camera: Camera, mount: Mount) -> PanopticFrame:
        """Return the masks of an image at its own size.

        `depth` (H, W) z-depth [m], 0 invalid; `color` (H, W, 3) uint8 RGB or None.
        """
        small = input_camera(camera)
        small_depth, small_color = resized(depth, color, small)
        inputs = torch.from_numpy(features(small_depth, small_color, small, mount))[None]
        with _one_thread(), torch.inference_mode():
            logits, heat, offsets = self.checkpoint.network(inputs.to(memory_format=torch.channels_last))
        coarse = group(
            logits[0].contiguous().numpy(),
            heat[0, 0].numpy(),
            offsets[0].contiguous().numpy(),
            self.classes,
            self.settings,
            self.unnamed,
        )
        named_at = np.ascontiguousarray(small_depth[::STRIDE, ::STRIDE])
        ids = raise_to_depth(coarse.ids, named_at, depth, camera.width / small.width)
        present = set(np.unique(ids).tolist())
        return PanopticFrame(ids, {number: mask for number, mask in coarse.masks.items() if number in present})


@contextmanager
def _one_thread() -> Iterator[None]:
    """One thread: an image is too small for more to pay, on a busy machine they wait for each other far longer than
    they work, and the masks do not depend on the number of cores."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)


def load_predictor(path: Path, vocabulary: Vocabulary, settings: GroupingSettings | None = None) -> Predictor:
    """Read a checkpoint for use. Raises BadInput as load_checkpoint does."""
    checkpoint = load_checkpoint(path, vocabulary)
    fold_normalization(checkpoint.network)
    entries = [vocabulary.by_name(name) for name in checkpoint.classes]
    classes = tuple(Named(entry.id, entry.kind == "thing") for entry in entries)
    unnamed = checkpoint.classes.index(UNNAMED) if UNNAMED in checkpoint.classes else None
    return Predictor(checkpoint, classes, settings or GroupingSettings(), unnamed)


class NetworkBackend:
    """Masks of our own network; of a bundled one when no weights are given. Colour is used where there is any.

    Without a sequence (frames that a service receives) nothing is known of gravity, and the camera is that of the
    points.
    """

    name = "network"
    says_object_in_doubt = True
    """What `object` means here: see SegmentsFile.recognised."""

    def __init__(
        self,
        vocabulary: Vocabulary,
        weights: Path | None = None,
        *,
        sequence: SequenceFile | None = None,
        reader: FrameReader | None = None,
        settings: GroupingSettings | None = None,
    ) -> None:
        self._reader = reader
        colored = sequence is None or "color" in sequence.streams
        self.streams: tuple[str, ...] = ("color", "depth") if colored else ("depth",)
        method = sequence.gravity.method if sequence is not None else "none"
        self._gravity_known = method != "none"
        self._floor_is_zero = method in ("given", "floor_plane")
        self._predictor = load_predictor(weights or BUNDLED, vocabulary, settings)
        self.label = "own network, trained on generated rooms" if weights is None else f"network {weights.stem}"
        if not colored:
            self.label += ", without colour"

    def _masks(self, frame: Frame, camera: Camera) -> PanopticFrame:
        assert frame.depth is not None
        mount = mount_of_pose(
            frame.world_from_camera, gravity_known=self._gravity_known, floor_is_zero=self._floor_is_zero
        )
        color = frame.color if frame.color is not None and shows_something(frame.color) else None
        return self._predictor.predict(frame.depth, color, camera, mount)

    def __call__(self, frame: Frame, geometric: GeometricFrame, random: np.random.Generator) -> PanopticFrame:
        """Return the masks of a frame; one without depth has none, as no geometric segment could take them."""
        camera = (
            self._reader.cameras[frame.camera_name] if self._reader is not None else camera_of_points(geometric.points)
        )
        if frame.depth is None or camera is None:
            return PanopticFrame(np.zeros(geometric.labels.shape, dtype=np.int32))
        return self._masks(frame, camera)


def shows_something(color: np.ndarray) -> bool:
    """Whether a picture (H, W, 3) uint8 is more than night, a lens cap or glare: the network was taught what to do
    without colour, and not what a black picture says."""
    return bool(color[::4, ::4].max(axis=2).std() > LEAST_CONTRAST)


def camera_of_points(points: np.ndarray) -> Camera | None:
    """Return the pinhole camera in which points (H, W, 3) [m] lie behind their pixels, None when there are too few.

    Least squares of u = fx x / z + cx, and the same for v, over the pixels that have a point.
    """
    v, u = np.nonzero(points[..., 2] > 0)
    if len(u) < 16 or np.ptp(u) < 2 or np.ptp(v) < 2:
        return None
    visible = points[v, u].astype(np.float64)
    fx, cx = np.polyfit(visible[:, 0] / visible[:, 2], u, 1)
    fy, cy = np.polyfit(visible[:, 1] / visible[:, 2], v, 1)
    height, width = points.shape[:2]
    return Camera(width=width, height=height, fx=float(fx), fy=float(fy), cx=float(cx), cy=float(cy))


def open_backend(request: BackendRequest) -> NetworkBackend:
    """Return the backend that the request asks for. Raises UsageError for weights of another kind, BadInput."""
    if request.weights is not None and request.weights.suffix != ".safetensors":
        raise UsageError(
            f"{request.weights.name} is not a checkpoint of the network of our own (a .safetensors file)",
            hint="say whose weights they are with --backend detector, onnx or huggingface",
        )
    sequence = request.sequence.info if request.sequence is not None else None
    return NetworkBackend(load_vocabulary(), request.weights, sequence=sequence, reader=request.reader)
