"""What makes a scene stand: free spots, real bearing surfaces, balance, free space; and the colours of parts."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.stages.cad.apart import stays_on
from scenewright.stages.cad.bearing import borne_share, shift_to_bearing
from scenewright.stages.cad.coloring import part_colors
from scenewright.stages.cad.free_space import NOTHING_KNOWN, load_free_space
from scenewright.stages.cad.free_spots import free_spot
from scenewright.stages.cad.model_surfaces import Look
from scenewright.stages.cad.scoring import balance_margin, filled_space
from scenewright.stages.kit.geometry.boxes import box_from_bounds
from scenewright.stages.kit.geometry.convex_solids import convex_solid, penetration

from tests.panoptic_maps import box_mesh, write_map
from tests.unit.cad.test_cad_stage import mesh_of, placement_at, surface_points


def solid(*boxes):
    meshes = [box_mesh(low, high) for low, high in boxes]
    return convex_solid([(np.asarray(mesh.vertices), np.asarray(mesh.faces)) for mesh in meshes])


def anywhere(shift):
    return True


@given(st.floats(0.005, 0.06), st.floats(0, 2 * math.pi))
@settings(max_examples=25, deadline=None)
def test_the_nearest_free_spot_is_as_far_as_the_overlap(overlap, yaw):
    """Two unit cubes, one of them turned with the push: the least shift is the overlap."""
    turn = np.array([[math.cos(yaw), -math.sin(yaw), 0], [math.sin(yaw), math.cos(yaw), 0], [0, 0, 1]])
    cubes = []
    for shift in (0.0, 1.0 - overlap):
        mesh = box_mesh((shift, 0, 0), (shift + 1, 1, 1))
        cubes.append(convex_solid([(np.asarray(mesh.vertices) @ turn.T, np.asarray(mesh.faces))]))
    spot = free_spot(cubes[0], [cubes[1]], anywhere, tolerance=0.001, maximum_shift=0.1)
    assert spot.depth == 0.0 and spot.offset[2] == 0.0
    assert overlap - 0.002 <= np.linalg.norm(spot.offset) <= overlap + 0.006
    assert penetration(cubes[0].shifted(spot.offset), cubes[1]).depth <= 0.001


def test_a_free_spot_is_no_place_that_is_not_allowed():
    mover, other = solid(((0, 0, 0), (1, 1, 1))), solid(((0.97, 0, 0), (2, 1, 1)))
    only_up = free_spot(mover, [other], lambda shift: shift[0] >= -0.001, tolerance=0.002, maximum_shift=0.05)
    assert only_up.depth > 0.02  # nowhere to go within 5 cm but back
    free = free_spot(mover, [solid(((5, 5, 5), (6, 6, 6)))], anywhere, tolerance=0.002, maximum_shift=0.05)
    assert free.depth == 0.0 and not free.offset.any()


def test_shifted_solids_leave_the_first_where_it_was():
    one = solid(((0, 0, 0), (1, 1, 1)))
    moved = one.shifted(np.array([2.0, 0, 0]))
    assert penetration(one, moved).depth == 0.0
    assert np.allclose(moved.low, [[2, 0, 0]]) and np.allclose(one.low, 0)
    assert penetration(moved, solid(((2.5, 0, 0), (3.5, 1, 1)))).depth == pytest.approx(0.5, abs=1e-3)


def test_what_stands_stays_over_its_surface():
    outline = np.array([[0, 0], [1, 0], [1, 0.5], [0, 0.5]])
    box = box_from_bounds((0.8, 0.2, 1), (1.0, 0.3, 1.2))
    assert stays_on(box, outline, np.array([0.05, 0.0])) and not stays_on(box, outline, np.array([0.15, 0.0]))
    outside = box_from_bounds((1.2, 0.2, 1), (1.4, 0.3, 1.2))
    assert stays_on(outside, outline, np.array([-0.1, 0])) and not stays_on(outside, outline, np.array([0.01, 0]))
    assert stays_on(box, None, np.array([9.0, 9.0]))


def test_things_move_to_where_the_model_bears_them(library):
    """A thing over the edge of a table's top goes back until all of its five points are borne."""
    surface, table = placement_at(library, "table_square", (0, 0, 0), 0.0, 1.0)
    on = box_from_bounds((-0.1, -0.1, 0.74), (0.1, 0.1, 0.9))
    beyond = box_from_bounds((0.35, -0.1, 0.74), (0.55, 0.1, 0.9))
    assert borne_share(table, surface, on, 0.74) == 1.0
    assert borne_share(table, surface, beyond, 0.74) == pytest.approx(0.4)  # two of five points
    assert borne_share(table, surface, on, 0.5) == 0.0
    assert not shift_to_bearing(table, surface, on, 0.74, np.zeros(2)).any()
    shift = shift_to_bearing(table, surface, beyond, 0.74, np.zeros(2))
    assert shift[1] == pytest.approx(0) and 0.109 - 0.005 <= -shift[0] <= 0.12  # 0.45 + 0.06 -> 0.40 (5 mm reach)


