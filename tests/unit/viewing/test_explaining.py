"""Why things are what they are: sentences of each kind, names that are not there, the same facts as JSON, the page."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
import trimesh
from scenewright.cli.explaining.cad_reasons import joint_reason, replacement_reasons
from scenewright.cli.explaining.explaining import explain, sentences
from scenewright.cli.explaining.graph_reasons import node_reasons
from scenewright.cli.explaining.map_reasons import entity_reasons, plane_reasons
from scenewright.cli.explaining.plan_reasons import link_reasons
from scenewright.cli.explaining.reason import Reason, edit_reasons
from scenewright.cli.explaining.scene_reasons import body_reasons, settled_reason
from scenewright.cli.main import run
from scenewright.cli.viewing.view import view_artifact
from scenewright.schemas.base import as_transform
from scenewright.schemas.cad_scene import CadCandidate, JointEvidence, Replacement
from scenewright.schemas.contact_graph import ContactGraphFile, GraphNode
from scenewright.schemas.edits import AppliedEdit, AppliedEditsFile
from scenewright.schemas.errors import BadInput
from scenewright.schemas.interactive_scene import InteractiveSceneFile, SceneBody, SettledBody
from scenewright.schemas.panoptic_map import (
    Because,
    BecauseFile,
    EntitiesFile,
    Entity,
    LayoutFile,
    LayoutPlane,
    Opening,
)
from scenewright.schemas.plan import PlanFile, PlannedAction, TriedPlan
from scenewright.schemas.scene_parts import Box, Joint, Relation
from scenewright.stages.engine.reading import open_artifact
from scenewright.stages.kit.tasks.pddl import parse_domain, parse_problem

from tests.unit.viewing.artifacts import seal
from tests.unit.viewing.test_page import document_of

BOX = Box(center=(0.0, 0.0, 0.5), size=(1.0, 1.0, 1.0))
POSE = as_transform(np.eye(4))


def said(reasons: list[Reason]) -> list[str]:
    return [reason.says for reason in reasons]


def entity(instance: int, name: str, observations: int = 12) -> Entity:
    return Entity(
        instance=instance,
        class_name=name,
        mesh=f"entities/{instance}.ply",
        vertices=8,
        triangles=12,
        box_minimum=(0, 0, 0),
        box_maximum=(1, 1, 1),
        confidence=0.657,
        observations=observations,
        segments=(1,),
    )


ENTITIES = EntitiesFile(
    voxel_size=0.02,
    truncation_distance=0.08,
    frames_integrated=5,
    segmentation="test",
    entities=(entity(2, "chair"), entity(47, "object", 0), entity(45, "wall", 0)),
)
BECAUSE = BecauseFile(
    entities=(
        Because(
            instance=2,
            shape="masks",
            looks=22.0,
            said={"chair": 0.273, "table": 0.227, "bed": 0.001},
            name="the likeliest of the names that masks gave it",
            posterior=0.747,
            runners_up={"table": 0.062, "bed": 0.0},
        ),
        Because(
            instance=47, shape="a piece that geometry cuts", looks=1.0, said={}, name="nobody named it", posterior=1.0
        ),
        Because(instance=45, shape="planes that bound the room", looks=40.0, said={"wall": 1.0}),
    ),
    dropped=("flush along 56% of its outline, and masks are less sure than usual: 0.72",),
)
PLANES = LayoutFile(
    floor=0.0,
    planes=(
        LayoutPlane(
            kind="wall",
            bounds=True,
            normal=(1.0, 0.0, 0.0),
            offset=-2.0,
            area=7.3,
            start=(-2.0, 2.0, 0.0),
            end=(-2.0, -2.0, 2.5),
            reasons={"area": 1.5, "free space behind": 2.0, "height": 1.0, "cameras": 0.0},
            log_odds=4.5,
            openings=(Opening(left=1.0, width=0.9, sill=0.0, head=2.02),),
        ),
        LayoutPlane(
            kind="wall",
            bounds=False,
            normal=(0.0, 1.0, 0.0),
            offset=0.0,
            area=0.67,
            start=(1.75, 0.29, 0.68),
            end=(0.92, 0.02, 1.73),
            reasons={"height": -4.0, "surface behind": 1.0, "wall over it": -1.2, "something new": -0.5},
            log_odds=-4.7,
        ),
    ),
)


def test_an_entity_says_how_its_surface_and_its_name_were_found() -> None:
    rows = entity_reasons(ENTITIES, BECAUSE, PLANES)
    assert said(rows["chair_2"]) == [
        "Its surface comes from masks. 22 frames saw it.",
        "Mean scores of masks, 0 to 1 a frame: chair 0.27 and table 0.23.",
        "It is called chair: the likeliest of the names that masks gave it. The posterior of the name is 0.75.",
        "The next names: table 0.06.",
        "12 frames voted for it; 66 % of the votes agree with its class and number.",
    ]
    assert said(rows["object_47"]) == [
        "Its surface comes from a piece that geometry cuts. 1 frame saw it.",
        "Masks said next to nothing of it.",
        "It stays an object: nobody named it. The posterior that it has no name is 1.00.",
        "No frame voted for it: its surface is not one that masks outlined.",
    ]
    assert said(rows["wall_45"])[2:] == [
        "It is no thing: names of things were not weighed.",
        "No frame voted for it: its surface is not one that masks outlined.",
        "The planes that bound the room as wall: plane_1. Ask for one to read why.",
    ]
    without = said(entity_reasons(ENTITIES, None, None)["chair_2"])
    assert without[0].startswith("The map has no because.json") and len(without) == 2


def test_a_plane_says_what_speaks_for_and_against_it() -> None:
    rows = plane_reasons(PLANES)
    assert said(rows["plane_1"]) == [
        "It bounds the room as wall: its log odds are +4.50, and 0 is the limit. "
        "It has 7.30 m² from (-2.00, 2.00, 0.00) to (-2.00, -2.00, 2.50) m. "
        "For it: cameras saw hardly any free space behind it (+2.0); it is large (+1.5); "
        "it goes up to the highest surface (+1.0). "
        "A door in it is 0.90 m wide and goes up to 2.02 m."
    ]
    assert said(rows["plane_2"])[0].endswith(
        "For it: hardly any surface lies behind it (+1.0). "
        "Against it: it ends too low for a wall (-4.0); "
        "a surface that faces the same way goes on over its top (-1.2); something new (-0.5)."
    )


def link(source: str, target: str, relation: str, **evidence: float) -> Relation:
    return Relation.model_validate(
        {"source": source, "target": target, "relation": relation, "confidence": 0.96} | evidence
    )


def node(name: str, kind: str = "rigid", **more: str) -> GraphNode:
    class_name, _, number = name.rpartition("_")
    instance = int(number) if number.isdigit() else 0
    values = {"id": name, "instance": instance, "class_name": class_name or name, "node_type": kind, "box": BOX}
    return GraphNode.model_validate(values | more)


GRAPH = ContactGraphFile(
    nodes=(
        node("scene", "scene"),
        node("floor_1", "layout"),
        node("fridge_4"),
        node("cup_5"),
        node("lamp_6"),
        node("chair_7", mark="fixed"),
    ),
    links=(
        link("scene", "floor_1", "supports"),
        link("floor_1", "fridge_4", "supports", plane=0, gap=-0.008, overlap=0.99),
        link("fridge_4", "cup_5", "contains", plane=3, gap=0.016, overlap=1.0, inside=0.98),
        link("floor_1", "lamp_6", "carries_on_wall", gap=0.12, overlap=0.5),
        link("floor_1", "chair_7", "supports"),
        link("fridge_4", "chair_7", "leans_on", gap=0.01, overlap=0.4),
        link("cup_5", "fridge_4", "proximal", gap=0.01, overlap=0.25),
    ),
)


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("floor_1", ["Nothing carries it: it bounds the room.", "It carries fridge_4, lamp_6 and chair_7."]),
        (
            "fridge_4",
            [
                "It stands on floor_1, with confidence 0.96. Its lowest point was 8 mm below plane 0 of floor_1 before "
                "it was moved onto it. 99 % of its footprint lies over the plane.",
                "It is close to cup_5 (25 %): that share of the smaller box lies in the other.",
                "It carries cup_5.",
            ],
        ),
        (
            "cup_5",
            [
                "It stands inside fridge_4, with confidence 0.96. Its lowest point was 16 mm above plane 3 of fridge_4 "
                "before it was moved onto it. 100 % of its footprint lies over the plane. "
                "98 % of its box lies inside fridge_4.",
                "It is close to fridge_4 (25 %): that share of the smaller box lies in the other.",
            ],
        ),
        (
            "lamp_6",
            [
                "It hangs on floor_1, with confidence 0.96. The gap between the two is 0.12 m. "
                "50 % of its side faces the plane."
            ],
        ),
        (
            "chair_7",
            [
                "A person marked it fixed.",
                "It stands on floor_1, with confidence 0.96.",
                "It leans on fridge_4, with confidence 0.96. The gap between the two is 10 mm. "
                "40 % of its height is where they meet.",
            ],
        ),
    ],
)
def test_a_node_says_what_carries_it_and_by_what_evidence(name: str, expected: list[str]) -> None:
    assert said(node_reasons(GRAPH)[name]) == expected


def candidate(model: str, error: float = 0.012, **more: str) -> CadCandidate:
    return CadCandidate(
        model_id=model, scale=1.0, world_from_model=POSE, matching_error=0.5, alignment_error=error, **more
    )


def test_a_model_says_why_it_and_not_another() -> None:
    chosen = candidate("table_00_for_table_3", stretched_from="table_00")
    entry = Replacement(
        node="table_3",
        decision="cad",
        reason="table_00 stretched by 1.19 x 1.11 x 0.99",
        chosen=chosen,
        best_single=candidate("table_02", 0.02),
        alternatives=(candidate("table_02", 0.02), candidate("table_05", 0.03), candidate("table_05", 0.04)),
        rejected={"alignment rank": 10, "scale out of range": 2},
    )
    assert said(list(replacement_reasons(entry))) == [
        "The model table_00_for_table_3, stretched from table_00, stands for it. It lies 12 mm (RMS) from what was "
        "seen, its matching error is 0.50.",
        "The reason: table_00 stretched by 1.19 x 1.11 x 0.99.",
        "By itself table_02 fitted best; the check of all things together chose another. It lies 20 mm (RMS) from what "
        "was seen, its matching error is 0.50.",
        "Other valid models, with their distance from what was seen: table_05 (30 mm).",
        "12 candidates were discarded before: alignment rank (10), scale out of range (2).",
    ]
    kept = Replacement(node="object_5", decision="mesh", reason="the library has no model of class object")
    assert said(list(replacement_reasons(kept))) == [
        "No model stands for it, its own mesh stays: the library has no model of class object."
    ]


def test_a_joint_says_why_it_is_believed_or_held() -> None:
    held = joint_reason("fridge_4__door_hinge", JointEvidence())
    assert held.says == "The joint fridge_4__door_hinge is held: nothing in the map speaks for it."
    believed = joint_reason("fridge_4__door_hinge", JointEvidence(grounds=("open", "handle"), handle_height=0.032))
    assert believed.says == (
        "The joint fridge_4__door_hinge is believed: its part was seen open and a handle stands out of its leaf. "
        "The handle stands out by 32 mm."
    )


def body(name: str, *, movable: bool, parent: str | None = "floor_1", **more: object) -> SceneBody:
    values = {"name": name, "class_name": name.rpartition("_")[0], "movable": movable, "parent": parent, "mass": 1.0}
    return SceneBody.model_validate(values | {"world_from_body": POSE, "box": BOX} | more)


def test_a_body_says_why_it_is_free_or_fixed() -> None:
    hinge = Joint(
        name="fridge_4__door_hinge",
        type="revolute",
        part="fridge_4__door",
        origin=(0, 0, 0),
        axis=(0, 0, 1),
        lower=0.0,
        upper=2.0,
    )
    scene = InteractiveSceneFile(
        bodies=(
            body("floor_1", movable=False, parent=None),
            body("fridge_4", movable=False, joints=(hinge,), joint_values={"fridge_4__door_hinge": 1.0}),
            body("cup_5", movable=True, parent="fridge_4", relation="contains"),
            body("lamp_6", movable=False, relation="carries_on_wall"),
            body("chair_7", movable=False),
            body("surroundings", movable=False, parent=None),
        )
    )
    rows = body_reasons(scene, GRAPH, {"cup"}, ())
    assert said(rows["floor_1"]) == ["It is fixed: it bounds the room."]
    assert said(rows["fridge_4"]) == [
        "It is fixed: class fridge is part of the building, or too heavy to push.",
        "The joint fridge_4__door_hinge turns fridge_4__door from 0 to 115 degrees. It was seen at 57 degrees.",
    ]
    assert said(rows["fridge_4__door_hinge"]) == said(rows["fridge_4"])[1:]
    assert said(rows["cup_5"]) == ["It is free: an arm carries things of class cup."]
    assert said(rows["lamp_6"]) == ["It is fixed: it hangs, and would fall."]
    assert said(rows["chair_7"]) == ["It is fixed: a person marked it fixed."]
    assert said(rows["surroundings"]) == ["It is fixed: it is all that was mapped and has no name."]


def test_what_could_be_free_and_is_held_says_so() -> None:
    """A cup under something fixed, one that would not stand, and one of which a part is inferred."""
    loaded = InteractiveSceneFile(bodies=(body("cup_5", movable=False), body("lamp_6", movable=False, parent="cup_5")))
    assert said(body_reasons(loaded, GRAPH, {"cup"}, ())["cup_5"]) == ["It is fixed: it carries lamp_6, fixed too."]
    alone = InteractiveSceneFile(bodies=(body("cup_5", movable=False, because="held: it would not stand"),))
    assert said(body_reasons(alone, GRAPH, {"cup"}, ())["cup_5"]) == ["It is fixed: it would not stand."]
    completed = body("cup_5", movable=True, because="inferred: a bottom; what was seen ends 16 mm above the shelf")
    assert said(body_reasons(InteractiveSceneFile(bodies=(completed,)), GRAPH, {"cup"}, ())["cup_5"]) == [
        "It is free: an arm carries things of class cup.",
        "Nobody saw a bottom of it: what was seen ends 16 mm above the shelf.",
    ]
    left = settled_reason(SettledBody(name="cup_5", moved=0.2, turned=0.5, leaves=0.75), 1.5)
    assert left.says == (
        "Let go in physics, it moved 0.20 m and turned 28.6 degrees: it left its place after 0.8 s. "
        "That is 1.5 standard deviations from the limit."
    )


DOMAIN = """(define (domain d) (:requirements :strips :typing) (:types thing - object)
 (:predicates (near ?a - thing) (holding ?a - thing) (hand_empty) (on ?a - thing ?b - thing) (behind ?a ?b - thing))
 (:action drive :parameters (?a - thing ?b - thing) :precondition (and (near ?a))
  :effect (and (near ?b) (not (near ?a))))
 (:action take_out :parameters (?a - thing ?b - thing) :precondition (and (near ?a) (hand_empty) (behind ?a ?b))
  :effect (and (holding ?a) (not (hand_empty))))
 (:action place :parameters (?a - thing ?b - thing) :precondition (and (holding ?a) (near ?b))
  :effect (and (on ?a ?b) (hand_empty) (not (holding ?a)))))"""
PROBLEM = """(define (problem p) (:domain d) (:objects start cup_5 table_3 door_1 - thing)
 (:init (near start) (hand_empty) (behind cup_5 door_1)) (:goal (and (on cup_5 table_3))))"""


def action(name: str, *arguments: str) -> PlannedAction:
    return PlannedAction(name=name, arguments=arguments, start=0, end=1, base_pose=POSE)


PLAN = PlanFile(
    goal=("on(cup_5, table_3)",),
    planned_in="reconstructed",
    executed_in=None,
    status="planned",
    actions=(
        action("drive", "start", "cup_5"),
        action("pick", "cup_5", "door_1"),
        action("drive", "cup_5", "table_3"),
        action("place", "cup_5", "table_3"),
    ),
    tried=(
        TriedPlan(
            actions=("drive(start, cup_5)", "take_out(cup_5, door_1)", "drive(cup_5, table_3)", "place(cup_5, table_3)")
        ),
    ),
)


def test_a_step_says_what_needs_it_and_what_it_needs() -> None:
    domain = parse_domain(DOMAIN)
    rows = link_reasons(PLAN, domain, parse_problem(PROBLEM, domain))
    assert {name: said(reasons) for name, reasons in rows.items()} == {
        "step_1": [
            "It makes near(cup_5) true, which step_2 and step_3 need.",
            "It needs near(start), true from the start.",
        ],
        "step_2": [
            "It makes holding(cup_5) true, which step_4 needs.",
            "It needs behind(cup_5, door_1) and hand_empty, true from the start; near(cup_5), made true by step_1.",
        ],
        "step_3": ["It makes near(table_3) true, which step_4 needs.", "It needs near(cup_5), made true by step_1."],
        "step_4": [
            "It makes on(cup_5, table_3) true, which the goal needs.",
            "It needs holding(cup_5), made true by step_2; near(table_3), made true by step_3.",
        ],
    }


def test_edits_say_who_changed_what() -> None:
    edits = AppliedEditsFile(
        edits=(AppliedEdit(number=1, what="rename", status="applied", things=("mug_2",), by="Ada", note="a mug"),)
    )
    assert said(edit_reasons(edits)["mug_2"]) == ["Edit 1 by Ada, rename, was applied. Its note: a mug"]


@pytest.fixture
def run_folder(tmp_path: Path) -> Path:
    """A map of a chair, an object and a wall; a graph of it, in which a person calls the chair a stool; a plan."""
    root = tmp_path / "panoptic_map"
    (root / "entities").mkdir(parents=True)
    trimesh.creation.box((1, 1, 1)).export(root / "mesh.ply")
    np.savez(root / "mesh_labels.npz", instance=np.full(8, 2, np.int32))
    ENTITIES.write(root / "entities.json")
    BECAUSE.write(root / "because.json")
    PLANES.write(root / "layout.json")
    seal(root, "panoptic_map")
    (tmp_path / "contact_graph").mkdir()
    nodes, links = (
        (node("scene", "scene"), node("wall_45", "layout"), node("stool_2")),
        (link("scene", "wall_45", "supports"),),
    )
    links = (*links, link("wall_45", "stool_2", "supports"))
    ContactGraphFile(nodes=nodes, links=links).write(tmp_path / "contact_graph" / "graph.json")
    seal(tmp_path / "contact_graph", "contact_graph", panoptic_map=root)
    (tmp_path / "plan").mkdir()
    PLAN.write(tmp_path / "plan" / "plan.json")
    ContactGraphFile(nodes=(), links=()).write(tmp_path / "plan" / "graph.json")
    (tmp_path / "plan" / "domain.pddl").write_text(DOMAIN)
    (tmp_path / "plan" / "problem.pddl").write_text(PROBLEM)
    seal(tmp_path / "plan", "plan")
    return tmp_path


def test_a_graph_is_explained_back_to_its_map(run_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    graph = run_folder / "contact_graph"
    assert run(["explain", str(graph)]) == 0
    names = capsys.readouterr().out.split()
    assert names == ["chair_2", "object_47", "wall_45", "plane_1", "plane_2", "dropped", "stool_2"]
    assert run(["explain", str(graph), "stool_2"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == f"panoptic_map {run_folder / 'panoptic_map'}"
    assert (
        "  It is called chair: the likeliest of the names that masks gave it. The posterior of the name is 0.75."
        in lines
    )
    assert lines[-2:] == [f"contact_graph {graph}", "  It stands on wall_45, with confidence 0.96."]


def test_json_has_the_same_facts(run_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    graph = str(run_folder / "contact_graph")
    assert run(["explain", graph, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["names"][0] == "chair_2"
    assert run(["explain", graph, "stool_2", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert run(["explain", graph, "stool_2"]) == 0
    lines = [line.strip() for line in capsys.readouterr().out.splitlines() if line.startswith("  ")]
    assert [row["says"] for row in told["reasons"]] == lines
    assert told["reasons"][2]["facts"]["posterior"] == 0.747
    assert told["reasons"][-1]["facts"]["confidence"] == 0.96 and told["left_out"] == []


def test_a_plan_explains_its_outcome_steps_and_things(run_folder: Path) -> None:
    explained = explain(open_artifact(run_folder / "plan"))
    assert explained.names() == ["outcome", "step_1", "step_2", "step_3", "step_4", "cup_5", "door_1", "table_3"]
    ((_, reasons),) = explained.of("outcome")
    assert said(reasons) == ["The goal is on(cup_5, table_3). A plan was found and not executed."]
    ((_, reasons),) = explained.of("step_2")
    assert said(reasons)[:2] == [
        "Step 2 of 4: pick(cup_5, door_1).",
        "It makes holding(cup_5) true, which step_4 needs.",
    ]


def test_a_wrong_name_gets_the_nearest_and_exit_code_2(run_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    graph = str(run_folder / "contact_graph")
    assert run(["explain", graph, "chiar_2"]) == 2
    done = capsys.readouterr()
    assert done.out == "" and done.err == f"error: {graph}: has no 'chiar_2' (the nearest: chair_2)\n"
    assert run(["explain", graph, "%"]) == 2
    assert capsys.readouterr().err == f"error: {graph}: has no '%' (scenewright explain {graph} lists its names)\n"


def test_what_is_not_at_hand_is_said(run_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shutil.rmtree(run_folder / "panoptic_map")
    graph = run_folder / "contact_graph"
    assert run(["explain", str(graph), "stool_2"]) == 0
    done = capsys.readouterr()
    assert done.out.splitlines()[0] == f"contact_graph {graph}"
    assert done.err == (
        f"{run_folder / 'panoptic_map'}: the panoptic_map is not there, or was made anew: what it records is left out\n"
    )


def test_a_kind_that_records_no_reasons_is_bad_input(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    root = Path(__file__).resolve().parents[2] / "golden" / "v1" / "segments"
    assert run(["explain", str(root)]) == 3
    assert "records no reasons (give one of panoptic_map, contact_graph" in capsys.readouterr().err
    assert sentences(open_artifact(root)) == {}


def test_a_click_on_a_page_has_the_same_sentences(run_folder: Path) -> None:
    page = run_folder / "graph.html"
    view_artifact(run_folder / "contact_graph", page)
    shown = document_of(page)["because"]
    assert shown == sentences(open_artifact(run_folder / "contact_graph"))
    assert shown["stool_2"][-1] == "It stands on wall_45, with confidence 0.96."


def test_a_page_stands_although_the_map_behind_it_is_broken(run_folder: Path) -> None:
    (run_folder / "panoptic_map" / "because.json").write_text("{}")
    seal(run_folder / "panoptic_map", "panoptic_map")
    seal(run_folder / "contact_graph", "contact_graph", panoptic_map=run_folder / "panoptic_map")
    explained = explain(open_artifact(run_folder / "contact_graph"))
    assert len(explained.missing) == 2 and "because.json" in explained.missing[0]
    with pytest.raises(BadInput, match=r"because.json"):
        explain(open_artifact(run_folder / "panoptic_map"))
