"""Vision on small rendered tables, and what it says of images that it cannot use."""

import numpy as np
import pytest
from scenewright.stages.tableware.vision.detection import detect
from scenewright.stages.tableware.vision.detections import as_table, statement
from scenewright.stages.tableware.vision.rim_finding import Rim
from scenewright.stages.tableware.vision.stack_reading import read_stacks
from scenewright.stages.tableware.world.items import STANDARD, rise
from scenewright.stages.tableware.world.overhead import overhead_camera

VIEW = overhead_camera()


@pytest.fixture(scope="package")
def found(images):
    return detect(*images, VIEW)


def test_items_are_where_they_stand(found):
    known = {one.kind: one for one in found if one.kind is not None}
    assert sorted(known) == ["bowl", "cup", "spoon"]
    assert known["bowl"].position == pytest.approx((-0.2, 0.1, 0.0), abs=2e-3)
    assert known["cup"].position == pytest.approx((-0.2, 0.1, rise(STANDARD["cup"], STANDARD["bowl"])), abs=2e-3)
    assert found[known["cup"].on] is known["bowl"]
    assert known["spoon"].position[:2] == pytest.approx((0.15, -0.1), abs=4e-3)
    assert known["spoon"].yaw == pytest.approx(0.6, abs=0.03)


def test_what_is_no_tableware_is_said(found):
    (brick,) = [one for one in found if one.kind is None]
    assert brick.position[:2] == pytest.approx((0.2, 0.15), abs=0.012)
    assert brick.unsure == ("unknown object",)
    assert "1 thing of unknown kind" in statement(found)


def test_the_found_table_carries_what_was_carried(found):
    table = as_table(found)
    assert len(table.items) == 3
    assert [len(stack) for stack in table.stacks] == [2, 1]


def test_an_empty_table_is_a_statement():
    depth = np.full((720, 1280), 0.83, dtype=np.float32)
    color = np.full((720, 1280, 3), 220, dtype=np.uint8)
    assert detect(color, depth, VIEW) == ()
    assert "empty" in statement(())


def test_a_stack_is_read_from_its_lips():
    """Two bowls and three cups would be five; two bowls and two cups are found from their two highest lips."""
    bowl, cup = STANDARD["bowl"], STANDARD["cup"]
    lower = bowl.nesting_rise
    foot = lower + rise(cup, bowl) + cup.nesting_rise
    rims = [Rim("cup", 0.101, 0.0, foot + cup.height + 0.001, 0.9, 1.0), Rim("bowl", 0.1, 0.0, lower + 0.07, 1.0, 1.0)]
    (stack,) = read_stacks(rims, STANDARD)
    assert stack.kinds == ("bowl", "bowl", "cup", "cup")
    assert stack.misfit < 0.001
