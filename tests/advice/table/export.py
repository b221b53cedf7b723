"""`export`."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np

from tests.advice.inputs import masks
from tests.advice.rows import NotTried, Tried
from tests.unit.poses.textured_room import CAMERA
from tests.unit.viewing.artifacts import seal

OPTIONS, STAGE, MASKS = "stages/export/parameters.py", "stages/export/stage.py", "stages/export/masks.py"
ASKED = "export --sequence {golden}/sequence --out out --dry-run"
TWO = "export --sequence {walks}/two --out out"
COCO = "export --sequence {room}/sequence --layout coco --out out --segments"


def told(folder: Path) -> dict:
    return dict(json.loads((folder / "out/export.json").read_text()))


def left_alone(folder: Path) -> None:
    assert [told(folder)[name] for name in ("cameras", "frame_count")] == [["left"], 3]


def four_pictures(folder: Path) -> None:
    assert len(json.loads((folder / "out/panoptic.json").read_text())["annotations"]) == 4


def masks_of_a_table(folder: Path) -> None:
    """A mask a picture, of a table, in four frames of walks/two."""
    (folder / "masks").mkdir()
    for frame in range(4):
        mask = np.zeros((1, CAMERA.height, CAMERA.width), bool)
        mask[:, 20:40, 20:40] = True
        np.savez(folder / f"masks/{frame:06d}.npz", masks=mask, classes=["table"], scores=[1.0])


def segments_without_ids(folder: Path) -> None:
    """Segments of the room whose list lacks the first id of frame 0."""
    shutil.copytree(Path(masks(), "segments"), folder / "cut")
    path = folder / "cut/segments.json"
    document = json.loads(path.read_text())
    del document["frames"][0]["segments"][0]
    path.write_text(json.dumps(document))
    seal(folder / "cut", "segments")


ROWS = [
    Tried(OPTIONS, "--streams: no stream", f"{ASKED} --streams colour", f"{ASKED} --streams color"),
    Tried(OPTIONS, "--dialect", f"{ASKED} --dialect ros2", f"{ASKED} --dialect ros2 --layout mcap"),
    Tried(STAGE, "--camera {} is not in it", f"{TWO} --camera right", f"{TWO} --camera left", right=left_alone),
    Tried(STAGE, "--camera NAME", f"{TWO} --layout tum", f"{TWO} --layout tum --camera left", code=0, right=left_alone),
    Tried(
        STAGE,
        "holds no masks",
        "export --sequence {room}/sequence --layout tum --out out --segments {masks}/segments",
        f"{COCO} {{masks}}/segments",
        right=four_pictures,
    ),
    Tried(
        MASKS,
        "has no masks of its own",
        f"{TWO} --layout coco",
        "segment --sequence {walks}/two --backend masks --masks masks --out found && "
        f"{TWO} --layout coco --segments found",
        code=3,
        given=masks_of_a_table,
        right=four_pictures,
    ),
    Tried(
        MASKS,
        "is not in segments.json",
        f"{COCO} cut",
        f"segment --sequence {{room}}/sequence --backend ground-truth --out again && {COCO} again",
        code=3,
        given=segments_without_ids,
        right=four_pictures,
    ),
    NotTried("stages/export/formats/coco/writer.py", "written by", "says what wrote a file, advises nothing"),
]
