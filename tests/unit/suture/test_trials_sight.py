"""Trials that see by rendered views: the scene that is made of a trial, what is seen of it, the command's option."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scenewright.cli.main import run
from scenewright.stages.kit.geometry.transforms import apply, inverse
from scenewright.stages.suture.motion.needle import point_at
from scenewright.stages.suture.robot.arms import REMOTE_CENTRES
from scenewright.stages.suture.training.network.trial_views import PLACES, Keeping, trial_scenes
from scenewright.stages.suture.trials.bench import CORNER, Bench, loaded
from scenewright.stages.suture.trials.machine import run_trial
from scenewright.stages.suture.trials.perception import FOLDER, perception_model
from scenewright.stages.suture.trials.policies import POLICIES
from scenewright.stages.suture.trials.settings import World
from scenewright.stages.suture.trials.sight import PICTURED_FROM_TRIAL, LookingEyes, driver, pictured
from scenewright.stages.suture.trials.thread import Thread
from scenewright.stages.suture.world.scene import make_scene

MODEL = perception_model(FOLDER / "perception_ours.toml")


def watched(seed: int) -> tuple[Bench, LookingEyes]:
    eyes = LookingEyes(MODEL, seed, pictures=False)
    needle, hold = loaded(World(), np.random.default_rng(seed))
    bench = Bench(World(), eyes, np.random.default_rng(1), np.zeros(3), Thread(0.2), needle, hold)
    bench.tools["right"] = CORNER.copy()
    bench.lay_thread()
    eyes.watch(bench)
    return bench, eyes


def test_cameras_see_the_corner_on_their_right_and_far() -> None:
    bench, _ = watched(0)
    world = make_scene(0)
    scene = pictured(world, bench, bench.needle, 0)
    middle = world.rig.left(apply(world.camera_from_world, np.zeros((1, 3))))[0]
    corner = world.rig.left(scene.pose.centre[None])[0]
    assert corner[0] > middle[0] + 50 and corner[1] < middle[1]
    swage = apply(inverse(PICTURED_FROM_TRIAL), scene.thread[0])
    assert np.allclose(swage, point_at(bench.needle, np.pi), atol=1e-6)
    tubes = scene.tubes()
    assert set(np.unique(tubes.bodies)) == {1, 2, 3, 4}


def test_a_shaft_goes_through_its_remote_centre() -> None:
    centre = REMOTE_CENTRES["right"]
    tubes = driver(CORNER, centre, 0.05, 4)
    along = tubes.ends[-1] - tubes.starts[-1]
    off = np.cross(centre - tubes.starts[-1], along / np.linalg.norm(along))
    assert np.linalg.norm(off) < 1e-9
    assert np.linalg.norm(tubes.ends - CORNER[:3, 3], axis=1).min() < 0.003


def test_what_is_seen_of_a_rendered_trial_is_where_the_needle_is() -> None:
    found = 0
    for seed in range(3):
        bench, eyes = watched(seed)
        seen = bench.look("corner_right")
        assert eyes.looks == 1 and sum(eyes.places["corner_right"].values()) == 1
        if seen is None:
            continue
        ends = sorted((seen.tip, seen.swage), key=lambda end: float(np.linalg.norm(end - CORNER[:3, 3])))
        found += bool(np.linalg.norm(ends[1] - point_at(bench.needle, 0.0)) < 0.003)
    assert found >= 2


def test_keeping_what_is_looked_at_changes_no_trial() -> None:
    eyes = Keeping(5)
    assert run_trial(POLICIES["ours"], 5, eyes=eyes) == run_trial(POLICIES["ours"], 5)
    assert len(eyes.scenes) <= eyes.looks
    assert len({scene.pose.camera_from_needle.tobytes() + scene.thread.tobytes() for scene in eyes.scenes}) > 1


def test_a_trial_gives_one_scene_of_each_place_and_always_the_same() -> None:
    scenes, again = trial_scenes(5), trial_scenes(5)
    places = [scene.place for scene in scenes]
    assert len(set(places)) == len(places) and set(places) <= set(PLACES) and "corner_right" in places
    assert all(np.array_equal(one.thread, other.thread) for one, other in zip(scenes, again, strict=True))


def test_an_error_model_is_not_for_rendered_views(tmp_path: Path) -> None:
    model = str(FOLDER / "perception_ours.toml")
    told = ["suture", "simulate", "--sight", "geometry", "--perception", model, "--out", str(tmp_path / "out")]
    assert run(told) == 2
