"""A splat from all sides: a doll's house, open above the height that its cameras stood at."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from PIL import Image
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.kit.geometry.transforms import inverse, look_at
from scenewright.stages.kit.rendering.splatting.gaussians import Gaussians
from scenewright.stages.kit.rendering.splatting.rasterizer import Rasterizer, View
from scenewright.stages.splat.strays import no_strays

SIZE = (480, 360)
"""Width and height of a picture [px]."""
FIELD_OF_VIEW = np.deg2rad(45.0)
"""Vertical field of view [rad]."""
ELEVATION = np.deg2rad(55.0)
"""Steep enough to look into a room over its walls."""
LEAST_RADIUS = 0.05
"""Least radius of what is shown [m]: a single Gaussian has none."""
SHEET = 4
"""Pictures of the sheet that stands for the turn, two in a row."""
SECONDS = 6.0
"""Time of a turn [s]."""


def opened(gaussians: Gaussians, camera_centers: np.ndarray) -> Gaussians:
    """Return the Gaussians that are no strays, nor higher than the highest of the cameras (V, 3) [m], where any are
    left."""
    inside = no_strays(gaussians.means)
    below = inside & (gaussians.means[:, 2] <= camera_centers[:, 2].max())
    return gaussians.taken(below if below.any() else inside)


def turn(gaussians: Gaussians, rasterizer: Rasterizer, count: int) -> Iterator[np.ndarray]:
    """Yield `count` pictures (H, W, 3) uint8 of Gaussians from places around their middle, evenly spread."""
    low, high = gaussians.means.min(axis=0).astype(float), gaussians.means.max(axis=0).astype(float)
    middle, radius = (low + high) / 2, max(float(np.linalg.norm(high - low)) / 2, LEAST_RADIUS)
    focal = SIZE[1] / 2 / np.tan(FIELD_OF_VIEW / 2)
    camera = Camera(width=SIZE[0], height=SIZE[1], fx=focal, fy=focal, cx=(SIZE[0] - 1) / 2, cy=(SIZE[1] - 1) / 2)
    distance = radius / np.sin(FIELD_OF_VIEW / 2)
    for angle in 2 * np.pi * np.arange(count) / count:
        flat = np.cos(ELEVATION) * np.array([np.cos(angle), np.sin(angle), 0.0])
        eye = middle + distance * (flat + np.array([0.0, 0.0, np.sin(ELEVATION)]))
        picture = rasterizer.draw(gaussians, View(camera, inverse(look_at(eye, middle)))).picture
        white = picture.color + (1 - picture.alpha)[..., None]
        yield np.round(255 * np.clip(white, 0, 1)).astype(np.uint8)


def write_turn(folder: Path, pictures: list[np.ndarray]) -> None:
    """Write turntable.gif, and turntable.png: some of its pictures."""
    images = [Image.fromarray(picture) for picture in pictures]
    chosen = [images[len(images) * k // SHEET] for k in range(SHEET)]
    sheet = Image.new("RGB", (2 * SIZE[0], SHEET // 2 * SIZE[1]), "white")
    for number, image in enumerate(chosen):
        sheet.paste(image, (number % 2 * SIZE[0], number // 2 * SIZE[1]))
    sheet.save(folder / "turntable.png")
    even = [image.quantize(128) for image in images]
    each = round(1000 * SECONDS / len(even))
    even[0].save(folder / "turntable.gif", save_all=True, append_images=even[1:], duration=each, loop=0, optimize=False)
