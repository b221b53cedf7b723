"""The walk: clear of everything, smooth, as fast as a person, looks where it should, evenly sampled."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scenewright.schemas.errors import BadInput
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.kit.geometry.cameras import project
from scenewright.stages.kit.geometry.transforms import apply, inverse, is_rigid
from scenewright.stages.kit.rendering.ray_casting import SceneRenderer
from scenewright.stages.synthesize.arrangement import Arrangement, arrange, world_meshes
from scenewright.stages.synthesize.free_space import find_free_space
from scenewright.stages.synthesize.furniture import Catalogue
from scenewright.stages.synthesize.recipes import load_recipe
from scenewright.stages.synthesize.viewpoints import blocked_floor, choose_views
from scenewright.stages.synthesize.walk import CLEARANCE, Walk, frame_times, plan_walk

CAMERA = Camera(width=160, height=120, fx=131.0, fy=131.0, cx=79.5, cy=59.5)
Place = tuple[Arrangement, SceneRenderer, Walk]


def walk_through(catalogue: Catalogue, recipe: str, seed: int) -> Place:
    arrangement = arrange(load_recipe(recipe), catalogue, "medium", seed, blocked_floor)
    renderer = SceneRenderer(world_meshes(arrangement))
    space = find_free_space(renderer, arrangement.room.size)
    views = choose_views(renderer, arrangement, space, CAMERA, np.random.default_rng([seed, 1]))
    return arrangement, renderer, plan_walk(views, space, renderer, 0.5, np.random.default_rng([seed, 2]))


@pytest.fixture(scope="module", params=[("room", 0), pytest.param(("room", 2), marks=pytest.mark.slow), ("office", 1)])
def place(request: pytest.FixtureRequest, catalogue: Catalogue) -> Place:
    return walk_through(catalogue, *request.param)


def sampled(walk: Walk, rate: float = 30.0) -> np.ndarray:
    return np.array([walk.pose(t) for t in np.arange(0.0, walk.duration, 1.0 / rate)])


def test_camera_keeps_its_distance(place: Place) -> None:
    _, renderer, walk = place
    poses = sampled(walk)
    # The hand's tremor of a centimetre or two comes on top of the planned clearance.
    assert renderer.distance(walk.eye).min() >= CLEARANCE
    assert renderer.distance(poses[:, :3, 3]).min() >= 0.3


def test_camera_is_inside_the_room_at_hand_height(place: Place) -> None:
    arrangement, _, walk = place
    eye = sampled(walk)[:, :3, 3]
    assert np.all(np.abs(eye[:, :2]) < arrangement.room.size[:2] / 2 - 0.25)
    assert eye[:, 2].min() > 1.0 and eye[:, 2].max() < 1.75
    assert 1.35 < np.median(eye[:, 2]) < 1.6


def test_poses_are_upright_and_smooth(place: Place) -> None:
    _, _, walk = place
    poses = sampled(walk)
    assert all(is_rigid(pose) for pose in poses)
    # Image right is level within a hand's tremor, image down is down.
    assert np.abs(poses[:, 2, 0]).max() < np.sin(np.deg2rad(4))
    assert poses[:, 2, 1].max() < -0.3
    speed = np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1) * 30
    assert speed.max() < 0.9 and 0.05 < speed.mean() < 0.6
    cosine = np.einsum("nji,nji->n", poses[1:, :3, :3], poses[:-1, :3, :3])
    turning = np.rad2deg(np.arccos(np.clip((cosine - 1) / 2, -1, 1))) * 30
    assert turning.max() < 150 and np.percentile(turning, 95) < 100
    # It trembles: poses differ from the planned ones, by little.
    shift = (
        poses[:, :3, 3]
        - np.array(
            [np.interp(np.arange(len(poses)) / 30, np.arange(len(walk.eye)) / 60, walk.eye[:, k]) for k in range(3)]
        ).T
    )
    assert 0.001 < shift.std() < 0.02


def test_objects_and_the_fridges_inside_are_seen(place: Place) -> None:
    arrangement, renderer, walk = place
    poses = [walk.pose(t) for t in np.linspace(0, walk.duration, 60)]
    seen: dict[int, int] = {}
    for pose in poses:
        ids, counts = np.unique(renderer.render(CAMERA, pose).instance, return_counts=True)
        for instance, count in zip(ids, counts, strict=True):
            seen[int(instance)] = max(seen.get(int(instance), 0), int(count))
    big = [t for t in arrangement.objects if t.furnishing.closed_size.max() > 0.4]
    assert all(seen.get(t.instance, 0) > 60 for t in big), [t.name for t in big if seen.get(t.instance, 0) <= 60]
    found = [seen.get(t.instance, 0) > 8 for t in arrangement.objects]
    assert np.mean(found) > 0.9
    for thing in arrangement.objects:
        if thing.furnishing.joints and thing.class_name == "fridge":
            # Some frame looks in from the front: the middle of the fridge is in the image, within 45 degrees.
            front = -thing.world_from_model[:3, 1]
            middle = apply(thing.world_from_model, np.array([0.0, 0.0, 0.5 * thing.furnishing.closed_size[2]]))
            good = 0
            for pose in poses:
                pixel, depth = project(apply(inverse(pose), middle[None]), CAMERA)
                to_camera = pose[:3, 3] - middle
                frontal = to_camera @ front / np.linalg.norm(to_camera) > np.cos(np.deg2rad(45))
                good += bool(
                    depth[0] > 0 and frontal and 0 < pixel[0, 0] < CAMERA.width and 0 < pixel[0, 1] < CAMERA.height
                )
            assert good >= 2


def test_walk_is_repeatable(catalogue: Catalogue) -> None:
    first, second = (walk_through(catalogue, "room", 0)[2] for _ in range(2))
    assert np.array_equal(first.eye, second.eye) and np.array_equal(first.pose(3.21), second.pose(3.21))


def test_frame_times() -> None:
    times = frame_times(60.0, 300, 30.0)
    assert len(times) == 300 and times[0] == 0.0 and times[-1] == pytest.approx(60.0)
    assert np.allclose(times * 30, np.round(times * 30)) and np.diff(times).min() > 0
    assert np.ptp(np.diff(times)) <= 1 / 30 + 1e-9
    crowded = frame_times(2.0, 300, 30.0)
    assert np.allclose(np.diff(crowded), 1 / 30)


def test_nothing_to_look_at(catalogue: Catalogue) -> None:
    arrangement, renderer, _ = walk_through(catalogue, "room", 0)
    space = find_free_space(renderer, arrangement.room.size)
    with pytest.raises(BadInput):
        plan_walk([], space, renderer, 0.5, np.random.default_rng(0))


def test_rooms_in_which_nobody_can_work_are_refused(catalogue: Catalogue) -> None:
    """A bed before the fridge: nobody gets there. And a room that is refused is followed by another."""
    good = arrange(load_recipe("room"), catalogue, "medium", 0, blocked_floor)
    assert blocked_floor(good) is None
    fridge = next(thing for thing in good.objects if thing.class_name == "fridge")
    shelf = next(thing for thing in good.objects if thing.class_name == "shelf")
    front = fridge.world_from_model.copy()
    front[:3, 3] -= 1.5 * front[:3, 1]
    bed = catalogue.furnishing(catalogue.by_class["bed"][0], {})
    blocked = tuple(replace(t, furnishing=bed, world_from_model=front) if t is shelf else t for t in good.objects)
    reason = blocked_floor(replace(good, objects=blocked))
    assert reason is not None and "fridge" in reason
    asked: list[int] = []

    def refuse_the_first(arrangement: Arrangement) -> str | None:
        asked.append(len(arrangement.objects))
        return "no" if len(asked) == 1 else None

    arrange(load_recipe("room"), catalogue, "medium", 0, refuse_the_first)
    assert len(asked) == 2
