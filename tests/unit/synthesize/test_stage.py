"""The whole step, small: files agree with each other and with the geometry that they tell of."""

from __future__ import annotations

import hashlib
from pathlib import Path

import cv2
import numpy as np
import open3d as o3d
import pytest
import trimesh
from scenewright.schemas.cad_library import CadLibrary
from scenewright.schemas.contact_graph import SCENE_NODE
from scenewright.schemas.errors import UsageError
from scenewright.schemas.ground_truth import GroundTruth
from scenewright.schemas.interactive_scene import InteractiveSceneFile
from scenewright.stages.kit.formats.frames import FrameReader
from scenewright.stages.kit.formats.trajectories import read_tum
from scenewright.stages.kit.geometry.boxes import boxes_overlap_volume, points_in_box
from scenewright.stages.kit.geometry.cameras import back_project
from scenewright.stages.kit.geometry.transforms import apply
from scenewright.stages.kit.progress import SilentProgress
from scenewright.stages.kit.rendering.depth_noise import DepthCamera
from scenewright.stages.kit.simulation.world import load_scene
from scenewright.stages.kit.stage import Context
from scenewright.stages.synthesize.parameters import SynthesizeParameters, check
from scenewright.stages.synthesize.stage import run


def make(library: CadLibrary, output: Path, **options: object) -> GroundTruth:
    parameters = SynthesizeParameters.model_validate({"frames": 6, "width": 160, "height": 120} | options)
    return run(
        library, parameters=parameters, context=Context(output=output, seed=3, device="cpu", progress=SilentProgress())
    )


@pytest.fixture(scope="module")
def truth(library: CadLibrary, tmp_path_factory: pytest.TempPathFactory) -> GroundTruth:
    return make(library, tmp_path_factory.mktemp("exact"), depth_noise=False)


def test_log_and_trajectory_agree(truth: GroundTruth) -> None:
    times, poses = read_tum(truth.path("trajectory.tum"))
    with FrameReader(truth.path("log.mcap")) as log:
        frames = list(log.frames())
        assert log.camera == truth.info.camera and log.world_up == "z"
        table = {entry.instance: entry.class_name for entry in log.label_table}
    assert len(frames) == 6 == truth.info.frame_count
    assert np.allclose([frame.time for frame in frames], times, atol=1e-6)
    for frame, pose in zip(frames, poses, strict=True):
        assert frame.world_from_camera is not None and np.allclose(frame.world_from_camera, pose, atol=1e-6)
    assert table == {entry.instance: entry.class_name for entry in truth.info.objects}


def test_labelled_depth_lies_on_the_labelled_surface(truth: GroundTruth) -> None:
    """Every depth pixel, put back into the world, is on the mesh of the instance that the label names."""
    whole = trimesh.load(truth.path("mesh.ply"), process=False)
    instance = np.asarray(whole.metadata["_ply_raw"]["vertex"]["data"]["instance"]).reshape(-1)
    scenes = {}
    for label in np.unique(instance):
        scene = o3d.t.geometry.RaycastingScene()
        faces = whole.faces[instance[whole.faces[:, 0]] == label]
        scene.add_triangles(np.asarray(whole.vertices, dtype=np.float32), faces.astype(np.uint32))
        scenes[int(label)] = scene
    checked = 0
    with FrameReader(truth.path("log.mcap")) as log:
        for frame in log.frames(every=2):
            assert frame.depth is not None and frame.labels is not None and frame.world_from_camera is not None
            points = apply(frame.world_from_camera, back_project(frame.depth, log.camera).astype(float))
            for label in np.unique(frame.labels):
                if label == 0:
                    continue
                here = points[(frame.labels == label) & (frame.depth > 0)].astype(np.float32)
                distance = scenes[int(label)].compute_distance(o3d.core.Tensor(here)).numpy()
                assert distance.max() < 1.5e-3
                checked += len(here)
    assert checked > 3 * 160 * 120 * 0.95


