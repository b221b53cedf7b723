"""Words about two things, answered by the contact graph."""

from __future__ import annotations

from scenewright.schemas.contact_graph import ContactGraphFile, GraphNode
from scenewright.schemas.scene_parts import Relation
from scenewright.stages.kit.open_words.relations import related


def test_the_graph_says_which_pairs() -> None:
    names = {"scene": 0, "floor": 1, "table": 2, "tray": 3, "cup": 4, "fridge": 5, "bottle": 6}
    nodes = tuple(
        GraphNode(id=name, instance=number, class_name=name, node_type="rigid" if number else "scene")
        for name, number in names.items()
    )
    links = [("scene", "floor", "supports"), ("floor", "table", "supports"), ("table", "tray", "supports")]
    links += [("tray", "cup", "supports"), ("floor", "fridge", "supports"), ("fridge", "bottle", "contains")]
    links += [("table", "fridge", "proximal")]
    graph = ContactGraphFile(
        nodes=nodes, links=tuple(Relation(source=a, target=b, relation=r, confidence=1.0) for a, b, r in links)
    )
    assert {(4, 3), (4, 2), (3, 2)} <= related(graph, "on") and (2, 4) not in related(graph, "on")
    assert related(graph, "in") == {(6, 5), (6, 1)} or (6, 5) in related(graph, "in")
    assert (4, 3) not in related(graph, "in") and (2, 4) in related(graph, "under")
    assert {(2, 5), (5, 2)} <= related(graph, "beside") and (4, 6) not in related(graph, "beside")
