"""The figures of a plan: which task plans were tried, and how the robot moved."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from pydantic import ValidationError
from scenewright.schemas.base import as_transform
from scenewright.schemas.errors import BadInput
from scenewright.schemas.plan import Failure, PlanFile, PlannedAction, TriedPlan
from scenewright.stages.report.motion_figures import motion_figure, tried_tree

ACTIONS = ("drive(start, fridge_7)", "open(fridge_7__door_hinge)", "pick(bottle_9, fridge_7)")


def file(**fields) -> PlanFile:
    needed = {"goal": (), "planned_in": "reconstructed", "executed_in": None, "status": "planned", "actions": ()}
    return PlanFile.model_validate(needed | fields)


def test_tried_plans_share_what_they_share_and_say_where_each_ended() -> None:
    failure = Failure(kind="no_path", message="the shelf is in the way")
    tried = (TriedPlan(actions=ACTIONS, failed_action=2, failure=failure), TriedPlan(actions=ACTIONS))
    texts = [text.get_text() for text in tried_tree(file(tried=tried)).axes[0].texts]
    assert texts.count("drive\nfridge_7") == texts.count("open\nfridge_7 door") == 1
    assert "1: pick\nbottle_9: the shelf is in the way" in texts and "2: every action has a motion" in texts


@pytest.mark.parametrize("failed, why", [(2, False), (None, True), (3, True), (-1, True)])
def test_a_tried_plan_names_the_action_that_failed_and_why_or_neither(failed: int | None, why: bool) -> None:
    failure = {"kind": "no_path", "message": "the shelf is in the way"} if why else None
    with pytest.raises(ValidationError, match="failed_action"):
        TriedPlan.model_validate({"actions": ACTIONS, "failed_action": failed, "failure": failure})


def test_motion_is_drawn_by_joint_with_the_actions(tmp_path) -> None:
    count = 20
    base = np.tile(np.eye(4), (count, 1, 1))
    arrays = {"time": np.linspace(0, 2, count), "joints": np.full((count, 9), 0.04), "world_from_base": base}
    np.savez(tmp_path / "trajectory.npz", **arrays)
    pose = as_transform(np.eye(4))
    rows = ((0, 10), (10, 30))  # the second one is torn: it ends after the last row
    actions = tuple(PlannedAction(name="pick", arguments=(), start=a, end=b, base_pose=pose) for a, b in rows)
    plan = SimpleNamespace(info=file(actions=actions), path=lambda name: tmp_path / name)
    above, below = motion_figure(plan).axes
    assert [line.get_label() for line in below.lines][6:] == ["joint 7", "finger 1 [cm]", "finger 2 [cm]"]
    assert below.lines[0].get_ydata()[0] == pytest.approx(0.04)  # [rad]
    assert below.lines[8].get_ydata()[0] == pytest.approx(4.0)  # [cm]
    assert [text.get_text() for text in above.texts] == ["pick"]
    (tmp_path / "trajectory.npz").write_bytes(b"torn")
    with pytest.raises(BadInput):
        motion_figure(plan)
