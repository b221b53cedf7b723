"""One small CAD library for all tests of the scene bundle: building it takes seconds."""

from __future__ import annotations

import pytest
from scenewright.schemas.cad_library import CadLibrary

from tests.unit.urdf.small_room import small_library


@pytest.fixture(scope="session")
def library(tmp_path_factory: pytest.TempPathFactory) -> CadLibrary:
    """Two shapes of each class. Only read it."""
    return small_library(tmp_path_factory.mktemp("library"), "table", "cabinet", "fridge", "cup", "bottle", "monitor")
