"""Run `graph` on maps made by hand."""

from __future__ import annotations

from pathlib import Path

import pytest
from scenewright.schemas.contact_graph import ContactGraphFile
from scenewright.stages.graph.parameters import GraphParameters
from scenewright.stages.graph.stage import run
from scenewright.stages.kit.progress import SilentProgress
from scenewright.stages.kit.stage import Context

from tests.panoptic_maps import write_map


@pytest.fixture
def build_graph(tmp_path: Path):
    """Return a function (meshes, classes, **parameters) -> graph file."""

    def build(meshes, classes, **options) -> ContactGraphFile:
        panoptic_map = write_map(tmp_path / "map", meshes, classes)
        output = tmp_path / "graph"
        output.mkdir(exist_ok=True)
        context = Context(output=output, seed=0, device="cpu", progress=SilentProgress())
        artifact = run(panoptic_map, parameters=GraphParameters(**options), context=context)
        build.summary, build.outcome = artifact.summary, artifact.outcome
        return artifact.info

    return build
