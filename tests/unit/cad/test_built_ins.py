"""What no model fits becomes a run of boxes, where that explains it and hurts nothing."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
import trimesh
from scenewright.schemas.articulations import Articulation
from scenewright.stages.cad.building_in import hovers
from scenewright.stages.cad.built_in_leaves import leaves_of
from scenewright.stages.cad.carcasses import Cells, Patches, cells_of, own_yaw, patches_of
from scenewright.stages.kit.formats.cad_models import load_collision_parts, read_model
from scenewright.stages.kit.formats.entity_meshes import EntityMesh
from scenewright.stages.kit.geometry.boxes import box_from_bounds
from scenewright.stages.kit.geometry.transforms import apply

from tests.panoptic_maps import floor_mesh, placed, seen_surface
from tests.unit.cad.test_cad_stage import placement_at

EYES = [(-1.4, -1.8, 1.5), (1.4, -1.8, 1.6), (0.1, -1.7, 1.0)]
COUNTER = ((-1.0, 0.4, 0.0), (1.0, 1.0, 0.9))
WALL_CABINET = ((-0.6, 0.65, 1.45), (1.0, 1.0, 2.1))


def union(*boxes):
    return trimesh.util.concatenate([trimesh.creation.box(bounds=bounds) for bounds in boxes])


def seen_of(mesh, *hidden, noise=0.004):
    """The surface of a mesh but for the sides that look along `hidden`."""
    shown = ~np.any([mesh.face_normals @ np.array(side) > 0.9 for side in hidden], axis=0)
    vertices, faces = trimesh.remesh.subdivide_to_size(mesh.vertices, mesh.faces[shown], 0.03)
    vertices = vertices + np.random.default_rng(0).normal(0, noise, vertices.shape)
    return EntityMesh(vertices, faces, np.full((len(vertices), 3), 100, np.uint8))


def nothing_known(points):
    return np.zeros(len(points), bool)


def bounds_of(cells):
    return sorted((*np.round(low, 2), *np.round(high, 2)) for low, high in cells.boxes())


def covers(cells, points):
    return np.any([np.all((points > low) & (points < high), axis=1) for low, high in cells.boxes()], axis=0)


def test_a_corner_kitchen_of_one_lump_is_its_boxes():
    """An L of counters and a cabinet on the wall over one of them, of which neither backs nor undersides were seen."""
    boxes = [((0, 0, 0), (2, 0.6, 0.9)), ((1.4, -1.2, 0), (2, 0, 0.9)), ((0, 0.25, 1.45), (2, 0.6, 2.1))]
    patches = patches_of(seen_of(union(*boxes), (0, 1, 0), (0, 0, -1), (1, 0, 0)))
    cells = cells_of(patches, np.array([0, -1.2, 0.0]), np.array([2, 0.6, 2.1]), lambda p: p[:, 2] > 2.2)
    random = np.random.default_rng(1).uniform([0, -1.2, 0], [2, 0.6, 2.1], (4000, 3))
    full = np.any([np.all((random > low) & (random < high), axis=1) for low, high in boxes], axis=0)
    between = (random[:, 2] > 0.9) & (random[:, 2] < 1.45)  # nobody saw what is behind the worktop
    agree = covers(cells, random)[~between] == full[~between]
    assert agree.mean() > 0.97
    tops = {round(float(low[2]), 1) for low, _ in cells.sides(2, True)}
    assert 0.9 in tops and 2.1 in tops


@pytest.mark.parametrize("yaw", [-0.6, 0.0, 0.3, 0.75])
def test_the_frame_is_that_of_the_fronts(yaw):
    mesh = placed(union(((0, 0, 0), (2, 0.6, 0.9)), ((1.4, -1.2, 0), (2, 0, 0.9))), (0, 0, 0), yaw)
    found = own_yaw(patches_of(seen_of(mesh, (0, 0, -1))))
    assert abs((found - yaw + np.pi / 4) % (np.pi / 2) - np.pi / 4) < np.radians(1.5)


def test_what_was_seen_empty_is_empty_and_a_board_is_left():
    patches = patches_of(seen_of(union(((0, 0, 0), (1, 0.5, 1.0))), (0, 1, 0), (0, 0, -1)))
    low, high = np.zeros(3), np.array([1, 0.5, 1.0])
    assert bounds_of(cells_of(patches, low, high, nothing_known)) == [(0, 0, 0, 1, 0.5, 1)]
    ((board_low, board_high),) = cells_of(patches, low, high, lambda points: np.ones(len(points), bool)).boxes()
    assert board_high[2] == pytest.approx(1.0) and board_high[2] - board_low[2] < 0.05


def cupboard():
    x, y, z = np.array([0, 1.2]), np.array([0, 0.6]), np.array([0, 0.9])
    return Cells((x, y, z), np.ones((1, 1, 1), bool))


def door(first_open: bool):
    """The left half of the front, hinged at x = 0, opened by a quarter turn."""
    shut = [(0, 0, 0.1), (0.6, 0, 0.1), (0.6, 0, 0.8), (0, 0, 0.8)]
    wide = [(0, 0, 0.1), (0, -0.6, 0.1), (0, -0.6, 0.8), (0, 0, 0.8)]
    leaf, after = (wide, shut) if first_open else (shut, wide)
    return Articulation(
        type="revolute",
        axis=(0, 0, 1) if first_open else (0, 0, -1),
        origin=(0, 0, 0.4),
        travel=np.pi / 2,
        leaf=tuple(leaf),
        leaf_after=tuple(after),
        last_before=3,
        first_after=9,
        overlap=0.9,
    )


@pytest.mark.parametrize("first_open", [False, True])
def test_a_door_that_was_seen_to_move_is_a_leaf(first_open):
    cells, leaves = leaves_of(cupboard(), np.eye(3), [door(first_open)])
    (leaf,) = leaves
    assert leaf.type == "revolute" and leaf.travel == pytest.approx(np.pi / 2)
    assert leaf.value == (0.0 if first_open else pytest.approx(np.pi / 2)), "as the log left it"
    assert leaf.axis == pytest.approx([0, 0, -1]), "opens outwards"
    low, high = leaf.boxes[0]
    assert low == pytest.approx([0, 0, 0.1]) and high == pytest.approx([0.6, 0.02, 0.8])
    assert not covers(cells, np.array([[0.3, 0.3, 0.45]])).any(), "there is room behind it"
    assert covers(cells, np.array([[0.9, 0.3, 0.45]])).all()


def test_a_drawer_has_a_bottom_and_a_leaf_elsewhere_is_none():
    shut = [(0.1, 0, 0.6), (1.1, 0, 0.6), (1.1, 0, 0.8), (0.1, 0, 0.8)]
    drawn = [(x, -0.3, z) for x, _, z in shut]
    entry = door(False).model_copy(
        update={"type": "prismatic", "axis": (0, -1, 0), "travel": 0.3, "leaf": tuple(shut), "leaf_after": tuple(drawn)}
    )
    _, (leaf,) = leaves_of(cupboard(), np.eye(3), [entry])
    assert leaf.axis == pytest.approx([0, -1, 0]) and leaf.value == pytest.approx(0.3) and len(leaf.boxes) == 4
    away = entry.model_copy(
        update={k: tuple((x, y + 3, z) for x, y, z in getattr(entry, k)) for k in ("leaf", "leaf_after")}
    )
    assert leaves_of(cupboard(), np.eye(3), [away])[1] == ()


@pytest.fixture
def kitchen():
    """A counter with a box on it and a cabinet over it, mapped as one nameless lump, and a ball."""
    meshes = {
        1: floor_mesh((-1.6, -1.6), (1.6, 1.6)),
        2: union(COUNTER, WALL_CABINET),
        3: trimesh.creation.box(bounds=[(-0.9, 0.5, 0.9), (-0.7, 0.7, 1.1)]),
    }
    return seen_surface(meshes, EYES, noise=0.003), {1: "floor", 2: "object", 3: "box"}


def test_a_lump_becomes_a_built_in(kitchen, replace_objects):
    scene = replace_objects(*kitchen)
    (entry,) = [entry for entry in scene.info.replacements if entry.node == "object_2"]
    assert entry.decision == "cad" and entry.reason.startswith("built in: "), entry.reason
    assert scene.summary["built_in"] == 1 and scene.summary["cad"] == 1
    assert entry.joint_evidence is None, "nobody saw anything move"
    model = read_model(scene.path("models") / entry.chosen.model_id)
    assert model.joints == () and not (scene.path("meshes") / "object_2.ply").exists()
    pieces = load_collision_parts(scene.path("models") / model.id)["body"]
    world = np.array(entry.chosen.world_from_model)
    points = np.concatenate([apply(world, np.asarray(piece.vertices)) for piece in pieces])
    assert points.min(axis=0) == pytest.approx([-1.0, 0.4, 0.0], abs=0.04)
    assert points.max(axis=0)[[0, 2]] == pytest.approx([1.0, 2.1], abs=0.04)
    levels = [plane.center[2] for plane in scene.graph.node("object_2").planes if plane.horizontal]
    assert min(abs(level - 0.9) for level in levels) < 0.02
    parent = scene.graph.parent_link("box_3")
    assert parent.source == "object_2"


@pytest.mark.slow
def test_without_built_ins_it_keeps_its_mesh(kitchen, replace_objects):
    entry = next(e for e in replace_objects(*kitchen, built_ins=False).info.replacements if e.node == "object_2")
    assert entry.decision == "mesh"


@pytest.mark.slow
def test_the_thesis_builds_nothing(kitchen, replace_objects):
    entry = next(e for e in replace_objects(*kitchen, method="thesis").info.replacements if e.node == "object_2")
    assert entry.decision == "mesh"


def test_what_boxes_do_not_explain_keeps_its_mesh(replace_objects):
    ball = trimesh.creation.icosphere(subdivisions=4, radius=0.5)
    ball.apply_translation((0, 0.6, 0.5))
    meshes = {1: floor_mesh((-1.6, -1.6), (1.6, 1.6)), 2: ball}
    scene = replace_objects(seen_surface(meshes, EYES), {1: "floor", 2: "object"})
    entry = next(e for e in scene.info.replacements if e.node == "object_2")
    assert entry.decision == "mesh" and "not built in: boxes explain" in entry.reason
    assert not (scene.path("models") / "object_2_built_in").exists()


def test_a_built_in_yields_to_what_stands_there(replace_objects):
    """The middle of a nameless block is where a table stands (what a wrong map may well say)."""
    meshes = {
        1: floor_mesh((-1.6, -1.6), (1.6, 1.6)),
        2: trimesh.creation.box(bounds=COUNTER),
        3: trimesh.creation.box(bounds=[(-0.5, 0.2, 0.0), (0.5, 0.8, 0.6)]),
    }
    surface = {1: meshes[1], **{k: seen_surface({k: meshes[k]}, EYES)[k] for k in (2, 3)}}
    scene = replace_objects(surface, {1: "floor", 2: "object", 3: "wardrobe"})
    built = [entry.node for entry in scene.info.replacements if entry.reason.startswith("built in")]
    assert len(built) <= 1


def test_a_built_in_reaches_down_to_what_it_stands_on(library):
    """A board inside a fridge without a model would drop out of its place; one of a thing that hangs stays."""
    box = box_from_bounds((-0.5, -0.5, 0.0), (0.5, 0.5, 0.8))
    stands = SimpleNamespace(node=SimpleNamespace(box=box), hangs=False)
    hangs = SimpleNamespace(node=SimpleNamespace(box=box), hangs=True)
    for height, expected in ((0.0, False), (0.04, False), (0.4, True)):
        surface, placement = placement_at(library, "table_square", (0, 0, height), 0.0, 1.0)
        assert hovers(placement, surface, stands) is expected and not hovers(placement, surface, hangs)


def test_patches_without_upright_surface_have_no_turn():
    assert own_yaw(Patches(np.zeros((3, 3)), np.tile([0, 0, 1.0], (3, 1)), np.ones(3))) == 0.0
