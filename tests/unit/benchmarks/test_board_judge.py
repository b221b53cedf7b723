"""The board's judge: which things ought to be free, and what stays where it was put."""

from __future__ import annotations

from types import SimpleNamespace

import pytest
from scenewright.schemas.contact_graph import ContactGraphFile, GraphNode
from scenewright.schemas.scene_parts import Relation
from scenewright.stages.urdf.motions import BodyMotion
from scenewright.stages.urdf.scene_penetration import Overlap
from scenewright.stages.urdf.settle_report import SettleReport

from benchmarks.board import judge
from benchmarks.board.judge import loose_by_truth, loose_things, of_physics


def graph(*things: tuple[str, int]) -> ContactGraphFile:
    """Return a graph of things that all stand on the floor."""
    scene = GraphNode(id="scene", instance=0, class_name="scene", node_type="scene")
    floor = GraphNode(id="floor_9", instance=9, class_name="floor", node_type="layout")
    named = [GraphNode(id=f"{c}_{i}", instance=i, class_name=c, node_type="rigid") for c, i in things]
    links = [Relation(source="floor_9", target=node.id, relation="supports", confidence=1.0) for node in named]
    return ContactGraphFile(nodes=(scene, floor, *named), links=tuple(links))


def room(*things: tuple[str, int]) -> SimpleNamespace:
    true = graph(*things)
    names = [SimpleNamespace(name=f"{c}_{i}") for c, i in things]
    return SimpleNamespace(graph=true, evaluated=lambda things_only: names)


def test_what_is_truly_built_in_need_not_be_free_and_what_is_not_has_to_whatever_it_is_called() -> None:
    true = room(("cabinet", 1), ("chair", 2))
    found = graph(("object", 5), ("fridge", 6), ("object", 7), ("shelf", 8))
    overlaps = {(1, 5): 0.8, (2, 5): 0.3, (2, 6): 0.5, (1, 8): 0.1, (9, 7): 0.9}
    assert loose_things(found) == {"object_5", "object_7"}
    assert loose_by_truth(found, true, overlaps) == {"fridge_6": "chair_2", "object_7": None}


def test_what_has_to_be_free_and_is_held_is_not_at_rest(monkeypatch: pytest.MonkeyPatch) -> None:
    stays, leaves = BodyMotion("cup_1", 0.0, 0.0, False), BodyMotion("chair_2", 0.2, 0.0, False)
    report = SettleReport(3.0, (stays, leaves), (), (Overlap("desk_3", "cup_1", "desk_3", "cup_1", 0.009),))
    monkeypatch.setattr(judge, "settle_report", lambda scene: report)
    monkeypatch.setattr(judge, "mujoco_motions", lambda scene, seconds: (stays, BodyMotion("chair_2", 0, 0, False)))
    found = graph(("cup", 1), ("chair", 2), ("book", 4))
    true = room(("cup", 11), ("chair", 12), ("book", 14), ("vase", 15))
    overlaps = {(11, 1): 0.9, (12, 2): 0.9, (14, 4): 0.9}
    figures = of_physics(SimpleNamespace(scene="nowhere"), true, found, overlaps)
    assert (figures["loose_found"], figures["loose_true"], figures["at_rest_count"]) == (3, 4, 1)
    assert figures["at_rest_of_found"] == pytest.approx(1 / 3, abs=1e-5) and figures["at_rest_of_true"] == 0.25
    assert figures["held_of_found"] == figures["colliding_of_found"] == pytest.approx(1 / 3, abs=1e-5)
    assert figures["settled"] == 0


def test_a_thing_that_came_in_two_pieces_is_at_rest_once(monkeypatch: pytest.MonkeyPatch) -> None:
    bodies = (BodyMotion("cup_1", 0.0, 0.0, False), BodyMotion("cup_2", 0.0, 0.0, False))
    monkeypatch.setattr(judge, "settle_report", lambda scene: SettleReport(3.0, bodies, (), ()))
    monkeypatch.setattr(judge, "mujoco_motions", lambda scene, seconds: bodies)
    true, overlaps = room(("cup", 11), ("vase", 12)), {(11, 1): 0.5, (11, 2): 0.4}
    figures = of_physics(SimpleNamespace(scene="nowhere"), true, graph(("cup", 1), ("cup", 2)), overlaps)
    assert figures["at_rest_of_true"] == 0.5 and figures["at_rest_of_found"] == 1.0
