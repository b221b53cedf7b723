"""Which edges agree, which are missing or wrong, by relation; and trees drawn in the order of another."""

from __future__ import annotations

import pytest
from scenewright.schemas.contact_graph import SCENE_NODE, ContactGraphFile, GraphNode
from scenewright.schemas.scene_parts import Relation
from scenewright.stages.kit.drawing.tree_layout import tree_layout
from scenewright.stages.kit.measurement.edge_agreement import edge_agreement, edge_errors

CLASSES = {"floor": "layout", "wall": "layout", "desk": "rigid", "shelf": "rigid", "cup": "rigid", "board": "rigid"}


def graph(edges: list[tuple[str, str, str]], suffix: str = "") -> ContactGraphFile:
    nodes = [GraphNode(id=SCENE_NODE, instance=0, class_name="scene", node_type="scene")]
    nodes += [
        GraphNode(id=name + suffix, instance=k, class_name=name, node_type=kind)
        for k, (name, kind) in enumerate(CLASSES.items(), start=1)
    ]

    def end(name: str) -> str:
        return name if name == SCENE_NODE else name + suffix

    links = [Relation(source=end(s), target=end(t), relation=r, confidence=1.0) for s, t, r in edges]
    return ContactGraphFile(nodes=tuple(nodes), links=tuple(links))


TRUE = [
    (SCENE_NODE, "floor", "supports"),
    (SCENE_NODE, "wall", "supports"),
    ("floor", "desk", "supports"),
    ("floor", "shelf", "supports"),
    ("shelf", "cup", "contains"),
    ("desk", "board", "supports"),
    ("wall", "board", "leans_on"),
]
FOUND = [*TRUE[:4], ("shelf", "cup", "supports"), ("desk", "board", "supports"), ("shelf", "board", "also_supports")]
PARTNER = {name: f"{name}_x" for name in CLASSES}


def test_support_counts_relations_and_leaves_the_root_out():
    agreement = edge_agreement(graph(TRUE), graph(FOUND, "_x"), PARTNER)
    support = agreement["support"]
    assert (support.true_count, support.predicted_count, support.agreed) == (4, 4, 3)
    assert support.f1 == pytest.approx(0.75)
    assert agreement["any_support"].f1 == 1.0  # whatever the relation is called, and with the root
    assert agreement["leans_on"].recall == 0.0 and agreement["leans_on"].precision is None
    assert agreement["also_supports"].precision == 0.0 and agreement["also_supports"].recall is None


def test_an_unknown_carrier_is_no_claim():
    """It costs recall, like an edge that is not there, and no precision."""
    unsure = [*TRUE[:5], (SCENE_NODE, "board", "unknown")]
    agreement = edge_agreement(graph(TRUE), graph(unsure, "_x"), PARTNER)
    for name in ("support", "any_support"):
        assert agreement[name].precision == 1.0 and agreement[name].true_count == agreement[name].agreed + 1
    missing, wrong = edge_errors(graph(TRUE), graph(unsure, "_x"), PARTNER)
    assert missing == {("desk", "board", "supports"), ("wall", "board", "leans_on")} and not wrong


def test_edges_that_are_missing_and_wrong():
    missing, wrong = edge_errors(graph(TRUE), graph(FOUND, "_x"), PARTNER)
    assert missing == {("shelf", "cup", "contains"), ("wall", "board", "leans_on")}
    assert wrong == {("shelf_x", "cup_x", "supports"), ("shelf_x", "board_x", "also_supports")}
    assert edge_errors(graph(TRUE), graph(TRUE, "_x"), PARTNER) == (frozenset(), frozenset())
    without_cup = {name: other for name, other in PARTNER.items() if name != "cup"}
    missing, wrong = edge_errors(graph(TRUE), graph(TRUE, "_x"), without_cup)
    assert missing == {("shelf", "cup", "contains")} and wrong == {("shelf_x", "cup_x", "contains")}
    assert edge_errors(graph(TRUE), graph(FOUND, "_x"), PARTNER, ignored=frozenset({"cup", "board"})) == (
        frozenset(),
        frozenset(),
    )


def test_a_tree_in_the_order_of_another():
    parents = {"root": None, "a": "root", "b": "root", "new": "root", "b1": "b", "b2": "b"}
    assert tree_layout(parents)["a"] == (1.0, 0.0)
    layout = tree_layout(parents, {"b": 0.0, "b2": 0.0, "b1": 1.0, "a": 2.0})
    assert [layout[name] for name in ("b2", "b1", "a", "new")] == [(2.0, 0.0), (2.0, 1.0), (1.0, 2.0), (1.0, 3.0)]
