"""The harness of models that `library add` takes: any bytes as one of its formats, beside files that it names."""

from __future__ import annotations

import base64
import functools
import json
from pathlib import Path

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.library.importing.discovery import find_models
from scenewright.stages.library.importing.grouping import grouped, source_points
from scenewright.stages.library.importing.source_folder import SourceFolder
from scenewright.stages.library.importing.source_model import SourceModel

from tests.fuzz.harness import Harness, chosen, refused, scratch
from tests.unit.library.test_addition import ASSETS, MJCF, URDF, dae, obj_box, write


def _gltf() -> str:
    """Return a triangle as glTF, its buffer within."""
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "<f4").tobytes()
    return json.dumps(
        {
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
            "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
            "bufferViews": [{"buffer": 0, "byteLength": 36}],
            "buffers": [{"byteLength": 36, "uri": "data:;base64," + base64.b64encode(corners).decode()}],
        }
    )


SAMPLES = {
    "old_cabinet.urdf": URDF,
    "hutch.xml": MJCF.format(angle="degree", turn=30, low=-10, high=70)
    .replace("../renamed/sub/", "")
    .replace("/></body>", ' group="1"/></body>'),
    "chair.dae": dae(0.01, "Y_UP", (45.0, 90.0, 50.0)),
    "box.obj": "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvt 0 0\nusemtl m\nf 1/1 2/1 3/1\nf 1 2 4\n",
    "shelf.sdf": '<sdf version="1.7"><model name="shelf"><link name="a"><visual name="v"><geometry><cylinder>'
    "<radius>1</radius><length>2</length></cylinder></geometry></visual></link></model></sdf>",
    "cup.gltf": _gltf(),
}
"""File name -> a model."""


@functools.cache
def _folder() -> Path:
    """Return a folder with the files that the samples name."""
    folder = scratch() / "models"
    write(folder / "assets.xml", ASSETS)
    obj_box(folder / "parts" / "carcass.obj", (60.0, 50.0, 80.0))
    return folder


def library_model(data: bytes) -> None:
    """The first byte chooses the file that the rest becomes; what is found is refused, or has points."""
    number, rest = chosen(data, len(SAMPLES))
    path = _folder() / list(SAMPLES)[number]
    path.write_bytes(rest)
    try:
        for model in find_models(SourceFolder(_folder())):
            if model.source != path.name:
                continue
            with refused(BadInput):
                if not isinstance(model, SourceModel):
                    raise BadInput(model.reason)
                groups, _ = grouped(model)
                assert source_points(groups).shape[1] == 3
    finally:
        path.unlink()


def _seeds() -> dict[str, bytes]:
    return {name: bytes([number]) + text.encode() for number, (name, text) in enumerate(SAMPLES.items())}


HARNESSES = {"library_model": Harness(library_model, _seeds, choosing=1)}
