"""Colour and depth pictures of a board in files: what is wanted, seen instead of told.

A folder holds color.png (8 bits), depth.png (16 bits, millimetres along the camera's axis, 0 where unknown) and
camera.json: {"camera": {width, height, fx, fy, cx, cy}, "world_from_camera": 4 x 4}, z = 0 the board's top. Pictures of
several cameras lie in folders of their own below one folder.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
import trimesh
from PIL import Image
from scenewright.schemas.base import Model, Transform, as_transform
from scenewright.schemas.errors import BadInput
from scenewright.schemas.outside import LARGEST_SHOWN, file_content
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.cutting.pictures import colored
from scenewright.stages.cutting.sight.views import View
from scenewright.stages.cutting.world.body import Body
from scenewright.stages.kit.formats.image_headers import may_be_decoded
from scenewright.stages.kit.geometry.transforms import is_rigid
from scenewright.stages.kit.rendering.ray_casting import SceneRenderer

HINT = "a folder of color.png, depth.png and camera.json, or of such folders (docs/CUTTING.md)"
MILLIMETRE = 0.001
"""Unit of the depth in files [m]."""
MOST_CAMERAS, MOST_PIXELS, LARGEST_CAMERA = 8, 10_000_000, 100_000
"""Most cameras, most pixels of a picture, and the largest file of a camera [bytes]; by eye."""
WOOD = np.array([196, 164, 124, 255], np.uint8)
"""Colour (RGBA) of the board."""


class CameraFile(Model):
    """camera.json."""

    camera: Camera
    world_from_camera: Transform


def read_pictures(folder: Path) -> list[tuple[View, np.ndarray]]:
    """Return the views in a folder with their colour pictures (H, W, 3) uint8. Raises BadInput."""
    folders = [folder] if (folder / "camera.json").exists() else sorted(p.parent for p in folder.glob("*/camera.json"))
    if not folders:
        raise BadInput(f"{folder}: holds no pictures", hint=HINT)
    if len(folders) > MOST_CAMERAS:
        raise BadInput(f"{folder}: pictures of {len(folders)} cameras, at most {MOST_CAMERAS}", hint=HINT)
    return [_read_view(each) for each in folders]


def _read_view(folder: Path) -> tuple[View, np.ndarray]:
    file = CameraFile.read(folder / "camera.json", largest=LARGEST_CAMERA, hint=HINT)
    camera, pose = file.camera, np.array(file.world_from_camera)
    if min(camera.width, camera.height) < 1 or camera.width * camera.height > MOST_PIXELS or camera.fx * camera.fy <= 0:
        raise BadInput(f"{folder / 'camera.json'}: this is not a camera", hint=HINT)
    if not is_rigid(pose) or pose[2, 3] <= 0:
        raise BadInput(f"{folder / 'camera.json'}: world_from_camera is not a pose over a board at z = 0", hint=HINT)
    depth = _decode(folder / "depth.png", np.dtype(np.uint16), 2, camera)
    color = _decode(folder / "color.png", np.dtype(np.uint8), 3, camera)
    return View(depth.astype(np.float32) * np.float32(MILLIMETRE), camera, pose), np.ascontiguousarray(color[..., ::-1])


def _decode(path: Path, kind: np.dtype, dimensions: int, camera: Camera) -> np.ndarray:
    data = file_content(path, LARGEST_SHOWN, hint=HINT)
    image = None
    if may_be_decoded(data):
        image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    if image is None:
        raise BadInput(f"{path}: no picture", hint=HINT)
    if image.dtype != kind or image.ndim != dimensions or (dimensions == 3 and image.shape[2] != 3):
        raise BadInput(
            f"{path}: {image.dtype} of {image.ndim} dimensions; depth has 16 bits, colour 8 bits of three channels",
            hint=HINT,
        )
    if image.shape[:2] != (camera.height, camera.width):
        raise BadInput(
            f"{path}: {image.shape[1]} x {image.shape[0]}, the camera {camera.width} x {camera.height}", hint=HINT
        )
    return np.asarray(image)


def write_pictures(folder: Path, views: Sequence[View], bodies: Sequence[Body]) -> None:
    """Write what cameras report of bodies on the board; colour is rendered here."""
    board = trimesh.creation.box((2.0, 2.0, 0.02))
    board.apply_translation((0.0, 0.0, -0.01))
    board.visual = trimesh.visual.ColorVisuals(board, face_colors=np.tile(WOOD, (len(board.faces), 1)))
    renderer = SceneRenderer([(1, board), *((n + 2, colored(body, n)) for n, body in enumerate(bodies))])
    for number, view in enumerate(views):
        below = folder / f"camera_{number}"
        below.mkdir(parents=True)
        pose = as_transform(view.world_from_camera)
        CameraFile(camera=view.camera, world_from_camera=pose).write(below / "camera.json")
        millimetres = np.round(view.depth / MILLIMETRE).clip(0, 65535).astype(np.uint16)
        Image.fromarray(millimetres).save(below / "depth.png")
        Image.fromarray(renderer.render(view.camera, view.world_from_camera).color).save(below / "color.png")
