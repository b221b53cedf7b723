"""Models that are made as large as what was seen, longer along one axis than along another."""

from __future__ import annotations

import numpy as np
import pytest
from scenewright.schemas.cad_library import CadLibrary
from scenewright.stages.cad.model_surfaces import load_surface
from scenewright.stages.cad.parameters import CadParameters
from scenewright.stages.cad.stretching import (
    anisotropy,
    factors_for,
    source_of,
    stretched,
    stretched_surface,
    write_stretched,
)
from scenewright.stages.kit.formats.cad_models import model_folder, posed_mesh, read_model
from scenewright.stages.kit.formats.urdf_check import require_sound

from tests.panoptic_maps import floor_mesh, seen_surface
from tests.unit.cad.test_cad_stage import EYES, decisions, mesh_of

FACTORS = np.array([1.3, 0.8, 1.1])


def longer_table(library: CadLibrary, factors: np.ndarray):
    """The mesh of a table that the library has in another size."""
    mesh = mesh_of(library, "table_long", (0.0, 0.0, 0.0))
    mesh.vertices = np.asarray(mesh.vertices) * factors
    return mesh


def test_a_table_of_no_size_that_there_is_becomes_a_stretched_one(library, replace_objects):
    room = seen_surface({1: floor_mesh((-1.6, -1.3), (1.6, 1.6)), 2: longer_table(library, FACTORS)}, EYES, noise=0.003)
    found = decisions(replace_objects(room, {1: "floor", 2: "table"}))["table_2"]
    assert found.chosen.model_id == "table_long_for_table_2" and "table_long stretched by" in found.reason
    assert found.chosen.alignment_error < 0.01 and found.chosen.library_model == "table_long"
    whole = decisions(replace_objects(room, {1: "floor", 2: "table"}, "one_scale", stretched=False))["table_2"]
    assert whole.chosen is None or whole.chosen.alignment_error > 2 * found.chosen.alignment_error


def test_the_scene_holds_the_folder_of_the_stretched_model(library, replace_objects):
    room = seen_surface({1: floor_mesh((-1.6, -1.3), (1.6, 1.6)), 2: longer_table(library, FACTORS)}, EYES, noise=0.003)
    scene = replace_objects(room, {1: "floor", 2: "table"})
    folder = scene.path("models") / "table_long_for_table_2"
    model = read_model(folder)
    require_sound(folder / "model.urdf")
    bounds = posed_mesh(folder, model, {}).bounds
    state = model.states[0]
    assert np.allclose(bounds, [state.box_minimum, state.box_maximum], atol=1e-6)
    assert np.abs((bounds[1] - bounds[0]) / (FACTORS * [1.4, 0.7, 0.74]) - 1).max() < 0.03


def test_what_a_model_is_as_large_as_stays_whole(library, replace_objects):
    room = seen_surface({1: floor_mesh((-1.6, -1.3), (1.6, 1.6)), 2: longer_table(library, np.ones(3))}, EYES)
    assert decisions(replace_objects(room, {1: "floor", 2: "table"}))["table_2"].chosen.model_id == "table_long"


def test_planes_doors_and_mass_are_those_of_the_stretched_meshes(library, tmp_path):
    source = model_folder(library, "fridge_tall")
    model = read_model(source)
    longer = stretched(model, FACTORS, "longer")
    write_stretched(longer, source, tmp_path / "longer")
    surface, written = (
        stretched_surface(longer, source),
        load_surface(tmp_path / "longer", read_model(tmp_path / "longer")),
    )
    assert np.allclose(surface.hull_points({}), written.hull_points({}), atol=1e-6)
    for plane in longer.states[0].planes:
        probe = np.array([plane.center])
        assert surface.closest(probe, {}).distance[0] < 0.002, "planes lie on the surface"
        edges = np.diff(np.asarray(plane.corners)[:3], axis=0)
        assert np.abs(edges @ np.asarray(plane.normal)).max() < 1e-9
    (door,) = longer.joints
    assert door.upper == model.joints[0].upper, "an angle"
    assert np.allclose(door.origin, FACTORS * model.joints[0].origin)
    assert longer.mass == pytest.approx(model.mass * FACTORS.prod())
    assert all(not any(state.joints.values()) for state in longer.states), "an open door is no stretched open door"
    assert source_of(longer) == "fridge_tall" and source_of(model) is None


def test_factors_are_those_of_the_turn_that_stretches_less(library):
    model = read_model(model_folder(library, "table_long"))
    own = np.array([1.4, 0.7, 0.74])
    found = factors_for(model, (own * 1.2)[[1, 0, 2]], CadParameters())
    assert found == pytest.approx([1.2, 1.2, 1.2], rel=1e-3)
    assert anisotropy(stretched(model, found, "same")) == pytest.approx(0.0, abs=1e-3)
    assert factors_for(model, own * [2.0, 1.0, 1.0], CadParameters()) is None, "more than a scale may be"
    assert factors_for(model, own * [1.0, 0.0, 1.0], CadParameters()) is None, "a box without depth"


def test_a_joint_that_would_bend_is_not_stretched(library):
    model = read_model(model_folder(library, "fridge_tall"))
    skewed = model.joints[0].model_copy(update={"axis": (0.6, 0.0, 0.8)})
    size = np.subtract(model.states[0].box_maximum, model.states[0].box_minimum)
    assert factors_for(model, size, CadParameters()) is not None
    assert factors_for(model.model_copy(update={"joints": (skewed,)}), size, CadParameters()) is None
