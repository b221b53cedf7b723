"""Parents against an annotation with several carriers and doubts: counts by hand."""

from __future__ import annotations

import json

import numpy as np
import pytest
from scenewright.schemas.contact_graph import ContactGraphFile, GraphNode
from scenewright.schemas.scene_parts import Camera, Relation
from scenewright.stages.kit.geometry.cameras import back_project
from scenewright.stages.kit.geometry.transforms import apply, look_at
from scenewright.stages.truth.support_annotation import SupportAnnotation

from benchmarks.experiments.mosd_supports.support_score import f1, levels_of, score_graph
from benchmarks.experiments.mosd_supports.tabletop_maps import upright_pose

NAMES = ("table", "a", "b", "c", "d")
TOLD = SupportAnnotation.model_validate_json(
    json.dumps(
        {
            "format": "scenewright-supports",
            "version": 1,
            "scene": "by hand",
            "made": {"by": "a test", "how": "by hand", "date": "2026-11-22"},
            "nodes": [
                {"name": name, "class": "table" if name == "table" else "object", "find": {"labels": [k]}}
                for k, name in enumerate(NAMES, 1)
            ],
            "relations": [
                {"child": "table", "parent": "scene"},
                {"child": "a", "parent": "table"},
                {"child": "b", "parent": "a"},
                {"child": "c", "parent": "a", "also": ["b"], "leans_on": ["d"]},
                {"child": "d", "parent": "table", "uncertain": ["a"]},
            ],
        }
    )
)


def graph(parents: dict[str, str], beside: tuple[tuple[str, str, str], ...] = (), table: bool = True):
    """A predicted graph of the things of NAMES; `x` is a thing that nobody annotated."""
    names = [*(NAMES if table else NAMES[1:]), "x"] if "x" in parents else list(NAMES if table else NAMES[1:])
    nodes = [GraphNode(id="scene", instance=0, class_name="scene", node_type="scene")]
    nodes.append(GraphNode(id="floor_9", instance=9, class_name="floor", node_type="layout"))
    nodes += [GraphNode(id=n, instance=10 + ord(n[0]), class_name="object", node_type="rigid") for n in names]
    links = [Relation(source="scene", target="floor_9", relation="supports", confidence=1.0)]
    links += [Relation(source=p, target=c, relation="supports", confidence=1.0) for c, p in parents.items()]
    links += [Relation(source=s, target=t, relation=r, confidence=1.0) for r, s, t in beside]  # type: ignore[arg-type]
    return ContactGraphFile(nodes=tuple(nodes), links=tuple(links))


NODE_OF = {10 + ord(name[0]): name for name in NAMES}
RIGHT = {"table": "scene", "a": "table", "b": "a", "c": "a", "d": "table"}


def test_levels_count_the_things_between():
    assert levels_of(TOLD, "table") == {"a": 1, "b": 2, "c": 3, "d": 1}


def test_any_of_the_carriers_is_right():
    for parent, other in (("a", "b"), ("b", "a")):
        score = score_graph(TOLD, graph({**RIGHT, "c": parent}), NODE_OF, "table")
        assert (score.true, score.predicted, score.agreed, score.wrong) == (4, 4, 4, [])
        assert (score.true_to_things, score.predicted_to_things, score.agreed_to_things) == (2, 2, 2)
        found = score_graph(
            TOLD,
            graph({**RIGHT, "c": parent}, (("also_supports", other, "c"), ("leans_on", "b", "d"))),
            NODE_OF,
            "table",
        )
        assert found.second == {"also_supports": [1, 1, 1], "leans_on": [1, 1, 0], "second": [2, 2, 1]}


def test_doubts_count_neither_way_and_mistakes_twice():
    score = score_graph(TOLD, graph({**RIGHT, "d": "a", "b": "table"}), NODE_OF, "table")
    assert score.doubtful == 1
    assert (score.true, score.predicted, score.agreed) == (3, 3, 2)
    assert (score.true_to_things, score.predicted_to_things, score.agreed_to_things) == (2, 1, 1)
    assert score.wrong == [("by hand", "b", "a", "table")]
    assert score.levels == {1: [1, 1], 2: [1, 0], 3: [1, 1]}
    assert f1(score.true, score.predicted, score.agreed) == pytest.approx(2 / 3)


def test_what_is_missing_or_invented_costs_recall_or_precision():
    parents = {"table": "scene", "a": "table", "c": "a", "d": "table", "x": "a"}
    whole = graph({**parents, "b": "a"})
    without = ContactGraphFile(
        nodes=tuple(n for n in whole.nodes if n.id != "b"), links=tuple(e for e in whole.links if e.target != "b")
    )
    score = score_graph(TOLD, without, NODE_OF, "table")
    assert (score.true, score.predicted, score.agreed) == (4, 4, 3)
    assert score.wrong == [("by hand", "not annotated (x)", "", "a"), ("by hand", "b", "a", "not in the map")]


def test_without_a_table_the_floor_stands_for_it():
    parents = {"a": "floor_9", "b": "a", "c": "a", "d": "scene"}
    score = score_graph(TOLD, graph(parents, table=False), NODE_OF, "table")
    assert score.agreed == score.true == 4
    with_table = score_graph(TOLD, graph({**parents, "table": "floor_9"}), NODE_OF, "table")
    assert with_table.agreed == 2


def test_the_table_becomes_the_ground():
    camera = Camera(width=64, height=48, fx=60.0, fy=60.0, cx=31.5, cy=23.5)
    pose = look_at(np.array([0.1, -0.8, 0.6]), np.array([0.0, 0.0, 0.0]))
    v, u = np.mgrid[:48, :64]
    rays = np.stack([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, np.ones(u.shape)], axis=-1)
    down = (rays @ pose[:3, :3].T)[..., 2]
    depth = np.where(down < -0.05, -pose[2, 3] / np.minimum(down, -0.05), 0.0).astype(np.float32)
    found = upright_pose(depth, depth > 0, camera)
    points = apply(found, back_project(depth, camera)[depth > 0].astype(float))
    np.testing.assert_allclose(points[:, 2], 0.0, atol=1e-4)
    np.testing.assert_allclose(found[2, 3], 0.6, atol=1e-4)
    np.testing.assert_allclose(np.linalg.det(found[:3, :3]), 1.0, atol=1e-9)
