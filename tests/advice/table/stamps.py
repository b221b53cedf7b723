"""`ingest` of logs whose stamps are no clock's, or whose depth unit only the layout states."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scenewright.schemas.sequence import Sequence
from scenewright.stages.kit.formats.frames import FrameReader

from tests.advice.rows import Tried
from tests.unit.ingest.folder_writers import write_image_folder, write_numbered_tum
from tests.unit.ingest.tiny_room import CAMERA, frames

CLOCKS, UNITS = "stages/ingest/clocks.py", "stages/ingest/folders/depth_units.py"
DEPTH, TUM = "stages/ingest/preflight/depth.py", "stages/ingest/layouts/tum/reader.py"
INGEST = "ingest --log log --out out"
FRAMES = 4


def without_clock(folder: Path) -> None:
    write_numbered_tum(folder / "log", [7.0] * FRAMES, pairs=True)


def in_millimetres(folder: Path) -> None:
    write_numbered_tum(folder / "log", [index / 30 for index in range(FRAMES)], pairs=True, units=500.0)


def five_times_millimetres(folder: Path) -> None:
    recorded = [(color, depth * np.float32(5), pose) for color, depth, pose in frames(FRAMES)]
    write_image_folder(folder / "log", [(c, np.rint(d * 200) / 200, p) for c, d, p in recorded], poses=False)


def without_calibration(folder: Path) -> None:
    write_numbered_tum(folder / "log", [index / 30 for index in range(FRAMES)], pairs=True)
    (folder / "log/calibration.txt").unlink()


def ten_a_second(folder: Path) -> None:
    with FrameReader(folder / "out/frames.mcap") as reader:
        np.testing.assert_allclose(np.diff(reader.times), [0.1] * (FRAMES - 1), atol=1e-6)


def of_a_height(folder: Path) -> None:
    camera = Sequence(folder / "out").info.cameras[0].camera
    assert abs(camera.fx / camera.height - 615 / 480) < 0.01 and camera.cx == CAMERA.width / 2


ROWS = [
    Tried(CLOCKS, "--frame-rate", INGEST, f"{INGEST} --frame-rate 10", 0, given=without_clock, right=ten_a_second),
    *(
        Tried(UNITS, "--depth-scale", INGEST, f"{INGEST} --depth-scale {units}", 0, given=in_millimetres)
        for units in (1000, 5000)
    ),
    Tried(
        DEPTH,
        "where that is so",
        "inspect log",
        "inspect log --depth-scale 5000",
        0,
        shows="unit plausible",
        given=five_times_millimetres,
    ),
    Tried(
        TUM,
        "of a RealSense D435",
        INGEST,
        f"{INGEST} --fx {{fx}} --fy {{fx}} --cx {{cx}} --cy {{cy}}".format(
            fx=f"{615 / 480 * CAMERA.height:.4g}", cx=CAMERA.width / 2, cy=CAMERA.height / 2
        ),
        3,
        given=without_calibration,
        right=of_a_height,
    ),
]
