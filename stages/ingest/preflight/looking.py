"""The frames that are looked at: loaded one at a time, kept small, so that memory does not grow with the log."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.ingest.source import Entry, LoadedFrame, Unusable
from scenewright.stages.kit.formats.foxglove import decode_color

WORKING_WIDTH = 640
"""Pictures are thinned by a whole factor to about this width."""
PICTURE_WIDTH = 480
"""Width of the colour pictures that are kept for the page."""


@dataclass(frozen=True)
class Look:
    """One frame as the checks see it. `camera` is that of `gray`, `depth_camera` that of `depth`, both thinned."""

    index: int
    """Among the selected frames of its camera."""
    time: float
    name: str
    camera: Camera
    depth_camera: Camera
    factor: int
    """Full image over this one."""
    gray: np.ndarray | None
    """(h, w) uint8."""
    right: np.ndarray | None
    """(h, w) uint8, right eye."""
    depth: np.ndarray | None
    """(h, w) uint16 [mm], 0 = invalid."""
    depth_values: np.ndarray | None
    """(K,) uint16 ascending: every value [mm] of the full depth image, without 0."""
    depth_counts: np.ndarray | None
    """(K,) how often each occurs."""
    depth_pixels: int
    """Of the full depth image."""
    picture: np.ndarray | None
    """(h', w', 3) uint8 RGB for the page, when asked for."""


def look_at_entry(entry: Entry, index: int, camera: Camera, keep_picture: bool) -> Look:
    """Load a frame. Raises Unusable when ingest would leave it out."""
    loaded = entry.load()
    width = _width_of(loaded, camera)
    factor = max(1, round(width / WORKING_WIDTH))
    color = _pixels(loaded.color, "undecodable_color")
    right = _pixels(loaded.right, "undecodable_right")
    depth = loaded.depth
    values = counts = None
    if depth is not None:
        values, counts = np.unique(depth[depth > 0], return_counts=True)
    first = (factor - 1) // 2
    return Look(
        index=index,
        time=entry.time,
        name=entry.name,
        camera=_thinned(camera, factor, (factor - 1) / 2),
        depth_camera=_thinned(camera, factor, first),
        factor=factor,
        gray=None if color is None else _small_gray(color, factor),
        right=None if right is None else _small_gray(right, factor),
        depth=None if depth is None else _every(depth, factor, first),
        depth_values=values,
        depth_counts=counts,
        depth_pixels=0 if depth is None else depth.size,
        picture=_small_picture(color) if keep_picture and color is not None else None,
    )


def _width_of(loaded: LoadedFrame, camera: Camera) -> int:
    return loaded.depth.shape[1] if loaded.depth is not None else camera.width


def _pixels(image: np.ndarray | bytes | None, reason: str) -> np.ndarray | None:
    if not isinstance(image, bytes):
        return image
    decoded = decode_color(image)
    if decoded is None:
        raise Unusable(reason, f"{len(image)} bytes")
    return decoded


def _thinned(camera: Camera, factor: int, first: float) -> Camera:
    """Camera of the image whose pixel k is pixel `first + factor k` of the full one."""
    return Camera(
        width=camera.width // factor,
        height=camera.height // factor,
        fx=camera.fx / factor,
        fy=camera.fy / factor,
        cx=(camera.cx - first) / factor,
        cy=(camera.cy - first) / factor,
    )


def _small_gray(color: np.ndarray, factor: int) -> np.ndarray:
    gray = color if color.ndim == 2 else cv2.cvtColor(color, cv2.COLOR_RGB2GRAY)
    height, width = gray.shape[0] // factor, gray.shape[1] // factor
    if factor == 1:
        return np.ascontiguousarray(gray)
    return cv2.resize(gray[: height * factor, : width * factor], (width, height), interpolation=cv2.INTER_AREA)


def _every(image: np.ndarray, factor: int, first: int) -> np.ndarray:
    height, width = image.shape[0] // factor, image.shape[1] // factor
    return np.ascontiguousarray(image[first::factor, first::factor][:height, :width])


def _small_picture(color: np.ndarray) -> np.ndarray:
    height, width = color.shape[:2]
    if width <= PICTURE_WIDTH:
        return color
    size = (PICTURE_WIDTH, max(1, round(height * PICTURE_WIDTH / width)))
    return cv2.resize(color, size, interpolation=cv2.INTER_AREA)
