"""Distances to more meshes than ray-casting scenes may exist at a time."""

from __future__ import annotations

import numpy as np
import open3d as o3d
import pytest
import trimesh
from scenewright.stages.kit.geometry.ray_scenes import LIVE_SCENES, triangles_of

BEYOND_ANY_PROCESS = 1100
"""Scenes alive at once at which the process used to crash."""


def test_as_many_meshes_as_a_large_room_needs():
    point = o3d.core.Tensor.from_numpy(np.array([[5.0, 0.0, 0.0]], dtype=np.float32))
    sizes = np.linspace(0.5, 2.0, BEYOND_ANY_PROCESS)
    boxes = [trimesh.creation.box((size, size, size)) for size in sizes]
    meshes = [triangles_of(np.asarray(box.vertices), np.asarray(box.faces)) for box in boxes]
    for _ in range(2):
        for mesh, size in zip(meshes, sizes, strict=True):
            assert float(mesh.scene.compute_distance(point).numpy()[0]) == pytest.approx(5.0 - size / 2, abs=1e-5)
    assert meshes[-1].scene is meshes[-1].scene, "what was just asked is kept"
    assert LIVE_SCENES < 900
