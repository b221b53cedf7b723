"""Unnamed surface: what stands free, on a top or beside one is a piece of its own, a wall is none."""

from __future__ import annotations

import numpy as np
import trimesh
from scenewright.stages.fuse.extraction import ExtractedEntity, LabelledSurface
from scenewright.stages.fuse.piece_entities import Classes, with_unnamed_pieces
from scenewright.stages.fuse.surface import Surface
from scenewright.stages.fuse.unnamed_pieces import FLOOR, TOLD, unnamed_pieces
from scenewright.stages.fuse.walls import of_walls
from scenewright.stages.kit.formats.ply_files import ColoredMesh
from scenewright.stages.kit.geometry.point_clouds import vertex_normals

from tests.unit.fuse.scenes import class_id

VOXEL = 0.02
MESH = ColoredMesh(np.zeros((3, 3), np.float32), np.array([[0, 1, 2]], np.int32), np.zeros((3, 3), np.uint8))


Corners = tuple[tuple[float, float, float], tuple[float, float, float]]


def sheet(low: np.ndarray, high: np.ndarray, axis: int, outwards: int) -> trimesh.Trimesh:
    """A rectangle of one vertex a voxel: the side of a box that lies low (-1) or high (1) on an axis."""
    first, second = [k for k in range(3) if k != axis]
    u, v = (np.arange(low[k], high[k] + 1e-9, VOXEL) for k in (first, second))
    points = np.zeros((len(u), len(v), 3))
    points[..., first], points[..., second] = u[:, None], v[None]
    points[..., axis] = high[axis] if outwards > 0 else low[axis]
    corner = np.arange(len(u) * len(v)).reshape(len(u), len(v))
    a, b, c, d = corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:]
    faces = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])
    turned = (outwards > 0) == (axis == 1)
    return trimesh.Trimesh(points.reshape(-1, 3), faces[:, ::-1] if turned else faces, process=False)