def test_balance_is_the_distance_to_the_edge_of_the_foot():
    foot = np.array([[x, y, 0.0] for x in (-0.1, 0.1) for y in (-0.2, 0.2)])
    points = np.concatenate([foot, foot + [0.3, 0, 1.0]])
    assert balance_margin(points, np.array([0.04, 0.0, 0.5])) == pytest.approx(0.06)
    assert balance_margin(points, np.array([0.15, 0.0, 0.5])) == pytest.approx(-0.05)
    assert balance_margin(np.array([[0, 0, 0.0], [1, 0, 0.0], [0, 0, 1.0]]), np.zeros(3)) == -math.inf


def volume(root, tsdf_of_x, voxel_size=0.02, truncation_distance=0.08):
    """A map whose two blocks hold a field that depends on x alone; the second block was hardly observed."""
    found = write_map(root, {1: box_mesh((0, 0, 0), (0.1, 0.1, 0.1))}, {1: "box"})
    info = found.info.model_copy(update={"voxel_size": voxel_size, "truncation_distance": truncation_distance})
    info.write(root / "entities.json")
    x = np.tile((np.arange(8) + 0.5) * voxel_size, 64)
    tsdf = np.stack([tsdf_of_x(x), tsdf_of_x(x)]).astype(np.float16)
    weight = np.stack([np.ones(512), np.zeros(512)]).astype(np.float16)
    blocks = np.array([[0, 0, 0], [-1, 0, 0]], dtype=np.int32)
    np.savez(root / "volume.npz", block_coordinates=blocks, tsdf=tsdf, weight=weight)
    return PanopticMap(root)


def test_free_space_is_what_lies_before_surface(tmp_path):
    """A wall at x = 0.1 m seen from x = 0: 1 - x / 0.1 truncation distances before it."""
    free = load_free_space(volume(tmp_path, lambda x: (0.1 - x) / 0.08))
    points = np.array([[0.05, 0.05, 0.05], [0.13, 0.05, 0.05], [-0.05, 0.05, 0.05], [5.0, 0, 0]])
    assert np.allclose(free.depth_within(points), [0.05, 0, 0, 0], atol=1e-4)  # before, behind, unobserved, unknown
    assert not NOTHING_KNOWN.depth_within(points).any()


def test_a_model_that_fills_free_space_is_told(tmp_path, library):
    free = load_free_space(volume(tmp_path, lambda x: np.full_like(x, 0.5)))
    surface, inside = placement_at(library, "box_cube", (0.08, 0.08, 0.0), 0.0, 0.5)
    _, outside = placement_at(library, "box_cube", (1.0, 0.08, 0.0), 0.0, 0.5)
    assert filled_space(inside, surface, free) == pytest.approx(0.04, abs=1e-3)  # half of 8 cm, everywhere
    assert filled_space(outside, surface, free) == 0.0


def test_a_map_without_volume_knows_no_free_space(tmp_path):
    assert load_free_space(write_map(tmp_path, {1: box_mesh((0, 0, 0), (1, 1, 1))}, {1: "box"})) == NOTHING_KNOWN