def test_boxes_hold_their_visible_points(truth: GroundTruth) -> None:
    seen = np.load(truth.path("visible.npz"), allow_pickle=False)
    points, instance = seen["points"], seen["instance"]
    assert points.dtype == np.float32 and instance.dtype == np.int32 and len(points) == len(instance) > 5000
    cells = np.floor(points.astype(np.float64) / 0.01).astype(int)
    assert len(np.unique(np.column_stack([cells, instance]), axis=0)) > 0.999 * len(points)
    for entry in truth.info.objects:
        own = points[instance == entry.instance].astype(float)
        if len(own):
            assert points_in_box(entry.box, own, margin=2e-3).all(), entry.name
        assert (entry.visible_pixels > 0) or len(own) == 0
    assert sum(entry.visible_pixels for entry in truth.info.objects) == 6 * 160 * 120


def test_graph_is_a_tree_of_true_contacts(truth: GroundTruth) -> None:
    graph = truth.graph
    names = {node.id for node in graph.nodes}
    assert names == {entry.name for entry in truth.info.objects} | {SCENE_NODE}
    for node in graph.nodes:
        if node.id == SCENE_NODE:
            assert node.box is None and graph.parent_link(node.id) is None
            continue
        link = graph.parent_link(node.id)
        assert link is not None and link.source in names
        if node.class_name in ("floor", "wall", "ceiling"):
            assert (link.source, link.relation) == (SCENE_NODE, "supports")
        elif link.relation == "carries_on_wall":
            assert link.source.startswith("wall_")
        else:
            assert link.plane is not None and link.gap is not None and link.overlap is not None
            plane = graph.node(link.source).planes[link.plane]
            assert plane.horizontal and abs(link.gap) <= 1e-3 and link.overlap >= 0.3, link
        if link.relation == "contains":
            assert graph.node(link.source).class_name in (
                "fridge",
                "shelf",
                "cabinet",
                "box",
                "microwave",
                "wall_cabinet",
                "bin",
            )
    assert any(link.relation == "contains" and link.source.startswith("fridge") for link in graph.links)
    boxes = {node.id: node.box for node in graph.nodes if node.box is not None}
    linked = {frozenset((link.source, link.target)) for link in graph.links if link.relation != "proximal"}
    for link in graph.links:
        if link.relation == "proximal":
            assert boxes_overlap_volume(boxes[link.source], boxes[link.target]) > 0
            assert frozenset((link.source, link.target)) not in linked


def test_room_is_an_interactive_scene(truth: GroundTruth) -> None:
    scene = InteractiveSceneFile.read(truth.path("room") / "scene.json")
    assert {body.name for body in scene.bodies} == {entry.name for entry in truth.info.objects}
    assert (truth.path("room") / scene.combined_file).is_file() and (truth.path("room") / scene.static_file).is_file()
    poses = {entry.name: entry.world_from_model for entry in truth.info.objects}
    for body in scene.bodies:
        assert np.allclose(body.world_from_body, poses[body.name])
        assert (body.file is not None) == body.movable
    fridge = next(body for body in scene.bodies if body.class_name == "fridge")
    assert max(fridge.joint_values.values()) > 1.0


def test_noise_changes_the_depth_and_nothing_else(library: CadLibrary, truth: GroundTruth, tmp_path: Path) -> None:
    noisy = make(library, tmp_path, depth_noise=True)
    assert noisy.path("graph.json").read_bytes() == truth.path("graph.json").read_bytes()
    assert noisy.path("visible.npz").read_bytes() == truth.path("visible.npz").read_bytes()
    assert noisy.path("trajectory.tum").read_bytes() == truth.path("trajectory.tum").read_bytes()
    sensor = DepthCamera()
    with FrameReader(noisy.path("log.mcap")) as a, FrameReader(truth.path("log.mcap")) as b:
        for with_noise, exact in zip(a.frames(), b.frames(), strict=True):
            assert with_noise.depth is not None and exact.depth is not None
            assert np.array_equal(with_noise.color, exact.color) and np.array_equal(with_noise.labels, exact.labels)
            valid = with_noise.depth > 0
            assert 0.5 < valid.mean() < 1.0 and (exact.depth > 0).mean() > 0.999
            assert with_noise.depth[valid].min() >= sensor.minimum_range - 1e-3
            error = np.abs(with_noise.depth - exact.depth)[valid]
            assert 0.0005 < np.median(error) < 0.03


