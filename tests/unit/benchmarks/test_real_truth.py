"""A log with a truth: reading the folder, each damage of it, and how what was found is counted."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scenewright.schemas.contact_graph import ContactGraphFile, GraphNode
from scenewright.schemas.errors import BadInput
from scenewright.schemas.ground_truth import TrueObject
from scenewright.schemas.panoptic_map import EntitiesFile, Entity
from scenewright.schemas.scene_parts import Relation
from scenewright.stages.evaluate import PredictedMap, TrueRoom
from scenewright.stages.evaluate.surfaces import Surface
from scenewright.stages.kit.geometry.boxes import minimum_box

from benchmarks.board.real.annotated import NO_GRAPH
from benchmarks.board.real.records import Edges, Tally
from benchmarks.board.real.things import false_things, judged, overlaps_of, partners
from benchmarks.board.real.told import seen_shares, supports_agreed
from benchmarks.board.real.truth_folder import read_truth

TABLE, MUG = {"id": 7, "class": "table", "support": "floor"}, {"id": 9, "class": "mug", "support": 7}


def write(folder: Path, **told: Any) -> Path:
    """Write a whole folder; `told` into truth.json beside two instances."""
    (folder / "log.mcap").write_bytes(b"")
    (folder / "truth.json").write_text(json.dumps({"instances": [TABLE, MUG], **told}))
    points = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]])
    np.savez(folder / "truth.npz", points=points, instance=np.array([7, 9, 0]))
    return folder


def test_a_folder_is_read_with_its_log_and_options(tmp_path: Path) -> None:
    thing = {"id": 9, "class": "astrolabe", "box": {"center": [0, 0, 0], "size": [1, 1, 1]}}
    told = read_truth(
        write(tmp_path, instances=[TABLE, thing], ingest={"every": 2, "fx": 525.0, "register_depth": False})
    )
    assert told.log.path == tmp_path / "log.mcap" and told.log.every == 2
    assert told.log.words[-2:] == ("--fx=525.0", "--no-register-depth")
    assert told.unknown_words == ("astrolabe",) and told.owner.tolist() == [7, 9, 0]


def again(key: str, value: Any) -> Callable[[Path], object]:
    """Write truth.json with another value."""
    return lambda folder: write(folder, **{key: value})


def arrays(**of: Any) -> Callable[[Path], object]:
    """Write truth.npz with these arrays."""
    return lambda folder: np.savez(folder / "truth.npz", **of)


POINTS, OWNER = np.zeros((3, 3)), np.array([7, 9, 0])


@pytest.mark.parametrize(
    ("damage", "said"),
    [
        (lambda folder: (folder / "truth.json").unlink(), "holds no truth.json"),
        (lambda folder: (folder / "truth.npz").unlink(), "holds no truth.npz"),
        (lambda folder: (folder / "log.mcap").unlink(), "one log is expected, there is none"),
        (lambda folder: (folder / "log.bag").write_bytes(b""), "log.bag, log.mcap"),
        (lambda folder: (folder / "truth.json").write_text("{"), "truth.json"),
        (again("instances", []), "instances"),
        (again("instances", [TABLE, {**TABLE, "color": "red"}]), "color"),
        (again("instances", [TABLE, TABLE]), "instance 7 is there twice"),
        (again("instances", [{**TABLE, "id": 0}]), "id"),
        (again("instances", [{**TABLE, "support": 8}, MUG]), "support 8 is no instance"),
        (again("instances", [{**TABLE, "support": 9}, MUG]), "carries itself"),
        (again("instances", [{**TABLE, "support": 7}, MUG]), "carries itself"),
        (again("instances", [{**TABLE, "support": "moon"}, MUG]), "support"),
        (again("ingest", {"out": "/etc"}), "no option out"),
        (again("ingest", {"log": "other.mcap"}), "no option log"),
        (again("ingest", {"every": 0}), "every 0"),
        (lambda folder: (folder / "truth.npz").write_bytes(b"PK"), "truth.npz"),
        (arrays(points=POINTS), "instance"),
        (arrays(points=POINTS[:, :2], instance=OWNER), "points"),
        (arrays(points=POINTS[:2], instance=OWNER), "instance"),
        (arrays(points=np.full((3, 3), np.nan), instance=OWNER), "not finite"),
        (arrays(points=np.full((3, 3), 1e6), instance=OWNER), "metres"),
        (arrays(points=POINTS, instance=OWNER + 0.5), "whole numbers"),
        (arrays(points=POINTS, instance=np.array([7, 9, 4])), "instance 4 is not in truth.json"),
        (arrays(points=POINTS[:0], instance=OWNER[:0]), "0 points"),
        (arrays(points=np.array([None] * 3, dtype=object), instance=OWNER), "truth.npz"),
    ],
)
def test_each_damage_is_one_line_that_names_the_file(
    tmp_path: Path, damage: Callable[[Path], object], said: str
) -> None:
    write(tmp_path)
    damage(tmp_path)
    with pytest.raises(BadInput) as error:
        read_truth(tmp_path)
    text = str(error.value)
    assert str(tmp_path) in text and said in text and "\n" not in text and error.value.hint


def test_a_folder_that_is_not_there_is_bad_input(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="no folder"):
        read_truth(tmp_path / "nowhere")


def line_of_points(x: float, count: int = 60) -> np.ndarray:
    """A thing: points 1 cm apart along y, at x."""
    return np.column_stack([np.full(count, x), 0.01 * np.arange(count), np.zeros(count)])


def room(things: dict[int, tuple[str, np.ndarray]], hidden: frozenset[int] = frozenset()) -> TrueRoom:
    """A room of things, by instance."""
    objects = tuple(
        TrueObject(instance=k, name=f"t{k}", class_name=name, world_from_model=np.eye(4).tolist(), box=minimum_box(own))
        for k, (name, own) in things.items()
    )
    points = np.concatenate([own for _, own in things.values()])
    instances = np.concatenate([np.full(len(own), k) for k, (_, own) in things.items()])
    surface = Surface(points, np.zeros((0, 3), np.int64))
    return TrueRoom(objects, points, instances, NO_GRAPH, surface, hidden, "made by hand")


def made(things: dict[int, tuple[str, np.ndarray]]) -> PredictedMap:
    """A map of things, by instance."""
    entities = tuple(
        Entity(
            instance=k,
            class_name=name,
            mesh=f"{k}.ply",
            vertices=len(own),
            triangles=0,
            box_minimum=(0, 0, 0),
            box_maximum=(0, 0, 0),
            confidence=1,
            observations=1,
            segments=(),
        )
        for k, (name, own) in things.items()
    )
    info = EntitiesFile(
        voxel_size=0.02, truncation_distance=0.1, frames_integrated=1, segmentation="by hand", entities=entities
    )
    vertices = np.concatenate([own for _, own in things.values()])
    owner = np.concatenate([np.full(len(own), k) for k, (_, own) in things.items()])
    return PredictedMap(info, Surface(vertices, np.zeros((0, 3), np.int64)), owner)


def test_things_are_found_in_one_piece_named_and_stand_and_the_rest_is_false() -> None:
    truth = room(
        {
            1: ("table", line_of_points(0)),
            2: ("chair", line_of_points(1)),
            3: ("cup", line_of_points(2, 20)),
            4: ("sofa", line_of_points(3)),
            5: ("floor", line_of_points(4)),
        },
        hidden=frozenset({4}),
    )
    whole, chair = line_of_points(0), line_of_points(1)
    predicted = made(
        {
            11: ("table", whole),
            12: ("table", chair[:40]),  # misnamed
            13: ("chair", chair[40:]),  # a further piece
            14: ("cup", line_of_points(4)),  # on the floor
            15: ("sofa", line_of_points(3)[:10]),  # of what counts neither way
            16: ("plant", line_of_points(9)),  # where nobody knows
        }
    )
    found = partners(truth, overlaps_of(truth, predicted), predicted.classes())
    assert found == {1: 11, 2: 12}
    assert false_things(truth, predicted, found.values()) == [13, 14]
    things = judged(truth, predicted, found, {1: 0.04, 2: 0.2}, 0.1)
    assert things.large == Tally(true=2, found=2, named=1, stand=1, off_mm=(40.0, 200.0))
    assert things.small == Tally(true=1) and things.false == 2
    unknown = judged(truth, predicted, found, {}, 0.1, unknown=frozenset({1}))
    assert unknown.large == Tally(true=2, found=2)


def test_without_a_map_all_that_was_seen_is_missed() -> None:
    things = judged(room({1: ("table", line_of_points(0))}), None, {}, {}, 0.1)
    assert things.large == Tally(true=1) and things.false == 0


def test_the_share_of_a_thing_that_was_seen_is_of_its_own_points() -> None:
    shares = seen_shares(np.array([0, 1, 1, 1, 1, 3]), np.array([True, True, False, False, False, True]), 5)
    assert shares.tolist() == [1.0, 0.25, 0.0, 1.0, 0.0]


def test_supports_agree_by_what_was_matched_and_layout_by_its_class() -> None:
    names = {"scene": 0, "floor_20": 20, "table_11": 11, "cup_13": 13, "plant_16": 16}
    kinds: dict[str, Any] = {"scene": "scene", "floor_20": "layout"}
    nodes = tuple(
        GraphNode(id=n, instance=k, class_name=n.split("_")[0], node_type=kinds.get(n, "rigid"))
        for n, k in names.items()
    )
    edges = {"floor_20": "scene", "table_11": "floor_20", "cup_13": "table_11", "plant_16": "floor_20"}
    links = tuple(Relation(source=s, target=t, relation="supports", confidence=1) for t, s in edges.items())
    graph = ContactGraphFile(nodes=nodes, links=links)
    told: dict[int, Any] = {1: "floor", 3: 1, 4: "wall"}
    found = {1: 11, 3: 13}
    assert supports_agreed(told, found, graph, []) == Edges(true=3, predicted=2, agreed=2)
    assert supports_agreed(told, found, graph, [16]) == Edges(true=3, predicted=3, agreed=2)
    assert supports_agreed({1: "wall", 3: 4}, found, graph, []) == Edges(true=2, predicted=2, agreed=0)
    assert supports_agreed({}, found, graph, [16]) == Edges()
