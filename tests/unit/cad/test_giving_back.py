"""A model that has to go too far from what was seen is none; what goes along with its carrier is."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scenewright.schemas.contact_graph import SCENE_NODE, ContactGraphFile, GraphNode
from scenewright.schemas.scene_parts import Relation
from scenewright.stages.cad.arranging import Arrangement
from scenewright.stages.cad.giving_back import moved_off

from tests.panoptic_maps import box_mesh, write_map
from tests.unit.cad.test_cad_stage import placement_at

LOW, HIGH = (-0.1, -0.1, 0.0), (0.1, 0.1, 0.2)
LIMIT = 0.08


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

    def judged(shift, carrier=(0.0, 0.0, 0.0), limit=LIMIT):
        moved = [replace(placement, translation=np.array(each, dtype=float)) for each in (shift, carrier)]
        arranged = Arrangement(dict(zip(names, moved, strict=True)), {}, {})
        chosen = dict.fromkeys(names, placement)
        return moved_off(graph, panoptic_map, arranged, chosen, {"box_cube": surface}, limit)

    return judged


def test_what_is_moved_by_more_than_a_candidate_may_err_gives_its_mesh_back(scene):
    """Corners of a cube that went by 0.2 m along x lie 0 or 0.2 m off: 0.141 m root mean square."""
    why = scene((0.2, 0.0, 0.0))
    assert set(why) == {"box_1"} and "200 mm aside" in why["box_1"] and "141 mm off" in why["box_1"]
    assert not scene((0.1, 0.0, 0.0)), "0.071 m off"
    assert not scene((0.0, 0.0, 0.4)), "it was put onto what carries it"
    assert not scene((0.2, 0.0, 0.0), limit=math.inf), "the thesis keeps what it chose"


def test_what_goes_along_with_its_carrier_is_judged_by_its_own_way(scene):
    assert set(scene((0.3, 0.0, 0.0), carrier=(0.3, 0.0, 0.0))) == {"box_2"}
