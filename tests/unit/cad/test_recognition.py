"""Names that shape gives where masks gave none, or one that cannot be."""

from __future__ import annotations

import pytest
from scenewright.schemas.edits import AppliedEdit, AppliedEditsFile
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.stages.cad.parameters import CadParameters
from scenewright.stages.cad.stage import run as run_cad
from scenewright.stages.graph.parameters import GraphParameters
from scenewright.stages.graph.stage import run as run_graph

from tests.panoptic_maps import floor_mesh, seen_surface, write_map
from tests.unit.cad.conftest import context
from tests.unit.cad.test_cad_stage import EYES, decisions, mesh_of


@pytest.fixture(scope="module")
def room(library):
    meshes = {
        1: floor_mesh((-1.4, -1.3), (1.6, 1.6)),
        2: mesh_of(library, "table_long", (-0.5, 0.6, 0), 0.2),
        3: mesh_of(library, "chair_low", (-0.4, -0.5, 0), 2.5, 1.05),
        4: mesh_of(library, "fridge_tall", (1.0, 0.9, 0)),
    }
    return seen_surface(meshes, EYES, noise=0.003)


def named(scene):
    """Node -> class in the scene, and model."""
    found = decisions(scene)
    return {
        node.id: (node.class_name, found[node.id].chosen.model_id if found[node.id].chosen else None)
        for node in scene.graph.nodes
        if node.id in found and node.class_name != "floor"
    }


def test_shape_names_what_masks_did_not(room, replace_objects):
    scene = replace_objects(room, {1: "floor", 2: "object", 3: "bottle", 4: "fridge"})
    assert named(scene) == {
        "object_2": ("table", "table_long"),
        "bottle_3": ("chair", "chair_low"),
        "fridge_4": ("fridge", "fridge_tall"),
    }
    reasons = {name: entry.reason for name, entry in decisions(scene).items()}
    assert reasons["object_2"].startswith("by its shape a table: ") and "chair" in reasons["bottle_3"]
    assert not reasons["fridge_4"], "its name was right"
    assert scene.graph.node("object_2").node_type == "rigid"


def test_only_where_it_tells(room, replace_objects):
    classes = {1: "floor", 2: "object", 3: "bottle", 4: "fridge"}
    left = {"object_2": ("object", None), "bottle_3": ("bottle", None), "fridge_4": ("fridge", "fridge_tall")}
    never = {"recognition_error": 0.0, "built_ins": False}
    assert named(replace_objects(room, classes, "never", **never)) == left
    decisive = {"recognition_margin": 1.0, "built_ins": False}
    kept = named(replace_objects(room, {**classes, 4: "object"}, "ambiguous", **decisive))
    assert kept["object_2"] == ("table", "table_long"), "nothing else fits at all"


def test_what_people_said_stands(room, library, tmp_path):
    panoptic_map = write_map(tmp_path / "map", room, {1: "floor", 2: "object", 3: "bottle", 4: "fridge"})
    said = AppliedEdit(number=1, what="rename", status="applied", things=("bottle_3",))
    AppliedEditsFile(edits=(said,)).write(panoptic_map.path("edits.json"))
    panoptic_map = PanopticMap(panoptic_map.root)
    graph = run_graph(panoptic_map, parameters=GraphParameters(), context=context(tmp_path / "graph"))
    options = CadParameters(built_ins=False)
    scene = run_cad(graph, panoptic_map, library, parameters=options, context=context(tmp_path / "cad"))
    assert named(scene)["bottle_3"] == ("bottle", None) and named(scene)["object_2"][0] == "table"


@pytest.mark.slow
def test_the_thesis_believes_masks(room, replace_objects):
    scene = replace_objects(room, {1: "floor", 2: "object", 3: "bottle", 4: "fridge"}, method="thesis")
    assert named(scene)["object_2"] == ("object", None)
    assert named(scene)["bottle_3"] == ("bottle", None)
