"""Loading the images of one frame of a folder: colour, depth, a right eye, each only where the log has it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.ingest.folders.files import file_bytes, raw_depth
from scenewright.stages.ingest.folders.undistortion import RecordedCamera, undistorted
from scenewright.stages.ingest.images import (
    DepthForm,
    decode_as_calibrated,
    depth_millimetres,
    fitted_color,
    usable_color,
)
from scenewright.stages.ingest.source import FrameFiles, LoadedFrame, Unusable


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


def frame_loader(files: FrameFiles, form: FrameFormat) -> Callable[[], LoadedFrame]:
    """Return a function that reads and checks a frame's images, without distortion; it raises Unusable."""

    def load() -> LoadedFrame:
        color = loaded_color(files.color, form.recorded, form.camera, "color") if form.has_color else None
        depth = None
        if form.has_depth:
            if files.depth is None:
                raise Unusable("missing_depth")
            raw = raw_depth(files.depth)
            if raw.shape == (form.camera.height, form.camera.width):
                raw = undistorted(raw, form.recorded, form.camera, smooth=False)
            depth = depth_millimetres(raw, form.camera, form.depth)
        return LoadedFrame(color, depth)

    return load


def loaded_color(path: Path | None, recorded: RecordedCamera, camera: Camera, stream: str) -> np.ndarray | bytes:
    """Return the colour in a file as `camera` sees it: the file's own bytes where they can be kept, else (H, W, 3)
    uint8 RGB. Raises Unusable, with reasons that name the `stream`."""
    if path is None:
        raise Unusable(f"missing_{stream}")
    data = file_bytes(path, stream)
    if recorded.lens.is_pinhole and recorded.camera == camera:
        return usable_color(data, camera)
    image = decode_as_calibrated(data, (recorded.camera.width, recorded.camera.height))
    if image is None:
        raise Unusable(f"undecodable_{stream}", f"{path.name}: {len(data)} bytes")
    return undistorted(fitted_color(image, recorded.camera), recorded, camera, smooth=True)
