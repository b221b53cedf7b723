"""The rooms of the house of others: what is put on a table stands on it, and its camera measures what it says."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from scenewright.schemas.interactive_scene import SceneBody
from scenewright.schemas.scene_parts import Box
from scenewright.stages.cad.alignment import turn_about_z
from scenewright.stages.kit.geometry.cameras import back_project
from scenewright.stages.kit.geometry.transforms import look_at

from benchmarks.experiments.house.furnishing import House, Recipe, Thing, Wish, furnish, placed_at, scene_of
from benchmarks.experiments.house.models import MODELS, Model, mesh_of
from benchmarks.experiments.house.placing import true_places
from benchmarks.experiments.house.recording import DISPARITY, disturbed, walk
from benchmarks.experiments.house.tiny_renderer import TinyRenderer
from benchmarks.experiments.surface.scenes import camera_of
from benchmarks.nested_furniture import nested
from tests.unit.cad.models import chair, write_library


def standing(size: tuple[float, float, float]) -> trimesh.Trimesh:
    box = trimesh.creation.box(size)
    box.apply_translation((0, 0, size[2] / 2))
    return box


MESHES = {"table": standing((1.2, 0.8, 0.7)), "chair": standing((0.4, 0.4, 0.9)), "cup": standing((0.1, 0.1, 0.12))}
RECIPE = Recipe(
    (4.0, 4.0),
    (4.5, 4.5),
    (
        Wish("table", "floor"),
        Wish("chair", "beside", "table"),
        Wish("chair", "wall"),
        *[Wish("cup", "on", "table")] * 4,
    ),
)


@pytest.fixture(scope="module")
def house() -> House:
    return furnish(RECIPE, MESHES, np.random.default_rng(3))


def test_things_stand_apart_on_what_carries_them(house: House) -> None:
    assert [thing.name for thing in house.things if thing.parent == "table_1"] == [f"cup_{k}" for k in (1, 2, 3, 4)]
    assert not house.unplaced
    table = house.things[0]
    for thing in house.things:
        low, high = thing.bounds
        assert low[2] == pytest.approx(table.bounds[1][2] if thing.parent == "table_1" else 0.0, abs=1e-6)
        assert (low[:2] > 0).all() and (high[:2] < house.size[:2]).all()
    for first in house.things:
        for second in house.things:
            if first is not second:
                assert (np.maximum(first.bounds[0], second.bounds[0]) >= np.minimum(*tops(first, second)) - 1e-6).any()
    again = furnish(RECIPE, MESHES, np.random.default_rng(3))
    assert all(
        np.array_equal(a.mesh.vertices, b.mesh.vertices) for a, b in zip(house.things, again.things, strict=True)
    )


def tops(first: Thing, second: Thing) -> tuple[np.ndarray, np.ndarray]:
    return first.bounds[1], second.bounds[1]


def test_the_rasteriser_shows_what_rays_hit() -> None:
    """Depth within a tenth of a millimetre a metre where both see the same mesh."""
    import open3d as o3d

    meshes = [trimesh.creation.box((4, 4, 0.1)), standing((0.8, 0.5, 0.6))]
    camera = camera_of(160)
    pose = look_at(np.array([1.2, -1.5, 1.4]), np.array([0.1, 0.0, 0.3]))
    with TinyRenderer(meshes, np.array([[0.5, 0.5, 0.5], [0.8, 0.2, 0.2]])) as renderer:
        _, depth, number = renderer.render(camera, pose)
    directions = back_project(np.ones(depth.shape, np.float32), camera) @ pose[:3, :3].T
    rays = np.concatenate([np.broadcast_to(pose[:3, 3], directions.shape), directions], axis=-1)
    hit = scene_of(meshes).cast_rays(o3d.core.Tensor.from_numpy(np.ascontiguousarray(rays, dtype=np.float32)))
    same = hit["geometry_ids"].numpy() == number
    assert same[number >= 0].mean() > 0.99
    assert np.quantile(np.abs(depth - hit["t_hit"].numpy())[same & (number >= 0)], 0.99) < 1e-4 * 3


def test_depth_is_quantised_in_disparity() -> None:
    camera = camera_of(160)
    exact = np.full((120, 160), 2.0, np.float32)
    depth = disturbed(exact, camera, np.random.default_rng(0))
    levels = DISPARITY / depth[depth > 0]
    assert np.abs(levels - np.round(levels)).max() < 1e-3
    assert (depth > 0).mean() > 0.99 and abs(depth[depth > 0].mean() - 2.0) < 0.003


def test_the_walk_keeps_off_things_at_head_height(house: House) -> None:
    poses = walk(house, 24, np.random.default_rng(1))
    assert len(poses) == 24
    for pose in poses:
        eye = pose[:3, 3]
        assert 1.5 < eye[2] < 1.7 and (eye[:2] > 0.25).all() and (eye[:2] < house.size[:2] - 0.25).all()
        for thing in house.things:
            low, high = thing.bounds
            inside = (eye[:2] > low[:2] - 0.2).all() and (eye[:2] < high[:2] + 0.2).all()
            assert not inside or thing.parent != "floor"


Size = tuple[float, float, float]


def body(name: str, center: Size, size: Size, *, movable: bool = False) -> SceneBody:
    pose = tuple(tuple(row) for row in np.eye(4).tolist())
    box = Box(center=center, size=size)
    return SceneBody(name=name, class_name=name, movable=movable, world_from_body=pose, box=box, mass=1.0)  # type: ignore[arg-type]


def test_furniture_of_which_more_than_half_lies_in_another_is_named() -> None:
    bed, desk = body("bed", (0, 0, 0.3), (2, 1.6, 0.6)), body("desk", (1.4, 0, 0.3), (1, 0.6, 0.6))
    bystanders = [body("cup", (0, 0, 0.3), (0.5, 0.5, 0.1), movable=True)]
    bystanders += [body(name, (0, 0, 0), (3, 3, 3)) for name in ("wall", "surroundings")]
    assert nested([bed, desk, *bystanders]) == ()
    assert nested([bed, desk, body("sofa", (0.3, 0, 0.3), (1, 0.9, 0.6)), *bystanders]) == ("sofa in bed",)


def test_the_true_place_of_a_thing_is_where_its_mesh_was_put(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whichever way the model was turned and scaled to furnish with."""
    model = Model("aws", "chair_a", "chair", turn=90.0, scale=1.5)
    monkeypatch.setitem(MODELS, "chair_a", model)
    library = write_library(tmp_path, {"chair_a": chair(0.4, 0.45, 0.9)})
    mesh = placed_at(mesh_of({"aws": library}, model), 0.3, (1.0, 2.0, 0.0))
    house = House(np.array([4.0, 4.0, 2.6]), [Thing("chair_a_1", "chair_a", mesh, "floor")])
    place = true_places(house, library, np.eye(4))["chair_a_1"]
    assert place.rotation == pytest.approx(turn_about_z(np.radians(90) + 0.3), abs=1e-6)
    assert place.center[2] == pytest.approx(np.mean(mesh.bounds[:, 2]), abs=1e-6)
    assert place.extents[2] == pytest.approx(np.ptp(mesh.bounds[:, 2]), abs=1e-6)
