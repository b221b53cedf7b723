"""The overhead RGB-D camera: what it sees of a table with tableware, rendered with light, shadows and depth noise."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
import trimesh
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.kit.rendering.depth_noise import DepthCamera, disturb_depth
from scenewright.stages.kit.rendering.light_map import AreaLight
from scenewright.stages.kit.rendering.patterns import Material
from scenewright.stages.kit.rendering.ray_casting import SceneRenderer
from scenewright.stages.tableware.world.dish_shapes import item_mesh
from scenewright.stages.tableware.world.items import TABLE_SIDES, Table

CAMERA_HEIGHT = 0.83
"""Height of the camera above the table [m] (Srinivas 2024, section 7.1)."""
FLOOR = -0.75
"""World height of the floor [m]."""

Scheme = Literal["dark_on_white", "white_on_dark"]
SCHEMES: tuple[Scheme, ...] = ("dark_on_white", "white_on_dark")


@dataclass(frozen=True)
class OverheadCamera:
    """Intrinsics, and where the camera stands: `world_from_camera` (4, 4), OpenCV camera frame."""

    camera: Camera
    world_from_camera: np.ndarray


@dataclass(frozen=True)
class Level:
    """How well a scene is lit and how noisy the sensor is."""

    key: float
    """Light that falls from the lamp on a white surface that faces it."""
    ambient: float
    grain: float
    """Standard deviation of the colour noise [grey levels of 255]."""
    gloss: float
    """Of the dishes."""
    dark_signal: float
    """Of the depth sensor: returned signal at which half of the pixels are lost, see DepthCamera."""
    axial: float
    """Standard deviation [m] of further noise along the ray."""


LEVELS: dict[str, Level] = {
    "bright": Level(key=0.50, ambient=0.45, grain=1.5, gloss=0.0, dark_signal=0.0012, axial=0.0),
    "usual": Level(key=0.45, ambient=0.25, grain=4.0, gloss=0.25, dark_signal=0.015, axial=0.001),
    "dim": Level(key=0.18, ambient=0.07, grain=7.0, gloss=0.6, dark_signal=0.035, axial=0.002),
}
"""Name of a light -> exposure, ambient share, grain, gloss and noise of the depth; by eye."""
_TONES: dict[Scheme, tuple[float, float]] = {"dark_on_white": (0.90, 0.22), "white_on_dark": (0.20, 0.88)}
"""sRGB of table and of dishes."""


def overhead_camera(height: float = CAMERA_HEIGHT, width: int = 1280, rows: int = 720) -> OverheadCamera:
    """Return the camera straight above the table's middle: image x along world x, image y along world -y. The focal
    length is that of a camera with a horizontal field of view of 90 degrees, as the D455's depth camera has."""
    focal = 0.5 * width
    camera = Camera(width=width, height=rows, fx=focal, fy=focal, cx=0.5 * width - 0.5, cy=0.5 * rows - 0.5)
    pose = np.diag([1.0, -1.0, -1.0, 1.0])
    pose[2, 3] = height
    return OverheadCamera(camera, pose)


def _color_mesh(mesh: trimesh.Trimesh, srgb: np.ndarray) -> trimesh.Trimesh:
    rgba = np.append(np.round(255.0 * np.clip(srgb, 0.0, 1.0)), 255.0).astype(np.uint8)
    mesh.visual = trimesh.visual.ColorVisuals(mesh, face_colors=np.tile(rgba, (len(mesh.faces), 1)))
    return mesh


def _slab(width: float, depth: float, top: float) -> trimesh.Trimesh:
    return trimesh.creation.box(
        (width, depth, 0.03), trimesh.transformations.translation_matrix([0.0, 0.0, top - 0.015])
    )


def render_overhead(
    table: Table,
    seed: int,
    level: str = "usual",
    scheme: Scheme = "dark_on_white",
    *,
    noise: bool = True,
    view: OverheadCamera | None = None,
    others: tuple[trimesh.Trimesh, ...] = (),
    poses: Mapping[str, np.ndarray] | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Return (color (H, W, 3) uint8 sRGB, depth (H, W) float32 [m], 0 where the sensor reports none).

    The lamp's place, the dishes' tones and the noise follow from `seed`. `others` are meshes that are no tableware.
    Without `noise` both images are exact. `poses`: item -> world_from_item (4, 4) where it does not stand upright.
    """
    view = view or overhead_camera()
    light = LEVELS[level]
    random = np.random.default_rng([seed, 72])
    table_tone, dish_tone = _TONES[scheme]
    meshes = [(1, _color_mesh(_slab(*TABLE_SIDES, 0.0), np.full(3, table_tone) + random.uniform(-0.04, 0.04)))]
    meshes.append((2, _color_mesh(_slab(6.0, 6.0, FLOOR), np.array([0.42, 0.38, 0.35]))))
    for index, item in enumerate(table.items):
        tone = dish_tone + random.uniform(-0.08, 0.08) + random.uniform(-0.05, 0.05, 3)
        mesh = item_mesh(item)
        if poses is not None and item.name in poses:
            upright = trimesh.transformations.rotation_matrix(item.yaw, [0.0, 0.0, 1.0])
            upright[:3, 3] = item.position
            mesh.apply_transform(poses[item.name] @ np.linalg.inv(upright))
        meshes.append((3 + index, _color_mesh(mesh, tone)))
    first_other = 3 + len(table.items)
    for index, mesh in enumerate(others):
        meshes.append((first_other + index, _color_mesh(mesh.copy(), random.uniform(0.2, 0.7, 3))))
    lamp = (float(random.uniform(-0.8, 0.8)), float(random.uniform(-0.8, 0.8)), 1.8)
    lights = (
        AreaLight(lamp, (0.3, 0.0, 0.0), (0.0, -0.3, 0.0), (light.key,) * 3),
        AreaLight((-lamp[0], -lamp[1], 2.2), (0.3, 0.0, 0.0), (0.0, -0.3, 0.0), (0.3 * light.key,) * 3),
    )
    materials = {index: Material(gloss=light.gloss, sharpness=60.0) for index, _ in meshes[2:]}
    renderer = SceneRenderer(meshes, lights=lights, ambient=(light.ambient,) * 3, materials=materials)
    picture = renderer.render(view.camera, view.world_from_camera)
    if not noise:
        return picture.color, picture.depth
    grain = random.standard_normal(picture.color.shape, dtype=np.float32) * light.grain
    color = np.clip(np.rint(picture.color + grain), 0, 255).astype(np.uint8)
    reflectance = picture.albedo.mean(axis=2)
    gloss = np.where(picture.instance > 2, light.gloss, 0.0).astype(np.float32)
    sensor = DepthCamera(dark_signal=light.dark_signal)
    depth = disturb_depth(picture.depth, picture.incidence, reflectance, gloss, view.camera, random, sensor)
    further = random.standard_normal(depth.shape, dtype=np.float32) * np.float32(light.axial)
    return color, np.where(depth > 0.0, depth + further, 0.0).astype(np.float32)
