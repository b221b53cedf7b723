"""Models of other people: `library add`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from tests.advice.rows import NotTried, Tried

ADDITION, FRAMES = "stages/library/addition.py", "stages/library/importing/frames.py"
OTHERS = "stages/library/importing/other_formats.py"
ADD = "library add in --out out --decomposition hulls"
TABLE, BOTTLE = (0.6, 0.4, 0.72), (0.08, 0.08, 0.3)
"""Width, depth and height [m]."""


def box(name: str, size: tuple[float, float, float], per_metre: float = 1.0, *, z_up: bool = False) -> Any:
    """Return what writes a box of a size [m], y up as OBJ and GLB have it, or z up."""

    def write(folder: Path) -> None:
        mesh = trimesh.creation.box(np.multiply(size, per_metre))
        mesh.apply_translation([0, 0, per_metre * size[2] / 2])
        if not z_up:
            mesh.apply_transform(trimesh.transformations.rotation_matrix(-np.pi / 2, [1, 0, 0]))
        (folder / "in").mkdir(exist_ok=True)
        mesh.export(folder / "in" / name)

    return write


def with_class_file(folder: Path) -> None:
    box("quark.obj", TABLE)(folder)
    (folder / "names.toml").write_text('[models]\n"quark" = "table"\n')


def with_far_collision(folder: Path) -> None:
    """A table whose collision shape is a thousand kilometres long."""
    shape = "<{0}><origin xyz='0 0 0.36'/><geometry><box size='{1}'/></geometry></{0}>"
    shapes = shape.format("visual", "0.6 0.4 0.72") + shape.format("collision", "1000000 0.4 0.72")
    (folder / "in").mkdir()
    (folder / "in" / "table.urdf").write_text(f"<robot name='table'><link name='table'>{shapes}</link></robot>")


def with_coacd(folder: Path) -> None:
    pytest.importorskip("coacd")
    box("table.obj", TABLE)(folder)


def is_a(name: str, size: tuple[float, float, float]) -> Any:
    """Return a check that the one model has a class and a size [m]."""

    def check(folder: Path) -> None:
        (model,) = json.loads((folder / "out/library.json").read_text())["models"]
        assert model["class_name"] == name
        (state,) = model["states"]
        np.testing.assert_allclose(np.subtract(state["box_maximum"], state["box_minimum"]), size, atol=1e-4)

    return check


the_table, the_bottle = is_a("table", TABLE), is_a("bottle", BOTTLE)
NO_CLASS = "nothing tells its class"

ROWS = [
    Tried(ADDITION, NO_CLASS, ADD, f"{ADD} --class-name table", code=3, given=box("quark.obj", TABLE), right=the_table),
    Tried(ADDITION, NO_CLASS, ADD, f"{ADD} --mapping names.toml", code=3, given=with_class_file, right=the_table),
    Tried(
        ADDITION,
        NO_CLASS,
        ADD,
        f"{ADD} --unknown object",
        code=3,
        given=box("quark.obj", TABLE),
        right=is_a("object", TABLE),
    ),
    Tried(
        ADDITION,
        "--unit says otherwise",
        f"{ADD} --unit mm",
        f"{ADD} --unit m",
        code=3,
        given=box("table.obj", TABLE),
        right=the_table,
    ),
    Tried(
        FRAMES,
        "is unusual for anything in a room",
        f"{ADD} --class-name object",
        f"{ADD} --class-name object --unit mm",
        code=0,
        given=box("quark.glb", TABLE, per_metre=1000),
        right=is_a("object", TABLE),
    ),
    Tried(
        FRAMES,
        "it would be usual (--unit",
        ADD,
        f"{ADD} --unit mm",
        code=0,
        given=box("table.glb", TABLE, per_metre=1000),
        right=the_table,
    ),
    Tried(
        FRAMES,
        "up it would be usual (--up",
        ADD,
        f"{ADD} --up +z",
        code=0,
        given=box("bottle.glb", BOTTLE, z_up=True),
        right=the_bottle,
    ),
    Tried(
        "stages/library/importing/placing.py",
        "--collision visual",
        ADD,
        f"{ADD} --collision visual",
        code=3,
        given=with_far_collision,
        right=the_table,
    ),
    Tried(
        "stages/library/importing/versions.py",
        "coacd is not installed",
        f"{ADD} --decomposition coacd",
        ADD,
        code=5,
        lacks=("coacd",),
        given=box("table.obj", TABLE),
        right=the_table,
    ),
    Tried(
        "stages/library/importing/versions.py",
        "coacd is not installed",
        f"{ADD} --decomposition coacd",
        f"{ADD} --decomposition coacd",
        code=5,
        lacks=("coacd",),
        given=with_coacd,
        right=the_table,
    ),
    NotTried(OTHERS, "open it in Blender", "Blender is no part of this project"),
    NotTried(OTHERS, "open it in FreeCAD", "FreeCAD is no part of this project"),
    NotTried(
        OTHERS, "export GLB from its program", "the programs of 3ds, Max, SketchUp, Cinema 4D and Maya are not here"
    ),
    NotTried(OTHERS, "open it in MeshLab", "MeshLab is no part of this project"),
    NotTried(
        "stages/kit/formats/gltf_extensions.py",
        "png {name} OUT.glb --formats avif",
        "glTF Transform is a program of Node.js, which is not here; the page of its commands says so",
    ),
]
