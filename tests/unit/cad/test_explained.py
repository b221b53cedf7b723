"""How much of what was seen a scene explains, by closed forms: boxes, and models half as long."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from scenewright.schemas.cad_scene import UNEXPLAINED, Explained
from scenewright.schemas.scene_parts import SurfacePlane
from scenewright.stages.cad.carcasses import patches_of
from scenewright.stages.cad.explained import (
    depth_spread,
    distances,
    explained_by_mesh,
    explained_by_model,
    shares_of,
    unexplained,
)
from scenewright.stages.kit.formats.entity_meshes import EntityMesh, load_entity_mesh

from tests.panoptic_maps import box_mesh, floor_mesh, seen_surface, table_mesh
from tests.unit.cad.test_cad_stage import placement_at

EYES = [(-1.2, -1.5, 1.6), (1.2, -1.5, 1.6), (0.0, 1.6, 1.5)]


def mesh_of(*boxes, edge=0.02) -> EntityMesh:
    mesh = trimesh.util.concatenate([box_mesh(*box) for box in boxes])
    vertices, faces = trimesh.remesh.subdivide_to_size(mesh.vertices, mesh.faces, edge)
    return EntityMesh(vertices, faces, np.full((len(vertices), 3), 90, np.uint8))


def test_a_cube_on_a_cube_is_explained_to_where_the_model_ends(library):
    """The surface of 0.2 x 0.2 x 0.4 m has 0.4 m²; the model's side ends half way up, and its top is 0.2 m too low."""
    surface, placement = placement_at(library, "box_cube", (0, 0, 0), 0.0, 1.0)
    seen = patches_of(mesh_of(((-0.1, -0.1, 0.0), (0.1, 0.1, 0.4)), edge=0.01))
    told = explained_by_model(surface, placement, seen, 0.02)
    assert told.area == pytest.approx(0.4, rel=1e-3) and told.by_mesh == 0.0
    assert told.by_model == pytest.approx((4 * 0.2 * 0.22 + 0.04) / 0.4, abs=0.02)


def test_a_mesh_explains_itself_unless_it_went_too_far():
    mesh = mesh_of(((0, 0, 0), (1, 1, 0.1)))
    seen = patches_of(mesh)
    assert explained_by_mesh(seen, mesh, np.array([0.01, 0, 0]), 0.02).by_mesh == 1.0
    moved = explained_by_mesh(seen, mesh, np.array([0.0, 0, 0.05]), 0.02)
    sides_overlap, rim_of_top = 4 * 0.07, 1 - 0.96**2
    assert moved.by_model == 0.0 and moved.by_mesh == pytest.approx((sides_overlap + rim_of_top) / 2.4, abs=0.01)


def test_depth_spreads_about_planes_as_it_was_spread():
    mesh = mesh_of(((0, 0, 0), (1, 1, 0.1)), edge=0.05)
    top = mesh.vertices[:, 2] > 0.09
    lattice = np.random.default_rng(1).normal(0, 0.006, len(mesh.vertices)) * top
    patches = patches_of(EntityMesh(mesh.vertices + np.outer(lattice, [0, 0, 1]), mesh.faces, mesh.colors))
    plane = SurfacePlane(normal=(0, 0, 1), offset=-0.1, area=1.0, center=(0.5, 0.5, 0.1))
    assert depth_spread([(plane, patches)]) == pytest.approx(0.006 / np.sqrt(3), rel=0.25), "a middle is of three"
    assert depth_spread([]) == 0.0
    far = plane.model_copy(update={"offset": -5.0})
    assert depth_spread([(far, patches)]) == 0.0


def test_what_nothing_lies_near_to_is_the_rest():
    mesh = mesh_of(((0, 0, 0), (0.5, 0.5, 0.5)), ((2, 0, 0), (2.2, 0.2, 0.2)))
    stands = box_mesh((0, 0, 0), (0.5, 0.5, 0.5))
    rest = unexplained(mesh, [(np.asarray(stands.vertices), np.asarray(stands.faces))], 0.02)
    assert trimesh.triangles.area(rest.vertices[rest.faces]).sum() == pytest.approx(6 * 0.04)
    assert rest.vertices[:, 0].min() == pytest.approx(2.0)
    everything = [(mesh.vertices, mesh.faces)]
    assert unexplained(mesh, everything, 0.02) is None
    assert np.isinf(distances(mesh.vertices, [])).all()


def test_shares_are_by_area():
    things = {"a": Explained(area=3.0, by_model=1.0, by_mesh=0.0), "b": Explained(area=1.0, by_model=0.0, by_mesh=1.0)}
    assert shares_of(things) == {"explained_by_model": 0.75, "explained_by_mesh": 0.25}
    assert shares_of({}) == {"explained_by_model": 0.0, "explained_by_mesh": 0.0}


def test_a_scene_says_what_it_explains_and_what_not(replace_objects):
    """A table has its model, a lamp keeps its mesh, and on the table's mesh there is a flap that the model lacks."""
    flap = box_mesh((0.5, -0.15, 0.76), (0.52, 0.15, 0.95))
    meshes = {
        1: floor_mesh(),
        2: trimesh.util.concatenate([table_mesh(size=(1.4, 0.7, 0.74)), flap]),
        3: box_mesh((-0.9, 0.7, 0), (-0.8, 0.8, 0.3)),
    }
    scene = replace_objects(seen_surface(meshes, EYES), {1: "floor", 2: "table", 3: "lamp"}, built_ins=False)
    told = {entry.node: entry.explained for entry in scene.info.replacements}
    assert told["floor_1"] is None
    assert told["lamp_3"].by_mesh == 1.0 and told["lamp_3"].by_model == 0.0
    assert 0.6 < told["table_2"].by_model < 0.98 and told["table_2"].by_mesh == 0.0
    assert 0.02 <= scene.info.explained_within < 0.03
    rest = load_entity_mesh(scene.path(UNEXPLAINED))
    area = trimesh.triangles.area(rest.vertices[rest.faces]).sum()
    assert area == pytest.approx(told["table_2"].area * (1 - told["table_2"].by_model), abs=0.02)
    assert scene.summary["unexplained_m2"] == round(area, 2)
    assert rest.vertices[:, 2].max() > 0.9, "the flap is of it"
