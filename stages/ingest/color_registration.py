"""Colour resampled into the depth camera, for logs whose two cameras are not registered."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
from scipy.ndimage import distance_transform_edt

from schemas.scene_parts import Camera
from stages.ingest.source import LoadedFrame, Unusable
from stages.kit.formats.foxglove import decode_color, millimetres_to_depth
from stages.kit.geometry.cameras import back_project


def registered_loader(
    load: Callable[[], LoadedFrame], depth_camera: Camera, color_camera: Camera, color_from_depth: np.ndarray
) -> Callable[[], LoadedFrame]:
    """Return a function that loads a frame as `load` does, with its colour resampled into the depth camera."""

    def registered() -> LoadedFrame:
        frame = load()
        color = decode_color(frame.color) if isinstance(frame.color, bytes) else frame.color
        if color is None:
            raise Unusable("undecodable_color")
        depth = millimetres_to_depth(frame.depth)
        seen = color_in_depth_camera(color, depth, depth_camera, color_camera, color_from_depth)
        return LoadedFrame(color=seen, depth=frame.depth, labels=frame.labels)

    return registered


def color_in_depth_camera(
    color: np.ndarray,
    depth: np.ndarray,
    depth_camera: Camera,
    color_camera: Camera,
    color_from_depth: np.ndarray,
) -> np.ndarray:
    """Return the colour (H, W, 3) uint8 that the depth pixels (H, W) [m, 0 invalid] see.

    Every depth pixel is carried into the colour camera by `color_from_depth` (4, 4) and looked up there
    (bilinearly); pixels without depth are carried with the depth of the nearest pixel that has one, so that the
    picture has no holes. Depth, its camera and the poses stay as they are. A surface that the colour camera cannot
    see behind a nearer one gets the nearer one's colour: a seam of a few pixels.
    """
    if depth.any():
        nearest = distance_transform_edt(depth <= 0, return_distances=False, return_indices=True)
        depth = depth[tuple(nearest)]
    else:
        depth = np.ones_like(depth)
    # Depth quantisation must not fray the edges of the picture.
    depth = cv2.medianBlur(depth.astype(np.float32), 5)
    points = back_project(depth, depth_camera) @ color_from_depth[:3, :3].T + color_from_depth[:3, 3]
    z = np.maximum(points[..., 2], 1e-3)
    u = (color_camera.fx * points[..., 0] / z + color_camera.cx).astype(np.float32)
    v = (color_camera.fy * points[..., 1] / z + color_camera.cy).astype(np.float32)
    return cv2.remap(color, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
