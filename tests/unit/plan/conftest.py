"""What several tests of `plan` share: the handmade kitchen and the planner's picture of it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from scenewright.schemas.contact_graph import ContactGraphFile
from scenewright.stages.kit.simulation.robot_description import load_robot
from scenewright.stages.plan.world_model import WorldModel

from tests.unit.simulation.handmade_scene import kitchen, write_scene


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("kitchen")
    write_scene(root, kitchen())
    return root


@pytest.fixture(scope="module")
def kitchen_model(scene: Path) -> Iterator[WorldModel]:
    model = WorldModel(scene, ContactGraphFile.read(scene / "graph.json"), load_robot("panda"), 0.004)
    yield model
    model.close()


@pytest.fixture
def model(kitchen_model: WorldModel) -> Iterator[WorldModel]:
    snapshot = kitchen_model.snapshot()  # nothing is aboard
    yield kitchen_model
    kitchen_model.restore(snapshot)
