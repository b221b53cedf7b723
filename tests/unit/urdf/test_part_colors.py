"""Bodies in the colours of the map."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from scenewright.stages.kit.formats.mesh_files import read_mesh
from scenewright.stages.kit.formats.model_writer import write_obj
from scenewright.stages.kit.formats.part_colors import recolored, recolored_shapes
from scenewright.stages.kit.formats.urdf_file import Shape

colors = st.lists(st.tuples(*[st.floats(0, 1)] * 3), min_size=1, max_size=6)


@given(colors, st.tuples(*[st.floats(0, 1)] * 3), st.data())
def test_the_mean_is_the_given_colour_and_differences_keep_their_direction(given_colors, mean, data) -> None:
    weights = data.draw(st.lists(st.floats(0.1, 5), min_size=len(given_colors), max_size=len(given_colors)))
    before = np.array(given_colors)
    after = recolored(before, np.array(weights), np.array(mean))
    assert after.min() >= 0 and after.max() <= 1
    np.testing.assert_allclose(np.average(after, axis=0, weights=weights), mean, atol=1e-9)
    old, new = before - before[0], after - after[0]
    factor = np.abs(new).sum() / max(np.abs(old).sum(), 1e-12)
    assert factor <= 1 + 1e-6
    np.testing.assert_allclose(new, old * factor, atol=1e-6)


def test_contrast_is_kept_whole_where_there_is_room() -> None:
    after = recolored(np.array([[0.2, 0.2, 0.2], [0.4, 0.4, 0.4]]), np.array([1, 3]), np.array([0.5, 0.6, 0.7]))
    np.testing.assert_allclose(after, [[0.35, 0.45, 0.55], [0.55, 0.65, 0.75]])


def test_shapes_are_weighted_by_their_surface(tmp_path: Path) -> None:
    """A box of 1 m and one of 2 m: a quarter of the surface weighs as much as four quarters."""
    cube = trimesh.creation.box((1, 1, 1))
    write_obj(tmp_path / "cube.obj", cube.vertices, cube.faces)
    shapes = (Shape("cube.obj", color=(0.2, 0.2, 0.2, 1.0)), Shape("cube.obj", scale=2.0, color=(0.6, 0.6, 0.6, 0.5)))
    small, large = recolored_shapes(tmp_path, "cup_1", shapes, (102, 102, 102))
    assert small.color == pytest.approx((0.08, 0.08, 0.08, 1.0))
    assert large.color == pytest.approx((0.48, 0.48, 0.48, 0.5))
    assert (small.mesh, large.mesh) == ("cube.obj", "cube.obj")


def test_a_file_with_colours_of_its_own_is_copied_for_the_body(tmp_path: Path) -> None:
    cube = trimesh.creation.box((1, 1, 1))
    shades = np.where(cube.vertices[:, :1] > 0, 150, 50) * np.ones((1, 3))
    write_obj(tmp_path / "cube.obj", cube.vertices, cube.faces, shades)
    before = (tmp_path / "cube.obj").read_bytes()
    [shape] = recolored_shapes(tmp_path, "cup_1", (Shape("cube.obj", color=(0.4, 0.4, 0.4, 1.0)),), (200, 100, 120))
    assert shape.mesh is not None and shape.mesh.startswith("meshes/cup_1/")
    assert shape.color == pytest.approx((200 / 255, 100 / 255, 120 / 255, 1.0), abs=0.003)
    painted = np.asarray(read_mesh(tmp_path / shape.mesh).visual.vertex_colors)[:, :3].astype(int)
    assert np.unique(painted, axis=0).tolist() == [[150, 50, 70], [250, 150, 170]]
    assert (tmp_path / "cube.obj").read_bytes() == before
