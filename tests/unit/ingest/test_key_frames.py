"""Key frames against paths of which one knows what they add."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from scenewright.schemas.errors import UsageError
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.ingest import key_frames as module
from scenewright.stages.ingest.key_frames import ENOUGH, SeenSurface, cells_seen, key_frames, sharpness
from scenewright.stages.ingest.selection import NOT_SELECTED
from scenewright.stages.ingest.source import Entry, LoadedFrame, Unusable
from scipy.spatial.transform import Rotation

from tests.unit.ingest import tiny_room
from tests.unit.ingest.folder_writers import write_image_folder
from tests.unit.ingest.running import ingest

CAMERA = Camera(width=64, height=48, fx=60.0, fy=60.0, cx=31.5, cy=23.5)
CAMERAS = {"camera": CAMERA}
CHECKERS = np.kron(np.indices((12, 16)).sum(0) % 2, np.ones((4, 4))).astype(np.uint8)[..., None].repeat(3, 2) * 255
FLAT = np.full((48, 64, 3), 128, np.uint8)


def entry(number: int, pose: np.ndarray, color: np.ndarray = CHECKERS, depth: int = 2000) -> Entry:
    """Return a frame that looks at a wall at some depth [mm]."""
    frame = LoadedFrame(color, np.full((48, 64), depth, np.uint16))
    return Entry(str(number), float(number), pose, lambda: frame)


def turned(degrees: float, x: float = 0.0) -> np.ndarray:
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_euler("y", degrees, degrees=True).as_matrix()
    pose[0, 3] = x
    return pose


def names(entries: list[Entry]) -> list[str]:
    return [found.name for found in entries]


def test_a_camera_that_stands_still_has_one() -> None:
    assert names(key_frames([entry(k, np.eye(4)) for k in range(50)], CAMERAS)) == ["0"]


def test_a_turning_camera_has_one_for_each_piece_of_its_turn() -> None:
    step = np.degrees(module.TURN) / 5
    chosen = key_frames([entry(k, turned(step * (k + 0.5))) for k in range(50)], CAMERAS)
    assert len(chosen) == 10
    assert [int(name) // 5 for name in names(chosen)] == list(range(10))


def test_a_moving_camera_has_one_for_each_share_of_the_depth() -> None:
    step = 1.01 * module.MOVE * 2.0 / 4
    chosen = key_frames([entry(k, turned(0, step * (k + 0.5))) for k in range(40)], CAMERAS)
    assert len(chosen) == 10


def test_the_sharpest_of_a_piece_is_taken() -> None:
    for sharp in (0, 1, 2):
        piece = [entry(k, np.eye(4), CHECKERS if k == sharp else FLAT) for k in range(3)]
        assert names(key_frames(piece, CAMERAS)) == [str(sharp)]


def test_what_was_seen_often_enough_adds_nothing() -> None:
    away = 4 * np.degrees(module.TURN)
    there_and_back = [entry(k, turned(away * (k % 2))) for k in range(20)]
    assert len(key_frames(there_and_back, CAMERAS)) == 2 * ENOUGH


def test_another_direction_adds_something() -> None:
    """The same wall from in front and, at the same distance, from 45 degrees."""
    seen = SeenSurface()
    for _ in range(ENOUGH):
        seen.add(cells_seen(np.full((48, 64), 2.0, np.float32), CAMERA, np.eye(4)))
    assert seen.new_share(cells_seen(np.full((48, 64), 2.0, np.float32), CAMERA, np.eye(4))) == 0.0
    aside = turned(-45.0)
    aside[:3, 3] = [2.0, 0.0, 0.0]
    columns = np.arange(64)
    along = np.column_stack([(columns - CAMERA.cx) / CAMERA.fx, np.ones(64)]) @ aside[[0, 2]][:, [0, 2]].T
    depth = np.broadcast_to(((2.0 - aside[2, 3]) / along[:, 1]).astype(np.float32), (48, 64))
    assert seen.new_share(cells_seen(depth, CAMERA, aside)) > 0.9


def test_counts_are_those_of_a_plain_table() -> None:
    random, seen, table = np.random.default_rng(3), SeenSurface(), dict[int, int]()
    for _ in range(30):
        keys = np.unique(random.integers(-50, 50, 40))
        expected = np.mean([table.get(int(key), 0) < ENOUGH for key in keys])
        assert seen.new_share(keys) == pytest.approx(expected)
        seen.add(keys)
        for key in keys:
            table[int(key)] = table.get(int(key), 0) + 1
    assert dict(zip(seen.keys.tolist(), seen.looks.tolist(), strict=True)) == table


def test_a_frame_that_cannot_be_loaded_is_not_the_sharpest() -> None:
    def torn() -> LoadedFrame:
        raise Unusable("undecodable_color")

    piece = [Entry("torn", 0.0, np.eye(4), torn), entry(1, np.eye(4), FLAT), Entry("torn too", 2.0, np.eye(4), torn)]
    assert names(key_frames(piece, CAMERAS)) == ["1"]
    assert names(key_frames(piece[:1], CAMERAS)) == ["torn"]  # whoever writes it says why it is left out


def test_frames_keep_their_order_and_cameras_do_not_share_what_was_seen() -> None:
    cameras = {"left": CAMERA, "right": CAMERA}
    both = [
        Entry(f"{k}{name}", k + 0.1 * place, np.eye(4), entry(k, np.eye(4)).load, camera_name=name)
        for k in range(9)
        for place, name in enumerate(cameras)
    ]
    assert names(key_frames(both, cameras)) == ["0left", "0right"]


def test_sharpness_is_less_of_a_blurred_picture() -> None:
    assert sharpness(CHECKERS) > 2 * sharpness(cv2.blur(CHECKERS, (5, 5))) > sharpness(FLAT) == 0.0


def test_a_log_says_how_many_it_kept(tmp_path: Path) -> None:
    log = tiny_room.write_seven_scenes(tmp_path / "log", [frame for frame in tiny_room.frames(4) for _ in range(3)])
    made = ingest(log, tmp_path / "sequence", every="auto")
    assert made.summary["frames"] == 4 and made.info.drops[NOT_SELECTED] == 8


def test_a_log_without_poses_is_refused(tmp_path: Path) -> None:
    log = write_image_folder(tmp_path / "log", tiny_room.frames(2), poses=False)
    with pytest.raises(UsageError, match="needs poses"):
        ingest(log, tmp_path / "sequence", every="auto", depth_scale=1000.0)
