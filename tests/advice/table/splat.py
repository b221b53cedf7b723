"""The steps of `splat`."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from scenewright.cli.main import run
from scenewright.stages.kit.formats.frames import FrameWriter

from tests.advice.inputs import walks
from tests.advice.rows import NotTried, Tried
from tests.panoptic_maps import box_mesh, floor_mesh, write_map
from tests.unit.poses.textured_room import CAMERA, round_walk
from tests.unit.viewing.artifacts import seal

BUILD_STAGE, QUERY_STAGE = "stages/splat/build_stage.py", "stages/splat/query_stage.py"
BUILD = "splat build --steps 1 --steps-per-second 0.1 --width 64 --most-gaussians 100 --out out --sequence"
LABEL = "splat label --panoptic-map {fridge}/map --sequence {walks}/two --out words"
ASK = "splat query --out out --accept absent --accept unknown"


def flat_pictures(folder: Path) -> None:
    """A posed log without depth, whose pictures are grey."""
    grey = np.full((CAMERA.height, CAMERA.width, 3), 90, np.uint8)
    with FrameWriter(folder / "flat.mcap", CAMERA) as writer:
        for index, pose in enumerate(round_walk(60)[:4]):
            writer.write(0.1 * index, grey, None, pose)
    assert run(["ingest", "--log", "flat.mcap", "--out", "flat"]) == 0


def four_views(folder: Path) -> None:
    views = json.loads((folder / "out/splat.json").read_text())["views"]
    assert [view["frame"] for view in views] == [0, 1, 2, 3]


def words_of_another_map(folder: Path) -> None:
    (folder / "other").mkdir()
    box = box_mesh((0.2, 0.2, 0.0), (0.8, 0.8, 1.6))
    write_map(folder / "other", {11: floor_mesh((-2.0, -2.0), (2.0, 2.0)), 12: box}, {11: "floor", 12: "fridge"})
    seal(folder / "other", "panoptic_map")
    written = ["--panoptic-map", "other", "--sequence", f"{walks()}/two", "--out", "other_words"]
    assert run(["splat", "label", *written]) == 0


def words_without_names(folder: Path) -> None:
    (folder / "nameless").mkdir()
    box = box_mesh((0.2, 0.2, 0.0), (0.8, 0.8, 1.6))
    things = {11: floor_mesh((-2.0, -2.0), (2.0, 2.0)), 12: box}
    write_map(folder / "nameless", things, dict.fromkeys(things, "object"))
    seal(folder / "nameless", "panoptic_map")
    written = ["--panoptic-map=nameless", f"--sequence={walks()}/two", "--out=words"]
    assert run(["splat", "label", *written]) == 0


def both_shown(folder: Path) -> None:
    answers = json.loads((folder / "out/answers.json").read_text())["answers"]
    assert len(answers) == 2, answers


ROWS = [
    Tried(
        "stages/splat/views.py",
        "scenewright poses",
        f"{BUILD} {{walks}}/unposed",
        f"poses --sequence {{walks}}/unposed --out path && {BUILD} {{walks}}/unposed --trajectory path",
        code=3,
        right=four_views,
    ),
    Tried(
        BUILD_STAGE,
        "scenewright inspect LOG",
        f"{BUILD} flat",
        "inspect flat.mcap",
        code=3,
        then_code=3,
        given=flat_pictures,
    ),
    Tried(
        QUERY_STAGE,
        "scenewright splat label",
        f"{ASK} --language other_words --contact-graph {{fridge}}/graph --text 'fridge on the floor'",
        f"{LABEL} && {ASK} --language words --contact-graph {{fridge}}/graph --text 'fridge on the floor'",
        code=3,
        given=words_of_another_map,
    ),
    Tried(
        QUERY_STAGE,
        "--least-probability 0",
        f"{ASK} --language words --text fridge",
        f"{ASK} --language words --text fridge --least-probability 0",
        code=0,
        given=words_without_names,
        right=both_shown,
    ),
    Tried(
        "cli/asking/answering.py",
        "scenewright graph; ask that",
        "ask {fridge}/map 'where can I put the cup?'",
        "graph --panoptic-map {fridge}/map --out graph && ask graph 'where can I put the cup?'",
    ),
    NotTried(QUERY_STAGE, "another --encoder", "another encoder has to be downloaded"),
    NotTried(BUILD_STAGE, "--method ours", "no pictures are known from which a method keeps no Gaussian"),
    NotTried(
        "stages/splat/training/word_probabilities/train.py",
        "scenewright train",
        "how a file of data/ was made, as it says",
    ),
]
