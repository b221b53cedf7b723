"""Furniture in what stays is held; of free furniture in each other the heaviest, and with it the rest."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scenewright.schemas.contact_graph import SCENE_NODE, ContactGraphFile, GraphNode
from scenewright.schemas.scene_parts import Box, Relation
from scenewright.stages.kit.geometry.layout_slabs import box_under
from scenewright.stages.urdf.scene_penetration import Overlap
from scenewright.stages.urdf.wedged import held


def overlap(first: str, second: str) -> Overlap:
    return Overlap(first, second, first, second, 0.05)


def test_what_lies_in_a_wall_stays_and_what_lies_in_that() -> None:
    free = {"chair": 5.0, "table": 20.0, "stool": 3.0}
    found = held(free, {"cup"}, [overlap("wall", "table"), overlap("chair", "table"), overlap("cup", "stool")])
    assert found == {"table": "wall", "chair": "table"}


def test_of_two_free_things_in_each_other_both_stay() -> None:
    assert held({"chair": 5.0, "table": 20.0}, (), [overlap("chair", "table")]) == {"table": "chair", "chair": "table"}


@given(
    st.lists(st.tuples(st.sampled_from("abcdef"), st.sampled_from("abcdefWX")), max_size=12), st.permutations("abcdef")
)
def test_no_free_furniture_is_left_in_anything(pairs: list[tuple[str, str]], order: list[str]) -> None:
    free = {name: 1.0 + k for k, name in enumerate(order)}
    overlaps = [overlap(a, b) for a, b in pairs if a != b]
    found = held(free, (), overlaps)
    loose = set(free) - set(found)
    assert not any({o.first, o.second} & loose for o in overlaps)
    assert all(any({name, other} == {o.first, o.second} for o in overlaps) for name, other in found.items())


@given(st.floats(-3, 3), st.floats(-3, 3), st.floats(0, 3))
def test_the_floor_goes_on_under_what_stands_beyond_its_edge(x: float, y: float, yaw: float) -> None:
    turned = (0.0, 0.0, float(np.sin(yaw / 2)), float(np.cos(yaw / 2)))
    floor = Box(center=(0, 0, 0), size=(2, 1, 0.02), orientation=turned)
    table = Box(center=(x, y, 0.4), size=(1, 0.6, 0.8))
    nodes = (
        GraphNode(id=SCENE_NODE, instance=0, class_name=SCENE_NODE, node_type="scene"),
        GraphNode(id="floor_1", instance=1, class_name="floor", node_type="layout", box=floor),
        GraphNode(id="table_2", instance=2, class_name="table", node_type="rigid", box=table),
    )
    link = Relation(source="floor_1", target="table_2", relation="supports", confidence=1.0)
    wide = box_under("floor_1", floor, ContactGraphFile(nodes=nodes, links=(link,)))
    cosine, sine = np.cos(yaw), np.sin(yaw)
    axes = np.array([[cosine, -sine], [sine, cosine]])
    for own in (floor, table):
        own_axes = axes if own is floor else np.eye(2)
        for a, b in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
            corner = np.array(own.center[:2]) + own_axes @ (0.5 * np.array([a, b]) * own.size[:2])
            inside = np.abs(axes.T @ (corner - np.array(wide.center[:2])))
            assert (inside <= 0.5 * np.array(wide.size[:2]) + 1e-9).all()
    assert wide.size[2] == floor.size[2] and wide.center[2] == floor.center[2]
