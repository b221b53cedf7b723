"""Rendering by rasterisation on the processor: the TinyRenderer of pybullet, nothing of our own generator's path."""

from __future__ import annotations

from collections.abc import Sequence
from types import TracebackType
from typing import Any, Self

import numpy as np
import pybullet
import trimesh
from scenewright.schemas.scene_parts import Camera

NEAR, FAR = 0.1, 20.0
"""Clipping planes [m]."""
MOST_CORNERS = 30_000
"""A shape takes so many corners at once."""
LIGHT = (0.3, -0.5, 1.0)


class TinyRenderer:
    """Holds coloured meshes in the world frame. Use as a context manager."""

    def __init__(self, meshes: Sequence[trimesh.Trimesh], colors: np.ndarray) -> None:
        """`colors` (N, 3) in 0..1, one a mesh: the rasteriser knows no colours of vertices."""
        self._client = pybullet.connect(pybullet.DIRECT)
        self._mesh_of: dict[int, int] = {}
        for number, (mesh, color) in enumerate(zip(meshes, colors, strict=True)):
            corners = np.asarray(mesh.vertices)[mesh.faces]
            normals = np.repeat(np.asarray(mesh.face_normals), 3, axis=0)
            flat = corners.reshape(-1, 3)
            for start in range(0, len(flat), MOST_CORNERS):
                part = slice(start, start + MOST_CORNERS)
                shape = pybullet.createVisualShape(
                    pybullet.GEOM_MESH,
                    vertices=flat[part].tolist(),
                    indices=list(range(len(flat[part]))),
                    normals=normals[part].tolist(),
                    rgbaColor=[*color, 1.0],
                    physicsClientId=self._client,
                )
                body = pybullet.createMultiBody(baseVisualShapeIndex=shape, physicsClientId=self._client)
                self._mesh_of[body] = number

    def __enter__(self) -> Self:
        """Nothing more to open."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the renderer."""
        pybullet.disconnect(physicsClientId=self._client)

    def render(self, camera: Camera, world_from_camera: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return colour (H, W, 3) uint8, depth (H, W) float32 [m], 0 for nothing, and the number of the mesh (H, W)
        int32, -1 for none."""
        eye, forward, down = (world_from_camera[:3, k] for k in (3, 2, 1))
        view = pybullet.computeViewMatrix(eye.tolist(), (eye + forward).tolist(), (-down).tolist())
        picture: Any = pybullet.getCameraImage(
            camera.width,
            camera.height,
            viewMatrix=view,
            projectionMatrix=projection(camera),
            lightDirection=LIGHT,
            shadow=0,
            renderer=pybullet.ER_TINY_RENDERER,
            physicsClientId=self._client,
        )
        shape = (camera.height, camera.width)
        color = np.asarray(picture[2], np.uint8).reshape(*shape, 4)[..., :3]
        window = np.asarray(picture[3], np.float64).reshape(shape)
        depth = NEAR * FAR / (FAR - (FAR - NEAR) * window)
        bodies = np.asarray(picture[4], np.int64).reshape(shape)
        numbers = np.full(shape, -1, np.int32)
        for body, number in self._mesh_of.items():
            numbers[bodies == body] = number
        return color, np.where(numbers >= 0, depth, 0).astype(np.float32), numbers


def projection(camera: Camera) -> list[float]:
    """Return the projection of OpenGL, column by column, whose pixel (u, v) is that of the pinhole camera.

    TinyRenderer asks what is at the lower left corner of a pixel, not in its middle: measured against rays.
    """
    width, height = camera.width, camera.height
    return [
        *(2 * camera.fx / width, 0, 0, 0),
        *(0, 2 * camera.fy / height, 0, 0),
        *(1 - 2 * camera.cx / width, (2 * camera.cy + 2) / height - 1, -(FAR + NEAR) / (FAR - NEAR), -1),
        *(0, 0, -2 * FAR * NEAR / (FAR - NEAR), 0),
    ]
