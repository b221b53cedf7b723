"""Surface that no mask names: what stands free, on a top or beside one is a piece of its own."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scenewright.stages.fuse.layout.evidence import Scene
from scenewright.stages.fuse.layout.room import find_layout
from scenewright.stages.fuse.pieces import (
    HELD,
    TOLD,
    Cloud,
    Footprint,
    connected,
    grown_things,
    pieces_beside,
    pieces_of,
)
from scenewright.stages.kit.geometry.point_clouds import vertex_areas, vertex_normals

from tests.unit.fuse.rooms import Corners, sheets

VOXEL = 0.02
Parts = tuple[np.ndarray, np.ndarray, np.ndarray]

BOX = ((-1.0, -1.0, 0.0), (-0.5, -0.5, 0.4))
COUNTER, ON_IT = ((0.0, 1.4, 0.0), (1.5, 1.98, 0.9)), ((0.5, 1.6, 0.92), (0.8, 1.8, 1.2))
TABLETOP = ((-1.0, -1.0, 0.68), (0.2, -0.2, 0.72))
SEAT, BACK = ((-0.6, -0.3, 0.4), (-0.2, 0.1, 0.44)), ((-0.6, -0.18, 0.44), (-0.2, -0.14, 0.95))


def cloud_of(scene: Parts) -> Cloud:
    vertices, faces, _ = scene
    return Cloud(vertices, vertex_normals(vertices, faces), VOXEL)


def pieces(scene: Parts, area: float = 0.05) -> np.ndarray:
    """Pieces of all but floor and wall."""
    return pieces_of(cloud_of(scene), scene[2] > 1, area)


def beside(
    scene: Parts, instance: np.ndarray, area: float = 0.05, told: np.ndarray | float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """Pieces beside the things of masks, and the thing of every vertex; floor and wall are the room's."""
    shares = np.broadcast_to(np.asarray(told, float), instance.shape)
    found = pieces_beside(cloud_of(scene), instance.astype(np.int32), scene[2] < 2, shares, area)
    return found.piece, found.thing_of


def of_part(piece: np.ndarray, owner: np.ndarray, part: int) -> int:
    """The piece that most of a part is of."""
    return int(np.bincount(piece[owner == part]).argmax())


def test_what_stands_free_is_a_piece_the_largest_first() -> None:
    scene = sheets(BOX, COUNTER, ON_IT)
    piece, owner = pieces(scene), scene[2]
    found = [of_part(piece, owner, part) for part in range(5)]
    assert found[:2] == [0, 0] and sorted(found[2:]) == [1, 2, 3] and found[3] == 1
    assert all((piece[owner == part] == found[part]).mean() > 0.95 for part in (2, 3, 4))


def test_small_things_on_a_top_are_pieces_and_what_depth_cannot_tell_is_none() -> None:
    cup, book, sheet = ((0.3, 1.6, 0.9), (0.4, 1.7, 1.0)), ((0.9, 1.6, 0.9), (1.2, 1.8, 0.935)), 0.91
    scene = sheets(COUNTER, cup, book, ((1.25, 1.6, 0.9), (1.45, 1.8, sheet)))
    piece, owner = pieces(scene, area=0.2), scene[2]
    counter, on_it, lying, flat = (of_part(piece, owner, part) for part in (2, 3, 4, 5))
    assert len({counter, on_it, lying} - {0}) == 3 and flat in (0, counter)


def test_a_bent_top_carries_nothing() -> None:
    vertices, faces, owner = sheets(COUNTER)
    middle = vertices[owner == 2].mean(axis=0)
    top = (owner == 2) & (vertices[:, 2] > 0.899)
    bent = vertices.copy()
    bent[top, 2] += 0.1 * (vertices[top, 0] - middle[0]) ** 2  # up to six centimetres at its ends
    assert len(set(pieces((bent, faces, owner))[top].tolist()) - {0}) == 1


def test_parts_above_each_other_are_one_unless_one_carries_the_other() -> None:
    lower, upper = ((-1.0, -1.0, 0.1), (-0.74, -0.74, 0.5)), ((-1.0, -1.0, 0.7), (-0.74, -0.74, 1.1))
    scene = sheets(lower, upper)
    piece, owner = pieces(scene), scene[2]
    assert of_part(piece, owner, 2) == of_part(piece, owner, 3) == 1
    scene = sheets(COUNTER, ON_IT)
    piece, owner = pieces(scene), scene[2]
    assert 0 < of_part(piece, owner, 2) != of_part(piece, owner, 3) > 0


def test_a_chair_at_a_table_is_cut_from_it() -> None:
    scene = sheets(TABLETOP, SEAT, BACK)
    piece, owner = pieces(scene), scene[2]
    assert 0 < of_part(piece, owner, 2) != of_part(piece, owner, 4) > 0


