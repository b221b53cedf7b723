"""`truth`, `edit masks` and `cad`: what is made of maps."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from tests.advice.rows import Tried
from tests.unit.truth.scenenn_folder import SCENE, annotation, labelled_mesh, ply_bytes
from tests.unit.truth.test_supports import MADE

SCENENN = f"truth scenenn --annotation {SCENE}.xml --mesh {SCENE}.ply --sequence {{room}}/sequence --out out"
SUPPORTS = "truth supports --annotation annotation.json --sequence {room}/sequence --out out"
CAD = "cad --contact-graph {fridge}/graph --panoptic-map {fridge}/map --library {fridge}/library --out out"


def scene(folder: Path) -> None:
    """An annotation that lists two of the labels of its mesh."""
    (folder / f"{SCENE}.xml").write_text(annotation({8844: "desk", 5: "floor"}))
    (folder / f"{SCENE}.ply").write_bytes(ply_bytes(*labelled_mesh()))


def supports(folder: Path) -> None:
    """An annotation whose fridge is found by a point of its surface."""
    document = {"format": "scenewright-supports", "version": 1, "scene": "room", "made": MADE}
    nodes = [{"name": "fridge", "class": "fridge", "find": {"point": [0.5, 0.175, 0.8]}}]
    relations = [{"child": "fridge", "parent": "scene"}]
    (folder / "annotation.json").write_text(json.dumps(document | {"nodes": nodes, "relations": relations}))


def told(folder: Path, name: str) -> Any:
    return json.loads((folder / "out" / name).read_text())


def floor_and_table(folder: Path) -> None:
    assert {entry["class_name"] for entry in told(folder, "ground_truth.json")["objects"]} == {"floor", "table"}


def fridge_found(folder: Path) -> None:
    (entry,) = told(folder, "ground_truth.json")["objects"]
    assert entry["visible_pixels"] > 100 and abs(entry["box"]["size"][2] - 1.6) < 0.05, entry


def fridge_placed(folder: Path) -> None:
    assert [entry["decision"] for entry in told(folder, "scene.json")["replacements"]].count("cad") == 1


def masks_in_each(folder: Path) -> None:
    assert [entry["frame"] for entry in told(folder, "segments.json")["frames"]] == [0, 1, 2, 3]


ROWS = [
    Tried(
        "stages/truth/stage.py",
        "--maximum-unlisted",
        SCENENN,
        f"{SCENENN} --maximum-unlisted 1",
        code=3,
        given=scene,
        right=floor_and_table,
    ),
    Tried(
        "stages/truth/annotated_points.py",
        "--panoptic-map",
        SUPPORTS,
        f"{SUPPORTS} --panoptic-map {{fridge}}/map",
        code=3,
        given=supports,
        right=fridge_found,
    ),
    Tried(
        "stages/edit/masks_stage.py",
        "--trajectory",
        "edit masks --sequence {walks}/unposed --panoptic-map {fridge}/map --out out",
        "poses --sequence {walks}/unposed --out path && "
        "edit masks --sequence {walks}/unposed --panoptic-map {fridge}/map --trajectory path --out out",
        code=3,
        right=masks_in_each,
    ),
    Tried("stages/cad/stage.py", "--vouched", f"{CAD} --vouched gate", f"{CAD} --vouched fridge", right=fridge_placed),
]
