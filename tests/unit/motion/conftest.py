"""A robot in the handmade kitchen, used for geometry only."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from scenewright.stages.kit.motion.collision import CollisionChecker
from scenewright.stages.kit.simulation.robot import Robot
from scenewright.stages.kit.simulation.robot_description import load_robot
from scenewright.stages.kit.simulation.world import load_scene

from tests.unit.simulation.handmade_scene import kitchen, write_scene


@pytest.fixture(scope="module")
def checker(tmp_path_factory: pytest.TempPathFactory) -> Iterator[CollisionChecker]:
    root = tmp_path_factory.mktemp("kitchen")
    write_scene(root, kitchen())
    with load_scene(root) as world:
        yield CollisionChecker(world, Robot(world, load_robot("panda")))
