"""The room's light goes out of colours by its walls."""

from __future__ import annotations

import numpy as np
import pytest
from scenewright.stages.cad.room_light import REFLECTED, gain_by_walls, luminance, relight, relit
from scenewright.stages.kit.formats.ply_files import ColoredMesh, read_ply, write_ply
from scenewright.stages.kit.rendering.surfaces import linear_to_srgb


def grey(light: float, count: int = 2000) -> np.ndarray:
    """sRGB of a grey of a linear luminance."""
    return np.full((count, 3), np.round(255 * linear_to_srgb(np.array(light))), dtype=np.uint8)


@pytest.mark.parametrize("light", [0.4, 0.65, 0.9])
def test_walls_reflect_what_walls_do(light):
    walls = grey(light)
    gain = gain_by_walls(walls, np.concatenate([walls, grey(0.1)]))
    assert gain == pytest.approx(REFLECTED / light, rel=0.02)
    assert luminance(relit(walls, gain)).mean() == pytest.approx(REFLECTED, abs=0.01)


def test_a_gain_keeps_hue_and_is_undone_by_its_inverse():
    colors = np.array([[120, 80, 50], [30, 90, 160]], np.uint8)
    brighter = relit(colors, 1.4)
    assert np.abs(relit(brighter, 1 / 1.4).astype(int) - colors).max() <= 1
    assert relit(colors, 1.0).tolist() == colors.tolist()


def test_what_is_brighter_than_white_bounds_the_gain():
    walls = grey(0.3)
    assert gain_by_walls(walls, np.concatenate([walls, grey(0.85)])) == pytest.approx(0.9 / 0.85, rel=0.02)
    assert gain_by_walls(walls, np.concatenate([walls, grey(1.0)])) == 1.0, "windows blown out say nothing of dimness"


def test_things_on_a_wall_do_not_darken_its_light():
    walls = np.concatenate([grey(0.5, 1300), grey(0.05, 700)])
    assert gain_by_walls(walls, walls) == pytest.approx(REFLECTED / 0.5, rel=0.02)


@pytest.mark.parametrize("count", [0, 10])
def test_too_little_wall_says_nothing(count):
    assert gain_by_walls(grey(0.2, count), grey(0.2)) == 1.0


def test_meshes_are_written_again_with_their_shape(tmp_path):
    vertices = np.random.default_rng(3).random((6, 3)).astype(np.float32)
    faces = np.array([[0, 1, 2], [3, 4, 5]], np.int32)
    write_ply(tmp_path / "a.ply", ColoredMesh(vertices, faces, np.full((6, 3), 100, np.uint8)))
    relight([tmp_path / "a.ply"], 1.5)
    mesh = read_ply(tmp_path / "a.ply")
    assert mesh.vertices.tolist() == vertices.tolist() and mesh.faces.tolist() == faces.tolist()
    assert (mesh.colors == relit(np.full((6, 3), 100, np.uint8), 1.5)).all()
