"""What a script knows of a recording, and which supports it takes for wrong."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
from scenewright.stages.truth.support_annotation import SupportAnnotation

from benchmarks.experiments.edits.effort import Told, supports_right
from benchmarks.experiments.edits_effort import told_by


def annotated() -> SupportAnnotation:
    def box(z: float) -> dict:
        return {"box": {"center": [0, 0, z], "size": [1, 1, 0.4]}}

    return SupportAnnotation.model_validate(
        {
            "format": "scenewright-supports",
            "version": 1,
            "scene": "a room",
            "made": {"by": "a test", "how": "by hand", "date": "2026-11-26"},
            "nodes": [
                {"name": "floor", "class": "floor", "find": box(0.0)},
                {"name": "desk", "class": "desk", "find": box(0.5)},
                {"name": "cup", "class": "cup", "find": box(1.0)},
                {"name": "bag", "class": "bag", "find": box(2.0), "optional": True},
            ],
            "relations": [
                {"child": "desk", "parent": "floor"},
                {"child": "cup", "parent": "desk", "uncertain": ["bag"]},
                {"child": "bag", "parent": "floor"},
            ],
        }
    )


def told() -> Told:
    return told_by(annotated(), np.array([[0, 0, 0.05], [0, 0, 0.5], [0, 0, 1.0], [5, 0, 1.0]]))


def test_a_recording_is_told_by_its_annotation() -> None:
    known = told()
    assert known.owner.tolist() == [1, 2, 3, 0]
    assert [node.wanted for node in known.nodes.values()] == [False, True, True, False], "no layout, nothing optional"
    assert known.parent["cup"] == ("desk", "supports")


def graph(carrier_of_cup: str | None):
    nodes = [SimpleNamespace(instance=k, id=f"n{k}") for k in (1, 2, 3, 4)]
    carriers = {"n2": "n1", "n3": carrier_of_cup}

    def parent_link(node: str):
        return SimpleNamespace(source=carriers[node]) if carriers.get(node) else None

    return SimpleNamespace(nodes=nodes, parent_link=parent_link)


def test_a_support_that_may_be_is_not_wrong() -> None:
    found = {"floor": 1, "desk": 2, "cup": 3, "bag": 4}
    assert supports_right(graph("n2"), found, told()) == ([], 2)
    assert supports_right(graph("n4"), found, told()) == ([], 2), "the annotator could not tell"
    assert supports_right(graph("n1"), found, told()) == (["cup"], 2)
    assert supports_right(graph(None), found, told()) == (["cup"], 2)
    missing = {name: k for name, k in found.items() if name != "desk"}
    assert supports_right(graph("n2"), missing, told()) == (["desk", "cup"], 2), "what carries it was not found"
