"""Fitting on vertices, settling, and the whole step with the little library."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh
from scenewright.schemas.errors import UsageError
from scenewright.schemas.scene_parts import SurfacePlane
from scenewright.stages.cad.fitting import fitted, refine, shape_at, solve_within_limits
from scenewright.stages.cad.model_surfaces import alignment_error, load_surface, to_world
from scenewright.stages.cad.placing import facing_wall, free_height, placed_box, supporting_surface, wall_depths
from scenewright.stages.cad.settling import shift_onto
from scenewright.stages.cad.shapes import Placement, shape_of_state
from scenewright.stages.cad.target import out_of_walls
from scenewright.stages.kit.formats.cad_models import model_folder, posed_mesh
from scenewright.stages.kit.geometry.boxes import bottom, box_from_bounds, box_iou, gravity_aligned_box
from scenewright.stages.kit.geometry.point_clouds import sample_large_triangles, thin_to_grid
from scipy.spatial.transform import Rotation

from tests.panoptic_maps import box_mesh, floor_mesh, placed, seen_surface

EYES = [(-1.4, -1.8, 1.5), (1.4, -1.8, 1.6), (0.1, 1.7, 1.7)]


def model_named(library, model_id):
    return next(model for model in library.info.models if model.id == model_id)


def mesh_of(library, model_id, position, yaw=0.0, scale=1.0, joints=None):
    mesh = posed_mesh(model_folder(library, model_id), model_named(library, model_id), joints or {}, scale)
    return placed(mesh, position, yaw)


def decisions(scene):
    return {replacement.node: replacement for replacement in scene.info.replacements}


def yaw_of(candidate):
    return math.atan2(candidate.world_from_model[1][0], candidate.world_from_model[0][0])


def turn_between(a, b, period=2 * math.pi):
    return abs((a - b + period / 2) % period - period / 2)


@pytest.fixture(scope="module")
def furnished(library):
    """A table with a box on it, a chair, and a fridge whose door stands open at 84 degrees with a box on a board."""
    meshes = {
        1: floor_mesh((-1.4, -1.3), (1.6, 1.6)),
        2: mesh_of(library, "table_long", (-0.5, 0.6, 0), 0.2),
        3: mesh_of(library, "chair_low", (-0.4, -0.5, 0), 2.5, 1.05),
        4: mesh_of(library, "fridge_tall", (1.0, 1.0, 0), 0.0, 1.0, {"door_hinge": 1.47}),
        5: mesh_of(library, "box_cube", (-0.7, 0.6, 0.74), 0.5),
        6: mesh_of(library, "box_flat", (1.0, 1.0, 0.8), 0.1, 0.9),
    }
    classes = {1: "floor", 2: "table", 3: "chair", 4: "fridge", 5: "box", 6: "box"}
    return seen_surface(meshes, [*EYES, (0.9, -0.6, 1.2)], noise=0.003), classes


TRUE_POSE = {
    "table_2": (-0.5, 0.6, 0),
    "chair_3": (-0.4, -0.5, 0),
    "fridge_4": (1.0, 1.0, 0),
    "box_5": (-0.7, 0.6, 0.74),
}


@pytest.fixture
def scene(furnished, replace_objects):
    return replace_objects(*furnished)


def test_furnished_room(scene):
    found = decisions(scene)
    assert {name: entry.decision for name, entry in found.items()} == {
        "floor_1": "layout",
        "table_2": "cad",
        "chair_3": "cad",
        "fridge_4": "cad",
        "box_5": "cad",
        "box_6": "cad",
    }
    models = {name: entry.chosen.model_id for name, entry in found.items() if entry.chosen}
    assert models == {
        "table_2": "table_long",
        "chair_3": "chair_low",
        "fridge_4": "fridge_tall",
        "box_5": "box_cube",
        "box_6": "box_flat",
    }
    for name, position in TRUE_POSE.items():
        origin = np.array(found[name].chosen.world_from_model)[:3, 3]
        assert np.allclose(origin, position, atol=0.015), name
    assert turn_between(yaw_of(found["chair_3"].chosen), 2.5) < 0.03
    assert found["chair_3"].chosen.scale == pytest.approx(1.05, abs=0.02)
    assert turn_between(yaw_of(found["table_2"].chosen), 0.2, math.pi) < 0.03
    assert turn_between(yaw_of(found["fridge_4"].chosen), 0.0) < 0.03
    assert all(entry.chosen.alignment_error < 0.01 for entry in found.values() if entry.chosen)
    assert scene.info.conflicts_after == 0


def test_open_door_is_found_and_measured(scene):
    """1.47 rad lies between the stored states 1.0 and 2.0."""
    assert decisions(scene)["fridge_4"].chosen.joints["door_hinge"] == pytest.approx(1.47, abs=0.05)


def test_children_stand_exactly_on_cad_surfaces(scene):
    graph = scene.graph
    for link in graph.links:
        child = graph.node(link.target)
        if child.model_id is None or link.relation == "proximal":
            continue
        plane = graph.node(link.source).planes[link.plane]
        assert plane.horizontal
        assert link.gap == 0.0
        assert bottom(child.box) == pytest.approx(
            plane.center[2], abs=1e-6 if graph.node(link.source).model_id else 0.01
        )
    inside = graph.parent_link("box_6")
    assert (inside.source, inside.relation) == ("fridge_4", "contains")
    assert graph.node("fridge_4").planes[inside.plane].center[2] == pytest.approx(0.8, abs=0.03)


def test_cg_prime_keeps_the_structure(scene):
    graph = scene.graph
    assert {node.id for node in graph.nodes} == {"scene", "floor_1", "table_2", "chair_3", "fridge_4", "box_5", "box_6"}
    chair = graph.node("chair_3")
    assert chair.model_id == "chair_low" and chair.world_from_model is not None and chair.scale > 1
    true = gravity_aligned_box((-0.4, -0.5, 1.05 * 0.45), (0.462, 0.462, 0.945), 2.5)
    assert box_iou(chair.box, true) > 0.9
    assert scene.path("models/chair_low/visual/body.glb").is_file()
    assert scene.path("layout/floor_1.ply").is_file()
    assert not scene.path("models/chair_stool").exists()


def test_same_seed_same_bytes(furnished, replace_objects):
    meshes, classes = {k: furnished[0][k] for k in (1, 3)}, furnished[1]
    first, second = (replace_objects(meshes, classes, name=name) for name in ("a", "b"))
    for file in ("scene.json", "graph.json"):
        assert first.path(file).read_bytes() == second.path(file).read_bytes()


@pytest.mark.slow
def test_thesis_method_runs_without_refinement(furnished, replace_objects):
    meshes, classes = {k: furnished[0][k] for k in (1, 2, 3)}, furnished[1]
    found = decisions(replace_objects(meshes, classes, method="thesis"))
    assert found["chair_3"].chosen is not None
    ours = decisions(replace_objects(meshes, classes, name="ours"))
    assert ours["chair_3"].chosen.alignment_error <= found["chair_3"].chosen.alignment_error + 1e-9


def test_what_was_tried_is_told_in_order(scene):
    """Every way says what it gave, and why or why not; so does what is held and what is free."""
    by_node = {entry.node: entry for entry in scene.info.replacements}
    for entry in by_node.values():
        if entry.decision == "layout":
            assert entry.tries == () and entry.stays == ""
            continue
        assert [tried.way for tried in entry.tries] == ["library", "stretched", "by_shape", "family", "built_in"]
        assert all(tried.because or tried.model_id for tried in entry.tries)
        assert entry.stays.startswith(("held: ", "free: "))
    chosen = [entry.chosen for entry in by_node.values() if entry.chosen is not None]
    assert all(one.explained is not None and one.score is not None for one in chosen)
    told = [c for entry in by_node.values() for c in entry.alternatives if c.explained is not None]
    assert told and all(0 <= c.explained <= 1 for c in told)


def test_what_has_no_candidate_keeps_its_mesh(replace_objects):
    meshes = {1: floor_mesh(), 2: box_mesh((0, 0, 0), (0.1, 0.1, 0.3)), 3: box_mesh((-1, -1, 0), (-0.9, -0.2, 1.1))}
    scene = replace_objects(meshes, {1: "floor", 2: "bottle", 3: "box"}, maximum_scale=1.1)
    found = decisions(scene)
    assert found["bottle_2"].decision == "mesh" and "no model of class bottle" in found["bottle_2"].reason
    assert found["box_3"].decision == "mesh"
    assert set(found["box_3"].rejected) & {"alignment error too large", "refined scale out of range"}
    assert all(f"{name} {count}" in found["box_3"].reason for name, count in found["box_3"].rejected.items())
    assert scene.path("meshes/box_3.ply").is_file() and scene.path("meshes/bottle_2.ply").is_file()
    assert scene.graph.node("box_3").model_id is None
    assert scene.summary["mesh"] == 2


def test_children_need_a_surface(replace_objects):
    """A table with a small second tier at 0.3 m that carries a box; no table of the library has one."""
    tiers = [box_mesh((-0.7, -0.35, 0.7), (0.7, 0.35, 0.74)), box_mesh((-0.2, -0.2, 0.26), (0.2, 0.2, 0.3))]
    legs = [box_mesh((x, y, 0), (x + 0.05, y + 0.05, 0.7)) for x in (-0.7, 0.65) for y in (-0.35, 0.3)]
    meshes = {
        1: floor_mesh(),
        2: trimesh.util.concatenate(tiers + legs),
        3: box_mesh((-0.1, -0.1, 0.3), (0.1, 0.1, 0.5)),
    }
    classes = {1: "floor", 2: "table", 3: "box"}
    # The thesis discards every candidate that fails (2.2) for a child.
    thesis = decisions(replace_objects(meshes, classes, name="thesis", method="thesis"))
    assert thesis["table_2"].decision == "mesh"
    assert thesis["table_2"].rejected["does not support a child"] > 0
    # Ours keeps the best there is, says so, and puts the child on the nearest surface in which it fits.
    scene = replace_objects(meshes, classes, name="ours", maximum_alignment_error=0.3)
    ours = decisions(scene)
    assert ours["table_2"].decision == "cad" and "box_3" in ours["table_2"].reason
    link = scene.graph.parent_link("box_3")
    surface = scene.graph.node("table_2").planes[link.plane]
    assert surface.horizontal and surface.center[2] > 0.5
    assert bottom(scene.graph.node("box_3").box) == pytest.approx(surface.center[2], abs=1e-6)


def test_scale_limits_must_make_sense(replace_objects):
    with pytest.raises(UsageError, match="minimum_scale"):
        replace_objects({1: floor_mesh()}, {1: "floor"}, minimum_scale=2.0, maximum_scale=1.0)


def test_empty_map_is_an_empty_scene(replace_objects):
    scene = replace_objects({}, {})
    assert scene.outcome == "empty" and scene.info.replacements == ()


def surface_points(mesh, spacing=0.015):
    points, normals = sample_large_triangles(
        np.asarray(mesh.vertices), np.asarray(mesh.faces), spacing, np.random.default_rng(0)
    )
    return thin_to_grid(points, normals, spacing)


def placement_at(library, model_id, position, yaw, scale, joints=None):
    model = model_named(library, model_id)
    surface = load_surface(model_folder(library, model_id), model)
    shape = shape_of_state(model, model.states[0])
    if joints:
        shape = shape_at(surface, shape, joints)
    rotation = Rotation.from_euler("z", yaw).as_matrix()
    return surface, Placement(shape, scale, rotation, np.array(position, dtype=float), 0.0, math.inf, math.inf)


def test_alignment_error_is_the_distance_to_the_surface(library):
    surface, placement = placement_at(library, "box_cube", (1, 2, 0), 0.0, 2.0)
    points = np.array([[1.0, 2.0, 0.4], [1.0, 2.0, 0.45], [1.3, 2.0, 0.2]])
    assert alignment_error(surface, placement, points) == pytest.approx(np.sqrt((0.05**2 + 0.1**2) / 3), rel=1e-5)
    # A point just below the top that faces down has no such surface near: the bottom is 0.39 m away.
    facing_down = alignment_error(surface, placement, np.array([[1.0, 2.0, 0.39]]), np.array([[0.0, 0, -1]]))
    assert facing_down == pytest.approx(0.39, rel=1e-4)


def test_refinement_recovers_scale_yaw_and_shift(library):
    points, normals = surface_points(mesh_of(library, "chair_low", (0.3, -0.2, 0.0), 0.5, 1.1))
    surface, start = placement_at(library, "chair_low", (0.34, -0.17, 0.0), 0.35, 1.03)
    found = refine(surface, start, points, normals, free_height=False)
    assert found.alignment_error < 0.002
    assert found.scale == pytest.approx(1.1, abs=0.005)
    assert np.allclose(found.translation, (0.3, -0.2, 0.0), atol=0.005)
    assert math.atan2(found.rotation[1, 0], found.rotation[0, 0]) == pytest.approx(0.5, abs=0.01)


@pytest.mark.parametrize("angle", [0.0, 0.9, 1.6])
def test_fitting_finds_the_door_angle(library, angle):
    points, normals = surface_points(mesh_of(library, "fridge_tall", (0, 0, 0), 0.2, 1.0, {"door_hinge": angle}), 0.03)
    surface, start = placement_at(library, "fridge_tall", (0.02, -0.02, 0.0), 0.24, 1.02, {"door_hinge": 1.2})
    found = fitted(surface, start, points, normals, free_height=False)
    assert found.shape.joints["door_hinge"] == pytest.approx(angle, abs=0.03)
    assert found.alignment_error < 0.005
    true = posed_mesh(model_folder(library, "fridge_tall"), surface.model, found.shape.joints)
    assert np.allclose(found.shape.size, true.extents, atol=1e-3)


def test_planes_move_with_their_part(library):
    surface, closed = placement_at(library, "fridge_tall", (0, 0, 0), 0.0, 1.0)
    opened = shape_at(surface, closed.shape, {"door_hinge": math.pi / 2})
    moved = [k for k, (a, b) in enumerate(zip(closed.shape.surfaces, opened.surfaces, strict=True)) if a != b]
    front = min(range(len(moved)), key=lambda k: closed.shape.surfaces[moved[k]].center[1])
    before, after = closed.shape.surfaces[moved[front]], opened.surfaces[moved[front]]
    assert np.allclose(before.normal, (0, -1, 0)) and np.allclose(after.normal, (1, 0, 0), atol=1e-9)
    assert np.dot(after.normal, after.center) + after.offset == pytest.approx(0, abs=1e-9)
    assert len(moved) == 6


def test_unknowns_stay_within_limits():
    matrix, right = np.array([[2.0, 1.0], [1.0, 2.0]]), np.array([1.0, -4.0])
    free = np.linalg.solve(matrix, right)
    assert np.allclose(solve_within_limits(matrix, right, 1, np.array([-9.0]), np.array([9.0])), free)
    held = solve_within_limits(matrix, right, 1, np.array([0.0]), np.array([1.0]))
    assert held[1] == 0.0 and held[0] == pytest.approx(0.5)


def level(low, high, z, normal=1.0):
    corners = [(low[0], low[1], z), (high[0], low[1], z), (high[0], high[1], z), (low[0], high[1], z)]
    area = (high[0] - low[0]) * (high[1] - low[1])
    center = tuple(np.mean(corners, axis=0))
    return SurfacePlane(
        normal=(0, 0, normal),
        offset=-normal * z,
        area=area,
        center=center,
        corners=tuple(corners),
        horizontal=normal > 0,
    )


def test_children_go_on_the_nearest_surface_in_which_they_fit():
    boards = (
        level((0, 0), (1, 0.4), 0.3),
        level((0, 0), (1, 0.4), 0.6),
        level((0, 0), (1, 0.4), 0.58, -1.0),
        level((0, 0), (1, 0.4), 1.18, -1.0),
        level((0, 0), (0.1, 0.4), 0.52),
    )
    low = box_from_bounds((0.4, 0.1, 0.5), (0.6, 0.3, 0.7))
    high = box_from_bounds((0.4, 0.1, 0.4), (0.6, 0.3, 0.9))
    keep = dict(area_threshold=0.5, tolerance=1.0)
    assert free_height(boards, 0, low) == pytest.approx(0.28)
    assert supporting_surface(boards, low, 0.5, **keep) == 1
    assert supporting_surface(boards, low, 0.32, **keep) == 0
    # Half a metre high: too high for the lower board, which is nearer.
    assert supporting_surface(boards, high, 0.4, **keep) == 1
    assert supporting_surface(boards, low, 0.5, area_threshold=0.5, tolerance=0.05) is None
    beside = box_from_bounds((0.9, 0.3, 0.5), (1.2, 0.5, 0.7))
    assert supporting_surface(boards, beside, 0.5, **keep) is None


def test_shift_onto_moves_no_farther_than_needed():
    outline = np.array([[0, 0], [1, 0], [1, 0.5], [0, 0.5]], dtype=float)
    assert np.allclose(shift_onto(outline, box_from_bounds((0.9, 0.4, 0), (1.1, 0.6, 1))), (-0.1, -0.1))
    assert np.allclose(shift_onto(outline, box_from_bounds((0.1, 0.1, 0), (0.2, 0.2, 1))), 0)
    assert np.allclose(shift_onto(outline, box_from_bounds((0.1, -0.5, 0), (0.2, 0.9, 1))), (0, 0.05))


def test_walls_reject_and_turn_fronts(library):
    from scenewright.schemas.contact_graph import GraphNode

    corners = ((0.0, -2.0, 0.0), (0.0, 2.0, 0.0), (0.0, 2.0, 2.5), (0.0, -2.0, 2.5))
    plane = SurfacePlane(normal=(1, 0, 0), offset=0.0, area=10, center=(0, 0, 1.25), corners=corners)
    wall = GraphNode(id="wall_1", instance=1, class_name="wall", node_type="layout", planes=(plane,))
    points = np.array([[-0.2, 0, 1], [0.3, 0, 1], [-0.9, 3.0, 1.0]])
    ((depth, out),) = wall_depths(points, np.array([0.3, 0, 1]), [wall])
    assert depth == pytest.approx(0.2) and out.tolist() == [1, 0, 0]
    assert wall_depths(points, np.array([-0.3, 0, 1]), [wall]) == []
    surface, inside = placement_at(library, "fridge_small", (0.2, 0, 0), math.pi / 2, 1.0)
    seen = SimpleNamespace(node=SimpleNamespace(box=placed_box(inside, surface)), around=SimpleNamespace(walls=[wall]))
    seen.surfaces = {"fridge_small": surface}
    clear = out_of_walls(inside, seen)
    assert np.allclose(clear.translation[1:], inside.translation[1:])
    assert to_world(clear, surface.hull_points(clear.shape.joints))[:, 0].min() == pytest.approx(0.0, abs=1e-9)
    assert out_of_walls(clear, seen).translation == pytest.approx(clear.translation)
    surface, away = placement_at(library, "fridge_small", (0.3, 0, 0), math.pi / 2, 1.0)
    box = placed_box(away, surface)
    assert facing_wall(away, box, [wall]) == pytest.approx(0.0, abs=1e-9)
    _, towards = placement_at(library, "fridge_small", (0.3, 0, 0), -math.pi / 2, 1.0)
    assert facing_wall(towards, box, [wall]) == pytest.approx(1.0)
    _, far = placement_at(library, "fridge_small", (1.5, 0, 0), -math.pi / 2, 1.0)
    assert facing_wall(far, placed_box(far, surface), [wall]) == 0.0


def test_neighbours_that_overlap_are_moved_apart(replace_objects):
    """Two boxes whose meshes interpenetrate by 3 cm: no candidate helps, a small shift does."""
    meshes = {
        1: floor_mesh(),
        2: box_mesh((-0.2, -0.1, 0), (0.0, 0.1, 0.2)),
        3: box_mesh((-0.03, -0.1, 0), (0.17, 0.1, 0.2)),
    }
    classes = {1: "floor", 2: "box", 3: "box"}
    stuck = replace_objects(meshes, classes, name="stuck", maximum_shift=0.0)
    assert stuck.info.conflicts_before == 1 and stuck.info.conflicts_after == 1
    apart = replace_objects(meshes, classes, name="apart", maximum_shift=0.05)
    assert apart.info.conflicts_after == 0
    for a, b in zip(stuck.info.replacements, apart.info.replacements, strict=True):
        if a.chosen and b.chosen:
            shift = np.array(a.chosen.world_from_model)[:3, 3] - np.array(b.chosen.world_from_model)[:3, 3]
            assert np.linalg.norm(shift) <= 0.05 + 1e-9 and shift[2] == 0
