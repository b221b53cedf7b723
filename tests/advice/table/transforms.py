"""`ingest` of bags and MCAP: poses, cameras and damage."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from tests.advice.rows import NotTried, Tried
from tests.advice.table.logs import GIVEN, all_are_posed, camera_is_right
from tests.unit.ingest.message_logs import FIRST, SECOND, record_room, recorder
from tests.unit.ingest.test_message_poses import _images as pictures
from tests.unit.ingest.test_message_poses import _moved as moved
from tests.unit.ingest.tiny_room import CAMERA, frames, jpeg, millimetres

LOG = "ingest --log log/log.mcap --out out --gravity none"
TORN = "torn logs of many chunks are read in both ways in tests/unit/ingest"
CAMERAS = "stages/ingest/messages/cameras.py"
POSES, SOURCE = "stages/ingest/messages/pose_source.py", "stages/ingest/messages/message_source.py"


def written(write: Callable[[Any], None]) -> Callable[[Path], None]:
    """Return what writes a log with a recorder, to log/log.mcap."""

    def given(folder: Path) -> None:
        with recorder(folder / "log") as log:
            write(log)
        log.path.rename(folder / "log/log.mcap")

    return given


def with_a_gap(log: Any) -> None:
    for tick in [*range(0, 2), *range(6, 9)]:
        log.transform("/tf", FIRST + tick * SECOND // 10, "odom", "optical", moved(tick / 10))
    pictures(log, 4)


def fixed(log: Any) -> None:
    log.transform("/tf_static", FIRST, "camera_link", "optical", moved(1))
    pictures(log)


def two_parents(log: Any) -> None:
    pictures(log)
    for tick in range(4):
        stamp = FIRST + tick * SECOND // 5
        for world, parent in (("map", "odom"), ("map", "truth")):
            log.transform("/tf", stamp, world, parent, np.eye(4))
            log.transform("/tf", stamp, parent, "optical", moved(tick))


def of_no_world(log: Any) -> None:
    record_room(log, frames(2))
    log.transform("/tf", FIRST, "lab", "other", np.eye(4))


def two_cameras(worlds: tuple[str, str]) -> Callable[[Any], None]:
    def write(log: Any) -> None:
        for name, world in zip(("front", "wrist"), worlds, strict=True):
            for index, (color, depth, pose) in enumerate(frames(2)):
                stamp = FIRST + index * SECOND // 10
                log.transform("/tf", stamp, world, f"{name}_optical", pose)
                log.info(f"/{name}/color/camera_info", stamp, f"{name}_optical")
                log.compressed(f"/{name}/color/image_raw/compressed", stamp, jpeg(color), "jpeg", f"{name}_optical")
                depth_topic = f"/{name}/aligned_depth_to_color/image_raw"
                log.image(depth_topic, stamp, millimetres(depth), "16UC1", f"{name}_optical")

    return write


def uncalibrated(log: Any) -> None:
    for index, (color, _, pose) in enumerate(frames(2)):
        stamp = FIRST + index * SECOND // 10
        log.transform("/tf", stamp, "map", "optical", pose)
        log.info("/camera/color/camera_info", stamp, "optical", CAMERA, K=[0.0] * 9)
        log.compressed("/camera/color/image_raw/compressed", stamp, jpeg(color), "jpeg", "optical")


ROWS = [
    Tried(
        "stages/ingest/messages/camera_frames.py",
        "interpolates",
        f"{LOG} --maximum-transform-gap 0.2",
        f"{LOG} --maximum-transform-gap 0.5",
        code=0,
        given=written(with_a_gap),
        right=all_are_posed,
    ),
    Tried(
        POSES, "takes it so", LOG, f"{LOG} --world-frame camera_link", code=0, given=written(fixed), right=all_are_posed
    ),
    Tried(
        POSES,
        "nothing leads from",
        f"{LOG} --world-frame lab",
        LOG,
        code=3,
        given=written(of_no_world),
        right=all_are_posed,
    ),
    Tried(
        POSES,
        "has two parents",
        LOG,
        f"{LOG} --world-frame odom",
        code=3,
        given=written(two_parents),
        right=all_are_posed,
    ),
    *(
        Tried(
            SOURCE,
            "poses in different worlds",
            f"{LOG} --camera all",
            f"{LOG} {way}",
            code=3,
            given=written(two_cameras(("map", "odom"))),
            right=all_are_posed,
        )
        for way in ("--camera front", "--camera wrist")
    ),
    Tried(
        "stages/ingest/stage.py",
        "other cameras of the log",
        LOG,
        f"{LOG} --camera all",
        code=0,
        given=written(two_cameras(("map", "map"))),
        right=lambda folder: camera_is_right(folder, 4),
    ),
    Tried(
        CAMERAS,
        "not both",
        f"{LOG} --camera front --color-topic /wrist/color/image_raw/compressed",
        f"{LOG} --color-topic /wrist/color/image_raw/compressed",
        code=3,
        given=written(two_cameras(("map", "map"))),
        right=camera_is_right,
    ),
    Tried(
        "stages/ingest/lenses.py",
        "give --fx",
        LOG,
        f"{LOG} {GIVEN}",
        code=3,
        given=written(uncalibrated),
        right=camera_is_right,
    ),
    NotTried(SOURCE, "not used", "it names the topics that the options may choose, whichever of them is taken"),
    NotTried(SOURCE, "leave out --damage refuse", TORN),
    NotTried("stages/ingest/messages/damage_lines.py", "takes what is whole", TORN),
]
