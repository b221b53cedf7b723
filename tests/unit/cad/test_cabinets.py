"""Cabinets are read off the bars that stand out of their front: which leaves there are, and how they open."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scenewright.schemas.scene_parts import Joint
from scenewright.stages.cad.families.fitting import Fitted, fit
from scenewright.stages.cad.families.stand_in import contradicts_handles, inferred_of, write_form
from scenewright.stages.cad.front_bars import Bar, Front, bars_in, in_line
from scenewright.stages.cad.front_leaves import leaves_of
from scenewright.stages.cad.joint_evidence import Looked, joint_evidence
from scenewright.stages.cad.made_models import plane_of
from scenewright.stages.kit.formats.cad_models import part_transforms

from tests.unit.cad.test_families import node, reading_of

WIDE, DEEP, HIGH, FOOT = 0.9, 0.5, 0.85, 0.07
LYING, STANDING = False, True


def carcass():
    """A closed box on a plinth, its front at y = -DEEP / 2."""
    body = ((-WIDE / 2, -DEEP / 2, FOOT), (WIDE / 2, DEEP / 2, HIGH))
    return [body, ((-WIDE / 2 + 0.02, -DEEP / 2 + 0.05, 0.0), (WIDE / 2 - 0.02, DEEP / 2, FOOT))]


def bar(x, z, way, length=0.2, out=0.03):
    """A thick bar on the front, as wide as maps show them."""
    half = np.array([0.015, 0.5 * length] if way is STANDING else [0.5 * length, 0.015])
    low, high = np.array([x, z]) - half, np.array([x, z]) + half
    return ((low[0], -DEEP / 2 - out, low[1]), (high[0], -DEEP / 2 + 0.01, high[1]))


def flat_bar(x, z, way, length=0.2) -> Bar:
    half = np.array([0.01, 0.5 * length] if way is STANDING else [0.5 * length, 0.01])
    return Bar(np.array([x, z]) - half, np.array([x, z]) + half, 0.03, way)


def front(*bars: Bar) -> Front:
    return Front(np.array([0.0, 0.0]), np.array([0.9, 0.8]), 0.0, bars)


def cabinet_of(boxes, **options):
    found = fit("cabinet", reading_of(boxes, **options))
    assert isinstance(found, Fitted), found
    return found.form


FRONTS = {
    "two doors": ([(-0.05, 0.6, STANDING), (0.05, 0.6, STANDING)], ["door", "door"]),
    "four drawers": ([(0.0, z, LYING) for z in (0.17, 0.36, 0.56, 0.75)], ["drawer"] * 4),
    "a drawer over doors": (
        [(0.0, 0.75, LYING), (-0.05, 0.5, STANDING), (0.05, 0.5, STANDING)],
        ["door", "door", "drawer"],
    ),
    "one door": ([(0.38, 0.5, STANDING)], ["door"]),
}


@pytest.mark.parametrize("name", FRONTS)
@pytest.mark.parametrize("yaw", [-0.5, 1.9])
def test_a_cabinet_has_the_leaves_that_its_bars_tell(name, yaw):
    bars, kinds = FRONTS[name]
    form = cabinet_of([*carcass(), *(bar(*each) for each in bars)], yaw=yaw)
    assert sorted(leaf.name.split("_")[0] for leaf in form.leaves) == kinds
    corners = np.concatenate([piece.corners for piece in form.pieces])
    size = np.ptp(np.concatenate([corners, *(leaf.pieces[0].corners for leaf in form.leaves)]), axis=0)
    assert size == pytest.approx([WIDE, DEEP, HIGH], abs=0.03)
    fronts = [np.ptp(leaf.pieces[0].corners, axis=0) for leaf in form.leaves]
    assert sum(width * height for width, _, height in fronts) == pytest.approx(WIDE * (HIGH - FOOT), rel=0.08)
    for leaf in form.leaves:
        assert leaf.type == ("prismatic" if leaf.name.startswith("drawer") else "revolute")


def test_a_door_hangs_on_the_side_that_is_away_from_its_bar():
    form = cabinet_of([*carcass(), bar(0.38, 0.5, STANDING)], yaw=0.3)
    (leaf,) = form.leaves
    away = leaf.handle - leaf.origin
    assert abs(away[0]) == pytest.approx(0.83, abs=0.03), "half the front and where its bar is"
    moved = np.cross(leaf.axis, away)
    assert moved[1] < 0, "a positive angle brings it out of the front, which looks to -y"


def test_a_drawer_comes_out_to_the_front_by_no_more_than_its_depth():
    form = cabinet_of([*carcass(), bar(0.0, 0.46, LYING)], yaw=0.3)
    (leaf,) = form.leaves
    assert leaf.axis == pytest.approx([0, -1, 0]) and 0.3 < leaf.travel < DEEP


def test_a_box_without_bars_is_no_cabinet():
    assert str(fit("cabinet", reading_of(carcass()))).startswith("no bar stands out of a flat side of it; open: ")


def test_a_bar_that_hardly_stands_out_is_noise():
    boxes = [*carcass(), bar(0.38, 0.5, STANDING, out=0.006)]
    assert isinstance(fit("cabinet", reading_of(boxes)), str)


def test_depth_that_nobody_saw_ends_at_the_wall_behind():
    plate = ((-WIDE / 2, -DEEP / 2, 0.3), (WIDE / 2, -DEEP / 2 + 0.06, HIGH))
    reading = reading_of([plate, bar(0.38, 0.5, STANDING)], yaw=0.0, at=(0.0, 0.0, 0.0))
    reading = replace(reading, patches=reading.patches.chosen(reading.patches.normals[:, 1] < 0.5))
    alone = fit("cabinet", reading)
    assert str(alone).startswith("its depth was not seen, and no wall is behind it; open: ")
    wall = plane_of(1, False, np.array([-2.0, 0.25, 0.0]), np.array([2.0, 0.25, 2.5]))
    hanging = replace(
        reading,
        walls=(wall,),
        hangs=True,
        free_space=SimpleNamespace(is_empty=lambda points, own: np.zeros(len(points), bool)),
    )
    found = fit("cabinet", hanging)
    assert isinstance(found, Fitted) and found.form.classes == ("wall_cabinet",)
    corners = np.concatenate([piece.corners for piece in found.form.pieces])
    assert corners[:, 1].max() == pytest.approx(0.25, abs=0.01)


def test_a_cabinet_is_a_model_with_joints_and_the_same_bytes(tmp_path):
    form = cabinet_of([*carcass(), bar(0.0, 0.75, LYING), bar(-0.05, 0.5, STANDING), bar(0.05, 0.5, STANDING)])
    placement, surface = write_form(node("cabinet"), form, tmp_path / "a" / "thing_3_cabinet")
    write_form(node("cabinet"), form, tmp_path / "b" / "thing_3_cabinet")
    files = [{p.name: p.read_bytes() for p in sorted((tmp_path / x).rglob("*")) if p.is_file()} for x in "ab"]
    assert files[0] == files[1]
    model = surface.model
    assert model.articulated and model.contains and not model.movable
    assert [joint.type for joint in model.joints].count("revolute") == 2
    assert placement.translation[2] == pytest.approx(0.0, abs=0.01), "it stands on the ground"
    assert inferred_of(placement, surface).what == "bottom, back, plinth"
    for joint, leaf in zip(model.joints, form.leaves, strict=True):
        shut, opened = (part_transforms(model, {joint.name: value})[joint.part] for value in (0.0, joint.upper))
        handle = np.append(leaf.handle - leaf.origin, 1.0)
        assert (opened @ handle)[1] < (shut @ handle)[1] - 0.2, "its handle comes out to the front"


def test_leaves_that_bars_told_have_them_as_grounds(tmp_path):
    boxes = [*carcass(), bar(-0.05, 0.6, STANDING), bar(0.05, 0.6, STANDING)]
    reading = reading_of(boxes, yaw=0.0, at=(0, 0, 0))
    placement, surface = write_form(node("cabinet"), fit("cabinet", reading).form, tmp_path / "thing_3_cabinet")
    patches = reading.patches
    looked = Looked(patches.points, patches.normals, np.zeros((len(patches.points), 3), np.uint8))
    grounds = joint_evidence(surface, placement, looked, vouched=False)
    assert {entry.grounds for entry in grounds.values()} == {("handle",)}


def model_with_handles(*handles):
    """A placed model at the origin whose joints have handles: places and axes."""
    joints = [
        Joint(
            name=f"j{k}",
            type="revolute",
            part=f"p{k}",
            origin=(0, 0, 0),
            axis=(0, 0, 1),
            lower=0,
            upper=1,
            handle=place,
            handle_axis=axis,
        )
        for k, (place, axis) in enumerate(handles)
    ]
    shape = SimpleNamespace(model=SimpleNamespace(joints=joints))
    return SimpleNamespace(shape=shape, rotation=np.eye(3), translation=np.zeros(3), scale=1.0)


@pytest.mark.parametrize(
    ("handles", "contradicted"),
    [
        ([((-0.05, -0.3, 0.6), (0, 0, 1)), ((0.05, -0.3, 0.6), (0, 0, 1))], False),
        ([((-0.05, -0.3, 0.5), (0, 0, 1)), ((0.05, -0.3, 0.5), (0, 0, 1))], False),
        ([((-0.05, -0.3, 0.6), (1, 0, 0)), ((0.05, -0.3, 0.6), (1, 0, 0))], True),
        ([((0.0, -0.3, 0.75), (1, 0, 0))], True),
        ([], True),
    ],
)
def test_a_model_whose_handles_are_elsewhere_is_contradicted(handles, contradicted):
    boxes = [*carcass(), bar(-0.05, 0.6, STANDING), bar(0.05, 0.6, STANDING)]
    form = cabinet_of(boxes, yaw=0.0, at=(0.0, 0.0, 0.0))
    placement = model_with_handles(*handles)
    turned = replace(form, turn=np.eye(3)) if abs(form.turn[0, 0]) > 0.99 and form.turn[0, 0] > 0 else form
    assert contradicts_handles(placement, turned) is contradicted


def test_bars_that_touch_at_their_rim_are_told_higher_up():
    """Two bars beside each other, joined by low surface: one blob at 1 cm, two bars at 2 cm."""
    z = np.linspace(0.0, 0.2, 15)
    ridges = [np.column_stack([np.full(15, x), z]) for x in (-0.05, 0.05)]
    between = np.column_stack([np.tile(np.linspace(-0.04, 0.04, 5), 15), np.repeat(z, 5)])
    places = np.concatenate([*ridges, between])
    heights = np.concatenate([np.full(30, 0.03), np.full(75, 0.009)])
    bars = bars_in(places, heights)
    assert [each.standing for each in bars] == [True, True]
    assert sorted(round(float(each.middle[0]), 3) for each in bars) == [-0.05, 0.05]


def test_the_end_of_a_bar_counts_beside_a_long_one_that_goes_its_way():
    long, short = flat_bar(0.4, 0.6, LYING, 0.2), flat_bar(0.42, 0.3, LYING, 0.06)
    assert in_line([long, short]) == (long, short)
    assert in_line([short]) == () and in_line([long, flat_bar(0.42, 0.3, STANDING, 0.06)]) == (long,)


@pytest.mark.parametrize(
    ("bars", "why"),
    [
        ((), "no bar stands out of it"),
        (tuple(flat_bar(0.1, z, LYING) for z in (0.42, 0.46, 0.5)), "a leaf would be"),
        ((flat_bar(0.455, 0.5, STANDING),), "a bar stands in the middle of a leaf"),
        ((flat_bar(0.45, 0.75, LYING),), "a bar that lies may be of a flap"),
        ((flat_bar(0.4, 0.4, LYING), flat_bar(0.42, 0.41, STANDING)), "its bars are beside and above each other"),
    ],
)
def test_bars_that_tell_no_leaves_say_why(bars, why):
    assert str(leaves_of(front(*bars))).startswith(why)


def test_one_bar_beside_the_middle_is_of_two_doors_that_meet():
    left, right = leaves_of(front(flat_bar(0.5, 0.5, STANDING)))
    assert (left.seen, right.seen) == (False, True)
    assert left.high[0] == pytest.approx(0.45) and right.low[0] == pytest.approx(0.45)
    assert not left.hinge_right and right.hinge_right


@given(st.lists(st.floats(0.05, 0.3), min_size=1, max_size=6), st.booleans())
def test_a_stack_of_drawers_has_its_edges_back(heights, side_by_side):
    """Drawers of any heights above each other, bars in their middles: together they are the front, and where they are
    alike each has its own edges."""
    edges = np.concatenate([[0.0], np.cumsum(heights)])
    columns = [0.25, 0.75] if side_by_side else [0.5]
    bars = [flat_bar(x, 0.5 * (a + b), LYING, 0.15) for x in columns for a, b in zip(edges, edges[1:], strict=False)]
    leaves = leaves_of(Front(np.zeros(2), np.array([1.0, edges[-1]]), 0.0, tuple(bars)))
    if isinstance(leaves, str):
        assert leaves.startswith(("a leaf would be", "a bar that lies")), leaves
        return
    assert len(leaves) == len(bars)
    assert sum(float(np.prod(leaf.high - leaf.low)) for leaf in leaves) == pytest.approx(edges[-1])
    assert all(np.all(leaf.low < leaf.bar.middle) and np.all(leaf.bar.middle < leaf.high) for leaf in leaves)
    if len(set(heights)) == 1:
        assert [leaf.high[1] - leaf.low[1] for leaf in leaves] == pytest.approx([heights[0]] * len(leaves))


def test_what_leaks_onto_a_cabinet_is_no_part_of_it():
    """A thing on top, in the plane of the front: the front ends at the top."""
    boxes = [*carcass(), bar(-0.05, 0.6, STANDING), bar(0.05, 0.6, STANDING)]
    on_top = ((-0.15, -DEEP / 2, HIGH), (0.15, -DEEP / 2 + 0.2, HIGH + 0.2))
    form = cabinet_of([*boxes, on_top], yaw=0.0)
    assert np.concatenate([piece.corners for piece in form.pieces])[:, 2].max() == pytest.approx(HIGH, abs=0.02)
    assert not any(piece.name == "further piece" for piece in form.pieces)


def test_doors_swing_by_a_quarter_turn():
    form = cabinet_of([*carcass(), bar(0.38, 0.5, STANDING)])
    assert form.leaves[0].travel == pytest.approx(0.5 * math.pi)
