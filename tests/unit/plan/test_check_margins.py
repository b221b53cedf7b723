"""How sure the checks of an executed plan are."""

from __future__ import annotations

from pathlib import Path

import pytest
from scenewright.schemas.plan import Check
from scenewright.stages.kit.simulation.world import load_scene
from scenewright.stages.plan.check_margins import verdict_margin, with_margins
from scenewright.stages.plan.checks import check_joints, check_on

from tests.unit.simulation.handmade_scene import kitchen, write_scene


@pytest.mark.parametrize(("value", "margins"), [(0.0999, (0.0, 2.0)), (0.09, (5.0, 99.0)), (0.02, None)])
def test_a_door_that_is_hardly_shut_is_marginal(
    tmp_path: Path, value: float, margins: tuple[float, float] | None
) -> None:
    write_scene(tmp_path, kitchen(value))
    with load_scene(tmp_path) as world:
        world.step(24)

        def checked() -> tuple[Check, ...]:
            shut = check_joints(world, "closed(fridge_2)", "fridge_2", ["fridge_2__hinge"], shut=True)
            return shut, check_on(world, "on(cup_5, table_3)", "cup_5", "table_3")

        before = checked()
        shut, stands = with_margins(before, world, None, checked)
        assert checked() == before, "the world is as it was"
    assert shut.holds and stands.holds and stands.margin is None
    if margins is None:
        assert shut.margin is None
    else:
        assert shut.margin is not None and margins[0] <= shut.margin < margins[1]
    assert verdict_margin((shut, stands)) == shut.margin


def test_what_failed_surely_is_sure() -> None:
    def check(holds: bool, margin: float | None) -> Check:
        return Check(condition="on(a, b)", holds=holds, detail="", margin=margin)

    assert verdict_margin((check(True, 3.0), check(True, 1.0), check(True, None))) == 1.0
    assert verdict_margin((check(True, 1.0), check(False, 4.0), check(False, 3.0))) == 4.0
    assert verdict_margin((check(False, 1.0), check(False, None))) is None
