"""A front that was seen from one side would fall, what has a foot under its middle stands."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from scenewright.stages.urdf.steadiness import LEAST_TILT, stands_steadily


def solid(width: float, depth: float, height: float, lean: float = 0.0) -> trimesh.Trimesh:
    """A box on the floor, its top `lean` to the side."""
    mesh = trimesh.creation.box((width, depth, height)).apply_translation([0, 0, 0.5 * height])
    vertices = np.array(mesh.vertices)
    vertices[:, 1] += lean * vertices[:, 2] / height
    return trimesh.Trimesh(vertices, mesh.faces)


@pytest.mark.parametrize(
    ("mesh", "expected"),
    [
        (solid(0.8, 0.5, 1.8), True),
        (solid(1.1, 0.06, 0.87), False),  # the front of a counter
        (solid(0.5, 0.5, 1.0, lean=0.6), False),  # its middle is beyond its foot
        (solid(0.5, 0.5, 0.02), True),
        (solid(0.1, 2 * 0.5 * np.tan(LEAST_TILT) * 1.1, 1.0), True),
        (solid(0.1, 2 * 0.5 * np.tan(LEAST_TILT) * 0.9, 1.0), False),
    ],
)
def test_what_would_stand(mesh: trimesh.Trimesh, expected: bool) -> None:
    assert stands_steadily(np.asarray(mesh.vertices), np.asarray(mesh.faces), 0.0) is expected


def test_a_sheet_has_no_foot() -> None:
    points = np.array([[0.0, 0, 0], [1, 0, 0], [1, 0, 1], [0, 0, 1]])
    assert not stands_steadily(points, np.array([[0, 1, 2], [0, 2, 3]]), 0.0)
