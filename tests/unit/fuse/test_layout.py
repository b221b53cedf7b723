"""What bounds a room by geometry: its walls, floor and ceiling are found exactly, and nothing else is one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scenewright.schemas.panoptic_map import LayoutFile
from scenewright.stages.fuse.layout.evidence import VOTES, Scene, votes
from scenewright.stages.fuse.layout.file import layout_file
from scenewright.stages.fuse.layout.planes import level_planes, upright_planes
from scenewright.stages.fuse.layout.room import CEILING, FLOOR, WALL, Layout, find_layout
from scenewright.stages.kit.geometry.transforms import look_at

from tests.unit.fuse.rooms import look_around, seen, walls_around
from tests.unit.fuse.scenes import Block

EYES = ((2.0, 1.5, 1.5), (3.5, 2.2, 1.6))
ROOM = walls_around(5, 4, 2.5)
COUNTER = Block("cabinet", (0, 3.4, 0), (2.5, 4, 0.9))
TABLE = Block("table", (3, 1, 0.68), (4.4, 1.8, 0.72))
BED, SOFA = Block("bed", (0, 2, 0), (2, 3.8, 0.5)), Block("sofa", (3, 3, 0), (4.9, 3.9, 0.42))
PARTITION = Block("wall", (2.4, 0, 0), (2.5, 2.6, 2.5))
FRIDGE = (
    Block("fridge", (4.15, 1.5, 0), (4.9, 1.55, 1.75)),
    Block("fridge", (4.15, 2.25, 0), (4.9, 2.3, 1.75)),
    Block("fridge", (4.88, 1.5, 0), (4.92, 2.3, 1.75)),
    Block("fridge", (4.15, 1.5, 0.6), (4.9, 2.3, 0.63)),
)
LEAF = Block("fridge", (3.4, 2.26, 0.7), (4.1, 2.3, 1.75))
STOREY = Block("floor", (0, 0, 2.6), (3, 4, 2.8))
ROOMS = {
    "box": (ROOM, EYES),
    "partition": ((*ROOM, PARTITION), ((1.2, 2.0, 1.5), (3.7, 2.0, 1.5), (2.4, 3.3, 1.5))),
    "kitchen": ((*ROOM, COUNTER, TABLE), EYES),
    "bedroom": ((*ROOM, BED, SOFA), ((2.5, 1.5, 1.5), (3.5, 2, 1.6))),
    "storeys": ((*walls_around(5, 4, 5.4), STOREY), ((2, 2, 1.5), (4, 2, 1.5), (2, 2, 4.3), (1, 1, 4.3))),
    "corridor": (walls_around(6, 1.2, 2.5, but="ew"), ((1.0, 0.6, 1.5), (4.0, 0.6, 1.5))),
    "one wall": ((Block("wall", (-2, 2, 0), (4, 2.1, 2.5)),), ((1.0, 0.0, 1.5),)),
    "open fridge": ((*ROOM, *FRIDGE, LEAF), ((1.2, 1.2, 1.5), (3.4, 2.2, 1.6), (1.0, 3.2, 1.6))),
    "tabletop": ((TABLE, Block("cup", (3.5, 1.3, 0.72), (3.6, 1.4, 0.82))), ((3.6, 0.4, 1.2),)),
}


@cache
def view(name: str) -> tuple[Scene, np.ndarray, Layout]:
    """What cameras saw of a room, the block of every vertex, and the layout."""
    blocks, eyes = ROOMS[name]
    scene, owner = seen(blocks, look_around(*eyes))
    return scene, owner, find_layout(scene)


def bounds(layout: Layout) -> list[tuple[str, tuple[float, ...], float]]:
    """Kind, normal and offset of each plane that bounds the room, sorted."""
    kept = [each for each in layout.planes if each.log_odds > 0]
    rows = [(each.kind, tuple((np.rint(each.plane.normal) + 0.0).tolist()), each.plane.offset) for each in kept]
    return sorted((kind, normal, round(float(offset), 2) + 0.0) for kind, normal, offset in rows)


AROUND = [
    (CEILING, (0.0, 0.0, -1.0), -2.5),
    (FLOOR, (0.0, 0.0, 1.0), 0.0),
    (WALL, (-1.0, 0.0, 0.0), -5.0),
    (WALL, (0.0, -1.0, 0.0), -4.0),
    (WALL, (0.0, 1.0, 0.0), 0.0),
    (WALL, (1.0, 0.0, 0.0), 0.0),
]


def test_the_planes_of_a_box_are_exactly_its_walls() -> None:
    scene, owner, layout = view("box")
    assert bounds(layout) == AROUND and len(layout.planes) == 6
    assert (layout.owner > 0).all(), "all that is seen is of one of them"
    levels = [level_planes(scene.vertices, scene.normals, scene.areas, up=up) for up in (True, False)]
    assert [[round(float(p.offset), 3) + 0.0 for p in planes] for planes in levels] == [[0.0], [-2.5]]
    walls = upright_planes(scene.vertices, scene.normals, scene.areas)
    assert sorted(round(float(p.offset), 3) + 0.0 for p in walls) == [-5.0, -4.0, 0.0, 0.0]
    members = np.concatenate([p.members for p in walls])
    assert len(np.unique(members)) == len(members) and set(owner[members]) == {2, 3, 4, 5}


def test_a_partition_that_was_seen_from_both_sides_is_a_wall() -> None:
    _, owner, layout = view("partition")
    both = [(WALL, (-1.0, 0.0, 0.0), -2.4), (WALL, (1.0, 0.0, 0.0), 2.5)]
    assert bounds(layout) == sorted([*AROUND, *both])
    of_partition = owner == len(ROOM)
    assert (layout.of(WALL) | layout.of(CEILING) | layout.of(FLOOR))[of_partition].mean() > 0.99, "its end too"


def test_what_stands_at_a_partition_is_not_of_the_wall_on_its_other_side() -> None:
    shelf = Block("shelf", (2.5, 0.5, 0.0), (2.64, 2.0, 1.0))
    scene, owner = seen((*ROOM, PARTITION, shelf), look_around(*ROOMS["partition"][1]))
    layout = find_layout(replace(scene, furniture=(owner == len(ROOM) + 1).astype(float)))
    front = (owner == len(ROOM) + 1) & (scene.vertices[:, 0] > 2.62) & (scene.vertices[:, 2] > 0.1)
    assert front.sum() > 100 and not layout.owner[front].any()


def test_a_leaf_that_stands_open_and_the_back_behind_it_are_no_walls() -> None:
    scene, owner, layout = view("open fridge")
    assert bounds(layout) == AROUND
    leaf, back = owner == len(ROOM) + len(FRIDGE), owner == len(ROOM) + 2
    assert leaf.sum() > 300 and not layout.owner[leaf].any()
    judged = [
        each for each in layout.planes if set(np.unique(owner[each.plane.members])) & {len(ROOM) + 4, len(ROOM) + 2}
    ]
    assert back.sum() > 100 and all(each.log_odds < 0 for each in judged)


@pytest.mark.parametrize("name", ["kitchen", "bedroom"])
@pytest.mark.parametrize("said", ["nothing", "wall everywhere", "tables everywhere"])
def test_furniture_bounds_nothing_whatever_masks_say_of_everything(name: str, said: str) -> None:
    scene, owner, layout = view(name)
    ones = np.ones(len(owner))
    if said != "nothing":
        scene = replace(scene, **{"bounding" if said == "wall everywhere" else "furniture": ones})
        layout = find_layout(scene)
    assert bounds(layout) == AROUND
    furniture = owner >= len(ROOM)
    inside = furniture & (scene.vertices[:, 2] > 0.1) & (scene.vertices[:, :2] < [4.7, 3.7]).all(axis=1)
    inside &= scene.vertices[:, 0] > 0.3
    assert inside.sum() > 200 and not layout.owner[inside].any()


def test_votes_move_log_odds_one_way_and_the_other() -> None:
    scene, owner, layout = view("kitchen")
    counter = next(each.plane for each in layout.planes if each.log_odds < 0 and abs(each.plane.offset + 3.4) < 0.01)
    of_room, of_counter = (owner < len(ROOM)).astype(float), (owner == len(ROOM)).astype(float)
    assert votes(counter, scene) == 0.0
    assert votes(counter, replace(scene, bounding=of_room, furniture=of_counter)) == -VOTES
    assert votes(counter, replace(scene, bounding=of_counter)) == VOTES
    wall = next(each.plane for each in layout.planes if each.kind == WALL)
    assert votes(wall, replace(scene, bounding=of_room, furniture=of_counter)) > 0


@settings(max_examples=30, deadline=None)
@given(st.floats(0, 1), st.floats(0, 1), st.floats(0, 0.5))
def test_more_masks_of_bounds_never_speak_against_a_plane(bounding: float, furniture: float, more: float) -> None:
    scene, _, layout = view("kitchen")
    plane = layout.planes[-1].plane
    said = np.zeros(len(scene.vertices)), np.full(len(scene.vertices), furniture)
    said[0][plane.members] = bounding
    before = votes(plane, replace(scene, bounding=said[0], furniture=said[1]))
    said[0][plane.members] += more
    assert votes(plane, replace(scene, bounding=said[0], furniture=said[1])) >= before - 1e-12


def test_an_upper_storey_has_its_own_floor_and_is_of_no_ceiling_below() -> None:
    scene, owner, layout = view("storeys")
    levels = [(kind, offset) for kind, _, offset in bounds(layout) if kind != WALL]
    assert levels == [(CEILING, -5.4), (CEILING, -2.6), (FLOOR, 0.0), (FLOOR, 2.8)]
    top = (owner == 6) & (scene.normals[:, 2] > 0.5)
    assert layout.of(FLOOR)[top].mean() > 0.9 and not layout.of(CEILING)[top].any()
    upper_wall = (owner == 5) & (np.abs(scene.vertices[:, 2] - 4.0) < 0.5)
    assert layout.of(WALL)[upper_wall].all()
    assert layout.floor == pytest.approx(0.0, abs=0.01)


def test_a_room_at_any_angle_is_the_same_room() -> None:
    scene, _, layout = view("kitchen")
    scan = replace(scene, free=None)
    for turn in (0.03, 0.7, -2.5):
        c, s = np.cos(turn), np.sin(turn)
        turned = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]).T
        found = find_layout(
            replace(scan, **{name: getattr(scan, name) @ turned for name in ("vertices", "normals", "cameras")})
        )
        assert (np.sign(found.owner) == np.sign(layout.owner)).mean() > 0.99


HOLE_Y = (1.0, 1.9)


@pytest.mark.parametrize(("sill", "head"), [(0.0, 2.0), (0.9, 2.1)])
def test_a_door_begins_at_the_floor_and_a_window_above_it(sill: float, head: float) -> None:
    low, high = HOLE_Y
    wall = [((5, 0, 0), (5.1, low, 2.5)), ((5, high, 0), (5.1, 4, 2.5)), ((5, low, head), (5.1, high, 2.5))]
    wall += [((5, low, 0), (5.1, high, sill))] if sill else []
    beyond = [Block("wall", (7, -2, 0), (7.1, 6, 2.5)), Block("floor", (5.1, -2, -0.1), (7, 6, 0))]
    blocks = (*walls_around(5, 4, 2.5, but="e"), *(Block("wall", *corners) for corners in wall), *beyond)
    eyes = [np.array([x, y, z]) for x in (2.5, 3.2, 3.9) for y in (0.8, 1.3, 1.8, 2.3) for z in (1.3, 1.7)]
    through = [look_at(eye, np.array([5.0, 1.45, z])) for eye in eyes for z in (0.4, 1.2, 1.8)]
    scene, _ = seen(blocks, [*look_around(*EYES), *through])
    rows = [plane for plane in layout_file(find_layout(scene), scene).planes if plane.openings]
    (plane,) = rows
    (opening,) = plane.openings
    assert plane.offset == pytest.approx(-5.0, abs=0.01) and plane.kind == WALL and plane.bounds
    assert opening.sill == pytest.approx(sill, abs=0.101 if sill else 0)
    assert opening.head == pytest.approx(head, abs=0.101)
    assert opening.width == pytest.approx(high - low, abs=0.201)
    assert opening.left == pytest.approx(plane.start[1] - high, abs=0.151), "from the left, as one looks at the wall"


def test_a_scan_has_no_openings_and_nothing_speaks_of_free_space() -> None:
    scene, _, _ = view("kitchen")
    scan = replace(scene, free=None, cameras=np.zeros((0, 3)))
    file = layout_file(find_layout(scan), scan)
    assert not any(plane.openings or "free space behind" in plane.reasons for plane in file.planes)
    assert sum(plane.bounds and plane.kind == WALL for plane in file.planes) == 4


@pytest.mark.parametrize(
    ("name", "expected"), [("corridor", [CEILING, FLOOR, WALL, WALL]), ("one wall", [WALL]), ("tabletop", [FLOOR])]
)
def test_the_layout_that_can_be_had(name: str, expected: Sequence[str]) -> None:
    scene, _, layout = view(name)
    assert [kind for kind, _, _ in bounds(layout)] == expected
    assert (layout.floor is None) == (FLOOR not in expected)
    file = layout_file(layout, scene)
    assert LayoutFile.model_validate_json(file.model_dump_json()) == file


def test_a_tabletop_that_masks_call_a_table_is_no_floor() -> None:
    scene, owner, _ = view("tabletop")
    layout = find_layout(replace(scene, furniture=np.ones(len(owner))))
    assert bounds(layout) == [] and layout.floor is None


def test_no_surface_has_no_layout() -> None:
    nothing = np.zeros(0)
    layout = find_layout(Scene(np.zeros((0, 3)), np.zeros((0, 3)), nothing, nothing, nothing, np.zeros((0, 3)), None))
    assert layout.planes == () and layout.floor is None and layout.owner.shape == (0,)


@settings(max_examples=20, deadline=None)
@given(st.integers(1, 40), st.integers(0, 2**32 - 1))
def test_any_points_have_some_layout(count: int, seed: int) -> None:
    random = np.random.default_rng(seed)
    normals = random.normal(size=(count, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    shares = random.uniform(size=(3, count))
    scene = Scene(random.normal(size=(count, 3)), normals, shares[0], shares[1], shares[2], np.zeros((0, 3)), None)
    layout = find_layout(scene)
    assert layout.owner.shape == (count,) and layout.owner.max(initial=0) <= len(layout.planes)
    layout_file(layout, scene)