def test_a_tall_cabinet_beside_a_counter_is_cut_straight_down() -> None:
    scene = sheets(COUNTER, ((1.5, 1.4, 0.0), (1.98, 1.98, 1.8)))
    piece, owner = pieces(scene), scene[2]
    counter, tall = (of_part(piece, owner, part) for part in (2, 3))
    assert 0 < counter != tall > 0
    front = (owner == 3) & (scene[0][:, 1] < 1.41)
    assert (piece[front] == tall).mean() > 0.8


def test_a_back_and_arms_are_of_their_sofa() -> None:
    seat = ((-1.5, -1.0, 0.0), (0.1, -0.3, 0.42))
    back, arm = ((-1.5, -0.3, 0.0), (0.1, -0.12, 0.85)), ((-1.66, -1.0, 0.0), (-1.5, -0.12, 0.6))
    scene = sheets(seat, back, arm)
    piece, owner = pieces(scene), scene[2]
    assert len({of_part(piece, owner, part) for part in (2, 3, 4)}) == 1


def test_two_like_things_apart_are_two() -> None:
    left, right = ((-1.5, -1.0, 0.0), (-0.9, -0.4, 0.8)), ((-0.7, -1.0, 0.0), (-0.1, -0.4, 0.8))
    scene = sheets(left, right)
    assert of_part(pieces(scene), scene[2], 2) != of_part(pieces(scene), scene[2], 3)


def test_legs_and_leaves_that_masks_missed_are_of_their_thing() -> None:
    table, leg = ((-1.0, -1.0, 0.7), (0.5, 0.0, 0.75)), ((-1.0, -1.0, 0.0), (-0.8, -0.8, 0.7))
    on_it = ((-0.3, -0.7, 0.78), (0.1, -0.3, 1.0))
    scene = sheets(table, leg, on_it)
    owner = scene[2]
    piece, thing = beside(scene, np.where(owner == 2, 7, 0))
    assert (thing[owner == 3] == 7).mean() > 0.9 and (thing[owner == 2] == 7).all()
    assert of_part(piece, owner, 4) == 1 and set(np.unique(piece)) == {0, 1}
    plant = ((-1.0, -1.0, 0.1), (-0.4, -0.4, 1.2))
    scene = sheets(plant, ((-0.4, -0.8, 0.4), (-0.34, -0.6, 0.6)))
    piece, thing = beside(scene, np.where(scene[2] == 2, 9, 0))
    assert not piece.any() and (thing[scene[2] == 3] == 9).all()


def test_what_stands_on_the_top_of_a_thing_is_a_piece_though_a_mask_took_it_along() -> None:
    scene = sheets(COUNTER, ON_IT)
    owner = scene[2]
    for instance in (np.where(owner > 1, 7, 0), np.where(owner == 2, 7, 0)):
        piece, thing = beside(scene, instance)
        assert of_part(piece, owner, 3) > 0 and not thing[piece > 0].any()
        assert (thing[owner == 2] == 7).mean() > 0.95


def test_what_a_mask_took_of_a_thing_on_it_goes_back_to_that_thing() -> None:
    """The table's mask has the foot of a box on it, which no mask had: one piece, not two."""
    scene = sheets(COUNTER, ((0.5, 1.6, 0.9), (0.8, 1.8, 1.3)))
    owner = scene[2]
    foot = (owner == 3) & (scene[0][:, 2] < 1.02)
    piece, thing = beside(scene, np.where((owner == 2) | foot, 7, 0))
    assert piece.max() == 1 and (piece[(owner == 3) & (scene[0][:, 2] > 0.95)] == 1).all()
    assert (thing[owner == 2] == 7).mean() > 0.95


@pytest.mark.parametrize(("told", "cut"), [(0.0, True), (TOLD - 0.05, True), (TOLD, False), (1.0, False)])
def test_a_shelf_that_most_looks_had_in_the_mask_is_not_cut(told: float, cut: bool) -> None:
    scene = sheets(TABLETOP, SEAT, BACK, ((-0.3, -0.8, 0.72), (-0.1, -0.5, 0.9)))
    owner = scene[2]
    instance = np.where(np.isin(owner, (2, 4, 5)), 7, 0)  # the mask took the chair's back too
    piece, thing = beside(scene, instance, told=np.where(owner == 5, told, 0.0))
    assert (thing[owner == 2] == 7).mean() > 0.95
    assert of_part(piece, owner, 3) == of_part(piece, owner, 4) > 0, "the chair is cut from the table, its seat too"
    assert (of_part(piece, owner, 5) > 0) == cut and (of_part(thing, owner, 5) == 7) != cut