def test_parts_take_the_colours_of_their_vertices(library):
    surface, placement = placement_at(library, "fridge_small", (0, 0, 0), 0.0, 1.0, {"door_hinge": 2.0})
    points, normals = surface_points(mesh_of(library, "fridge_small", (0, 0, 0), 0.0, 1.0, {"door_hinge": 2.0}))
    door = surface.closest(points, placement.shape.joints, normals).part == surface.model.parts.index("door")
    colors = np.where(door[:, None], [200, 10, 20], [30, 40, 250]).astype(np.uint8)
    assert part_colors(surface, placement, points, normals, colors) == {"body": (30, 40, 250), "door": (200, 10, 20)}
    far = part_colors(surface, placement, points + [0, 0, 9.0], normals, colors)
    assert far == {}


def test_what_is_taken_is_by_how_much_the_seen_surface_differs(library):
    """Of a model whose triangles have two colours the half that was seen is a little darker: so is all of it then."""
    surface, placement = placement_at(library, "box_cube", (0, 0, 0), 0.0, 1.0)
    points, normals = surface_points(mesh_of(library, "box_cube", (0, 0, 0), 0.0, 1.0))
    look = surface.looks["body"]
    two = Look(np.where(np.arange(len(look.areas))[:, None] % 3 == 0, [200.0, 60, 50], [240.0, 230, 220]), look.areas)
    painted = replace(surface, looks={"body": two})
    nearest = surface.closest(points, {}, normals)
    seen = np.round(two.colors[nearest.triangle] - 20.0).astype(np.uint8)
    top = normals[:, 2] > 0.9
    taken = part_colors(painted, placement, points[top], normals[top], seen[top])["body"]
    assert np.allclose(taken, two.mean - 20.0, atol=1.0)


def test_the_colour_of_a_large_part_is_that_of_its_lit_surface(library):
    """A top under a lamp, sides of which a third is in shadow: half of the colour is from the top, half from lit sides;
    what leaks at the rim of a small part is no light."""
    surface, placement = placement_at(library, "box_cube", (0, 0, 0), 0.0, 1.0)
    points, normals = surface_points(mesh_of(library, "box_cube", (0, 0, 0), 0.0, 1.0))
    points, normals = np.tile(points, (40, 1)), np.tile(normals, (40, 1))
    top, shadow = normals[:, 2] > 0.9, np.arange(len(points)) // 7 % 3 == 0
    colors = np.where(top, 180, np.where(shadow, 30, 100))[:, None].repeat(3, axis=1).astype(np.uint8)
    assert part_colors(surface, placement, points, normals, colors) == {"body": (140, 140, 140)}
    few = slice(0, 200)
    brightest = np.where(np.arange(len(points)) % 12 == 0, 250, 90)[:, None].repeat(3, axis=1).astype(np.uint8)
    assert part_colors(surface, placement, points[few], normals[few], brightest[few]) == {"body": (90, 90, 90)}


def test_a_part_that_nobody_saw_follows_one_of_its_colour(library):
    where = ((0, 0, 0), 0.0, 1.0, {"door_hinge": 2.0})
    surface, placement = placement_at(library, "fridge_small", *where)
    points, normals = surface_points(mesh_of(library, "fridge_small", *where))
    body = surface.closest(points, placement.shape.joints, normals).part == surface.model.parts.index("body")
    colors = np.tile(np.array([[30, 40, 250]], np.uint8), (len(points), 1))
    alike = {"body": (100.0, 100, 100), "door": (104.0, 100, 98)}
    other = alike | {"door": (200.0, 20, 20)}
    for means, expected in ((alike, (34, 40, 248)), (other, (200, 20, 20))):
        looks = {k: Look(np.tile([means[k]], (len(v.areas), 1)), v.areas) for k, v in surface.looks.items()}
        found = part_colors(replace(surface, looks=looks), placement, points[body], normals[body], colors[body])
        assert found == {"body": (30, 40, 250), "door": expected}
