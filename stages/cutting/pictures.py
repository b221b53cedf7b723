"""Pictures of bodies: rendered, each in a colour of its own, side by side and in motion."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import trimesh
from PIL import Image, ImageDraw, ImageFont, ImageOps
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.cutting.world.body import Body
from scenewright.stages.kit.drawing.palette import instance_color
from scenewright.stages.kit.geometry.transforms import look_at
from scenewright.stages.kit.rendering.ray_casting import SceneRenderer

APART = 1.7
"""Factor by which distances between fragments grow in an exploded view; by eye."""
VIEW = np.array([0.75, -0.9, 0.95])
"""Direction (3,) from the bodies to the eye; by eye."""
SECONDS_OF_A_FRAME = 0.45
"""Time that a frame of an animation is shown [s]; by eye."""
MOST_FRAMES = 40
"""Most frames of an animation; by eye."""
ROW = 4
"""Pictures beside each other."""


def apart(bodies: Mapping[int, Body]) -> dict[int, Body]:
    """Return fragments moved away from their middle."""
    centers = {number: body.moments[0] for number, body in bodies.items()}
    middle = np.mean(list(centers.values()), axis=0)
    return {number: body.shifted((APART - 1.0) * (centers[number] - middle)) for number, body in bodies.items()}


def bounds_of(bodies: Sequence[Body]) -> tuple[np.ndarray, np.ndarray]:
    """Return the box around bodies (3,), (3,) [m]."""
    low = np.min([body.vertices.min(axis=0) for body in bodies], axis=0)
    high = np.max([body.vertices.max(axis=0) for body in bodies], axis=0)
    return low, high


def colored(body: Body, number: int) -> trimesh.Trimesh:
    """Return the mesh of a body in the colour of its number."""
    color = np.append(np.round(255 * np.array(instance_color(number + 1))), 255).astype(np.uint8)
    mesh = trimesh.Trimesh(body.vertices, body.faces, process=False)
    mesh.visual = trimesh.visual.ColorVisuals(mesh, face_colors=np.tile(color, (len(body.faces), 1)))
    return mesh


def draw(
    bodies: Mapping[int, Body], width: int, caption: str, bounds: tuple[np.ndarray, np.ndarray] | None = None
) -> Image.Image:
    """Return bodies, coloured by number, seen so that the bounds (their own without) fill the picture."""
    low, high = bounds or bounds_of(list(bodies.values()))
    height = round(0.7 * width)
    radius = 0.5 * float(np.linalg.norm(high - low))
    camera = Camera(
        width=width, height=height, fx=1.6 * width, fy=1.6 * width, cx=0.5 * width - 0.5, cy=0.5 * height - 0.5
    )
    middle = 0.5 * (low + high)
    eye = middle + VIEW / np.linalg.norm(VIEW) * radius * 4.3
    meshes = [(number + 1, colored(body, number)) for number, body in bodies.items()]
    return captioned(Image.fromarray(SceneRenderer(meshes).render(camera, look_at(eye, middle)).color), width, caption)


def captioned(image: Image.Image, width: int, caption: str) -> Image.Image:
    """Return a picture of the size of the others, with words below it."""
    height = round(0.7 * width)
    image = ImageOps.pad(image, (width, height), color="white")
    size = max(11, width // 24)
    sheet = Image.new("RGB", (width, height + 2 * size), "white")
    sheet.paste(image, (0, 0))
    font = ImageFont.load_default(size)
    ImageDraw.Draw(sheet).text((6, height + size // 3), caption, fill="#1f2937", font=font)
    return sheet


def strip(images: Sequence[Image.Image]) -> Image.Image:
    """Return pictures of one size side by side, a few in a row."""
    columns = min(ROW, len(images))
    width, height = images[0].size
    sheet = Image.new("RGB", (columns * width, -(-len(images) // columns) * height), "white")
    for number, image in enumerate(images):
        sheet.paste(image, (number % columns * width, number // columns * height))
    return sheet


def animate(path: Path, frames: Sequence[Mapping[int, Body]], width: int, captions: Sequence[str]) -> None:
    """Write a GIF of what lay there after each cut; of very many cuts, some of them."""
    chosen = np.unique(np.linspace(0, len(frames) - 1, min(len(frames), MOST_FRAMES)).round().astype(int))
    boxes = [bounds_of(list(frames[k].values())) for k in chosen]
    bounds = np.min([low for low, _ in boxes], axis=0), np.max([high for _, high in boxes], axis=0)
    images = [draw(frames[k], width, captions[k], bounds).quantize(128) for k in chosen]
    times = [round(1000 * SECONDS_OF_A_FRAME)] * (len(images) - 1) + [2000]
    images[0].save(path, save_all=True, append_images=images[1:], duration=times, loop=0, optimize=False)
