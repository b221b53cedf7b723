"""Loading the images of one frame of a folder: colour, depth, a right eye, each only where the log has it.

Where pictures are larger than depth, frames are those of the depth, and the picture is kept at its full size beside.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.ingest.confidence_levels import deviation_of_levels
from scenewright.stages.ingest.folders.files import color_image_size, file_bytes, raw_depth, resized_camera
from scenewright.stages.ingest.folders.undistortion import RecordedCamera, undistorted
from scenewright.stages.ingest.images import (
    DepthForm,
    decode_as_calibrated,
    depth_millimetres,
    fitted_color,
    is_kept,
    same_shape,
    usable_color,
)
from scenewright.stages.ingest.source import FrameFiles, LoadedFrame, Unusable
from scenewright.stages.kit.formats.foxglove import millimetres_to_depth

Size = tuple[int, int]
"""(width, height) [px]"""


@dataclass(frozen=True)
class FrameFormat:
    """How the files of all frames of a camera become its frames."""

    recorded: RecordedCamera
    """The camera that took them, at the size of the frames."""
    camera: Camera
    """What frames are wanted in; of the same size."""
    has_color: bool
    """Whether the log has colour at all: then a frame without it is unusable."""
    has_depth: bool
    depth: DepthForm = DepthForm()
    picture_size: Size | None = None
    """Of pictures that are larger than the frames, which are kept beside them."""


@dataclass(frozen=True)
class FrameReads:
    """What reads the images of one frame; each raises Unusable. None is an image that is missing, or a log without."""

    color: Callable[[], bytes | np.ndarray] | None = None
    """The bytes of a file, or (H, W, 3) uint8 RGB."""
    depth: Callable[[], np.ndarray] | None = None
    """(H, W) uint16 or float, in the log's unit."""
    levels: Callable[[], np.ndarray] | None = None
    """(H, W) uint8 confidence of depth: 0 low, 1 medium, 2 high."""


def larger(pictures: Size | None, frames: Size | None) -> Size | None:
    """Return the size of pictures where they are larger than the frames and of their shape, else None."""
    if pictures is None or frames is None or not same_shape(pictures, frames):
        return None
    return pictures if pictures[0] > frames[0] and pictures[1] > frames[1] else None


def kept_pictures(colors: Iterable[Path | None], camera: Camera) -> Size | None:
    """Return the size of the pictures of a camera where they are larger than its frames and of their shape, else
    None."""
    size = color_image_size((path for path in colors if path is not None), (camera.width, camera.height))
    return larger(size, (camera.width, camera.height))


def picture_camera(camera: Camera, size: Size | None) -> Camera | None:
    """Return the camera of frames at the size of their larger pictures, None where these are none. Raises BadInput for
    another shape."""
    return None if size is None else resized_camera(camera, size, "images")


def frame_loader(files: FrameFiles, form: FrameFormat) -> Callable[[], LoadedFrame]:
    """Return a function that reads and checks a frame's images, without distortion; it raises Unusable."""
    color, depth = files.color, files.depth
    reads = FrameReads(
        color=None if color is None else lambda: file_bytes(color, "color"),
        depth=None if depth is None else lambda: raw_depth(depth),
    )
    return loader_of(reads, form)


def loader_of(reads: FrameReads, form: FrameFormat) -> Callable[[], LoadedFrame]:
    """Return a function that reads and checks a frame's images, without distortion; it raises Unusable."""

    def load() -> LoadedFrame:
        color: np.ndarray | bytes | None = None
        picture: np.ndarray | bytes | None = None
        if form.has_color:
            if reads.color is None:
                raise Unusable("missing_color")
            color, picture = _color_and_picture(reads.color(), form)
        depth = deviation = None
        if form.has_depth:
            if reads.depth is None:
                raise Unusable("missing_depth")
            depth = depth_millimetres(_as_seen(reads.depth(), form), form.camera, form.depth)
            if reads.levels is not None:
                deviation = _deviation(_as_seen(reads.levels(), form), depth)
        return LoadedFrame(color, depth, deviation=deviation, picture=picture)

    return load


def _color_and_picture(
    data: bytes | np.ndarray, form: FrameFormat
) -> tuple[np.ndarray | bytes, np.ndarray | bytes | None]:
    """Return colour at the size of the frames, and the picture where it is kept, decoded once."""
    if form.picture_size is None:
        return _color(data, form.recorded, form.camera, "color"), None
    full = picture_camera(form.camera, form.picture_size)
    assert full is not None
    recorded = form.recorded.at(form.picture_size, "images")
    image = _decoded(data, recorded, "color")
    if isinstance(data, bytes) and recorded.lens.is_pinhole and recorded.camera == full and is_kept(data, image, full):
        return fitted_color(image, form.camera), data
    image = undistorted(fitted_color(image, recorded.camera), recorded, full, smooth=True)
    return fitted_color(image, form.camera), image


def _color(
    data: bytes | np.ndarray, recorded: RecordedCamera, camera: Camera, stream: str, name: str = ""
) -> np.ndarray | bytes:
    if isinstance(data, bytes) and recorded.lens.is_pinhole and recorded.camera == camera:
        return usable_color(data, camera)
    image = fitted_color(_decoded(data, recorded, stream, name), recorded.camera)
    return undistorted(image, recorded, camera, smooth=True)


def _decoded(data: bytes | np.ndarray, recorded: RecordedCamera, stream: str, name: str = "") -> np.ndarray:
    if not isinstance(data, bytes):
        return data
    image = decode_as_calibrated(data, (recorded.camera.width, recorded.camera.height))
    if image is None:
        raise Unusable(f"undecodable_{stream}", f"{name}: {len(data)} bytes".removeprefix(": "))
    return image


def _as_seen(image: np.ndarray, form: FrameFormat) -> np.ndarray:
    """Return an image of depth's kind without distortion; one of another size as it is."""
    if image.shape != (form.camera.height, form.camera.width):
        return image
    return undistorted(image, form.recorded, form.camera, smooth=False)


def _deviation(levels: np.ndarray, depth: np.ndarray) -> np.ndarray:
    if levels.shape != depth.shape:
        raise Unusable("size_mismatch", f"confidence of shape {levels.shape}, depth {depth.shape}")
    try:
        return deviation_of_levels(levels, millimetres_to_depth(depth))
    except ValueError as error:
        raise Unusable("undecodable_confidence", str(error)) from None
