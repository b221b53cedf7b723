"""Errors of placed models and their joints against values that are known by construction."""

from __future__ import annotations

import numpy as np
import pytest
from scenewright.stages.evaluate.alignment_errors import alignment_error
from scenewright.stages.evaluate.joint_errors import joint_errors, placed_joints
from scenewright.stages.evaluate.model_shapes import PlacedShape, supporting_area
from scenewright.stages.kit.geometry.transforms import transform_from, transform_from_yaw
from scenewright.stages.kit.measurement.room_penetrations import room_penetrations
from scipy.spatial.transform import Rotation

from tests.unit.evaluate.shapes import box_model, cupboard

TABLE = box_model("table_a", "table", (1.2, 0.8, 0.7))


def at(x=0.0, y=0.0, z=0.0, yaw=0.0) -> np.ndarray:
    return transform_from_yaw(yaw, np.array([x, y, z]))


def test_the_same_model_in_the_same_place_has_no_error():
    error = alignment_error(PlacedShape(TABLE, at(1, 2, 0, 0.3)), PlacedShape(TABLE, at(1, 2, 0, 0.3)))
    assert error.translation == pytest.approx(0.0) and error.rotation == pytest.approx(0.0, abs=1e-9)
    assert error.scale_ratios == pytest.approx((1, 1, 1)) and error.succeeds(every_axis=True)


def test_translation_is_that_of_the_middles_of_the_boxes():
    """A model twice as high that stands on the same spot is half a height off."""
    error = alignment_error(PlacedShape(TABLE, at()), PlacedShape(box_model("b", "table", (1.2, 0.8, 1.4)), at()))
    assert error.translation == pytest.approx(0.35)
    assert error.scale_ratios == pytest.approx((1, 1, 2))
    assert error.scale == pytest.approx(1 / 3) and error.worst_scale == pytest.approx(1.0)


def test_quarter_turns_of_a_square_table_permute_its_axes():
    square = box_model("s", "table", (1.0, 1.0, 0.7))
    other = box_model("o", "table", (1.0, 1.1, 0.7))
    error = alignment_error(PlacedShape(square, at()), PlacedShape(other, at(yaw=np.pi / 2 + 0.05)))
    assert error.rotation == pytest.approx(0.05)
    assert error.scale_ratios == pytest.approx((1.1, 1.0, 1.0))
    oblong = alignment_error(PlacedShape(TABLE, at()), PlacedShape(TABLE, at(yaw=np.pi / 2)))
    assert oblong.rotation == pytest.approx(np.pi / 2) and not oblong.succeeds()


def test_round_things_have_no_yaw_but_may_lean():
    error = alignment_error(PlacedShape(TABLE, at()), PlacedShape(TABLE, at(yaw=1.0)), is_round=True)
    assert error.rotation == pytest.approx(0.0, abs=1e-9)
    leaning = transform_from(Rotation.from_euler("x", 0.3).as_matrix(), np.zeros(3))
    assert alignment_error(PlacedShape(TABLE, at()), PlacedShape(TABLE, leaning), is_round=True).rotation == (
        pytest.approx(0.3)
    )


@pytest.mark.parametrize(
    ("pose", "scale", "right"),
    [
        (at(0.199), 1.0, True),
        (at(0.201), 1.0, False),
        (at(yaw=0.34), 1.0, True),
        (at(yaw=0.36), 1.0, False),
        (at(), 1.19, True),
        (at(), 1.21, False),
        (at(), 0.81, True),
        (at(), 0.79, False),
    ],
)
def test_success_has_the_thresholds_of_the_benchmark(pose, scale, right):
    assert alignment_error(PlacedShape(TABLE, at()), PlacedShape(TABLE, pose, scale)).succeeds() is right


def test_joints_of_the_same_model_agree_and_scale_with_it():
    shape = cupboard("c", drawers=(0.2, 0.6))
    values = {"door_hinge": 0.5, "drawer_1_slide": 0.1}
    true = placed_joints(PlacedShape(shape, at(1, 1), 1.0, values))
    assert [error.value for error in joint_errors(true, true)] == pytest.approx([0, 0, 0])
    larger = joint_errors(true, placed_joints(PlacedShape(shape, at(1, 1), 1.1, values)))
    door, low, high = larger
    assert door.offset == pytest.approx(0.1 * np.hypot(0.4, 0.25))  # the hinge moved out with the corner
    assert door.limits == pytest.approx(0.0) and door.value == pytest.approx(0.0)
    assert (low.partner, high.partner) == ("drawer_0_slide", "drawer_1_slide")
    assert low.offset is None and low.limits == pytest.approx(0.03) and high.value == pytest.approx(0.01)


def test_joints_of_another_model_are_paired_by_place_and_type():
    true = placed_joints(PlacedShape(cupboard("c", drawers=(0.2, 0.6)), at(), 1.0, {"drawer_0_slide": 0.2}))
    other = placed_joints(PlacedShape(cupboard("d", hinge_x=0.37, upper=2.0, drawers=(0.65, 0.15)), at()))
    door, low, high = joint_errors(true, other)
    assert door.offset == pytest.approx(0.03) and door.limits == pytest.approx(0.4)
    assert (low.partner, high.partner) == ("drawer_1_slide", "drawer_0_slide")
    assert low.value == pytest.approx(0.2)
    without = joint_errors(true, placed_joints(PlacedShape(cupboard("e"), at())))
    assert [error.partner for error in without] == ["door_hinge", None, None]
    assert joint_errors(true, [])[0].angle is None


def test_an_axis_that_points_the_other_way_turns_limits_round():
    shape = cupboard("c")
    hinge = shape.joints[0].model_copy(update={"axis": (0.0, 0.0, -1.0), "lower": -1.6, "upper": 0.0})
    flipped = type(shape)("f", "cabinet", shape.parts, (hinge,))
    (error,) = joint_errors(
        placed_joints(PlacedShape(shape, at(), 1.0, {"door_hinge": 0.7})),
        placed_joints(PlacedShape(flipped, at(), 1.0, {"door_hinge": -0.6})),
    )
    assert error.angle == pytest.approx(0.0, abs=1e-9) and error.limits == pytest.approx(0.0)
    assert error.value == pytest.approx(0.1)


def test_supporting_area_is_the_largest_level():
    assert supporting_area(TABLE) == pytest.approx(1.2 * 0.8)
    assert supporting_area(TABLE, scale=0.5) == pytest.approx(0.6 * 0.4)


def test_penetrations_of_a_room():
    table = PlacedShape(TABLE, at()).pieces()
    cup = box_model("cup", "cup", (0.1, 0.1, 0.1))
    floor = {"floor": PlacedShape(box_model("f", "floor", (9, 9, 0.2)), at(z=-0.198)).pieces()}
    room = {
        "standing": PlacedShape(cup, at(z=0.7)).pieces(),
        "sunk": PlacedShape(cup, at(0.3, 0.0, 0.68)).pieces(),
        "table": table,
    }
    found = room_penetrations(room, floor)
    assert [(p.first, p.second, p.layout) for p in found] == [("sunk", "table", False), ("table", "floor", True)]
    assert [p.depth for p in found] == pytest.approx([0.02, 0.002])
    assert [p.volume for p in found] == pytest.approx([0.1 * 0.1 * 0.02, 1.2 * 0.8 * 0.002])
    assert [p.collides for p in found] == [True, False]
