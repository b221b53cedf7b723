"""Movable bodies are laid down where they come to rest close by."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scenewright.schemas.scene_parts import Box
from scenewright.stages.kit.formats.scene_bundle import BundleBody, write_scene_bundle
from scenewright.stages.kit.geometry.transforms import transform_from_yaw
from scenewright.stages.urdf.resting import rested_bodies
from scenewright.stages.urdf.settle_report import settle_report

from tests.unit.urdf.small_room import graph_of, layout


def block(name: str, at: tuple[float, float, float], parent: str, size: tuple[float, float, float]) -> BundleBody:
    """A movable box that stands at `at`."""
    center = (at[0], at[1], at[2] + 0.5 * size[2])
    pose = transform_from_yaw(0.0, np.array(at))
    return BundleBody(name, "box", parent, "supports", pose, True, Box(center=center, size=size))


def scene() -> list[BundleBody]:
    """On the floor at z = 0.01 m: a box 6 mm above it that carries another, one at rest, one 30 cm up that carries
    another."""
    return [
        layout("floor_1", "floor", (0, 0, 0.0), (4.0, 4.0, 0.02)),
        block("box_2", (0, 0, 0.016), "floor_1", (0.2, 0.2, 0.1)),
        block("box_3", (0, 0, 0.118), "box_2", (0.1, 0.1, 0.1)),
        block("box_4", (1, 0, 0.010), "floor_1", (0.2, 0.2, 0.1)),
        block("box_5", (-1, 0, 0.31), "floor_1", (0.2, 0.2, 0.1)),
        block("box_6", (-1, 0, 0.415), "box_5", (0.1, 0.1, 0.1)),
    ]


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[BundleBody]]:
    root = tmp_path_factory.mktemp("scene")
    bodies = scene()
    write_scene_bundle(root, bodies, graph_of(bodies))
    return root, rested_bodies(root, bodies)


def test_what_hovers_by_millimetres_is_laid_down_with_what_it_carries(made: tuple[Path, list[BundleBody]]) -> None:
    laid = {body.name: body for body in made[1]}
    assert laid["box_2"].world_from_body[2, 3] == pytest.approx(0.010, abs=5e-4)
    assert laid["box_3"].world_from_body[2, 3] == pytest.approx(0.110, abs=8e-4)
    assert laid["box_3"].box.center[2] == pytest.approx(0.160, abs=8e-4)
    np.testing.assert_allclose(laid["box_2"].reconstructed, transform_from_yaw(0.0, np.array([0, 0, 0.016])))


def test_what_rests_or_falls_keeps_its_pose(made: tuple[Path, list[BundleBody]]) -> None:
    before = {body.name: body for body in scene()}
    for body in made[1]:
        if body.name in ("floor_1", "box_4", "box_5", "box_6"):
            assert body.reconstructed is None
            np.testing.assert_array_equal(body.world_from_body, before[body.name].world_from_body)


def test_scene_json_says_which_bodies_were_laid_down_and_they_stay(
    made: tuple[Path, list[BundleBody]], tmp_path: Path
) -> None:
    bodies = [body for body in made[1] if body.name not in ("box_5", "box_6")]
    written = write_scene_bundle(tmp_path, bodies, graph_of(bodies))
    assert {body.name for body in written.bodies if body.world_from_reconstructed is not None} == {"box_2", "box_3"}
    assert settle_report(tmp_path, 1.0).settled
    assert max(body.moved for body in settle_report(tmp_path, 1.0).bodies) < 1e-3


def test_the_same_scene_rests_the_same_way(made: tuple[Path, list[BundleBody]]) -> None:
    again = rested_bodies(made[0], scene())
    for first, second in zip(made[1], again, strict=True):
        np.testing.assert_array_equal(first.world_from_body, second.world_from_body)
