"""A small CAD library for all tests of this folder."""

from __future__ import annotations

from pathlib import Path

import pytest
from scenewright.schemas.cad_library import CadLibrary
from scenewright.stages.kit.progress import SilentProgress
from scenewright.stages.kit.stage import Context
from scenewright.stages.library.parameters import LibraryParameters
from scenewright.stages.library.stage import run
from scenewright.stages.synthesize.furniture import Catalogue
from scenewright.stages.synthesize.recipes import load_recipe, recipe_names


@pytest.fixture(scope="session")
def library(tmp_path_factory: pytest.TempPathFactory) -> CadLibrary:
    output: Path = tmp_path_factory.mktemp("library")
    # The classes that recipes name; others would only take time.
    classes = tuple(sorted({place.class_name for name in recipe_names() for place in load_recipe(name).place}))
    parameters = LibraryParameters(shapes_per_class=3, small_shapes_per_class=3, classes=classes)
    return run(parameters=parameters, context=Context(output=output, seed=5, device="cpu", progress=SilentProgress()))


@pytest.fixture(scope="session")
def catalogue(library: CadLibrary) -> Catalogue:
    return Catalogue(library)
