"""Triangle meshes ready for rays and distances, any number of them: ray-casting scenes are few at a time."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import open3d as o3d

LIVE_SCENES = 400
"""Ray-casting scenes that exist at a time: each holds a thread-local key, and a process crashes near 1000 of them."""


@dataclass(frozen=True, eq=False)
class Triangles:
    """Triangles ready for ray and distance queries, compared by identity."""

    vertices: np.ndarray
    """(V, 3), float32."""
    faces: np.ndarray
    """(F, 3), uint32."""

    @property
    def scene(self) -> o3d.t.geometry.RaycastingScene:
        """The ray-casting scene of the triangles, built again when `LIVE_SCENES` others were asked since."""
        return _scene(self)


@lru_cache(maxsize=LIVE_SCENES)
def _scene(triangles: Triangles) -> o3d.t.geometry.RaycastingScene:
    scene = o3d.t.geometry.RaycastingScene(nthreads=1)
    scene.add_triangles(o3d.core.Tensor.from_numpy(triangles.vertices), o3d.core.Tensor.from_numpy(triangles.faces))
    return scene


def triangles_of(vertices: np.ndarray, faces: np.ndarray) -> Triangles:
    """Return vertices (V, 3) and faces (F, 3) ready for ray and distance queries."""
    return Triangles(np.ascontiguousarray(vertices, dtype=np.float32), np.ascontiguousarray(faces, dtype=np.uint32))
