"""In which order a room is arranged: what is large stands, and what is small gives way to it, mesh or model."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from scenewright.schemas.contact_graph import SCENE_NODE, ContactGraphFile, GraphNode
from scenewright.schemas.scene_parts import Box, Relation
from scenewright.stages.cad.arranging import Placed, arrange
from scenewright.stages.cad.conflicts import placed_solid
from scenewright.stages.kit.geometry.convex_solids import convex_solid

from tests.unit.cad.test_cad_stage import placement_at


class Notes:
    """A placer that leaves everything where it is and notes what stood there already."""

    def __init__(self, surface):
        self.surface, self.said = surface, []

    def place(self, placement, seat, others):
        self.said.append((seat.name, len(others)))
        return Placed(placement, None, placed_solid(placement, self.surface))

    def shift(self, box, seat, solid, others):
        self.said.append((seat.name, len(others)))
        return np.zeros(3)


@pytest.mark.parametrize(("size", "order"), [(0.2, ["model", "mesh"]), (2.0, ["mesh", "model"])])
def test_what_is_larger_stands_first(library, size, order):
    surface, placement = placement_at(library, "box_cube", (0, 0, 0), 0.0, 4.0)  # 0.8 m
    root = GraphNode(id=SCENE_NODE, instance=0, class_name="scene", node_type="scene")
    box = Box(center=(0.0, 0.0, size / 2), orientation=(0.0, 0.0, 0.0, 1.0), size=(size, size, size))
    nodes = [
        GraphNode(id=name, instance=k, class_name="box", node_type="rigid", box=box) for k, name in enumerate(order, 1)
    ]
    links = tuple(
        Relation(source=SCENE_NODE, target=name, relation="supports", confidence=1.0) for name in ("mesh", "model")
    )
    graph = ContactGraphFile(nodes=(root, *nodes), links=links)
    cube = trimesh.creation.box(extents=[size] * 3)
    obstacles = {"mesh": convex_solid([(np.asarray(cube.vertices), np.asarray(cube.faces))])}
    notes = Notes(surface)
    arrange(graph, {"model": placement}, notes, obstacles, levels={}, area_threshold=0.1)
    assert notes.said == [(order[0], 0), (order[1], 1)]
