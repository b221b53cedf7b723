"""The drive of a robot: clear of everything, of the shape asked for, looking where it goes, at one height or two."""

from __future__ import annotations

import numpy as np
import pytest
from scenewright.schemas.errors import UsageError
from scenewright.stages.kit.rendering.ray_casting import SceneRenderer
from scenewright.stages.synthesize.arrangement import arrange, world_meshes
from scenewright.stages.synthesize.drive import HEIGHTS, Shape, plan_drive
from scenewright.stages.synthesize.free_space import FreeSpace, find_free_space
from scenewright.stages.synthesize.furniture import Catalogue
from scenewright.stages.synthesize.parameters import SynthesizeParameters, check
from scenewright.stages.synthesize.recipes import load_recipe
from scenewright.stages.synthesize.viewpoints import blocked_floor
from scenewright.stages.synthesize.walk import CLEARANCE, RATE, Walk

Place = tuple[FreeSpace, SceneRenderer]
SPEED = 0.5


@pytest.fixture(scope="module", params=[("room", 0), ("office", 1)])
def place(request: pytest.FixtureRequest, catalogue: Catalogue) -> Place:
    arrangement = arrange(load_recipe(request.param[0]), catalogue, "medium", request.param[1], blocked_floor)
    renderer = SceneRenderer(world_meshes(arrangement))
    return find_free_space(renderer, arrangement.room.size), renderer


def driven(place: Place, shape: Shape, rounds: int = 1) -> Walk:
    return plan_drive(shape, rounds, *place, SPEED, np.random.default_rng(5))


@pytest.mark.parametrize("shape", ["line", "loop", "eight"])
def test_drive_keeps_clear_at_its_speed_and_height(place: Place, shape: Shape) -> None:
    walk = driven(place, shape)
    speeds = np.linalg.norm(np.diff(walk.eye, axis=0), axis=1) * RATE
    assert place[1].distance(walk.eye).min() >= CLEARANCE
    assert np.median(speeds) == pytest.approx(SPEED, rel=0.02) and speeds.max() < 1.05 * SPEED
    assert walk.eye[:, 2] == pytest.approx(HEIGHTS[0])


def test_line_ends_far_from_its_start_and_closed_shapes_do_not(place: Place) -> None:
    cells = place[0].cells()
    across = np.linalg.norm(cells.max(axis=0) - cells.min(axis=0))
    shapes: tuple[Shape, ...] = ("line", "loop")
    gaps = {shape: np.linalg.norm(np.subtract(*driven(place, shape).eye[[0, -1], :2])) for shape in shapes}
    assert gaps["line"] > 0.5 * across
    assert gaps["loop"] < 0.5  # rounding corners rounds the ends off too
    assert driven(place, "eight").duration > driven(place, "line").duration


def test_camera_looks_where_it_goes(place: Place) -> None:
    walk = driven(place, "loop")
    step = np.diff(walk.eye[:, :2], axis=0)
    ahead = np.einsum("ij,ij->i", step, np.column_stack([np.cos(walk.yaw), np.sin(walk.yaw)])[1:])
    cosine = ahead / np.linalg.norm(step, axis=1)
    assert np.median(cosine) > 0.95


@pytest.mark.parametrize("shape", ["line", "loop"])
def test_second_round_is_lower_and_over_the_same_floor(place: Place, shape: Shape) -> None:
    once, twice = driven(place, shape), driven(place, shape, rounds=2)
    assert twice.duration == pytest.approx(2 * once.duration, abs=1.5)
    assert twice.eye[0, 2] == pytest.approx(HEIGHTS[0]) and twice.eye[-1, 2] == pytest.approx(HEIGHTS[1])
    second = once.eye[::-1] if shape == "line" else once.eye
    assert twice.eye[-30, :2] == pytest.approx(second[-30, :2], abs=0.1)


def test_tour_has_no_rounds() -> None:
    with pytest.raises(UsageError, match="a tour has no rounds"):
        check(SynthesizeParameters(rounds=2), {})
