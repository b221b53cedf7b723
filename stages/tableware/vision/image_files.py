"""Images of a table from files: a colour image with a depth image and a camera, or a folder with the three.

color.png | color.jpg | rgb.png     8 bits, three channels
depth.png                           16 bits, times `depth_scale` metres
depth.npy | depth.npz               metres times 1 / `depth_scale` (depth.npz: its array `depth`)
camera.json | scene.json            {"camera": {width, height, fx, fy, cx, cy}, "world_from_camera": 4 x 4 or absent,
                                     "workspace": [x, y] or absent, "depth_scale": metres a unit, or absent}
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from pydantic import ValidationError
from scenewright.schemas.base import Model, Transform
from scenewright.schemas.errors import BadInput, first_problem
from scenewright.schemas.outside import file_json
from scenewright.schemas.scene_parts import Camera
from scenewright.schemas.tableware_dishes import TablewareDishes
from scenewright.stages.kit.formats.numpy_files import read_array, read_arrays

COLORS = ("color.png", "color.jpg", "rgb.png", "rgb.jpg")
DEPTHS = ("depth.npz", "depth.npy", "depth.png")
CAMERAS = ("camera.json", "scene.json")
LARGEST_JSON, LARGEST_PIXELS = 5_000_000, 40_000_000
"""Largest file of a camera [bytes] and largest picture [px]; by eye."""
MILLIMETRE = 0.001
"""Scale of a 16-bit image where none is given."""


class CameraFile(Model):
    """camera.json."""

    camera: Camera
    world_from_camera: Transform | None = None
    """The world's origin is the middle of the workspace, z up; without it the table is found in the depth."""
    workspace: tuple[float, float] | None = None
    """Sides along x and y [m]."""
    depth_scale: float | None = None
    """Metres a unit of the depth file."""
    dishes: TablewareDishes | None = None
    """Of a scene."""


@dataclass(frozen=True)
class TableImage:
    """What was read: colour (H, W, 3) uint8, depth (H, W) float32 [m] or None, camera or None."""

    color: np.ndarray
    depth: np.ndarray | None
    camera: CameraFile | None
    scene: bool = False
    """Whether it is of `tableware scene`, whose sizes are known."""
    dishes: TablewareDishes | None = None
    """The user's sizes and gripper, where a scene has them."""


def read_image(
    image: Path, depth: Path | None = None, camera: Path | None = None, depth_scale: float | None = None
) -> TableImage:
    """Read an image of a table. `image` is a file, or a folder that holds all; `depth_scale` [m a unit] goes before
    what the camera's file says. Raises BadInput in one line for what cannot be read."""
    if image.is_dir():
        folder = image
        image = _one_of(folder, COLORS) or _refuse(f"{folder}: no colour image", f"one of {', '.join(COLORS)}")
        depth = depth or _one_of(folder, DEPTHS)
        camera = camera or _one_of(folder, CAMERAS)
    intrinsics = None if camera is None else read_camera(camera)
    color = _picture(image, cv2.IMREAD_COLOR)
    if depth is None:
        return TableImage(cv2.cvtColor(color, cv2.COLOR_BGR2RGB), None, intrinsics)
    scale = depth_scale if depth_scale is not None else None if intrinsics is None else intrinsics.depth_scale
    scene = camera is not None and camera.name == "scene.json"
    dishes = None if intrinsics is None else intrinsics.dishes
    return TableImage(cv2.cvtColor(color, cv2.COLOR_BGR2RGB), _depth(depth, scale), intrinsics, scene, dishes)


def read_camera(path: Path) -> CameraFile:
    """Return the camera of a camera.json, or of a scene.json that says more. Raises BadInput."""
    hint = 'it needs {"camera": {"width", "height", "fx", "fy", "cx", "cy"}}; docs/TIDY.md has an example'
    document = file_json(path, LARGEST_JSON, hint=hint)
    if not isinstance(document, dict):
        raise BadInput(f"{path}: no JSON object", hint=hint)
    try:
        return CameraFile.model_validate({key: document[key] for key in CameraFile.model_fields if key in document})
    except ValidationError as error:
        raise BadInput(f"{path}: {first_problem(error)}", hint=hint) from None


def _one_of(folder: Path, names: tuple[str, ...]) -> Path | None:
    return next((folder / name for name in names if (folder / name).is_file()), None)


def _refuse(message: str, hint: str) -> Path:
    raise BadInput(message, hint=hint)


def _picture(path: Path, flags: int) -> np.ndarray:
    if not path.is_file():
        raise BadInput(f"{path}: no such file", hint="give an image file")
    picture = cv2.imread(str(path), flags)
    if picture is None:
        raise BadInput(f"{path}: no image that can be read", hint="give a PNG or JPEG file")
    if picture.shape[0] * picture.shape[1] > LARGEST_PIXELS:
        raise BadInput(f"{path}: more than {LARGEST_PIXELS} pixels", hint="scale it down")
    return np.asarray(picture)


def _depth(path: Path, scale: float | None) -> np.ndarray:
    """Return depth (H, W) float32 [m]. 16-bit images are millimetres unless told otherwise, arrays metres."""
    if path.suffix.lower() in (".npy", ".npz"):
        hint = "save an array of (H, W) metres, in an .npz as `depth`"
        array = read_arrays(path, "depth", hint=hint)[0] if path.suffix.lower() == ".npz" else read_array(path, hint)
        if not np.issubdtype(array.dtype, np.number) or np.iscomplexobj(array) or array.ndim != 2:
            raise BadInput(f"{path}: the depth is {array.shape} {array.dtype}", hint="save an array of (H, W) metres")
        usual = MILLIMETRE if np.issubdtype(array.dtype, np.integer) else 1.0
    else:
        array = _picture(path, cv2.IMREAD_UNCHANGED)
        if array.ndim != 2 or array.dtype != np.uint16:
            raise BadInput(
                f"{path}: the depth image is {array.shape} {array.dtype}, not 16 bits in one channel",
                hint="8-bit images of depth hold no distances",
            )
        usual = MILLIMETRE
    return np.asarray(array, dtype=np.float32) * np.float32(usual if scale is None else scale)
