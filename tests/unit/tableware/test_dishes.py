"""A user's dishes and gripper: the file, what is seen with it, and what is planned."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image
from scenewright.schemas.errors import BadInput, UsageError
from scenewright.schemas.tableware_detections import TablewareDetections
from scenewright.schemas.tableware_dishes import TablewareDishes
from scenewright.schemas.tableware_scene import TablewareScene
from scenewright.stages.kit.progress import SilentProgress
from scenewright.stages.kit.stage import Context
from scenewright.stages.tableware import detect_stage, plan_stage, scene_stage
from scenewright.stages.tableware.detect_parameters import DetectParameters
from scenewright.stages.tableware.dishes_file import file_of, read_dishes, setting_of
from scenewright.stages.tableware.parameters import PlanParameters, SceneParameters
from scenewright.stages.tableware.planning.policy import THESIS
from scenewright.stages.tableware.planning.rules import Rules, can_hold, can_hold_two, can_stack, lips
from scenewright.stages.tableware.vision.detection import detect
from scenewright.stages.tableware.vision.possible_stacks import lip_range
from scenewright.stages.tableware.world.items import STANDARD, Table, make_item, rise
from scenewright.stages.tableware.world.overhead import overhead_camera, render_overhead
from scenewright.stages.tableware.world.scenes import make_table
from scenewright.stages.tableware.world.setting import Gripper, Setting

MINE = """
[cup]
height = 0.105
rim_radius = 0.036
foot_radius = 0.028
wall = 0.003
[bowl]
height = 0.055
rim_radius = 0.070
foot_radius = 0.040
wall = 0.005
[fork]
length = 0.19
width = 0.022
[spoon]
length = 0.18
width = 0.022
[gripper]
opening = 0.10
jaw_height = 0.03
finger_width = 0.02
"""
WRONG = [
    ("", "document: it says nothing"),
    ("[cup]\nheight = 0.08", "cup.rim_radius: Field required"),
    ("[cup]\nheight = 80\nrim_radius = 0.04", "cup.height: Input should be less than or equal to 0.15"),
    ("[mug]\nheight = 0.08\nrim_radius = 0.04", "mug: Extra inputs"),
    ("[cup]\nheight = 0.08\nrim_radius = 0.04\nfoot_radius = 0.05", "the foot is wider"),
    ("[cup]\nheight = 0.08\nrim_radius = 0.04\n[bowl]\nheight = 0.08\nrim_radius = 0.04", "narrower"),
    ("[fork]\nlength = 0.17\nwidth = 0.018", "both, or of neither"),
    ("cup = 3", "cup: "),
    ("[cup", "dishes.toml"),
]


@pytest.fixture()
def mine(tmp_path: Path) -> Path:
    path = tmp_path / "dishes.toml"
    path.write_text(MINE)
    return path


def context(folder: Path) -> Context:
    folder.mkdir()
    return Context(output=folder, seed=0, device="cpu", progress=SilentProgress())


@pytest.mark.parametrize(("text", "said"), WRONG)
def test_a_file_that_is_wrong_is_refused_in_one_line(text: str, said: str, tmp_path: Path) -> None:
    path = tmp_path / "dishes.toml"
    path.write_text(text)
    with pytest.raises(BadInput) as refusal:
        read_dishes(path)
    assert said in str(refusal.value) and "\n" not in str(refusal.value) and refusal.value.hint


def test_a_file_is_what_a_plan_goes_by_and_back(mine: Path) -> None:
    told = read_dishes(mine)
    setting = setting_of(told)
    assert setting.sizes["cup"].rim_radius == 0.036 and setting.sizes.plate is None
    assert setting.gripper == Gripper(0.10, 0.03, 0.01) and setting.stacking
    assert setting_of(file_of(setting)) == setting and file_of(Setting()) is None
    with pytest.raises(KeyError):
        setting.sizes["plate"]
    grip = setting_of(TablewareDishes.model_validate({"gripper": told.gripper.model_dump()}))  # type: ignore[union-attr]
    assert grip.sizes == STANDARD and grip.gripper.opening == 0.10
    told = told.model_copy(update={"cup": told.cup.model_copy(update={"wall": None})})  # type: ignore[union-attr]
    assert not setting_of(told).stacking


@settings(max_examples=30, deadline=None)
@given(st.floats(0.03, 0.12), st.floats(0.022, 0.15), st.floats(0.3, 1.0))
def test_lips_of_every_stack_lie_where_they_are_looked_for(height: float, rim: float, share: float) -> None:
    cup = replace(STANDARD["cup"], height=height, rim_radius=rim, foot_radius=max(0.01, share * rim))
    sizes = replace(STANDARD, bowl=None, plate=None, cup=cup)
    low, high = lip_range("cup", sizes)
    assert low < height and 3 * rise(cup, cup) + height < high
    rules = Rules(Setting(sizes))
    assert np.diff(lips("ccc", rules)) == pytest.approx([rise(cup, cup)] * 2)


def test_the_hand_decides_what_is_held() -> None:
    low = Rules(Setting(gripper=Gripper(jaw_height=0.012)))
    assert can_hold("cc", Rules()) and not can_hold("cc", low)
    guessed = Rules(Setting(stacking=False, alike=frozenset("b")))
    assert can_stack("c", "b", Rules()) and not can_stack("c", "b", guessed)
    assert can_hold_two("b", "b", guessed) and can_hold_two("c", "c", Rules()) and not can_hold_two("c", "c", guessed)


def test_dishes_of_other_sizes_are_found_with_their_file_alone(mine: Path) -> None:
    sizes, view = setting_of(read_dishes(mine)).sizes, overhead_camera()
    table = make_table("tier1", 3, sizes)
    color, depth = render_overhead(table, 3, "usual", "dark_on_white", view=view)
    found = detect(color, depth, view, sizes=sizes)
    for item in table.items:
        near = [
            one.kind
            for one in found
            if np.hypot(one.position[0] - item.position[0], one.position[1] - item.position[1]) < 0.01
        ]
        assert item.kind in near, item.name
    strangers = detect(color, depth, view)
    assert sum(one.kind in ("cup", "bowl") for one in strangers) < 4
    with pytest.raises(UsageError, match="plate"):
        make_table("tier3", 3, sizes)


def test_the_file_goes_from_the_scene_to_the_plan(mine: Path, tmp_path: Path) -> None:
    made = scene_stage.run(mine, parameters=SceneParameters(), context=context(tmp_path / "scene"))
    assert isinstance(made, TablewareScene) and made.info.dishes == read_dishes(mine)
    parameters = PlanParameters(source="truth", draws=2, image_width=300)
    plan = plan_stage.run(None, made, parameters=parameters, context=context(tmp_path / "plan")).info
    assert plan.dishes is not None and plan.dishes.gripper is not None and plan.dishes.gripper.opening == 0.10
    assert plan.steps and not plan.refused and any("standard dishes" in note for note in plan.notes)
    seen = detect_stage.run(
        made.root, None, None, None, parameters=DetectParameters(), context=context(tmp_path / "seen")
    )
    assert seen.info.sizes == "known" and seen.info.dishes == made.info.dishes
    planned = plan_stage.run(seen, None, parameters=PlanParameters(draws=2), context=context(tmp_path / "planned"))
    assert len(planned.info.items) >= 11


def raw_image(folder: Path, table: Table) -> Path:
    """Write an image of a table as a camera of one's own would, and return the folder."""
    view = overhead_camera()
    color, depth = render_overhead(table, 1, "usual", "dark_on_white", view=view)
    folder.mkdir()
    Image.fromarray(color).save(folder / "color.png")
    np.save(folder / "depth.npy", depth)
    told = {"camera": view.camera.model_dump(), "world_from_camera": view.world_from_camera.tolist()}
    (folder / "camera.json").write_text(json.dumps(told))
    return folder


