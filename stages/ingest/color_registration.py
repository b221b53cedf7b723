"""Colour resampled into the depth camera, for logs whose two cameras are not registered."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import cv2
import numpy as np
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.ingest.source import LoadedFrame, Unusable
from scenewright.stages.kit.compiled import compiled
from scenewright.stages.kit.formats.foxglove import decode_color, millimetres_to_depth
from scenewright.stages.kit.geometry.cameras import back_project


def registered_loader(
    load: Callable[[], LoadedFrame],
    depth_camera: Camera,
    color_camera: Camera,
    color_from_depth: np.ndarray,
    *,
    keep: bool = False,
) -> Callable[[], LoadedFrame]:
    """Return a function that loads a frame as `load` does, with its colour resampled into the depth camera; `keep`s the
    colour as it is as the frame's picture."""

    def registered() -> LoadedFrame:
        frame = load()
        if frame.color is None or frame.depth is None:
            return frame
        color = decode_color(frame.color) if isinstance(frame.color, bytes) else frame.color
        if color is None:
            raise Unusable("undecodable_color")
        depth = millimetres_to_depth(frame.depth)
        registered_color = color_in_depth_camera(color, depth, depth_camera, color_camera, color_from_depth)
        return replace(frame, color=registered_color, picture=frame.color if keep else None)

    return registered


def color_in_depth_camera(
    color: np.ndarray, depth: np.ndarray, depth_camera: Camera, color_camera: Camera, color_from_depth: np.ndarray
) -> np.ndarray:
    """Return the colour (H, W, 3) uint8 that the depth pixels (H, W) [m, 0 invalid] see.

    Every depth pixel is carried into the colour camera by `color_from_depth` (4, 4) and looked up there
    (bilinearly); pixels without depth are carried with the depth of the nearest pixel that has one, so that the
    picture has no holes. Depth, its camera and the poses stay as they are. A surface that the colour camera cannot
    see behind a nearer one gets the nearer one's colour: a seam of a few pixels.
    """
    depth = filled_depth(depth)
    # Depth quantisation must not fray the edges of the picture.
    depth = cv2.medianBlur(depth, 5)
    motion = color_from_depth.astype(np.float32)
    points = back_project(depth, depth_camera) @ motion[:3, :3].T + motion[:3, 3]
    z = np.maximum(points[..., 2], np.float32(1e-3))
    u = np.float32(color_camera.fx) * points[..., 0] / z + np.float32(color_camera.cx)
    v = np.float32(color_camera.fy) * points[..., 1] / z + np.float32(color_camera.cy)
    return cv2.remap(color, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)


def filled_depth(depth: np.ndarray) -> np.ndarray:
    """Return depth (H, W) float32 [m] in which every invalid pixel has the depth of the nearest valid one (1 m when
    there is none)."""
    valid = depth > 0
    if not valid.any():
        return np.ones(depth.shape, np.float32)
    hole = (~valid).astype(np.uint8)
    _, nearest = cv2.distanceTransformWithLabels(hole, cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL)
    return _filled(depth, nearest, int(nearest.max()) + 1)


@compiled(nogil=True)
def _filled(depth: np.ndarray, nearest: np.ndarray, labels: int) -> np.ndarray:
    """Return depth (H, W) with that of the valid pixel of the same label in `nearest` (H, W) where it is invalid."""
    values = np.zeros(labels, np.float32)
    height, width = depth.shape
    for row in range(height):
        for column in range(width):
            if depth[row, column] > 0:
                values[nearest[row, column]] = depth[row, column]
    filled = depth.copy()
    for row in range(height):
        for column in range(width):
            if not depth[row, column] > 0:
                filled[row, column] = values[nearest[row, column]]
    return filled
