"""The renderer against closed forms: depth of planes and spheres, ids, normals, light of a lamp, edges."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from scenewright.schemas.errors import BadInput
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.kit.geometry.cameras import back_project
from scenewright.stages.kit.geometry.transforms import apply, look_at
from scenewright.stages.kit.rendering.light_map import AreaLight, SoftLight
from scenewright.stages.kit.rendering.patterns import PATTERNS, Material, is_wood, pattern_factor
from scenewright.stages.kit.rendering.ray_casting import SceneRenderer
from scenewright.stages.kit.rendering.surfaces import corner_normals, linear_to_srgb, srgb_to_linear

CAMERA = Camera(width=80, height=60, fx=70.0, fy=70.0, cx=39.5, cy=29.5)


def painted_box(low: tuple[float, ...], high: tuple[float, ...], color: tuple[int, int, int]) -> trimesh.Trimesh:
    mesh = trimesh.creation.box(bounds=np.array([low, high], dtype=float))
    mesh.visual.face_colors = [*color, 255]
    return mesh


def floor() -> trimesh.Trimesh:
    return painted_box((-5, -5, -0.1), (5, 5, 0.0), (180, 180, 180))


def test_depth_of_a_plane_is_the_plane() -> None:
    pose = look_at(np.array([0.3, -1.0, 1.4]), np.array([0.0, 0.8, 0.0]))
    view = SceneRenderer([(1, floor())]).render(CAMERA, pose)
    points = apply(pose, back_project(view.depth, CAMERA).reshape(-1, 3).astype(float)).reshape(60, 80, 3)
    hit = view.depth > 0
    assert hit.mean() > 0.7
    assert np.abs(points[hit][:, 2]).max() < 1e-4 * np.abs(view.depth).max()
    assert np.allclose(view.normals[hit], [0, 0, 1], atol=1e-6)
    ray = points[hit] - pose[:3, 3]
    cosine = -ray[:, 2] / np.linalg.norm(ray, axis=1)
    assert np.allclose(view.incidence[hit], cosine, atol=1e-4)


def test_depth_of_a_sphere_is_the_sphere() -> None:
    ball = trimesh.creation.icosphere(subdivisions=5, radius=0.5)
    pose = look_at(np.array([0.0, -2.0, 0.0]), np.zeros(3))
    view = SceneRenderer([(7, ball)]).render(CAMERA, pose)
    v, u = np.nonzero(view.instance == 7)
    direction = np.stack([(u - CAMERA.cx) / CAMERA.fx, (v - CAMERA.cy) / CAMERA.fy, np.ones(len(u))], axis=1)
    # |t d - (0, 0, 2)| = 0.5, the nearer root; t is the z-depth.
    a, b, c = (direction**2).sum(axis=1), -2 * 2.0 * direction[:, 2], 4.0 - 0.25
    root = np.sqrt(np.maximum(b * b - 4 * a * c, 0.0))
    expected = (-b - root) / (2 * a)
    inner = b * b - 4 * a * c > 0.3  # away from the silhouette, where facets and sphere differ most
    assert inner.sum() > 300
    assert np.abs(view.depth[v, u] - expected)[inner].max() < 2e-3
    points = np.column_stack([direction * view.depth[v, u][:, None]])
    outward = apply(pose, points[inner])
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    assert np.einsum("ij,ij->i", view.normals[v, u][inner], outward).min() > 0.999


def test_instances_and_background() -> None:
    meshes = [
        (3, painted_box((-1, 0, -1), (0, 0.1, 1), (255, 0, 0))),
        (9, painted_box((0, 0, -1), (1, 0.1, 1), (0, 255, 0))),
    ]
    pose = look_at(np.array([0.0, -3.0, 0.0]), np.zeros(3))
    view = SceneRenderer(meshes, background=(0.2, 0.4, 0.6)).render(CAMERA, pose)
    assert set(np.unique(view.instance)) == {0, 3, 9}
    assert np.all(view.instance[30, :40][view.instance[30, :40] > 0] == 3)
    assert np.all(view.instance[30, 40:][view.instance[30, 40:] > 0] == 9)
    assert view.depth[0, 0] == 0.0
    assert np.abs(view.color[0, 0].astype(int) - [51, 102, 153]).max() <= 2
    red, green = view.color[30, 30], view.color[30, 50]
    assert red[0] > 4 * max(red[1], 1) and green[1] > 4 * max(green[0], 1)


def test_nearer_thing_hides_the_farther() -> None:
    meshes = [
        (1, painted_box((-2, 2, -2), (2, 2.1, 2), (200, 200, 200))),
        (2, painted_box((-0.2, 1, -0.2), (0.2, 1.1, 0.2), (9, 9, 9))),
    ]
    view = SceneRenderer(meshes).render(CAMERA, look_at(np.zeros(3), np.array([0.0, 1.0, 0.0])))
    assert view.instance[30, 40] == 2 and view.depth[30, 40] == pytest.approx(1.0, abs=1e-5)
    assert view.instance[5, 5] == 1 and view.depth[5, 5] == pytest.approx(2.0, abs=1e-5)


def test_shadow_darkens_what_the_lamp_cannot_see() -> None:
    roof = painted_box((-0.5, -0.5, 1.0), (0.5, 0.5, 1.05), (255, 255, 255))
    lamp = AreaLight((0.0, 0.0, 4.0), (0.1, 0, 0), (0, -0.1, 0), (0.6, 0.6, 0.6))
    pose = look_at(np.array([0.0, -4.0, 0.9]), np.array([0.0, 0.0, 0.0]))
    lit = SceneRenderer([(1, floor()), (2, roof)], lights=[lamp], shadows=False).render(CAMERA, pose)
    dark = SceneRenderer([(1, floor()), (2, roof)], lights=[lamp]).render(CAMERA, pose)
    center = (30, 40)
    assert lit.instance[center] == 1
    assert dark.color[center].mean() < 0.8 * lit.color[center].mean()
    assert np.array_equal(dark.color[55, 40], lit.color[55, 40])


def test_light_map_follows_the_inverse_square_of_a_small_lamp() -> None:
    """E = L A cos cos' / r^2; the map holds E / pi. Without bounce and ambient light on an open floor."""
    height, radiance, edge = 2.0, 50.0, 0.1
    lamp = AreaLight((0.0, 0.0, height), (edge, 0, 0), (0, -edge, 0), (radiance,) * 3)
    renderer = SceneRenderer([(1, floor())], lights=[lamp], ambient=(0.0,) * 3, soft_light=SoftLight((0.0,) * 3, 0.1))
    assert renderer.light_map is not None
    soup, light = renderer.soup, renderer.light_map
    up = np.flatnonzero(soup.face_normals[:, 2] > 0.9)
    checked = 0
    for t in up:
        n = int(light.subdivisions[t])
        for i, j in ((n // 4, n // 3), (n // 2, n // 5)):
            row = int(light.offset[t]) + i * (n + 1) - i * (i - 1) // 2 + j
            u, v = i / n, j / n
            point = (1 - u - v) * soup.corners[t, 0] + u * soup.corners[t, 1] + v * soup.corners[t, 2]
            square = float(point[0] ** 2 + point[1] ** 2 + height**2)
            expected = radiance * edge * edge * height**2 / square**2 / np.pi
            assert light.light[row].mean() == pytest.approx(expected, rel=0.02)
            checked += 1
    assert checked >= 4


def test_color_reflects_between_surfaces() -> None:
    """One bounce: on a grey floor before a lit red wall lies red light; far from it the light is the lamp's."""
    red = painted_box((0.5, -2, 0.0), (0.6, 2, 2.0), (255, 0, 0))
    lamp = AreaLight((-1.0, 0.0, 1.5), (0, 0.5, 0), (0, 0, 0.5), (20.0,) * 3)  # shines along +x
    renderer = SceneRenderer(
        [(1, floor()), (2, red)], lights=[lamp], ambient=(0.0,) * 3, soft_light=SoftLight((0.0,) * 3)
    )
    assert renderer.light_map is not None
    soup, light = renderer.soup, renderer.light_map
    points, colors = [], []
    for t in np.flatnonzero((soup.instance == 1) & (soup.face_normals[:, 2] > 0.9)):
        n, row = int(light.subdivisions[t]), int(light.offset[t])
        for i in range(n + 1):
            for j in range(n + 1 - i):
                u, v = i / n, j / n
                points.append((1 - u - v) * soup.corners[t, 0] + u * soup.corners[t, 1] + v * soup.corners[t, 2])
                colors.append(light.light[row])
                row += 1
    points, colors = np.array(points), np.array(colors)
    beside = (points[:, 0] > 0.2) & (points[:, 0] < 0.45) & (np.abs(points[:, 1]) < 0.8)
    before = (points[:, 0] < -2.0) & (points[:, 0] > -3.0)
    assert np.all(colors[beside, 0] > 1.1 * colors[beside, 1])
    assert colors[before, 0].mean() < 0.2 * colors[beside, 0].mean()


def test_rendering_is_repeatable() -> None:
    pose = look_at(np.array([0.3, -1.0, 1.4]), np.array([0.0, 0.8, 0.0]))
    materials = {1: Material("planks", gloss=0.2)}
    meshes = [(1, floor()), (2, painted_box((0, 0.5, 0), (0.3, 0.8, 0.4), (90, 60, 40)))]
    first = SceneRenderer(meshes, soft_light=SoftLight(), materials=materials).render(CAMERA, pose)
    second = SceneRenderer(meshes, soft_light=SoftLight(), materials=materials).render(CAMERA, pose)
    assert np.array_equal(first.color, second.color) and np.array_equal(first.depth, second.depth)


def test_antialiasing_changes_edges_alone() -> None:
    meshes = [(1, painted_box((-0.6, 0, -0.6), (0.6, 0.1, 0.6), (250, 250, 250)))]
    pose = look_at(np.array([0.35, -2.0, 0.2]), np.zeros(3))
    rough = SceneRenderer(meshes, antialias=False).render(CAMERA, pose)
    smooth = SceneRenderer(meshes).render(CAMERA, pose)
    changed = (rough.color != smooth.color).any(axis=2)
    assert 0 < changed.sum() < 0.15 * changed.size
    assert np.array_equal(rough.depth, smooth.depth) and np.array_equal(rough.instance, smooth.instance)


def test_empty_scene_is_refused() -> None:
    with pytest.raises(BadInput):
        SceneRenderer([(1, trimesh.Trimesh(np.zeros((3, 3)), [[0, 1, 2]], process=False))])


def test_smooth_normals_keep_hard_edges() -> None:
    box = trimesh.creation.box()
    corners = np.asarray(box.vertices)[box.faces]
    assert np.allclose(corner_normals(corners, box.face_normals), box.face_normals[:, None], atol=1e-6)
    ball = trimesh.creation.icosphere(subdivisions=3)
    corners = np.asarray(ball.vertices)[ball.faces]
    smooth = corner_normals(corners, np.asarray(ball.face_normals))
    assert np.einsum("ijk,ijk->ij", smooth, corners).min() > 0.995


def test_srgb_round_trip() -> None:
    values = np.linspace(0, 1, 101)
    assert np.abs(linear_to_srgb(srgb_to_linear(values)) - values).max() < 1e-5
    assert srgb_to_linear(np.array([0.5]))[0] == pytest.approx(0.21404, abs=1e-4)


@pytest.mark.parametrize("pattern", PATTERNS)
def test_patterns_vary_around_one_and_fade_when_far(pattern: str) -> None:
    row = Material(pattern, period=0.14).row()
    points = np.random.default_rng(0).uniform(-2, 2, (2000, 3))
    near = np.array([pattern_factor(row, *p, 1e-4)[0] for p in points])
    assert near.min() > 0.0 and abs(near.mean() - 1.0) < 0.08
    if pattern == "plain":
        assert np.all(near == 1.0)
    else:
        far = np.array([pattern_factor(row, *p, 1.0)[0] for p in points])
        assert near.std() > 0.005 and far.std() < near.std()


def test_wood_colors() -> None:
    woods = np.array([(196, 154, 108), (92, 62, 44), (222, 190, 148)]) / 255
    others = np.array([(178, 80, 70), (240, 240, 236), (92, 110, 132), (40, 42, 46)]) / 255
    assert is_wood(woods).all() and not is_wood(others).any()
