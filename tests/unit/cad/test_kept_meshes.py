"""Things that keep their mesh have a place in the scene too: on what carries them, in nothing else."""

from __future__ import annotations

import numpy as np
import pytest
from scenewright.stages.cad.obstacles import obstacles_of
from scenewright.stages.kit.formats.mesh_files import read_mesh
from scenewright.stages.kit.geometry.convex_solids import penetration

from tests.panoptic_maps import box_mesh, floor_mesh
from tests.unit.cad.test_standing import solid

LARGE, SMALL, ON_SMALL = (
    ((0, 0, -0.02), (0.6, 0.6, 0.5)),
    ((0.57, 0.1, 0), (0.9, 0.4, 0.3)),
    ((0.7, 0.2, 0.3), (0.8, 0.3, 0.4)),
)
CLASSES = {1: "floor", 2: "hob", 3: "object", 4: "object"}


@pytest.fixture
def crowded(replace_objects):
    """A large thing that reaches 2 cm into the floor, a small one 3 cm into it, and one on the small one."""

    def made(**options):
        meshes = {2: box_mesh(*LARGE), 3: box_mesh(*SMALL), 4: box_mesh(*ON_SMALL)}
        return replace_objects({1: floor_mesh((-2, -2), (2, 2)), **meshes}, CLASSES, built_ins=False, **options)

    return made


def bounds(scene, name):
    return np.asarray(read_mesh(scene.path("meshes") / f"{name}.ply").bounds)


def test_the_smaller_gives_way_and_what_it_carries_goes_along(crowded):
    scene = crowded()
    raised = bounds(scene, "hob_2") - np.array(LARGE)
    assert raised == pytest.approx(np.array([[0, 0, 0.02]] * 2), abs=0.006), "its cover reaches a little lower"
    low, high = bounds(scene, "object_3")
    assert 0.6 - 0.003 < low[0] < 0.62 and low[2] == pytest.approx(0.0, abs=1e-6)
    moved = low - np.array(SMALL[0])
    assert bounds(scene, "object_4") == pytest.approx(np.array(ON_SMALL) + moved, abs=0.004)
    for name in ("object_3", "object_4"):
        box = scene.graph.node(name).box
        assert np.array(box.center) == pytest.approx(bounds(scene, name).mean(axis=0), abs=0.006)
    entry = next(entry for entry in scene.info.replacements if entry.node == "object_3")
    assert entry.decision == "mesh" and "; moved by " in entry.reason


@pytest.mark.parametrize("options", [{"method": "thesis"}, {"maximum_shift": 0.0}])
def test_nothing_goes_where_nothing_may(crowded, options):
    scene = crowded(**options)
    for name, expected in (("hob_2", LARGE), ("object_3", SMALL), ("object_4", ON_SMALL)):
        assert bounds(scene, name) == pytest.approx(np.array(expected), abs=1e-6)


def test_an_obstacle_has_the_shape_that_physics_gives_it(crowded):
    """Furniture ends at its support, however low the map goes; what stays is covered by boxes."""
    scene = crowded()
    shapes = obstacles_of(scene.graph, scene.path("layout"), scene.path("meshes"))
    low = min(vertices[:, 2].min() for vertices, _ in shapes["object_3"])
    assert low == pytest.approx(0.0, abs=1e-3)


def test_what_ends_in_a_point_has_no_foot_and_is_an_obstacle(replace_objects):
    """A map in which one vertex alone of a thing comes near the floor."""
    mesh = box_mesh((0, 0, 0.3), (0.6, 0.6, 0.9))
    mesh.vertices[0] = [0.3, 0.3, 0.0]
    scene = replace_objects({1: floor_mesh((-2, -2), (2, 2)), 2: mesh}, CLASSES | {2: "chair"}, built_ins=False)
    shapes = obstacles_of(scene.graph, scene.path("layout"), scene.path("meshes"))
    assert min(vertices[:, 2].min() for vertices, _ in shapes["chair_2"]) == pytest.approx(0.0, abs=0.01)


def test_shifts_add_up():
    one = solid(((0, 0, 0), (1, 1, 1)))
    twice = one.shifted(np.array([1.5, 0, 0])).shifted(np.array([0, 0, 0.5]))
    other = solid(((1.5, 0, 1.4), (2.5, 1, 2.4)))
    assert np.allclose(twice.low, [[1.5, 0, 0.5]])
    assert penetration(twice, other).depth == pytest.approx(0.1, abs=1e-3)