def room(*boxes: Corners) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return vertices, faces, and the part of every vertex: floor 0, wall 1, then the boxes in order, without feet."""
    sides = [[sheet(np.array([-2.0, -2, 0]), np.array([2.0, 2, 0]), 2, 1)]]
    sides.append([sheet(np.array([-2.0, 2, 0]), np.array([2.0, 2, 2.4]), 1, -1)])
    for low, high in boxes:
        ends = [(axis, way) for axis in range(3) for way in (-1, 1) if (axis, way) != (2, -1)]
        sides.append([sheet(np.array(low), np.array(high), axis, way) for axis, way in ends])
    owner = np.repeat(np.arange(len(sides)), [sum(len(s.vertices) for s in part) for part in sides])
    whole = trimesh.util.concatenate([side for part in sides for side in part])
    return np.asarray(whole.vertices), np.asarray(whole.faces), owner


def pieces(
    scene: tuple[np.ndarray, np.ndarray, np.ndarray],
    named: tuple[int, ...] = (0,),
    area: float = 0.05,
    proposed: np.ndarray | None = None,
) -> np.ndarray:
    owner = scene[2]
    return of_instances(scene, np.where(np.isin(owner, named), owner + 1, 0), area, proposed)[0]


def of_instances(
    scene: tuple[np.ndarray, np.ndarray, np.ndarray],
    instance: np.ndarray,
    area: float = 0.05,
    proposed: np.ndarray | None = None,
    tables: tuple[int, ...] = (),
    topped: tuple[int, ...] = (),
    told: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    vertices, faces, owner = scene
    normals = vertex_normals(vertices, faces)
    walls = of_walls(vertices, normals, (instance == 0) & (vertices[:, 2] > FLOOR), VOXEL)
    room = walls | (owner == 0)
    cut = {"topped": topped + tables, "tables": tables, "told": told}
    return unnamed_pieces(vertices, normals, instance, room, voxel=VOXEL, minimum_area=area, proposed=proposed, **cut)


def of_part(piece: np.ndarray, owner: np.ndarray, part: int) -> int:
    """The piece that most of a part is of."""
    return int(np.bincount(piece[owner == part]).argmax())


BOX = ((-1.0, -1.0, 0.0), (-0.5, -0.5, 0.4))
COUNTER, ON_IT = ((0.0, 1.4, 0.0), (1.5, 2.0, 0.9)), ((0.5, 1.6, 0.92), (0.8, 1.8, 1.2))


def test_what_stands_free_is_a_piece_and_a_wall_is_none() -> None:
    scene = room(BOX, COUNTER, ON_IT)
    piece, owner = pieces(scene), scene[2]
    found = [of_part(piece, owner, part) for part in range(5)]
    assert found[:2] == [0, 0] and sorted(found[2:]) == [1, 2, 3]
    assert found[3] == 1, "the largest first"
    assert (piece[owner == 2] == found[2]).mean() > 0.75, "but for its foot"


def test_legs_are_left_to_the_named_thing_above() -> None:
    table = ((-1.0, -1.0, 0.7), (0.5, 0.0, 0.75))
    leg = ((-0.9, -0.9, 0.0), (-0.7, -0.7, 0.66))
    on_it = ((-0.3, -0.7, 0.78), (0.1, -0.3, 1.0))
    scene = room(table, leg, on_it)
    piece, owner = pieces(scene, (0, 2)), scene[2]
    assert of_part(piece, owner, 3) == 0 and of_part(piece, owner, 4) == 1
    assert set(np.unique(piece)) == {0, 1}


def test_parts_above_each_other_are_one_unless_one_carries_the_other() -> None:
    lower, upper = ((-1.0, -1.0, 0.1), (-0.6, -0.6, 0.3)), ((-1.0, -1.0, 0.5), (-0.6, -0.6, 0.8))
    scene = room(lower, upper)
    piece, owner = pieces(scene), scene[2]
    assert of_part(piece, owner, 2) == of_part(piece, owner, 3) == 1


def test_small_things_on_a_top_are_pieces_and_flat_ones_where_a_mask_proposed_them() -> None:
    cup, book, sheets = ((0.3, 1.6, 0.9), (0.4, 1.7, 1.0)), ((0.9, 1.6, 0.9), (1.2, 1.8, 0.935)), 0.915
    scene = room(COUNTER, cup, book, ((1.25, 1.6, 0.9), (1.45, 1.8, sheets)))
    owner = scene[2]
    piece = pieces(scene, area=0.2)
    counter, on_it, lying, flat = (of_part(piece, owner, part) for part in (2, 3, 4, 5))
    assert len({counter, on_it, lying} - {0}) == 3 and flat in (0, counter), "no thicker than what depth tells"
    piece = pieces(scene, area=0.2, proposed=np.where(owner == 5, 7, 0))
    assert len({of_part(piece, owner, part) for part in (2, 3, 4, 5)} - {0}) == 4


def test_a_bent_top_carries_nothing() -> None:
    vertices, faces, owner = room(COUNTER)
    middle = vertices[owner == 2].mean(axis=0)
    top = (owner == 2) & (vertices[:, 2] > 0.899)
    bent = vertices.copy()
    bent[top, 2] += 0.1 * (vertices[top, 0] - middle[0]) ** 2  # up to six centimetres at its ends
    assert len(set(pieces((bent, faces, owner))[top].tolist()) - {0}) == 1


def test_a_chair_beside_a_table_and_a_tall_cabinet_beside_a_counter_are_things_of_their_own() -> None:
    table, seat, back = (
        ((-1.0, -1.0, 0.68), (0.2, -0.2, 0.72)),
        ((-0.6, -0.3, 0.4), (-0.2, 0.1, 0.44)),
        ((-0.6, -0.18, 0.44), (-0.2, -0.14, 0.95)),
    )
    scene = room(table, seat, back)
    piece, owner = pieces(scene), scene[2]
    assert of_part(piece, owner, 2) != of_part(piece, owner, 4) > 0
    tall = ((1.5, 1.4, 0.0), (2.0, 2.0, 1.8))
    scene = room(COUNTER, tall)
    piece, owner = pieces(scene), scene[2]
    front = (owner == 3) & (scene[0][:, 1] < 1.41)
    assert 0 < of_part(piece, owner, 2) != of_part(piece, owner, 3) > 0
    assert (piece[front] == of_part(piece, owner, 3)).mean() > 0.8


def test_what_a_mask_took_with_a_table_is_cut_from_it() -> None:
    table, seat, back, box = (
        ((-1.0, -1.0, 0.68), (0.2, -0.2, 0.72)),
        ((-0.6, -0.3, 0.4), (-0.2, 0.1, 0.44)),
        ((-0.6, -0.18, 0.44), (-0.2, -0.14, 0.95)),
        ((-0.3, -0.8, 0.72), (-0.1, -0.5, 0.9)),
    )
    scene = room(table, seat, back, box)
    owner = scene[2]
    instance = np.where(np.isin(owner, (2, 4, 5)), 7, 0)
    kept, own = of_instances(scene, instance)
    assert not kept[np.isin(owner, (2, 4, 5))].any() and (own[owner == 4] == 7).all()
    piece, own = of_instances(scene, instance, tables=(7,))
    chair, thing = of_part(piece, owner, 4), of_part(piece, owner, 5)
    assert of_part(piece, owner, 2) == 0 and 0 < chair != thing > 0
    assert of_part(piece, owner, 3) == chair, "the seat goes with the back"
    assert (own[owner == 2] == 7).mean() > 0.9 and not own[piece > 0].any()
    shelf = np.where(owner == 5, TOLD, 0.0)  # what nearly all views had in the table's mask is a shelf over it
    piece, own = of_instances(scene, instance, tables=(7,), told=shelf)
    assert (own[owner == 5] == 7).all() and of_part(piece, owner, 4) > 0


def test_what_a_mask_took_with_any_furniture_is_cut_from_its_level_top() -> None:
    scene = room(COUNTER, ON_IT)
    owner = scene[2]
    instance = np.where(np.isin(owner, (2, 3)), 7, 0)
    assert not of_instances(scene, instance)[0].any()
    piece, own = of_instances(scene, instance, topped=(7,))
    assert of_part(piece, owner, 3) > 0 and not own[piece > 0].any()
    assert (own[owner == 2] == 7).mean() > 0.9


def test_a_leaf_that_touches_is_of_the_named_thing() -> None:
    plant = ((-1.0, -1.0, 0.1), (-0.4, -0.4, 1.2))
    touching, apart = ((-0.4, -0.8, 0.4), (-0.34, -0.6, 0.6)), ((-0.35, -0.8, 0.75), (-0.32, -0.6, 0.85))
    scene = room(plant, touching, apart)
    owner = scene[2]
    piece, own = of_instances(scene, np.where(owner == 2, 9, 0))
    assert not piece.any()
    assert (own[np.isin(owner, (2, 3))] == 9).all() and not own[owner == 4].any()


def test_small_and_empty() -> None:
    scene = room(BOX)
    assert pieces(scene, area=5.0).max() == 0
    nothing, _ = unnamed_pieces(
        np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0, int), np.zeros(0, bool), voxel=VOXEL, minimum_area=0.1
    )
    assert nothing.shape == (0,)
    assert pieces(scene, named=(0, 1, 2)).max() == 0, "all is named"


def test_a_desk_that_a_mask_took_for_the_wall_is_a_piece() -> None:
    """What stands off every wall and has a level top; a board there has none, and stays wall."""
    desk, lectern = ((-1.0, -0.5, 0.0), (0.4, 0.2, 0.72)), ((1.0, -1.0, 0.0), (1.3, -0.9, 1.0))
    vertices, faces, owner = room(desk, lectern)
    surface = Surface(vertices, faces, np.zeros((len(vertices), 3), np.uint8), owner)
    number = np.where(owner == 0, 1, 2).astype(np.int32)
    class_of = np.array([0, *(class_id(name) for name in ("floor", "wall", "ceiling", "object"))], np.int32)
    labelled = LabelledSurface(owner.astype(np.int32), class_of[number], number)
    entities = [ExtractedEntity(k, int(class_of[k]), (k,), MESH, 0.9, 5) for k in (1, 2)]
    classes = Classes(*(int(c) for c in class_of[1:]))
    found, result = with_unnamed_pieces(surface, entities, labelled, classes, voxel=VOXEL, minimum_area=0.05)
    assert [e.class_id for e in found] == [*class_of[1:3], class_of[4]]
    assert (result.instance[owner == 2] == found[2].instance).mean() > 0.9, "all but its feet"
    assert (result.class_id[(owner == 1) | (owner == 3)] == class_of[2]).all()
