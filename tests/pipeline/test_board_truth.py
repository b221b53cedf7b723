"""`python -m benchmarks.board.real --truth FOLDER`, end to end: a generated room in the form of docs/DATA.md."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scenewright.schemas.contact_graph import SCENE_NODE
from scenewright.schemas.errors import BadInput
from scenewright.schemas.ground_truth import GroundTruth

from benchmarks.board.method import Method
from benchmarks.board.real.figures import line
from benchmarks.board.real.told import measure_truth
from benchmarks.generated_rooms import make_room
from benchmarks.steps import opened

pytestmark = pytest.mark.slow
FRAMES, SIZE = 24, (320, 240)
PERFECT = ("--backend", "ground-truth")


def bring(truth: GroundTruth, folder: Path, moved: float = 0.0) -> Path:
    """Write a generated room as somebody would who had measured it; `moved` along x [m]."""
    folder.mkdir()
    shutil.copy(truth.path("log.mcap"), folder / "log.mcap")
    with np.load(truth.path("visible.npz"), allow_pickle=False) as seen:
        np.savez(folder / "truth.npz", points=seen["points"] + [moved, 0, 0], instance=seen["instance"])
    number = {node.id: node.instance for node in truth.graph.nodes}
    instances: list[dict[str, Any]] = []
    for entry in truth.info.objects:
        row: dict[str, Any] = {"id": entry.instance, "class": entry.class_name}
        link = truth.graph.parent_link(entry.name)
        if link is not None and link.source != SCENE_NODE:
            row["support"] = number[link.source]
        instances.append(row)
    instances[-1]["class"] = "astrolabe"
    (folder / "truth.json").write_text(json.dumps({"instances": instances, "complete": True}))
    return folder


@pytest.fixture(scope="module")
def room(tmp_path_factory: pytest.TempPathFactory) -> GroundTruth:
    """A small kitchen."""
    made = make_room(tmp_path_factory.mktemp("rooms"), "kitchen-40", FRAMES, size=SIZE, clutter="medium")
    return opened(GroundTruth, made.ground_truth)


def test_a_room_in_the_documented_form_is_judged(room: GroundTruth, tmp_path: Path) -> None:
    record = measure_truth(Method(), bring(room, tmp_path / "kitchen"), tmp_path / "out", PERFECT)
    large = record.things.large
    print(line(record), record)
    assert not record.failed and record.frames == FRAMES and record.unknown_words == ("astrolabe",)
    assert large.true >= 4 and large.found >= 0.7 * large.true and large.named >= large.found - 1
    assert large.stand >= 0.7 * large.found and np.median(large.off_mm) < 60
    assert record.supports.f1 is not None and record.supports.f1 > 0.6
    assert sum(record.seconds.values()) > 1 and "kitchen: of the room's large things" in line(record)


def test_a_truth_in_another_world_is_refused(room: GroundTruth, tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="shows nothing within 5 cm of the truth"):
        measure_truth(Method(), bring(room, tmp_path / "far", moved=50.0), tmp_path / "out", ("--backend", "geometric"))
