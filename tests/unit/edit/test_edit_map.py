"""Edits of maps: each does what it says, again on maps that number and cut things otherwise, or says that it cannot."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest
from pydantic import TypeAdapter
from scenewright.cli.edit_command import COMMANDS
from scenewright.cli.edit_forms import kinds_of
from scenewright.cli.main import run as scenewright
from scenewright.schemas.edits import AddJoint, AnyEdit, AppliedEdit, MapEdit
from scenewright.schemas.errors import BadInput
from scenewright.schemas.panoptic_map import Because, BecauseFile, LayoutFile, LayoutPlane, PanopticMap
from scenewright.stages.edit.anchoring import Fitting, anchor_of
from scenewright.stages.edit.applying import apply_edits
from scenewright.stages.edit.edits_file import append_edits, line_of, read_edits
from scenewright.stages.edit.map_edits import MAP_EDITS, box_surface
from scenewright.stages.edit.map_stage import BY_A_PERSON, run
from scenewright.stages.edit.map_state import MapState, read_state
from scenewright.stages.edit.parameters import EditMapParameters
from scenewright.stages.kit.formats.entity_meshes import load_entity_mesh
from scenewright.stages.kit.geometry.boxes import gravity_aligned_box
from scenewright.stages.kit.geometry.transforms import transform_from
from scenewright.stages.kit.progress import SilentProgress
from scenewright.stages.kit.stage import Context
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from tests.unit.edit.maps import room_map
from tests.unit.viewing.artifacts import seal

FITTING = Fitting(**EditMapParameters().model_dump())
CUP, TWIN, TABLE, CABINET = 3, 4, 2, 5


@pytest.fixture(scope="module")
def seen(tmp_path_factory: pytest.TempPathFactory) -> PanopticMap:
    """The map on which somebody made the edits."""
    return room_map(tmp_path_factory.mktemp("seen") / "map")


def edit(what: str, seen: PanopticMap, *instances: int, **values: Any) -> MapEdit:
    """An edit of things of a map, with anchors."""
    state, _ = read_state(seen)
    anchors = [anchor_of(state, k).model_dump(by_alias=True) for k in instances]
    of = {} if not anchors else {"of": anchors if what == "merge" else anchors[0]}
    return TypeAdapter(MapEdit).validate_python({"what": what, **of, **values})


def applied(panoptic_map: PanopticMap, *edits: MapEdit) -> tuple[MapState, list[AppliedEdit]]:
    state, _ = read_state(panoptic_map)
    records = apply_edits(state, edits, FITTING, MAP_EDITS)
    state.finished()
    return state, records


def names(state: MapState) -> list[str]:
    return [thing.name for thing in state.things()]


def box(center: tuple[float, float, float], size: tuple[float, float, float]) -> dict[str, Any]:
    return {"center": center, "size": size}


def test_edits_land_on_the_same_things_whatever_their_numbers(seen: PanopticMap, tmp_path: Path) -> None:
    other = room_map(tmp_path / "other", spacing=0.04, number={3: 40, 4: 3, 2: 5, 5: 2})
    asked = [
        edit("rename", seen, CUP, **{"class": "bottle"}),
        edit("delete", seen, TWIN),
        edit("merge", seen, TABLE, CABINET),
    ]
    here, records = applied(seen, *asked)
    assert [record.status for record in records] == ["applied"] * 3
    assert names(here) == ["floor_1", "table_2", "bottle_3"] and records[2].things == ("table_2",)
    there, records = applied(other, *asked)
    assert [record.status for record in records] == ["applied"] * 3
    assert names(there) == ["floor_1", "table_5", "bottle_40"]
    assert there.entities[40].confidence == 1.0
    # The surface of the deleted cup stays, without a name.
    assert len(there.instance) == len(read_state(other)[0].instance) and (there.instance == 0).sum() > 20


def test_the_layout_and_the_reasons_stay_and_a_new_name_says_whose_it_is(tmp_path: Path) -> None:
    room = room_map(tmp_path / "map")
    row = Because(instance=1, shape="masks", looks=9.0, said={"cup": 0.5}, name="the likeliest", posterior=0.7)
    rows = tuple(row.model_copy(update={"instance": e.instance}) for e in room.info.entities)
    BecauseFile(entities=rows, dropped=("few looks",)).write(room.path("because.json"))
    plane = LayoutPlane(
        kind="floor",
        bounds=True,
        normal=(0, 0, 1),
        offset=0,
        area=4,
        start=(0, 0, 0),
        end=(2, 2, 0),
        reasons={},
        log_odds=1,
    )
    LayoutFile(floor=0.0, planes=(plane,)).write(room.path("layout.json"))
    edits = tmp_path / "edits.toml"
    append_edits(edits, [edit("rename", room, CUP, **{"class": "bottle"}), edit("delete", room, CABINET)])
    context = Context(output=tmp_path / "edited", seed=0, device="cpu", progress=SilentProgress())
    found = run(room, edits, parameters=EditMapParameters(), context=context)
    assert found.layout is not None and found.layout == room.layout
    assert found.because is not None and found.because.dropped == ("few looks",)
    reasons = {row.instance: row for row in found.because.entities}
    assert set(reasons) == {row.instance for row in rows} - {CABINET}, "of what was deleted there is none"
    assert reasons[CUP] == row.model_copy(update={"instance": CUP, "name": BY_A_PERSON, "posterior": 1.0})
    assert reasons[TABLE] == row.model_copy(update={"instance": TABLE})


def test_what_no_longer_fits_is_a_conflict_and_changes_nothing(seen: PanopticMap, tmp_path: Path) -> None:
    asked = edit("rename", seen, CUP, **{"class": "bottle"})
    gone = room_map(tmp_path / "gone", without=(CUP,))
    as_one = room_map(tmp_path / "as_one", joined={CUP: TABLE})
    otherwise = room_map(tmp_path / "otherwise", classes={CUP: "book"})
    for where, words in (
        (gone, "table_2, which is no cup"),
        (as_one, "table_2, which is no cup"),
        (otherwise, "book_3, which is no cup"),
    ):
        state, (record,) = applied(where, asked)
        assert record.status == "conflict" and words in record.reason, record
        assert not state.touched and state.entities == read_state(where)[0].entities


def test_two_things_that_fit_alike_are_a_conflict(seen: PanopticMap, tmp_path: Path) -> None:
    asked = edit("delete", seen, CUP)
    state, _ = read_state(room_map(tmp_path / "double"))
    # A second cup in the place of the first: the map is of two minds.
    own = state.instance == CUP
    vertices, faces = box_surface(gravity_aligned_box((0.24, 0.04, 0.80), (0.09, 0.09, 0.11), 0.0), 0.02)
    state.add_surface(vertices, faces, state.new_entity("cup", 3))
    (record,) = apply_edits(state, [asked], FITTING, MAP_EDITS)
    assert record.status == "conflict" and "more than one" in record.reason and "cup_3" in record.reason
    assert (state.instance[: len(own)] == CUP).sum() == own.sum()


def test_what_is_so_already_is_said_and_left(seen: PanopticMap, tmp_path: Path) -> None:
    renamed = room_map(tmp_path / "renamed", classes={CUP: "bottle"})
    merged = room_map(tmp_path / "merged", joined={CABINET: TABLE})
    for where, asked in (
        (renamed, edit("rename", seen, CUP, **{"class": "bottle"})),
        (merged, edit("merge", seen, TABLE, CABINET)),
        (seen, edit("add", seen, box=box((0.24, 0.04, 0.8), (0.08, 0.08, 0.1)), **{"class": "cup"})),
    ):
        state, (record,) = applied(where, asked)
        assert record.status == "already", record
        assert not state.touched


def test_a_part_becomes_a_thing_of_its_own(seen: PanopticMap, tmp_path: Path) -> None:
    upper = box((-0.6, 0.95, 0.7), (0.9, 0.4, 0.42))
    asked = edit("split", seen, CABINET, part=upper, **{"class": "shelf"})
    for where in (seen, room_map(tmp_path / "coarse", spacing=0.05)):
        state, (record,) = applied(where, asked)
        assert record.status == "applied" and record.things == ("cabinet_5", "shelf_6")
        points = state.surface.vertices
        assert points[state.instance == 6, 2].min() > 0.48 and points[state.instance == 5, 2].max() < 0.5
    beside = edit("split", seen, CABINET, part=box((0.5, 0.5, 0.5), (0.1, 0.1, 0.1)), **{"class": "shelf"})
    _, (record,) = applied(seen, beside)
    assert record.status == "conflict" and "0 of the" in record.reason


def test_a_thing_is_added_from_unnamed_surface_or_drawn(seen: PanopticMap, tmp_path: Path) -> None:
    where = room_map(tmp_path / "unnamed", unnamed=(CUP,))
    cup = box((0.24, 0.04, 0.8), (0.1, 0.1, 0.12))
    state, (record,) = applied(where, edit("add", seen, box=cup, **{"class": "cup"}))
    assert record.things == ("cup_6",) and state.entities[6].triangles > 20
    glass = edit("add", seen, box=box((0.0, -0.2, 0.82), (0.06, 0.06, 0.14)), surface="box", **{"class": "cup"})
    state, (record,) = applied(seen, glass)
    assert record.status == "applied"
    low, high = (np.array(state.entities[6].box_minimum), np.array(state.entities[6].box_maximum))
    assert np.allclose(high - low, (0.06, 0.06, 0.14), atol=1e-5)
    _, (record,) = applied(seen, edit("add", seen, box=box((0.9, -0.9, 1.5), (0.1, 0.1, 0.1)), **{"class": "cup"}))
    assert record.status == "conflict" and "0 vertices without a name" in record.reason


def test_a_drawn_box_is_closed_and_looks_outwards() -> None:
    import trimesh

    vertices, faces = box_surface(gravity_aligned_box((1, 2, 3), (0.3, 0.2, 0.1), 0.4), 0.05)
    mesh = trimesh.Trimesh(vertices, faces, process=True)
    assert mesh.is_watertight and mesh.volume == pytest.approx(0.3 * 0.2 * 0.1)


def test_the_point_of_an_anchor_lies_where_most_of_the_thing_is_around_it(seen: PanopticMap) -> None:
    state = read_state(seen)[0]
    anchor = anchor_of(state, CUP)
    assert anchor.class_name == "cup" and anchor.box.size == pytest.approx((0.08, 0.08, 0.1), abs=1e-3)
    assert state.things()[CUP - 1].surface.query(anchor.point)[0] < 1e-3
    # The cup stands on the table: its foot is surrounded by the table's top.
    assert anchor.point[2] > 0.78
    table = anchor_of(state, TABLE)
    assert min(np.hypot(table.point[0] - x, table.point[1] - 0.04) for x in (0.24, -0.26)) > 0.08


def test_a_thing_of_which_less_was_seen_fits_unless_it_is_a_piece(seen: PanopticMap) -> None:
    asked = edit("rename", seen, CABINET, **{"class": "shelf"})
    for rest, status in ((0, "applied"), (6, "conflict")):
        state, _ = read_state(seen)
        heights = state.surface.vertices[:, 2]
        near = np.abs(heights - asked.of.point[2]) < 0.3  # of its 0.9 m, the part that the point is in
        if rest:
            assert state.new_entity("cabinet", 3) == rest
        state.relabel((state.instance == CABINET) & ~near, rest)
        (record,) = apply_edits(state, [asked], FITTING, MAP_EDITS)
        assert record.status == status, record


def test_what_masks_did_not_recognise_may_be_any_class(seen: PanopticMap, tmp_path: Path) -> None:
    asked = edit("rename", seen, CUP, **{"class": "bottle"})
    nameless = room_map(tmp_path / "nameless", classes={CUP: "object"})
    _, (record,) = applied(nameless, asked)
    assert record.things == ("bottle_3",)


def test_the_step_writes_a_whole_map_and_says_conflicts(seen: PanopticMap, tmp_path: Path, capsys) -> None:
    edits, out = tmp_path / "edits.toml", tmp_path / "edited"
    command = ["--panoptic-map", str(seen.root), "--by", 'An"na <b>', "--note", "a\nb\x7f"]
    assert scenewright(["edit", "rename", str(edits), "cup_3", "--class", "bottle", *command]) == 0
    assert scenewright(["edit", "merge", str(edits), "2", "5", *command]) == 0
    apply = ["edit", "map", "--edits", str(edits), "--panoptic-map"]
    assert scenewright([*apply, str(seen.root), "--out", str(out)]) == 0
    made = PanopticMap(out)
    assert [f"{e.class_name}_{e.instance}" for e in made.info.entities] == ["floor_1", "table_2", "bottle_3", "cup_4"]
    assert made.edits is not None and [record.status for record in made.edits.edits] == ["applied", "applied"]
    assert made.edits.edits[0].by == 'An"na <b>' and len(made.edits.edits[0].when) == 20
    for entity in made.info.entities:
        mesh = load_entity_mesh(made.path(entity.mesh))
        assert (len(mesh.vertices), len(mesh.faces)) == (entity.vertices, entity.triangles)
    with np.load(made.path("mesh_labels.npz"), allow_pickle=False) as labels:
        assert set(np.unique(labels["instance"]).tolist()) == {1, 2, 3, 4} and len(np.unique(labels["class_id"])) == 4
    assert made.path("entities/1.ply").read_bytes() == seen.path("entities/1.ply").read_bytes()
    # An edited map is edited further, and undo is deleting a line.
    assert scenewright(["edit", "delete", str(edits), "bottle_3", "--panoptic-map", str(out)]) == 0
    lines = edits.read_text().splitlines()
    edits.write_text("\n".join(line for line in lines if "rename" not in line) + "\n")
    capsys.readouterr()
    assert scenewright([*apply, str(seen.root), "--out", str(out)]) == 4
    manifest = json.loads((out / "manifest.json").read_text())
    assert manifest["outcome"] == "conflicts" and manifest["summary"]["conflicts"] == 1
    assert "which is no bottle" in manifest["summary"]["reason"] and "no bottle" in capsys.readouterr().err
    # The graph is built from an edited map as from any other.
    assert scenewright(["graph", "--panoptic-map", str(out), "--out", str(tmp_path / "graph")]) == 0


def test_lines_are_added_to_a_file_that_people_write_too(seen: PanopticMap, tmp_path: Path) -> None:
    path = tmp_path / "edits.toml"
    first = edit("delete", seen, TWIN, by='quotes " and \\ and <b>', note="x" * 10_000)
    append_edits(path, [first])
    path.write_text(path.read_text().replace("edits = [", "# which are mine\nedits = [") + "# the end ]\n")
    with pytest.raises(BadInput, match="last thing"):
        append_edits(path, [first])
    path.write_text(path.read_text().replace("# the end ]\n", "# the end\n"))
    said = append_edits(path, [edit("delete", seen, CUP)])
    assert said == read_edits(path) and said.edits[0] == first and len(said.edits) == 2
    assert "# which are mine" in path.read_text() and path.read_text().endswith("# the end\n")
    assert line_of(first) in path.read_text() and not list(tmp_path.glob(".edits*"))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("edits = [", "edits.toml"),
        ('format = "scenewright-edits"\nversion = 2\n', "version"),
        ('format = "scenewright-edits"\nversion = 1\nedits = [{ what = "explode" }]\n', "edits.0"),
        ('format = "scenewright-edits"\nversion = 1\nwhere = 3\n', "where"),
        (
            'format = "scenewright-edits"\nversion = 1\nedits = [{ what = "add", class = "unicorn", '
            "box = { center = [0, 0, 0], size = [1, 1, 1] } }]\n",
            "unicorn",
        ),
        (
            'format = "scenewright-edits"\nversion = 1\nedits = [{ what = "add", class = "cup", '
            "box = { center = [nan, 0, 0], size = [1, 1, 1] } }]\n",
            "center",
        ),
    ],
)
def test_a_broken_file_is_refused_by_name_and_left(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "edits.toml"
    path.write_text(text)
    with pytest.raises(BadInput, match=words):
        read_edits(path)
    with pytest.raises(BadInput, match=words):
        append_edits(path, [])
    assert path.read_text() == text


def test_commands_refuse_what_is_not_there(seen: PanopticMap, tmp_path: Path, capsys) -> None:
    edits = str(tmp_path / "edits.toml")
    where = ["--panoptic-map", str(seen.root)]
    assert scenewright(["edit", "delete", edits, "cup_99", *where]) == 2 and "cup_3" in capsys.readouterr().err
    assert scenewright(["edit", "rename", edits, "cup_3", *where, "--class", "unicorn"]) == 2
    assert scenewright(["edit", "merge", edits, "3", "3", *where]) == 2
    assert (
        scenewright(["edit", "add", edits, "--class", "cup", "--center", "0", "0", "0", "--size", "0", "1", "1"]) == 2
    )
    assert scenewright(["edit", "delete", str(tmp_path / "no" / "edits.toml"), "3", *where]) == 3
    assert list(tmp_path.iterdir()) == []


def test_every_kind_of_edit_is_a_command_with_its_fields_and_ranges(capsys) -> None:
    kinds = kinds_of(AnyEdit)
    assert [command.__name__ for command in COMMANDS] == [get_args(k.model_fields["what"].annotation)[0] for k in kinds]
    assert scenewright(["edit", "new-joint", "--help"]) == 0
    said = " ".join(capsys.readouterr().out.split())
    for words in (
        "FILE",
        "THING",
        "--center",
        "--yaw",
        "--axis",
        "-100.0<=x<=100.0",
        "--handle",
        "--cad-scene",
        "--by",
    ):
        assert words in said
    assert AddJoint.model_fields["upper"].description in said
    assert scenewright(["edit", "joint", "e.toml", "fridge_3", "door", "--lower", "200", "--cad-scene", "x"]) == 2


def test_gravity_turns_the_whole_map_and_what_follows_it(tmp_path: Path) -> None:
    """A room that leans by 4 degrees stands upright after three clicks on its table; made anew it is told so again."""
    leaning = np.array(Rotation.from_euler("x", 4.0, degrees=True).as_matrix())
    seen = room_map(tmp_path / "map")
    upright, _ = read_state(seen)
    state, _ = read_state(seen)
    state.turn(transform_from(leaning, np.zeros(3)))
    places = [(0.5, -0.3, 0.75), (-0.5, -0.3, 0.75), (0.0, 0.3, 0.75)]
    leant = [tuple(np.round(leaning @ place, 3).tolist()) for place in places]
    asked = TypeAdapter(MapEdit).validate_python({"what": "gravity", "level": leant})
    (record,) = apply_edits(state, [asked], FITTING, MAP_EDITS)
    assert record.status == "applied" and "4.0 degrees" in record.reason
    table = next(thing for thing in state.things() if thing.instance == TABLE)
    before = next(thing for thing in upright.things() if thing.instance == TABLE)
    assert np.allclose(table.box.size, before.box.size, atol=5e-3)
    (record,) = apply_edits(
        state, [asked.model_copy(update={"level": places_now(state, places, upright)})], FITTING, MAP_EDITS
    )
    assert record.status == "already"
    for level, words in (
        ([(9.0, 9.0, 9.0), *leant[:2]], "no surface"),
        ([places_now(state, places, upright)[0]] * 3, "on one line"),
    ):
        (record,) = apply_edits(state, [asked.model_copy(update={"level": tuple(level)})], FITTING, MAP_EDITS)
        assert record.status == "conflict" and words in record.reason


def places_now(
    state: MapState, places: list[tuple[float, float, float]], upright: MapState
) -> tuple[tuple[float, float, float], ...]:
    """Where places of the upright map are now."""
    _, near = cKDTree(upright.surface.vertices).query(places)
    return tuple(tuple(float(value) for value in state.surface.vertices[k]) for k in near)  # type: ignore[return-value]


def test_a_turned_map_has_no_volume_and_says_how(tmp_path: Path) -> None:
    seen, edits, out = room_map(tmp_path / "map"), tmp_path / "edits.toml", tmp_path / "edited"
    (seen.root / "manifest.json").unlink()
    np.savez(seen.root / "volume.npz", tsdf=np.zeros(1))
    seal(seen.root, "panoptic_map")
    slope = [(0.5, -0.3, 0.75), (-0.5, -0.3, 0.75), (0.24, 0.04, 0.85)]  # no plane of the room: two of the table, a cup
    named = zip(("--first", "--second", "--third"), slope, strict=True)
    words = [word for name, place in named for word in (name, *map(str, place))]
    assert scenewright(["edit", "gravity", str(edits), *words]) == 0
    assert scenewright(["edit", "floor", str(edits), "--at", "0", "0", "0.1"]) == 0
    apply = ["edit", "map", "--panoptic-map", str(seen.root), "--edits", str(edits), "--out", str(out)]
    assert scenewright(apply) == 0
    made = PanopticMap(out)
    assert made.info.world_from_sequence is not None and not made.path("volume.npz").exists()
    entity = next(entity for entity in made.info.entities if entity.class_name == "floor")
    assert entity.box_maximum[2] >= 0.1 - 1e-3
    turned, plain = np.array(made.info.world_from_sequence), read_state(seen)[0].surface.vertices
    count = len(plain)
    assert np.allclose(
        read_state(made)[0].surface.vertices[:count], plain @ turned[:3, :3].T + turned[:3, 3], atol=1e-3
    )


def test_the_floor_is_where_a_person_says(tmp_path: Path) -> None:
    """The floor that was seen is 30 cm too high; without any the graph has one to stand things on."""
    state, _ = read_state(room_map(tmp_path / "map"))
    asked = TypeAdapter(MapEdit).validate_python({"what": "floor", "at": (0.3, 0.3, -0.3)})
    (record,) = apply_edits(state, [asked], FITTING, MAP_EDITS)
    assert record.status == "applied" and record.reason == "in place of floor_1"
    (floor,) = [thing for thing in state.things() if thing.class_name == "floor"]
    assert floor.box.center[2] + floor.box.size[2] / 2 == pytest.approx(-0.3, abs=1e-3)
    assert (state.instance == 0).any()  # what was called floor before
    (record,) = apply_edits(state, [asked], FITTING, MAP_EDITS)
    assert record.status == "already"
