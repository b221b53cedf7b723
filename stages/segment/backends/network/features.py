"""What the network sees: colour where there is any, and what depth says in terms that hold for every sensor and mount.

Inverse depth and pixels per metre tell how large things are whatever the lens; normals and heights are taken along
gravity when the poses know it (along the camera's own axes otherwise, with a flag). The direction of a pixel's ray
tells where in the image it is, which convolutions do not know but the way to a centre depends on. A channel of zeros
with its flag at zero stands for what is not known, so that one network serves logs with and without colour, gravity and
floor.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.kit.geometry.cameras import back_project
from scenewright.stages.segment.geometric import smooth_depth
from scenewright.stages.segment.normals import surface_normals

INPUT_WIDTH = 320
"""Images are brought to this width [pixels]."""
STRIDE = 2
"""Input pixels per output pixel of the network: its output (i, j) speaks of the input pixel (2 i, 2 j)."""
CHANNELS = (
    "red",
    "green",
    "blue",
    "has_color",
    "inverse_depth",
    "has_depth",
    "pixels_per_metre",
    "normal_right",
    "normal_up",
    "normal_forward",
    "has_gravity",
    "height_over_camera",
    "height_over_floor",
    "has_floor",
    "ray_right",
    "ray_down",
)
"""Names of the network's input channels, in order."""
SMOOTHING_WINDOW, NORMAL_WINDOW, NORMAL_STEP = 5, 7, 2
"""Edges of the windows that smooth depth and fit normals, and the step within the latter [px]; by eye."""
LARGEST_INVERSE_DEPTH, LARGEST_HEIGHT = 4.0, 3.0
"""Bounds at which inverse depth [1/m] and height [m] are cut."""


@dataclass(frozen=True)
class Mount:
    """What is known of how the camera hangs."""

    up: np.ndarray | None = None
    """(3,) unit vector against gravity in the camera frame; None when gravity is not known."""
    height: float | None = None
    """Of the camera over the floor [m]; None when the floor is not known. Needs `up`."""


def mount_of_pose(world_from_camera: np.ndarray | None, *, gravity_known: bool, floor_is_zero: bool) -> Mount:
    """Return what a pose (4, 4) in a world with z up says of the mount."""
    if world_from_camera is None or not gravity_known:
        return Mount()
    return Mount(world_from_camera[2, :3].copy(), float(world_from_camera[2, 3]) if floor_is_zero else None)


def input_camera(camera: Camera) -> Camera:
    """Return the camera of the image brought to INPUT_WIDTH pixels (pixel centres at integer coordinates)."""
    width, height = INPUT_WIDTH, max(32, round(camera.height * INPUT_WIDTH / camera.width))
    across, down = width / camera.width, height / camera.height
    return Camera(
        width=width,
        height=height,
        fx=camera.fx * across,
        fy=camera.fy * down,
        cx=(camera.cx + 0.5) * across - 0.5,
        cy=(camera.cy + 0.5) * down - 0.5,
    )


def resized(depth: np.ndarray, color: np.ndarray | None, camera: Camera) -> tuple[np.ndarray, np.ndarray | None]:
    """Return depth (h, w) and colour (h, w, 3) at the size of `camera`: depth by nearest pixel, as a mean across an
    edge lies on neither side, colour by area."""
    size = (camera.width, camera.height)
    if depth.shape != (camera.height, camera.width):
        depth = cv2.resize(depth, size, interpolation=cv2.INTER_NEAREST_EXACT)
    if color is not None and color.shape[:2] != (camera.height, camera.width):
        color = cv2.resize(color, size, interpolation=cv2.INTER_AREA)
    return depth, color


def features(depth: np.ndarray, color: np.ndarray | None, camera: Camera, mount: Mount) -> np.ndarray:
    """Return the network's input (16, h, w) float32, channels as in CHANNELS.

    `depth` (h, w) z-depth [m], 0 invalid; `color` (h, w, 3) uint8 RGB or None; both of `camera`, which should be
    INPUT_WIDTH wide.
    """
    depth = smooth_depth(depth.astype(np.float32), window=SMOOTHING_WINDOW)
    points = back_project(depth, camera)
    normals = surface_normals(points, window=NORMAL_WINDOW, step=NORMAL_STEP)
    valid = depth > 0
    inverse = np.where(valid, 1.0 / np.maximum(depth, 1e-3), 0.0)
    inverse = np.minimum(inverse, LARGEST_INVERSE_DEPTH)
    axes = viewing_axes(mount.up)
    result = np.zeros((len(CHANNELS), *depth.shape), dtype=np.float32)
    if color is not None:
        result[0:3] = color.transpose(2, 0, 1) * np.float32(1 / 127.5) - np.float32(1)
        result[3] = 1
    result[4] = inverse - 0.5 * valid
    result[5] = valid
    result[6] = inverse * np.float32(camera.fx / 260.0)
    result[7:10] = np.tensordot(axes, normals, axes=([1], [2]))
    height = points @ axes[1]
    result[11] = np.clip(height, -LARGEST_HEIGHT, LARGEST_HEIGHT) * valid
    if mount.up is not None:
        result[10] = 1
        if mount.height is not None:
            result[12] = np.clip(height + np.float32(mount.height), -LARGEST_HEIGHT, LARGEST_HEIGHT) * valid
            result[13] = 1
    result[14] = (np.arange(camera.width) - camera.cx)[None, :] / camera.fx
    result[15] = (np.arange(camera.height) - camera.cy)[:, None] / camera.fy
    return result


def viewing_axes(up: np.ndarray | None) -> np.ndarray:
    """Return (3, 3) float32 with the rows right, up and forward in the camera frame: right is the camera's x made
    level. Without gravity they are the camera's own axes."""
    if up is None:
        return np.array([[1, 0, 0], [0, -1, 0], [0, 0, 1]], dtype=np.float32)
    up = np.asarray(up, dtype=np.float64) / np.linalg.norm(up)
    # A camera on its side has a vertical x; its y is level then.
    across = np.array([1.0, 0.0, 0.0]) if abs(up[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    right = across - (across @ up) * up
    right /= np.linalg.norm(right)
    return np.stack([right, up, np.cross(up, right)]).astype(np.float32)
