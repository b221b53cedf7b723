"""A model that does not explain what was seen is none; what goes along with its carrier is."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scenewright.schemas.contact_graph import SCENE_NODE, ContactGraphFile, GraphNode
from scenewright.schemas.scene_parts import Relation
from scenewright.stages.cad.arranging import Arrangement
from scenewright.stages.cad.candidates import Shortlist
from scenewright.stages.cad.giving_back import given_back, unexplaining

from tests.panoptic_maps import box_mesh, write_map
from tests.unit.cad.test_cad_stage import placement_at

LOW, HIGH = (-0.1, -0.1, 0.0), (0.1, 0.1, 0.2)
LEAST = 0.5


@pytest.fixture
def scene(tmp_path, library):
    """A cube that was seen where its model stands, on another one. Returns judged(shift of it, shift of the other)."""
    panoptic_map = write_map(tmp_path / "map", {1: box_mesh(LOW, HIGH), 2: box_mesh(LOW, HIGH)}, {1: "box", 2: "box"})
    surface, placement = placement_at(library, "box_cube", (0, 0, 0), 0.0, 1.0)
    names = ("box_1", "box_2")
    root = GraphNode(id=SCENE_NODE, instance=0, class_name="scene", node_type="scene")
    mesh = "entities/{}.ply".format
    nodes = [GraphNode(id=f"box_{k}", instance=k, class_name="box", node_type="rigid", mesh=mesh(k)) for k in (1, 2)]
    links = (Relation(source="box_2", target="box_1", relation="supports", confidence=1.0),)
    graph = ContactGraphFile(nodes=(root, *nodes), links=links)

    def judged(shift, carrier=(0.0, 0.0, 0.0), least=LEAST):
        moved = [replace(placement, translation=np.array(each, dtype=float)) for each in (shift, carrier)]
        arranged = Arrangement(dict(zip(names, moved, strict=True)), {}, {})
        chosen = dict.fromkeys(names, placement)
        return unexplaining(graph, panoptic_map, arranged, chosen, {"box_cube": surface}, least, within=0.02)

    return judged


def test_what_explains_less_than_half_gives_its_mesh_back(scene):
    """A cube of 0.2 m that went 0.1 m along x explains its top, its bottom and two sides by half, and no other side."""
    why = scene((0.1, 0.0, 0.0))
    assert set(why) == {"box_1"} and "100 mm aside" in why["box_1"] and "would explain" in why["box_1"]
    assert not scene((0.01, 0.0, 0.0)), "no farther than surface is known"
    assert not scene((0.0, 0.0, 0.4)), "it was put onto what carries it"
    assert not scene((0.2, 0.0, 0.0), least=0.0), "the thesis keeps what it chose"


def test_what_goes_along_with_its_carrier_is_judged_by_its_own_way(scene):
    assert set(scene((0.3, 0.0, 0.0), carrier=(0.3, 0.0, 0.0))) == {"box_2"}


def test_the_next_model_takes_the_place_of_one_that_goes():
    def placed(model_id):
        return SimpleNamespace(shape=SimpleNamespace(model=SimpleNamespace(id=model_id)))

    entry = Shortlist(None, tuple(map(placed, ("chair_1", "chair_2", "chair_1"))), {}, "")
    second = given_back(entry, "chair_1", "chair_1 would explain 30%")
    assert [placement.shape.model.id for placement in second.placements] == ["chair_2"]
    assert second.reason == "the next, as chair_1 would explain 30%"
    last = given_back(second, "chair_2", "chair_2 would explain 40%")
    assert last.placements == () and last.reason == "no model: chair_2 would explain 40%"
