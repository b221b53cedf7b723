"""Candidates, the scene before and after the global check, and the graph beside the kinematic tree."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from scenewright.schemas.base import as_transform
from scenewright.schemas.cad_scene import UNEXPLAINED, CadCandidate, CadScene, Explained
from scenewright.schemas.scene_parts import Relation
from scenewright.stages.kit.measurement.cad_candidates import candidates_of
from scenewright.stages.report.candidates import object_views
from scenewright.stages.report.global_check import CONFLICT, checked_scenes
from scenewright.stages.report.kinematic_tree import corresponding_trees, read_joints
from scenewright.stages.report.placed_models import ModelShelf
from scenewright.stages.report.surfaces import NOT_EXPLAINED, cad_model

from tests.unit.evaluate.handmade import ROOM, graph_of, make_cad_scene, make_map, model_pose
from tests.unit.report.models import write_box_model
from tests.unit.report.test_report import SMALL, parse, report

FLOOR, WALL, TABLE, CUP, CHAIR, CABINET, BOTTLE = ROOM


def moved(candidate: CadCandidate, x: float = 0.0, y: float = 0.0, z: float = 0.0, **more) -> CadCandidate:
    pose = np.array(candidate.world_from_model)
    pose[:3, 3] += (x, y, z)
    return candidate.model_copy(update={"world_from_model": as_transform(pose), **more})


def make_scene(root: Path, best: dict[str, tuple[float, float, float]] | None = None) -> CadScene:
    """The hand-made room out of box models; `best`: node -> how far its best single candidate is from its choice."""
    made = make_cad_scene(root)
    replacements = []
    for r in made.info.replacements:
        if r.chosen is not None:
            chosen = r.chosen.model_copy(update={"joints": {}})
            shift = (best or {}).get(r.node)
            r = r.model_copy(
                update={
                    "chosen": chosen,
                    "best_single": None if best is None else moved(chosen, *(shift or (0, 0, 0))),
                    "alternatives": (chosen, moved(chosen, 0.2, matching_error=0.5)),
                    "rejected": {"scale out of range": 3, "alignment rank": 7},
                }
            )
        replacements.append(r)
    made.info.model_copy(update={"replacements": tuple(replacements)}).write(root / "scene.json")
    for thing in ROOM:
        if thing.model_id and thing is not BOTTLE:  # which stands in a cabinet that is a solid box here
            write_box_model(root / "models", thing.model_id, thing.class_name, np.subtract(thing.high, thing.low))
    return CadScene(root)


def test_candidates_are_listed_once_each(tmp_path):
    scene = make_scene(tmp_path / "cad", {CUP.name: (0.05, 0.0, 0.0)}).info
    by_node = {r.node: r for r in scene.replacements}
    assert [role for role, _ in candidates_of(by_node[CUP.name])] == ["chosen", "best by itself", ""]
    assert [role for role, _ in candidates_of(by_node[TABLE.name])] == ["chosen, best by itself", ""]
    assert candidates_of(by_node[FLOOR.name]) == []
    kept = by_node[CUP.name].model_copy(update={"decision": "mesh", "chosen": None})
    assert [role for role, _ in candidates_of(kept)] == ["best by itself", "", ""]


def test_objects_are_drawn_with_their_candidates(tmp_path):
    cad = make_scene(tmp_path / "cad", {CUP.name: (0.05, 0.0, 0.0)})
    views = {
        view.node: view for view in object_views(cad, ModelShelf(cad), make_map(tmp_path / "map"), count=2, width=60)
    }
    assert FLOOR.name not in views
    cup, bottle = views[CUP.name], views[BOTTLE.name]
    assert cup.changed and cup.outcome == "moved by 5 cm by the global check"
    assert [c.role for c in cup.candidates] == ["chosen", "best by itself"] and cup.others == 1
    assert cup.rejected == (("alignment rank", 7), ("scale out of range", 3))
    assert all(c.picture is not None and c.picture.width == 60 for c in cup.candidates)
    pictures = {cup.picture.uri, *(c.picture.uri for c in cup.candidates)}
    assert len(pictures) == 3  # another place is another picture
    assert not bottle.changed and bottle.picture is not None and bottle.candidates[0].picture is None  # no model


def test_conflicts_before_and_after_are_red(tmp_path):
    cad = make_scene(tmp_path / "cad", {CHAIR.name: (1.1, 0.4, 0.0)})
    before, after = checked_scenes(cad, ModelShelf(cad))
    assert [(p.first, p.second) for p in before.conflicts] == [(CHAIR.name, TABLE.name)]
    assert before.conflicts[0].depth == pytest.approx(0.4)  # the chair's side reaches from -0.1 to 0.4
    assert "1 conflict, red: chair_5 in table_3 (400 mm)" in before.caption
    assert after.conflicts == [] and "CAD models stands more than 5 mm" in after.caption
    red = np.all(np.isclose(before.model.soup.corner_colors[:, 0], np.array(CONFLICT) ** 2.2, atol=0.05), axis=1)
    assert {before.model.nodes[int(k)] for k in np.unique(before.model.soup.instance[red])} == {"chair_5", "table_3"}
    assert set(before.model.names.values()) == {"chair 5", "table 3"} and after.model.names == {}


def test_scenes_of_older_versions_show_what_the_check_left(tmp_path):
    cad = make_scene(tmp_path / "cad")
    (after,) = checked_scenes(cad, ModelShelf(cad))
    assert after.caption.startswith("After the global check")
    assert cad_model(cad).classes.keys() == after.model.classes.keys()
    views = object_views(cad, ModelShelf(cad), None, count=4, width=60)
    assert not any(view.changed for view in views) and views[0].picture is None


URDF = """<robot name="scene"><link name="world"/>
{links}
{joints}
</robot>"""


def write_urdf(path: Path, joints: list[tuple[str, str, str]]) -> Path:
    links = "".join(f'<link name="{child}"/>' for _, _, child in joints)
    text = "".join(
        f'<joint name="{child}__joint" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<limit lower="0" upper="1.6"/></joint>'
        for kind, parent, child in joints
    )
    path.write_text(URDF.format(links=links, joints=text))
    return path


JOINTS = [
    ("fixed", "world", "floor_1"),
    ("fixed", "world", "wall_2"),
    ("fixed", "floor_1", "table_3"),
    ("floating", "table_3", "cup_4"),
    ("fixed", "floor_1", "chair_5"),
    ("fixed", "floor_1", "cabinet_6"),
    ("revolute", "cabinet_6", "cabinet_6__door"),
    ("prismatic", "cabinet_6__door", "cabinet_6__drawer"),
    ("floating", "cabinet_6", "bottle_7"),
]


def test_the_same_thing_stands_in_the_same_row_of_both_trees(tmp_path):
    trees = corresponding_trees(graph_of(ROOM), *read_joints(write_urdf(tmp_path / "scene.urdf", JOINTS)))
    rows = {node.name: node.y for node in trees.graph_nodes}
    links = {node.name: node for node in trees.link_nodes}
    assert {name: links[name].y for name in rows if name != "scene"} == {k: v for k, v in rows.items() if k != "scene"}
    assert links["world"].y == rows["scene"]
    assert links["door"].kind == "part" and links["door"].x > links["cabinet_6"].x
    assert links["drawer"].x > links["door"].x  # it hangs on the door
    assert min(node.x for node in trees.link_nodes) > max(node.x + node.width for node in trees.graph_nodes)
    for nodes in (trees.graph_nodes, trees.link_nodes):
        boxes = [(n.x, n.y - 11, n.x + n.width, n.y + 11) for n in nodes]
        for k, a in enumerate(boxes):
            for b in boxes[k + 1 :]:
                assert not (a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3])
    assert trees.kinds == ("fixed", "floating", "prismatic", "revolute")
    assert (trees.only_graph, trees.only_urdf) == ((), ())
    assert any("cabinet_6__door__joint: revolute joint" in edge.title for edge in trees.joint_edges)


def test_what_is_in_one_tree_only_is_named(tmp_path):
    joints = [j for j in JOINTS if j[2] != "cup_4"] + [("fixed", "world", "stranger")]
    trees = corresponding_trees(graph_of(ROOM), *read_joints(write_urdf(tmp_path / "scene.urdf", joints)))
    assert (trees.only_graph, trees.only_urdf) == (("cup_4",), ("stranger",))


def test_a_circle_of_the_graph_is_refused(tmp_path):
    graph = graph_of(ROOM)
    links = tuple(k for k in graph.links if k.target != "table_3")
    links += (Relation(source="cup_4", target="table_3", relation="supports", confidence=1.0),)
    with pytest.raises(ValueError, match="circle"):
        corresponding_trees(graph.model_copy(update={"links": links}), *read_joints(write_urdf(tmp_path / "u", JOINTS)))


def test_the_page_shows_all_of_it(tmp_path):
    cad = make_scene(tmp_path / "cad", {CUP.name: (0.05, 0.0, 0.0)})
    made = report(tmp_path / "report", SMALL.model_copy(update={"candidates": 1, "candidate_width": 60}), cad_scene=cad)
    page = parse((made.root / "report.html").read_text())
    for text in (
        "Before and after the global check",
        "moved by 5 cm by the global check",
        "chosen, best by itself",
        "7 alignment rank",
        "2 more",
        "Candidates of the other objects",
    ):
        assert text in page.text, text


def test_places_of_models_follow_the_pose(tmp_path):
    cad = make_scene(tmp_path / "cad")
    chosen = next(r.chosen for r in cad.info.replacements if r.node == TABLE.name)
    (piece,) = ModelShelf(cad).pieces(chosen)
    assert piece.low == pytest.approx(np.array(TABLE.low)) and piece.high == pytest.approx(np.array(TABLE.high))
    assert np.allclose(ModelShelf(cad).mesh(chosen).bounds, [TABLE.low, TABLE.high], atol=1e-6)
    assert np.allclose(model_pose(TABLE)[:3, 3], np.array(chosen.world_from_model)[:3, 3])


def test_chosen_models_wear_the_colours_of_the_map(tmp_path):
    cad = make_scene(tmp_path / "cad")
    chosen = next(r.chosen for r in cad.info.replacements if r.node == TABLE.name)
    shelf = ModelShelf(cad)
    painted = shelf.mesh(chosen, {"body": (10, 200, 30), "door": (1, 2, 3)})
    assert np.unique(painted.visual.vertex_colors[:, :3], axis=0).tolist() == [[10, 200, 30]]
    assert np.unique(shelf.mesh(chosen).visual.vertex_colors[:, :3], axis=0).tolist() == [[180, 90, 40]]
    assert np.allclose(painted.bounds, shelf.mesh(chosen).bounds)


def test_what_nothing_explains_is_red_and_said(tmp_path):
    cad = make_scene(tmp_path / "cad")
    plain = cad_model(cad)
    trimesh.creation.box((0.3, 0.3, 0.3)).export(cad.path(UNEXPLAINED))
    marked = cad_model(cad, with_unexplained=True)
    assert (marked.soup.instance == NOT_EXPLAINED).sum() == 12 and not (plain.soup.instance == NOT_EXPLAINED).any()
    assert (cad_model(cad).soup.instance != NOT_EXPLAINED).all(), "only where it is asked for"
    told = [
        r.model_copy(update={"explained": Explained(area=1.0, by_model=0.6, by_mesh=0.0)})
        for r in cad.info.replacements
    ]
    written = cad.info.model_copy(update={"replacements": tuple(told), "explained_within": 0.024})
    written.write(cad.path("scene.json"))
    made = report(tmp_path / "report", SMALL.model_copy(update={"candidates": 0}), cad_scene=CadScene(cad.root))
    page = parse((made.root / "report.html").read_text())
    for text in ("Unexplained surface of the map, in red", "Within 24 mm, models explain 60 %", "60 %"):
        assert text in page.text, text
