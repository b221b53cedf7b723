"""The one entry: images that cannot be used, what could not be handled, oblique cameras, unknown sizes."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from scenewright.schemas.errors import BadInput
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.tableware.planning.rules import Rules, can_stack
from scenewright.stages.tableware.sight import setting_seen
from scenewright.stages.tableware.vision.detections import Detection
from scenewright.stages.tableware.vision.seeing import see, see_image, seen_from_the_side
from scenewright.stages.tableware.world.items import STANDARD, Table, make_item
from scenewright.stages.tableware.world.overhead import OverheadCamera, overhead_camera, render_overhead
from scenewright.stages.tableware.world.setting import Setting

VIEW = overhead_camera()


@pytest.mark.parametrize(
    ("depth", "said"),
    [
        (np.zeros((720, 1280)), "0% of the pixels"),
        (np.full((720, 1280), 830.0), "in metres"),
        (np.full((720, 1280), 0.00083), "0.00083"),
        (np.full((720, 1280), 0.70), "no table"),
        (np.zeros((360, 640)), "the depth image is"),
        (np.full((720, 1280), np.nan), "no numbers|not numbers"),
        (None, "no depth image"),
    ],
)
def test_useless_depth_is_refused_in_one_line(depth, said):
    with pytest.raises(BadInput, match=said) as refusal:
        see_image(np.zeros((720, 1280, 3), dtype=np.uint8), depth, VIEW)
    assert refusal.value.hint and "\n" not in str(refusal.value)


def test_a_tiny_image_is_refused():
    small = replace(VIEW, camera=Camera(width=160, height=90, fx=80, fy=80, cx=79.5, cy=44.5))
    with pytest.raises(BadInput, match="160 x 90 pixels is too small"):
        see(np.zeros((90, 160, 3), np.uint8), np.full((90, 160), 0.83), small)


def test_missing_numbers_count_as_no_depth_and_are_said(images):
    color, depth = images
    depth = depth.copy()
    depth[:40] = np.nan
    sight = see(color, depth, VIEW)
    assert [one.kind for one in sight.detections] == ["bowl", "cup", "spoon", None]
    assert "5.6% of the depth image are no positive numbers" in sight.statement


def test_glare_that_hides_a_place_is_said(images):
    color, depth = (image.copy() for image in images)
    color[420:450, 560:600], depth[420:450, 560:600] = 255, 0.0
    notes = " ".join(see(color, depth, VIEW).notes)
    assert "glare: 20 cm2 of the workspace are full white without depth" in notes


def test_what_is_outside_of_the_workspace_is_doubted(images):
    sight = see(*images, VIEW, (0.52, 0.5))
    (bowl,) = [one for one in sight.detections if one.kind == "bowl"]
    assert "outside of the workspace" in bowl.unsure and bowl.confidence < 0.6
    assert "outside of the workspace" in sight.statement


def test_a_pose_that_the_depth_contradicts_is_refused(images):
    pose = VIEW.world_from_camera.copy()
    pose[:3, :3] = trimesh.transformations.rotation_matrix(0.15, [1, 0, 0])[:3, :3] @ pose[:3, :3]
    with pytest.raises(BadInput, match="off it"):
        see(*images, replace(VIEW, world_from_camera=pose))


def test_depth_without_a_table_is_refused():
    random = np.random.default_rng(0)
    depth = random.uniform(0.3, 2.5, (240, 320)).astype(np.float32)
    camera = Camera(width=320, height=240, fx=300, fy=300, cx=160, cy=120)
    with pytest.raises(BadInput, match="no plane large enough"):
        see(np.zeros((240, 320, 3), np.uint8), depth, camera)


@pytest.fixture(scope="module")
def oblique():
    """A table with a bowl and a cup, 35 degrees off the vertical: (image, depth, camera)."""
    table = Table((make_item("bowl_1", "bowl", -0.12, 0.02), make_item("cup_1", "cup", 0.14, -0.05)))
    turn = trimesh.transformations.rotation_matrix(np.deg2rad(35.0), [1.0, 0.0, 0.0])
    pose = turn @ VIEW.world_from_camera
    view = OverheadCamera(Camera(width=640, height=480, fx=600.0, fy=600.0, cx=319.5, cy=239.5), pose)
    color, depth = render_overhead(table, 5, "bright", "white_on_dark", view=view)
    return color, depth, view


def test_an_oblique_view_is_rectified_by_its_pose(oblique):
    sight = see(*oblique)
    assert sight.rectified and "rectified" in sight.statement
    known = {one.kind: one for one in sight.detections if one.kind in ("bowl", "cup")}
    assert known["bowl"].position == pytest.approx((-0.12, 0.02, 0.0), abs=4e-3)
    assert known["cup"].position == pytest.approx((0.14, -0.05, 0.0), abs=4e-3)
    assert all("oblique view" in one.unsure and one.confidence <= 0.8 for one in known.values())


def test_without_a_pose_the_table_is_found(oblique):
    color, depth, view = oblique
    sight = see(color, depth, view.camera, sizes="estimated")
    angle = np.arccos(np.array(sight.plane[0]) @ view.world_from_camera[2, :3])
    assert np.rad2deg(angle) < 0.5
    assert sight.plane[1] == pytest.approx(view.world_from_camera[2, 3], abs=3e-3)
    found = {one.kind: one for one in sight.detections if one.kind is not None}
    assert sorted(found) == ["bowl", "cup"]
    for kind, one in found.items():
        assert one.size.rim_radius == pytest.approx(STANDARD[kind].rim_radius, abs=4e-3)
        assert one.size.height == pytest.approx(STANDARD[kind].height, abs=6e-3)
        assert "size estimated" in one.unsure
    apart = np.subtract(found["bowl"].position, found["cup"].position)
    assert np.hypot(*apart[:2]) == pytest.approx(np.hypot(0.26, 0.07), abs=5e-3)
    assert "stacks hold were not looked for" in sight.statement


def test_stacksseen_from_the_side_are_not_trusted():
    """A tall mug seen from the side reads as two nested cups: no plan may lift or build on that."""
    seen = (
        Detection(kind="cup", position=(0.0, 0.0, 0.0), hidden=True, confidence=0.9),
        Detection(kind="cup", position=(0.0, 0.0, 0.02), on=0, confidence=0.9),
        Detection(kind="bowl", position=(0.2, 0.0, 0.0), confidence=0.9),
        Detection(kind="fork", position=(0.2, 0.0, 0.0), on=2, confidence=0.9),
        Detection(kind=None, position=(0.0, 0.2, 0.0), confidence=0.0, unsure=("unknown object",)),
    )
    doubted = seen_from_the_side(seen)
    assert [one.confidence for one in doubted] == pytest.approx([0.0, 0.0, 0.72, 0.72, 0.0])
    assert all("a stack seen from the side" in one.unsure for one in doubted[:2])
    assert doubted[2].unsure == ("oblique view",) and doubted[4] == seen[4]


def test_nothing_is_stacked_of_what_is_seen_from_the_side(oblique):
    assert setting_seen((), Setting()) == Setting()
    setting = setting_seen(see(*oblique).detections, Setting())
    assert setting == replace(Setting(), stacking=False)
    assert can_stack("c", "b", Rules(Setting())) and not can_stack("c", "b", Rules(setting))