def test_a_second_eye_sees_the_same_points_further_left(
    library: CadLibrary, truth: GroundTruth, tmp_path: Path
) -> None:
    stereo = make(library, tmp_path, frames=2, depth_noise=False, stereo_baseline=0.1, depth=False)
    with FrameReader(truth.path("log.mcap")) as one, FrameReader(stereo.path("log.mcap")) as two:
        assert two.baselines == {"camera": pytest.approx(0.1)} and "depth" not in two.streams
        exact, pair = one.read(0), two.read(0, ("color", "right"))
        assert exact.depth is not None and pair.color is not None and pair.right is not None
        assert np.array_equal(pair.color, exact.color)
        row, column = np.mgrid[:120, :160].astype(np.float32)
        target = column - two.camera.fx * 0.1 / np.maximum(exact.depth, 0.1)
        carried = cv2.remap(pair.right, target.astype(np.float32), row, cv2.INTER_LINEAR)
        seen = target >= 0
        moved = np.abs(carried.astype(int) - pair.color)[seen].mean()
        assert moved < 0.4 * np.abs(pair.right.astype(int) - pair.color)[seen].mean()


@pytest.mark.slow
def test_three_cameras_see_in_turn_ahead_and_to_both_sides(library: CadLibrary, tmp_path: Path) -> None:
    for name in ("several", "alone"):
        (tmp_path / name).mkdir()
    several = make(library, tmp_path / "several", frames=4, depth_noise=False, cameras=3)
    alone = make(library, tmp_path / "alone", frames=4, depth_noise=False)
    with FrameReader(alone.path("log.mcap")) as one, FrameReader(several.path("log.mcap")) as three:
        frames, ahead = list(three.frames()), list(one.frames())
        assert [frame.camera_name for frame in frames] == ["camera", "camera_left", "camera_right", "camera"]
        assert np.array_equal(frames[3].color, ahead[3].color)
        assert not np.array_equal(frames[1].color, ahead[1].color)
        poses = [
            (np.asarray(a.world_from_camera), np.asarray(b.world_from_camera))
            for a, b in zip(ahead, frames, strict=True)
        ]
    for (a, b), degrees in zip(poses, (0, 60, -60, 0), strict=True):
        turn = b[:3, :3] @ a[:3, :3].T
        np.testing.assert_allclose(turn[2], (0, 0, 1), atol=1e-6)
        assert np.rad2deg(np.arctan2(turn[1, 0], turn[0, 0])) == pytest.approx(degrees, abs=1e-3)
        np.testing.assert_allclose(b[:3, 3], a[:3, 3], atol=1e-6)


def test_a_log_must_say_something_of_distance() -> None:
    with pytest.raises(UsageError, match="without distances"):
        check(SynthesizeParameters(depth=False), {})  # type: ignore[call-arg]


@pytest.mark.slow
def test_same_seed_same_bytes(library: CadLibrary, truth: GroundTruth, tmp_path: Path) -> None:
    again = make(library, tmp_path, depth_noise=False)

    def digests(root: Path) -> dict[str, str]:
        files = sorted(path for path in root.rglob("*") if path.is_file())
        return {str(path.relative_to(root)): hashlib.sha256(path.read_bytes()).hexdigest() for path in files}

    assert digests(again.root) == digests(truth.root)


def test_true_room_stands_still_in_a_physics_engine(truth: GroundTruth) -> None:
    """Nothing falls, slides or is thrown out: the collision margins of the engine alone move things, by millimetres."""
    with load_scene(truth.path("room")) as world:
        moved = world.settle(1.0)
    assert len(moved) >= 5
    assert max(moved.values()) < 0.01, {name: value for name, value in moved.items() if value >= 0.01}


def test_doors_and_drawers_stand_in_two_states(library: CadLibrary, tmp_path: Path) -> None:
    truth = make(library, tmp_path, opened=3, depth_noise=False, frames=16)
    moved = [thing for thing in truth.info.objects if thing.joints_before is not None]
    assert 1 <= len(moved) <= 3
    for thing in moved:
        assert thing.joints_before is not None
        changed = [name for name, value in thing.joints.items() if value != thing.joints_before[name]]
        assert len(changed) == 1
        assert 0.0 in (thing.joints[changed[0]], thing.joints_before[changed[0]])
    with FrameReader(truth.path("log.mcap")) as reader:
        poses = reader.poses()[1]
        assert all(np.allclose(poses[k], poses[-1 - k], atol=0.05) for k in range(8))  # there and back
        depths = [reader.read(index, ("depth",)).depth for index in range(16)]
    assert any(np.mean(np.abs(depths[k] - depths[-1 - k]) > 0.1) > 0.02 for k in range(8))