def test_without_a_file_sizes_are_estimated_and_nothing_is_stacked(mine: Path, tmp_path: Path) -> None:
    places = [("cup", -0.25, 0.1), ("cup", -0.05, 0.1), ("bowl", 0.2, 0.0), ("bowl", -0.2, -0.15)]
    items = tuple(make_item(f"{kind}_{n}", kind, x, y) for n, (kind, x, y) in enumerate(places))  # type: ignore[arg-type]
    raw = raw_image(tmp_path / "raw", Table(items))
    seen = detect_stage.run(raw, None, None, None, parameters=DetectParameters(), context=context(tmp_path / "seen"))
    assert seen.info.sizes == "estimated" and [one.kind for one in seen.info.items].count("cup") == 2
    plan = plan_stage.run(seen, None, parameters=PlanParameters(draws=2), context=context(tmp_path / "plan")).info
    assert plan.sizes == "estimated" and len(plan.items) == 4 and plan.trips < 4
    assert not any(step.action.name in ("stack", "stack_grasp") for step in plan.steps)
    assert plan.dishes is not None and plan.dishes.cup is not None
    assert plan.dishes.cup.rim_radius == pytest.approx(STANDARD["cup"].rim_radius, abs=5e-3)
    with pytest.raises(BadInput, match="leave one of them out|not to go by it"):
        detect_stage.run(
            raw, None, None, mine, parameters=DetectParameters(sizes="estimated"), context=context(tmp_path / "both")
        )
    assert isinstance(seen, TablewareDetections)


def test_dishes_that_differ_are_planned_one_by_one(tmp_path: Path) -> None:
    tall = replace(STANDARD["cup"], height=0.11)
    items = (make_item("a", "cup", -0.2, 0.0), replace(make_item("b", "cup", 0.0, 0.0), measures=tall))
    raw = raw_image(tmp_path / "raw", Table(items))
    seen = detect_stage.run(raw, None, None, None, parameters=DetectParameters(), context=context(tmp_path / "seen"))
    plan = plan_stage.run(seen, None, parameters=PlanParameters(draws=2), context=context(tmp_path / "plan")).info
    assert len(plan.items) == plan.trips == 2 and not plan.refused
    assert any("by estimate" in pair.message for pair in plan.impossible)
    assert THESIS.setting == Setting()
