"""Two depth cameras over a board: the depth that they report of bodies that lie there, by the kit's noise model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import open3d as o3d
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.cutting.world.body import Body
from scenewright.stages.kit.geometry.cameras import project
from scenewright.stages.kit.geometry.ray_scenes import triangles_of
from scenewright.stages.kit.geometry.transforms import apply, inverse, look_at
from scenewright.stages.kit.rendering.depth_noise import disturb_depth

WIDTH, HEIGHT, FOCAL = 1280, 720, 900.0
"""Size and focal length of the sensors [px]."""
EYES = (np.array([0.32, 0.32, 0.45]), np.array([-0.32, -0.32, 0.45]))
"""Places of the cameras [m]: opposite each other and across the rows, so that both see the board's middle."""
FRAMES = 9
"""Frames that a camera takes of a board on which nothing moves; of each pixel the median counts. By eye."""
REFLECTANCE = 0.4
"""Reflectance of all that is seen; by eye."""
MARGIN = 14
"""Width of board around what lies there that is looked at [px]; by eye."""


@dataclass(frozen=True)
class View:
    """What a camera reports."""

    depth: np.ndarray
    """(H, W) float32 [m], 0 where nothing came back."""
    camera: Camera
    world_from_camera: np.ndarray
    """(4, 4), the board's top is z = 0."""


def look(bodies: Sequence[Body], random: np.random.Generator, eyes: Sequence[np.ndarray] = EYES) -> list[View]:
    """Return what the cameras report of bodies on the board. Only the part of the image around them is rendered."""
    return [_view(bodies, eye, random) for eye in eyes]


def _view(bodies: Sequence[Body], eye: np.ndarray, random: np.random.Generator) -> View:
    pose = look_at(eye, np.zeros(3))
    full_camera = Camera(width=WIDTH, height=HEIGHT, fx=FOCAL, fy=FOCAL, cx=0.5 * WIDTH - 0.5, cy=0.5 * HEIGHT - 0.5)
    pixels, _ = project(np.concatenate([apply(inverse(pose), body.vertices) for body in bodies]), full_camera)
    low = np.maximum(np.floor(pixels.min(axis=0)).astype(int) - MARGIN, 0)
    high = np.minimum(np.ceil(pixels.max(axis=0)).astype(int) + MARGIN, (WIDTH, HEIGHT))
    width, height = np.maximum(high - low, 16).tolist()
    camera = full_camera.model_copy(
        update={"width": width, "height": height, "cx": full_camera.cx - low[0], "cy": full_camera.cy - low[1]}
    )
    depth, cosine = _true_depth(bodies, camera, pose)
    even, matt = np.full(depth.shape, REFLECTANCE, np.float32), np.zeros(depth.shape, np.float32)
    frames = np.stack([disturb_depth(depth, cosine, even, matt, camera, random) for _ in range(FRAMES)])
    return View(_median(frames), camera, pose)


def _true_depth(bodies: Sequence[Body], camera: Camera, pose: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the depth (H, W) [m] of bodies and board, and the cosine (H, W) between ray and surface normal."""
    board = np.array([[-2.0, -2.0, 0.0], [2.0, -2.0, 0.0], [2.0, 2.0, 0.0], [-2.0, 2.0, 0.0]])
    vertices, faces, first = [board], [np.array([[0, 1, 2], [0, 2, 3]])], len(board)
    for body in bodies:
        vertices.append(body.vertices)
        faces.append(body.faces + first)
        first += len(body.vertices)
    scene = triangles_of(np.concatenate(vertices), np.concatenate(faces)).scene
    v, u = np.mgrid[: camera.height, : camera.width]
    rays = np.stack([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, np.ones(u.shape)], axis=-1)
    rays = rays @ pose[:3, :3].T
    hits = scene.cast_rays(
        o3d.core.Tensor(  # type: ignore[call-overload]
            np.concatenate([np.broadcast_to(pose[:3, 3], rays.shape), rays], axis=-1).astype(np.float32)
        )
    )
    depth, normals = hits["t_hit"].numpy(), hits["primitive_normals"].numpy()
    cosine = np.abs((normals * rays).sum(axis=-1)) / np.linalg.norm(rays, axis=-1)
    return np.where(np.isfinite(depth), depth, 0.0).astype(np.float32), cosine.astype(np.float32)


def _median(frames: np.ndarray) -> np.ndarray:
    """Return the median (H, W) of what frames (N, H, W) report, 0 where fewer than half of them do."""
    ranked = np.sort(np.where(frames > 0, frames, np.inf), axis=0)
    count = (frames > 0).sum(axis=0)
    middle = np.take_along_axis(ranked, (np.maximum(count - 1, 0) // 2)[None], axis=0)[0]
    return np.where(2 * count >= len(frames), middle, 0.0).astype(np.float32)
