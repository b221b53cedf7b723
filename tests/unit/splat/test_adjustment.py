"""Poses that drift are brought back by what the pictures' depth and colour say of each other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scenewright.stages.kit.geometry.transforms import apply, inverse
from scenewright.stages.kit.registration.rigid_motion import angle_of, between, distance_of, exponential
from scenewright.stages.kit.rendering.splatting.compiled import CompiledRasterizer
from scenewright.stages.splat.adjustment import Adjustment
from scenewright.stages.splat.building import arrivals, placed_poses, train
from scenewright.stages.splat.methods import ours, thesis
from scenewright.stages.splat.trainer import Trainer
from scenewright.stages.splat.views import PosedView

from tests.unit.poses.textured_room import CAMERA, render, round_walk

TRUE = round_walk(25)


@pytest.fixture(scope="module")
def drifting() -> list[PosedView]:
    """A walk once round the room, whose every step is wrong by up to 2 cm and half a degree, the same way."""
    error = exponential(np.array([0.0, 0.0, 0.006, 0.012, 0.0, 0.006]))
    poses = [TRUE[0]]
    for before, after in zip(TRUE, TRUE[1:], strict=False):
        poses.append(poses[-1] @ between(before, after) @ error)
    views = []
    for k, (pose, true) in enumerate(zip(poses, TRUE, strict=True)):
        color, depth = render(true, CAMERA)
        views.append(PosedView(k, 0.1 * k, "camera", CAMERA, color.astype(np.float32) / 255, depth, inverse(pose)))
    return views


def errors(poses: np.ndarray, true: np.ndarray = TRUE) -> tuple[float, float]:
    """Greatest error of position [m] and of rotation [rad]."""
    apart = [between(a, b) for a, b in zip(true, poses, strict=True)]
    return max(map(distance_of, apart)), max(map(angle_of, apart))


def world(views: list[PosedView]) -> np.ndarray:
    return np.array([inverse(view.camera_from_world) for view in views])


def test_a_walk_that_drifts_is_brought_back(drifting: list[PosedView]) -> None:
    given = world(drifting)
    assert errors(given)[0] > 0.1 and errors(given)[1] > 0.04
    adjustment, poses = Adjustment(), given[:0]
    for count in (8, 16, 25):
        carried = poses[-1] @ inverse(given[len(poses) - 1]) if len(poses) else np.eye(4)
        poses = adjustment.adjusted(drifting[:count], np.concatenate([poses, carried @ given[len(poses) : count]]))
    np.testing.assert_allclose(poses[0], given[0], atol=1e-9)
    assert errors(poses)[0] < 0.02 and errors(poses)[1] < np.radians(0.6)


def test_without_depth_the_poses_stay_as_they_are_given(drifting: list[PosedView]) -> None:
    views = [replace(view, depth=None) for view in drifting[:5]]
    np.testing.assert_allclose(Adjustment().adjusted(views, world(views)), world(views), atol=1e-9)


def test_gaussians_go_with_the_view_that_set_them(drifting: list[PosedView]) -> None:
    seen = {}
    for method in (ours.METHOD, thesis.METHOD):
        trainer = Trainer(method, CompiledRasterizer(), np.random.default_rng(0), adjust_every=100)
        for view in drifting[:6]:
            trainer.add_view(view)
        third = trainer.views[3]
        before = trainer.gaussians.means.copy(), third.camera_from_world.copy()
        trainer.add_view(drifting[6], last=True)
        count = len(before[0])
        rows = trainer.state().origins[:count] == 3
        was = apply(before[1], before[0][rows])
        seen[method.carried] = np.abs(was - apply(third.camera_from_world, trainer.gaussians.means[:count][rows])).max()
        assert rows.any() and not np.allclose(before[1], third.camera_from_world, atol=1e-3)
    assert seen[True] < 1e-4 < 1e-3 < seen[False]


def test_a_picture_that_was_not_learned_is_placed_among_those_that_were(drifting: list[PosedView]) -> None:
    trainer = Trainer(ours.METHOD, CompiledRasterizer(), np.random.default_rng(0), adjust_every=12)
    kept = drifting[6::8]
    learned = [view for k, view in enumerate(drifting) if k % 8 != 6]
    for _ in train(trainer, arrivals(learned, 0.0), 1):
        pass
    frames = dict(placed_poses(trainer, kept))
    assert errors(np.array([frames[view.frame] for view in kept]), TRUE[6::8])[0] < 0.02
    assert errors(world(kept), TRUE[6::8])[0] > 0.1
