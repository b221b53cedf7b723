"""Recordings whose pictures lie on their side, as a phone that is held upright stores them: turned by quarters."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.ingest.source import LoadedFrame, Unusable
from scenewright.stages.kit.formats.foxglove import decode_color

OLD_FROM_TURNED = np.array([[0.0, 1, 0, 0], [-1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
"""The camera of a picture from that of the picture turned a quarter clockwise: x of the turned one is -y."""
LEAST_UP = 0.2
"""Length of the mean of up along the pictures, of 1, from which it is told where up is in them; by eye."""
WORDS = ("", "a quarter clockwise", "half around", "a quarter counter-clockwise")


def quarters_to_upright(poses: Sequence[np.ndarray], up: np.ndarray) -> int:
    """Return by how many quarters, clockwise, pictures are to be turned so that up in them is up on the whole.

    `poses` (N, 4, 4) are world_from_camera, `up` (3,) is in the world. 0 for cameras that look straight down.
    """
    finite = [pose for pose in poses if np.isfinite(pose).all()]
    if not finite:
        return 0
    x, y, _ = np.mean([up @ pose[:3, :3] for pose in finite], axis=0)
    if np.hypot(x, y) < LEAST_UP:
        return 0
    return int(np.argmax([-y, -x, y, x]))


def turned_camera(camera: Camera, quarters: int) -> Camera:
    """Return the camera of an image turned clockwise."""
    for _ in range(quarters):
        camera = Camera(
            width=camera.height,
            height=camera.width,
            fx=camera.fy,
            fy=camera.fx,
            cx=camera.height - 1 - camera.cy,
            cy=camera.cx,
        )
    return camera


def turned_pose(world_from_camera: np.ndarray | None, quarters: int) -> np.ndarray | None:
    """Return the pose (4, 4) of a camera whose images are turned clockwise."""
    if world_from_camera is None:
        return None
    return world_from_camera @ np.linalg.matrix_power(OLD_FROM_TURNED, quarters)


def turned_loader(load: Callable[[], LoadedFrame], quarters: int) -> Callable[[], LoadedFrame]:
    """Return a function that loads a frame as `load` does, and turns all its images clockwise."""

    def turned() -> LoadedFrame:
        frame = load()
        return replace(
            frame,
            color=_turned_picture(frame.color, quarters),
            depth=_turned(frame.depth, quarters),
            deviation=_turned(frame.deviation, quarters),
            picture=_turned_picture(frame.picture, quarters),
        )

    return turned


def _turned(image: np.ndarray | None, quarters: int) -> np.ndarray | None:
    return None if image is None else np.ascontiguousarray(np.rot90(image, -quarters))


def _turned_picture(picture: np.ndarray | bytes | None, quarters: int) -> np.ndarray | None:
    if not isinstance(picture, bytes):
        return _turned(picture, quarters)
    image = decode_color(picture)
    if image is None:
        raise Unusable("undecodable_color", f"{len(picture)} bytes")
    return _turned(image, quarters)