def test_a_thing_has_the_rest_of_the_piece_of_which_it_alone_has_a_part() -> None:
    scene = sheets(BOX, COUNTER)
    owner, x = scene[2], scene[0][:, 0]
    half = np.where((owner == 2) & (x < -0.7), 5, 0)
    cloud = cloud_of(scene)
    grown = grown_things(cloud, half, owner < 2, frozenset(), 0.05)
    assert (grown[owner == 2] == 5).all() and not grown[owner == 3].any()
    two = np.where((owner == 2) & (x > -0.6), 6, half)
    assert (grown_things(cloud, two, owner < 2, frozenset(), 0.05) == two).all(), "two things share it"
    little = np.where((owner == 3) & (x < 1.5 * HELD / 3), 8, 0)
    assert (grown_things(cloud, little, owner < 2, frozenset(), 0.05) == little).all()


def test_a_scan_that_nobody_labelled_leaves_floor_and_walls_out() -> None:
    scene = sheets(BOX, COUNTER)
    vertices, faces, owner = scene
    nothing = np.zeros(len(vertices))
    normals, areas = vertex_normals(vertices, faces), vertex_areas(vertices, faces)
    layout = find_layout(Scene(vertices, normals, areas, nothing, nothing, np.zeros((0, 3)), None))
    assert (layout.owner[owner < 2] > 0).mean() > 0.99
    piece = pieces_of(cloud_of(scene), layout.owner == 0, 0.05)
    assert 0 < of_part(piece, owner, 2) != of_part(piece, owner, 3) > 0 and not piece[owner < 2].any()


def test_small_and_empty() -> None:
    scene = sheets(BOX)
    assert pieces(scene, area=5.0).max() == 0
    everything = np.where(scene[2] == 2, 3, 0)
    piece, thing = beside(scene, everything)
    assert not piece.any() and (thing == everything).all(), "all is named"
    nothing = Cloud(np.zeros((0, 3)), np.zeros((0, 3)), VOXEL)
    assert pieces_of(nothing, np.zeros(0, bool), 0.1).shape == (0,)
    found = pieces_beside(nothing, np.zeros(0, np.int32), np.zeros(0, bool), np.zeros(0), 0.1)
    assert found.piece.shape == found.thing_of.shape == (0,)


def test_a_footprint_surrounds_what_hides_it() -> None:
    grid = np.stack(np.meshgrid(np.arange(0, 1, VOXEL), np.arange(0, 0.5, VOXEL)), axis=-1).reshape(-1, 2)
    holed = grid[(np.abs(grid - [0.5, 0.25]) > 0.1).any(axis=1)]
    footprint = Footprint(holed, VOXEL)
    assert footprint.holds(np.array([[0.5, 0.25], [0.05, 0.05]])).all()
    assert not footprint.holds(np.array([[1.5, 0.25], [-0.3, 0.0], [0.5, 0.9]])).any()
    assert footprint.width == pytest.approx(0.5, abs=0.1)
    depth = footprint.depth(np.array([[0.5, 0.25], [0.5, 0.45], [1.05, 0.25], [9.0, 9.0]]))
    assert depth[0] > depth[1] > 0 > depth[2] > depth[3] == -np.inf


@settings(max_examples=30, deadline=None)
@given(st.lists(st.tuples(*[st.integers(0, 6)] * 3), min_size=1, max_size=30, unique=True))
def test_connected_parts_do_not_depend_on_the_order(cells: list[tuple[int, int, int]]) -> None:
    points = np.array(cells, float) * 3 * VOXEL / 2
    forward, backward = connected(points, VOXEL), connected(points[::-1], VOXEL)[::-1]
    assert len(set(zip(forward.tolist(), backward.tolist(), strict=True))) == forward.max() + 1


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_pieces_are_numbered_by_size_and_of_free_surface(seed: int) -> None:
    random = np.random.default_rng(seed)
    low = random.uniform(-1.8, 1.0, (4, 3)) * [1, 1, 0]
    boxes: list[Corners] = [
        (tuple(corner), tuple(corner + size))  # type: ignore[misc]
        for corner, size in zip(low.round(2), random.uniform(0.2, 0.7, (4, 3)).round(2), strict=True)
    ]
    scene = sheets(*boxes, voxel=0.04)
    vertices, faces, owner = scene
    cloud = Cloud(vertices, vertex_normals(vertices, faces), 0.04)
    piece = pieces_of(cloud, owner > 1, 0.05)
    assert not piece[owner < 2].any()
    sizes = np.bincount(piece)[1:]
    assert (np.diff(sizes) <= 0).all() and sizes.all()
