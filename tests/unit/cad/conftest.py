"""Run `graph` and `cad` on maps made by hand with the little library."""

from __future__ import annotations

from pathlib import Path

import pytest
from scenewright.schemas.cad_library import CadLibrary
from scenewright.schemas.cad_scene import CadScene
from scenewright.schemas.contact_graph import ContactGraph
from scenewright.stages.cad.parameters import CadParameters
from scenewright.stages.cad.stage import run as run_cad
from scenewright.stages.graph.parameters import GraphParameters
from scenewright.stages.graph.stage import run as run_graph
from scenewright.stages.kit.progress import SilentProgress
from scenewright.stages.kit.stage import Context

from tests.panoptic_maps import write_map
from tests.unit.cad.models import block, chair, fridge, table, write_library


def context(output: Path) -> Context:
    output.mkdir(parents=True, exist_ok=True)
    return Context(output=output, seed=0, device="cpu", progress=SilentProgress())


@pytest.fixture(scope="session")
def library(tmp_path_factory: pytest.TempPathFactory) -> CadLibrary:
    return write_library(
        tmp_path_factory.mktemp("library"),
        {
            "chair_low": chair(0.44, 0.45, 0.90),
            "chair_stool": chair(0.40, 0.65, 0.85),
            "table_long": table(1.4, 0.7, 0.74),
            "table_square": table(0.8, 0.8, 0.74),
            "fridge_tall": fridge(0.6, 0.65, 1.6, (0.4, 0.8, 1.2)),
            "fridge_small": fridge(0.55, 0.55, 0.9, (0.45,)),
            "box_flat": block("box", 0.3, 0.2, 0.1),
            "box_cube": block("box", 0.2, 0.2, 0.2),
        },
    )


@pytest.fixture
def replace_objects(tmp_path: Path, library: CadLibrary):
    """Return a function (meshes, classes, name="", graph_options={}, **parameters) -> CadScene."""

    def replaced(meshes, classes, name="scene", graph_options=None, **options) -> CadScene:
        panoptic_map = write_map(tmp_path / name / "map", meshes, classes)
        graph: ContactGraph = run_graph(
            panoptic_map,
            parameters=GraphParameters(**(graph_options or {})),
            context=context(tmp_path / name / "graph"),
        )
        return run_cad(
            graph, panoptic_map, library, parameters=CadParameters(**options), context=context(tmp_path / name / "cad")
        )

    return replaced
