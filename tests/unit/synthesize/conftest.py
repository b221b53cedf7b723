"""A small CAD library for all tests of this folder."""

from __future__ import annotations

from pathlib import Path

import pytest

from schemas.cad_library import CadLibrary
from stages.kit.progress import SilentProgress
from stages.kit.stage import Context
from stages.library.parameters import LibraryParameters
from stages.library.stage import run
from stages.synthesize.furniture import Catalogue
from stages.synthesize.recipes import load_recipe, recipe_names


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
