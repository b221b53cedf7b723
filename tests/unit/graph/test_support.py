"""Equations 2.1 to 2.3 in closed form."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scenewright.schemas.scene_parts import SurfacePlane
from scenewright.stages.graph import thesis
from scenewright.stages.graph.corrected_support import candidates_for, hull_overlap, prefer_the_highest
from scenewright.stages.graph.nodes import Entity, Patch, is_horizontal, level_patch
from scenewright.stages.graph.ours import fragments
from scenewright.stages.graph.parameters import GraphParameters
from scenewright.stages.graph.support import Candidate, height_gap, support_score
from scenewright.stages.graph.touching import seam_share, smaller_share
from scenewright.stages.kit.geometry.boxes import box_from_bounds, gravity_aligned_box
from scenewright.stages.kit.geometry.planes import plane_height

SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])


def entity(name, box, patches=(), class_name="box", node_type="rigid", movable=True):
    return Entity(
        name=name,
        instance=int(name.split("_")[-1]),
        class_name=class_name,
        node_type=node_type,
        movable=movable,
        mesh=None,
        confidence=1.0,
        points=np.zeros((0, 3)),
        box=box,
        patches=tuple(patches),
    )


def solid(name, low, high, **kinds):
    """A box whose top is a supporting plane."""
    outline = np.array([[low[0], low[1]], [high[0], low[1]], [high[0], high[1]], [low[0], high[1]]])
    return entity(name, box_from_bounds(low, high), [level_patch(outline, high[2], hidden=False)], **kinds)


def test_horizontal_is_normal_times_gravity_at_most_a_th():
    assert is_horizontal((0, 0, 1), -1.0)
    assert is_horizontal((np.sin(0.4), 0, np.cos(0.4)), -0.9)
    assert not is_horizontal((np.sin(0.5), 0, np.cos(0.5)), -0.9)
    assert not is_horizontal((0, 0, -1), -0.9)


def test_height_gap_is_2_1():
    patch = level_patch(SQUARE, 0.75, hidden=False)
    child = gravity_aligned_box((0.5, 0.5, 1.0), (0.2, 0.2, 0.4), 0.3)
    # p - (-d + s / 2) with p = 1, d = -0.75, s = 0.4
    assert height_gap(child, patch) == pytest.approx(1.0 - (0.75 + 0.2))


def test_height_of_a_sloping_plane_is_taken_under_the_child():
    slope = np.array([np.sin(0.3), 0.0, np.cos(0.3)])
    plane = SurfacePlane(normal=tuple(slope), offset=-float(slope @ [2.0, 0, 1.0]), area=1, center=(2, 0, 1))
    assert plane_height(plane, np.array([2.0, 5.0])) == pytest.approx(1.0)
    assert plane_height(plane, np.array([3.0, 5.0])) == pytest.approx(1.0 - np.tan(0.3))


def test_rectangle_overlap_is_2_2_as_the_thesis_words_it():
    child = gravity_aligned_box((0.0, 0.0, 1.0), (2.0, 1.0, 1.0), 0.0)
    points = np.array([[-0.5, -0.5, 0.5], [0.5, 0.25, 0.5], [5.0, 5.0, 0.5]])
    assert thesis.rectangle_overlap(points, child) == pytest.approx(1.0 * 0.75 / 2.0)
    turned = gravity_aligned_box((0.0, 0.0, 1.0), (2.0, 1.0, 1.0), np.pi / 2)
    assert thesis.rectangle_overlap(np.array([[0.5, -1.0, 0], [-0.5, 1.0, 0]]), turned) == pytest.approx(1.0)
    assert thesis.rectangle_overlap(points[2:], child) == 0.0


def test_hull_overlap_spans_the_hole_under_the_child():
    child = gravity_aligned_box((0.5, 0.5, 1.0), (0.4, 0.4, 1.0), 0.0)
    grid = np.stack(np.meshgrid(np.linspace(0, 1, 21), np.linspace(0, 1, 21)), axis=-1).reshape(-1, 2)
    seen = grid[(np.abs(grid - 0.5).max(axis=1) > 0.22) & (grid[:, 1] < 0.95)]
    assert hull_overlap(SQUARE, child) == pytest.approx(1.0)
    # The camera looked along +y: nothing was seen inside the footprint.
    assert thesis.rectangle_overlap(np.column_stack([seen, np.zeros(len(seen))]), child) < 0.5
    half_off = gravity_aligned_box((1.0, 0.5, 1.0), (0.4, 0.4, 1.0), 0.0)
    assert hull_overlap(SQUARE, half_off) == pytest.approx(0.5)
    assert hull_overlap(np.zeros((0, 2)), child) == 0.0


@pytest.mark.parametrize(
    ("gap", "overlap", "score"), [(0, 1, 1), (0.25, 0.8, 0.6), (-0.25, 0.8, 0.6), (1.5, 1, 0), (0, 0.3, 0.3)]
)
def test_score_is_2_3(gap, overlap, score):
    assert support_score(gap, overlap) == pytest.approx(score)


def test_best_parent_maximises_the_score():
    floor = solid("floor_1", (-3, -3, -0.01), (3, 3, 0), class_name="floor", node_type="layout")
    table = solid("table_2", (0, 0, 0), (1, 1, 0.75), class_name="table", movable=False)
    cup = solid("cup_3", (0.4, 0.4, 0.76), (0.5, 0.5, 0.86), class_name="cup")
    # A cup 0.76 m above the floor does not stand on it.
    assert [c.parent for c in candidates_for(cup, [floor, table, cup], GraphParameters())] == ["table_2"]
    ranked = candidates_for(cup, [floor, table, cup], GraphParameters(tie_margin=0.0, movable_gap=1.0))
    assert [c.parent for c in ranked] == ["table_2", "floor_1"]
    assert ranked[0].score == pytest.approx(0.99)
    assert ranked[0].gap == pytest.approx(0.01) and ranked[0].overlap == pytest.approx(1.0)
    assert ranked[1].score == pytest.approx(0.24)


def test_area_threshold_and_minimum_score_reject():
    table = solid("table_2", (0, 0, 0), (1, 1, 0.75), class_name="table", movable=False)
    edge = solid("box_3", (0.9, 0.2, 0.75), (1.2, 0.5, 0.9))
    assert candidates_for(edge, [table, edge], GraphParameters()) == []
    found = candidates_for(edge, [table, edge], GraphParameters(area_threshold=0.3))
    assert found[0].overlap == pytest.approx(1 / 3)
    floating = solid("box_4", (0.2, 0.2, 1.6), (0.5, 0.5, 1.7))
    assert candidates_for(floating, [table, floating], GraphParameters()) == []


def test_a_plane_through_the_child_does_not_carry_it():
    """What is left of a chair under a table (its back) reaches above the table top."""
    table = solid("table_2", (0, 0, 0), (1, 1, 0.75), class_name="table", movable=False)
    chair = solid("chair_3", (0.3, 0.3, 0.5), (0.7, 0.7, 0.9), class_name="chair", movable=False)
    assert candidates_for(chair, [table, chair], GraphParameters()) == []
    baseline = thesis.candidates_for(
        chair,
        [entity("table_2", table.box, [Patch(table.patches[0].plane, SQUARE_3D, SQUARE)]), chair],
        GraphParameters(method="thesis"),
    )
    assert baseline[0].parent == "table_2"


SQUARE_3D = np.column_stack([0.3 + 0.4 * SQUARE, np.full(4, 0.75)])


def test_furniture_rather_stands_on_the_desk_than_on_the_keyboard():
    desk = solid("desk_1", (0, 0, 0), (1.2, 0.7, 0.73), class_name="desk", movable=False)
    keyboard = solid("keyboard_2", (0.3, 0.2, 0.73), (0.8, 0.4, 0.75), class_name="keyboard")
    monitor = solid("monitor_3", (0.35, 0.25, 0.77), (0.75, 0.39, 1.2), class_name="monitor", movable=False)
    assert candidates_for(monitor, [desk, keyboard, monitor], GraphParameters())[0].parent == "desk_1"


def test_among_near_equals_the_highest_surface_wins():
    table = solid("table_1", (0, 0, 0), (1, 1, 0.75), class_name="table", movable=False)
    book = solid("book_2", (0.3, 0.3, 0.75), (0.5, 0.5, 0.78), class_name="book")
    # A cup on the book whose rim sticks out over it, and of which the map lacks the lowest 2.5 cm, so that it touches
    # neither: (2.3) gives the table 0.945 and the book 0.88.
    cup = solid("cup_3", (0.41, 0.35, 0.805), (0.51, 0.45, 0.905), class_name="cup")
    plain = candidates_for(cup, [table, book, cup], GraphParameters(tie_margin=0.0))
    assert plain[0].parent == "table_1"
    assert candidates_for(cup, [table, book, cup], GraphParameters())[0].parent == "book_2"


def test_prefer_the_highest_ignores_planes_that_the_child_sinks_into():
    def candidate(parent, score, gap, height):
        return Candidate("x_9", parent, score, "supports", gap, 1.0, height, 0)

    ranked = [candidate("a_1", 0.97, 0.0, 0.75), candidate("b_2", 0.95, -0.04, 0.79)]
    assert prefer_the_highest(ranked, GraphParameters())[0].parent == "a_1"
    assert prefer_the_highest([], GraphParameters()) == []


def with_foot(name, low, high, **kinds):
    """A solid whose front and sides were seen, seen from -y: points along the lower front edge, 1 cm apart."""
    front = np.arange(low[0], high[0] + 1e-9, 0.01)
    foot = np.column_stack([front, np.full(len(front), low[1]), np.full(len(front), low[2])])
    return replace(solid(name, low, high, **kinds), points=foot)


def test_what_an_object_touches_carries_it_whatever_lies_deeper():
    """A flat box on a flat box on a table: 5 cm cost nothing in (2.3), yet nothing floats over what it touches."""
    table = solid("table_1", (0, 0, 0), (1, 1, 0.75), class_name="table", movable=False)
    # Two thirds of the upper one lie over the lower one: 0.67 against 0.95 for the table.
    lower = solid("object_2", (0.3, 0.3, 0.75), (0.5, 0.5, 0.8), class_name="object", movable=False)
    upper = solid("object_3", (0.3, 0.3667, 0.8), (0.5, 0.5667, 0.85), class_name="object", movable=False)
    ranked = candidates_for(upper, [table, lower, upper], GraphParameters())
    assert [c.parent for c in ranked] == ["object_2", "table_1"] and ranked[0].score < ranked[1].score
    # Where the lower one ends 3 cm below, it is no contact, and the better covered plane wins again.
    low = solid("object_2", (0.3, 0.3, 0.75), (0.5, 0.5, 0.77), class_name="object", movable=False)
    assert candidates_for(upper, [table, low, upper], GraphParameters())[0].parent == "table_1"


@pytest.mark.parametrize(("rise", "parent"), [(0.0, "object_2"), (-0.03, "table_1")])
def test_the_seam_before_the_foot_tells_what_a_hidden_top_cannot(rise, parent):
    """The box hides the top behind its front: of what carries it 15 cm before it are seen. Sunk into it, it stands
    behind it instead."""
    table = solid("table_1", (0, 0, 0), (1, 1, 0.75), class_name="table", movable=False)
    front = np.array([[0.3, 0.3], [0.5, 0.3], [0.5, 0.44], [0.3, 0.44]])
    seen = level_patch(front, 0.8, hidden=False)
    spread = np.stack(np.meshgrid(np.arange(0.3, 0.5, 0.01), np.arange(0.3, 0.44, 0.01)), axis=-1).reshape(-1, 2)
    seen = replace(seen, points=np.column_stack([spread, np.full(len(spread), 0.8)]))
    lower = entity("object_2", box_from_bounds((0.3, 0.3, 0.75), (0.5, 0.44, 0.8)), [seen], "object", movable=False)
    upper = with_foot("object_3", (0.35, 0.45, 0.8 + rise), (0.45, 0.55, 1.0), class_name="object", movable=False)
    assert seam_share(upper, seen) == 1.0
    assert candidates_for(upper, [table, lower, upper], GraphParameters())[0].parent == parent


@pytest.mark.parametrize(("shown", "carried"), [(0.2, False), (0.89, True)])
def test_a_worktop_goes_on_where_nothing_lower_was_seen(shown, carried):
    """Of a dark worktop the front edge alone gave depth: what stands farther back stands on it, unless the camera saw
    something lower there (at 0.2 m); what lies at the height of the top itself is not lower."""
    front = level_patch(np.array([[0, 0], [2, 0], [2, 0.15], [0, 0.15]]), 0.9, hidden=False)
    counter = entity("object_1", box_from_bounds((0, 0, 0), (2, 0.6, 1.1)), [front], "object", movable=False)
    boards = solid("sink_2", (1.0, 0.3, 0.88), (1.4, 0.6, 1.0), class_name="sink", movable=False)
    spread = np.stack(np.meshgrid(np.arange(1.0, 1.4, 0.01), np.arange(0.3, 0.6, 0.01)), axis=-1).reshape(-1, 2)
    below = entity("object_3", box_from_bounds((1, 0.3, 0), (1.4, 0.6, shown)), (), "object", movable=False)
    below = replace(below, points=np.column_stack([spread, np.full(len(spread), shown)]))
    ranked = candidates_for(boards, [counter, boards, below], GraphParameters())
    found = [(c.height, c.hidden.plane.hidden) for c in ranked if c.parent == "object_1"]
    assert found == ([(pytest.approx(0.9), True)] if carried else [])


def test_a_board_lies_on_a_post_that_is_narrower_than_itself():
    table = solid("table_1", (0, 0, 0), (1, 1, 0.75), class_name="table", movable=False)
    post = entity("object_2", box_from_bounds((0.45, 0.45, 0.75), (0.55, 0.55, 0.95)), (), "object", movable=False)
    board = solid("object_3", (0.3, 0.35, 0.95), (0.7, 0.65, 1.0), class_name="object", movable=False)
    assert smaller_share(board.box, post.box) == pytest.approx(1.0)
    best = candidates_for(board, [table, post, board], GraphParameters())[0]
    assert best.parent == "object_2" and best.hidden is not None
    baseline = thesis.candidates_for(board, [table, post, board], GraphParameters(method="thesis"))
    assert not [c for c in baseline if c.parent == "object_2"]


@pytest.mark.parametrize(("gap", "carried"), [(0.45, True), (0.62, False)])
def test_a_hood_does_not_stand_on_the_hob(gap: float, carried: bool) -> None:
    counter = solid("counter_1", (0, 0, 0), (2, 0.6, 0.9), class_name="counter", movable=False)
    hood = solid("object_2", (0.5, 0, 0.9 + gap), (1.1, 0.5, 1.2 + gap), class_name="object", movable=False)
    assert bool(candidates_for(hood, [counter, hood], GraphParameters())) == carried


@pytest.mark.parametrize(("gap", "parent"), [(0.0, "object_2"), (0.09, "object_2"), (0.13, "table_1")])
def test_what_juts_out_hides_the_top_of_what_carries_it(gap, parent):
    """A board that is 10 cm wider than its post, seen from 45 degrees above at most, hides 10 cm of it."""
    table = solid("table_1", (0, 0, 0), (1, 1, 0.75), class_name="table", movable=False)
    post = entity("object_2", box_from_bounds((0.45, 0.45, 0.75), (0.55, 0.55, 0.95)), (), "object", movable=False)
    low = 0.95 + gap
    board = solid("object_3", (0.45, 0.45, low), (0.65, 0.65, low + 0.05), class_name="object", movable=False)
    assert candidates_for(board, [table, post, board], GraphParameters())[0].parent == parent
    # Furniture lacks legs instead: a desk that is seen over a bin stands on the floor.
    desk = solid("desk_3", (0.45, 0.45, low + 0.03), (0.65, 0.65, low + 0.05), class_name="desk", movable=False)
    assert candidates_for(desk, [table, post, desk], GraphParameters())[0].parent == "table_1"


def test_furniture_within_furniture_of_its_class_is_a_piece_and_what_nobody_named_is_none():
    def pair(class_name, movable=False):
        whole = entity(f"{class_name}_1", box_from_bounds((0, 0, 0), (1, 1, 1)), class_name=class_name, movable=movable)
        piece = entity(
            f"{class_name}_2", box_from_bounds((0.1, 0.1, 0.1), (0.5, 0.5, 0.5)), class_name=class_name, movable=movable
        )
        return [replace(whole, points=np.zeros((9, 3))), replace(piece, points=np.zeros((4, 3)))]

    assert fragments(pair("sofa")) == {"sofa_2": "sofa_1"}
    assert fragments(pair("bowl", movable=True)) == {}
    assert fragments(pair("object")) == {}


def filled(low, high):
    """Points all over a box."""
    axes = [np.linspace(a, b, 6) for a, b in zip(low, high, strict=True)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3)


@pytest.mark.parametrize(
    ("low", "high", "board_at", "expected"),
    [
        ((0.9, 0.3, 0.4), (0.93, 0.33, 0.8), None, True),  # a post in the air, 3 cm thick: it would tip over
        ((0.9, 0.3, 0.4), (0.93, 0.33, 0.8), 0.39, False),  # a rod that stands on a board
        ((0.1, 0.1, 0.4), (0.8, 0.35, 0.43), None, False),  # a tray on something that nobody saw
        ((0.3, 0.1, 0.4), (0.36, 0.16, 0.52), 0.39, False),  # a bottle on a board
        ((0.3, 0.1, 0.4), (0.36, 0.16, 0.46), None, False),  # a cup whose foot nobody saw: too stout
        ((0.1, 0.1, 0.4), (0.5, 0.35, 0.7), None, False),  # a coffee machine
        ((0.9, 0.6, 0.4), (0.93, 0.63, 0.8), None, False),  # a post in front of the shelf
    ],
)
def test_a_board_or_post_that_would_fall_by_itself_is_a_piece_of_what_is_around_it(low, high, board_at, expected):
    whole = entity("shelf_1", box_from_bounds((0, 0, 0), (1, 0.4, 1.8)), class_name="shelf", movable=False)
    if board_at is not None:
        patch = level_patch(SQUARE * [1.0, 0.4], board_at, hidden=False)
        whole = replace(whole, patches=(patch,))
    whole = replace(whole, points=filled((0, 0, 0), (1, 0.4, 1.8)).repeat(2, axis=0))
    piece = entity("object_2", box_from_bounds(low, high), class_name="object", movable=False)
    found = fragments([whole, replace(piece, points=filled(low, high))])
    assert found == ({"object_2": "shelf_1"} if expected else {})


@pytest.mark.parametrize(("low", "parent"), [(0.78, "object_2"), (0.70, "floor_1")])
def test_what_seems_to_begin_below_a_glossy_top_stands_on_it(low, parent):
    """A top at 0.9 m that gave depth at its edge; a thing up to 1.1 m, of which more is above than below, or less."""
    floor = solid("floor_1", (-3, -3, -0.1), (3, 3, 0.0), class_name="floor", node_type="layout", movable=False)
    edge = level_patch(np.array([[0, 0], [2.0, 0], [2.0, 0.1], [0, 0.1]]), 0.9, hidden=False)
    counter = entity("object_2", box_from_bounds((0, 0, 0), (2, 0.6, 0.9)), [edge], "object", movable=False)
    thing = entity("object_3", box_from_bounds((0.8, 0.3, low), (1.1, 0.5, 1.1)), (), "object", movable=False)
    assert candidates_for(thing, [floor, counter, thing], GraphParameters())[0].parent == parent
