"""Recordings of phones that are torn, of two lengths, turned, archives that lie: one line, or counted."""

from __future__ import annotations

import json
import sys
import zipfile
from pathlib import Path

import cv2
import numpy as np
import pytest
from scenewright.schemas.errors import BadInput, MissingDependency
from scenewright.stages.ingest.detection import open_log
from scenewright.stages.ingest.folders.lzfse_blocks import declared_size, unpacked
from scenewright.stages.ingest.folders.video_frames import is_hdr
from scenewright.stages.ingest.parameters import IngestParameters
from scenewright.stages.ingest.preflight.inspection import inspect_log
from scenewright.stages.ingest.source import LogSource, Unusable
from scenewright.stages.kit.progress import SilentProgress

from tests.unit.ingest.phone_writers import (
    DEPTH,
    Take,
    write_polycam,
    write_r3d,
    write_record3d_export,
    write_stray_scanner,
    write_video,
)
from tests.unit.ingest.running import ingest
from tests.unit.ingest.tiny_room import jpeg, png

OF_ARKIT = "1280, 0, 978.3\n0, 1284, 711.1\n0, 0, 1"
"""The same camera at 1920x1440."""


@pytest.fixture(scope="module")
def take() -> Take:
    return Take(4)


def opened(path: Path, **options: object) -> LogSource:
    return open_log(path, IngestParameters(**options))  # type: ignore[arg-type]


def refused(path: Path) -> str:
    """Return the one line that both commands say."""
    with pytest.raises(BadInput) as caught:
        opened(path)
    with pytest.raises(BadInput) as again:
        inspect_log(path, IngestParameters(), 4, SilentProgress())
    assert str(caught.value) == str(again.value) and "\n" not in str(caught.value)
    return str(caught.value)


def problems(source: LogSource) -> list[str | None]:
    """Return why each frame of a log is left out, None where it is not."""
    found: list[str | None] = []
    for entry in source.entries:
        try:
            found.append(entry.problem)
            if entry.problem is None:
                entry.load()
        except Unusable as problem:
            found[-1] = problem.reason
    source.close()
    return found


# --- Stray Scanner ---------------------------------------------------------------------------------------------


def test_a_torn_video(tmp_path: Path, take: Take) -> None:
    log = write_stray_scanner(tmp_path / "log", take, intrinsics=False)
    data = (log / "rgb.mp4").read_bytes()
    (log / "rgb.mp4").write_bytes(data[: len(data) // 2])
    said = refused(log)
    assert "rgb.mp4: is not a video that can be read: it was cut" in said and "its depth alone is read" in said
    (log / "rgb.mp4").unlink()  # the advice
    assert "is not that of pictures of 1920x1440 pixels (give --fx" in refused(log)
    for text, options in ((None, {"fx": 42.7, "fy": 42.8, "cx": 32.1, "cy": 23.2}), (OF_ARKIT, {})):
        if text is not None:
            (log / "camera_matrix.csv").write_text(text)
        source = opened(log, **options)
        assert "there is no rgb.mp4: depth alone is read" in source.notes
        assert source.camera.width == 64 and source.camera.fx == pytest.approx(42.7, abs=0.04)
        assert problems(source) == [None] * 4


def test_a_video_that_was_made_smaller(tmp_path: Path, take: Take) -> None:
    log = write_stray_scanner(tmp_path / "log", take, intrinsics=False)
    (log / "camera_matrix.csv").write_text(OF_ARKIT)
    source = opened(log)
    assert (source.camera.cx, source.camera.cy) == (pytest.approx(DEPTH.cx), pytest.approx(DEPTH.cy))
    assert source.cameras[0].picture is not None and source.cameras[0].picture.width == 480
    assert problems(source) == [None] * 4


@pytest.mark.parametrize(("frames", "left_out"), [(3, ["missing_color"]), (5, ["missing_time"])])
def test_odometry_of_another_length_than_the_video(
    tmp_path: Path, take: Take, frames: int, left_out: list[str]
) -> None:
    log = write_stray_scanner(tmp_path / "log", take)
    write_video(log / "rgb.mp4", [*take.pictures, take.pictures[0]][:frames])
    source = opened(log)
    assert any(f"odometry.csv has 4 poses and rgb.mp4 {frames} frames" in note for note in source.notes)
    assert [problem for problem in problems(source) if problem] == left_out


def test_depth_without_confidence(tmp_path: Path, take: Take) -> None:
    log = write_stray_scanner(tmp_path / "log", take)
    (log / "confidence" / "000002.png").unlink()
    sequence = ingest(log, tmp_path / "some")
    assert "deviation" in sequence.info.streams and sequence.info.frame_count == 4
    assert any("read as a standard deviation of depth, of 3 of 4 frames" in note for note in sequence.info.notes)
    for path in (log / "confidence").iterdir():
        path.unlink()
    sequence = ingest(log, tmp_path / "none")
    assert "deviation" not in sequence.info.streams and sequence.info.frame_count == 4
    assert "no confidence beside depth: every pixel of depth counts the same" in sequence.info.notes


@pytest.mark.parametrize(
    ("image", "reason"),
    [
        (np.full((48, 64), 7, np.uint8), "undecodable_confidence"),
        (np.zeros((24, 32), np.uint8), "size_mismatch"),
        (np.zeros((48, 64), np.uint16), "undecodable_confidence"),
    ],
)
def test_confidence_that_is_none(tmp_path: Path, take: Take, image: np.ndarray, reason: str) -> None:
    log = write_stray_scanner(tmp_path / "log", take)
    (log / "confidence" / "000001.png").write_bytes(png(image))
    assert problems(opened(log)) == [None, reason, None, None]


def test_a_video_that_was_turned_by_a_converter(tmp_path: Path, take: Take) -> None:
    log = write_stray_scanner(tmp_path / "log", take)
    upright = [np.ascontiguousarray(np.rot90(picture)) for picture in take.pictures]
    write_video(log / "rgb.mp4", upright, turned=False)
    assert "pictures of 360x480 do not have the shape of 480x360" in refused(log)


def test_pictures_of_a_wide_video_beside_square_depth(tmp_path: Path, take: Take) -> None:
    log = write_stray_scanner(tmp_path / "log", take)
    write_video(log / "rgb.mp4", [picture[44:316] for picture in take.pictures])
    said = refused(log)
    assert "camera_matrix.csv: centre" in said or "nothing says what was cut off" in said


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("odometry.csv", "", "names no column x, y, z, qx, qy, qz, qw"),
        ("odometry.csv", "a, b\n1, 2\n", "names no column x"),
        ("odometry.csv", "timestamp, frame, x, y, z, qx, qy, qz, qw\n", "has no poses"),
        ("odometry.csv", "x, x, y, z, qx, qy, qz, qw\n1, 1, 1, 1, 0, 0, 0, 1\n", "names a column twice"),
        ("camera_matrix.csv", "320, 0, 240", "is not a 3x3 camera matrix"),
        ("camera_matrix.csv", "a, 0, 240\n0, 320, 180\n0, 0, 1", "holds a value that is not a number"),
        ("camera_matrix.csv", "320, 0, 20\n0, 320, 180\n0, 0, 1", "is not that of pictures of 480x360"),
        ("camera_matrix.csv", "0, 0, 240\n0, 320, 180\n0, 0, 1", "are those of no camera"),
    ],
)
def test_tables_that_are_none(tmp_path: Path, take: Take, name: str, text: str, words: str) -> None:
    log = write_stray_scanner(tmp_path / "log", take)
    if name == "camera_matrix.csv":
        write_stray_scanner(tmp_path / "old", take, intrinsics=False)
        log = tmp_path / "old"
    (log / name).write_text(text)
    assert words in refused(log)


def test_a_table_that_was_cut(tmp_path: Path, take: Take) -> None:
    log = write_stray_scanner(tmp_path / "log", take)
    rows = (log / "odometry.csv").read_text().splitlines()
    (log / "odometry.csv").write_text("\n".join([*rows[:4], rows[4][:40]]))
    source = opened(log)
    assert source.damage == ("odometry.csv: line 5 cannot be read",)
    assert problems(source) == [None, None, None, "missing_time"]


# --- Record3D --------------------------------------------------------------------------------------------------


def with_entry(path: Path, name: str, data: bytes | None, claim: int | None = None) -> Path:
    """Write the archive again with another entry, without it, or with one that claims so many bytes."""
    with zipfile.ZipFile(path) as archive:
        entries = {each: archive.read(each) for each in archive.namelist()}
    entries.pop(name)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for each, content in entries.items():
            archive.writestr(each, content)
        if data is not None:
            archive.writestr(name, data)
        if claim is not None:
            archive.getinfo(name).file_size = claim
    return path


def test_an_archive_bomb(tmp_path: Path, take: Take) -> None:
    path = write_r3d(tmp_path / "take.r3d", take)
    with_entry(path, "rgbd/1.jpg", bytes(2_000_000), claim=4_000_000_000)
    assert problems(opened(path)) == [None, "unreadable_color", None, None]
    with_entry(path, "metadata", b"{}" + b" " * 80_000_000)
    assert "metadata claims 80000002 bytes" in refused(path)


def test_lzfse_that_unpacks_to_more(tmp_path: Path, take: Take) -> None:
    library = pytest.importorskip("lzfse", reason="the extra `phone` is not installed")
    path = write_r3d(tmp_path / "take.r3d", take)
    bomb = library.compress(bytes(5_000_000))
    assert len(bomb) < 5_000 and declared_size(bomb) == 5_000_000
    with_entry(path, "rgbd/0.depth", bomb)
    with_entry(path, "rgbd/2.conf", bomb)
    assert problems(opened(path)) == ["undecodable_depth", None, "undecodable_confidence", None]


@pytest.mark.parametrize("size", [0, 1, 17, 1000, 49152, 1_000_000])
def test_what_lzfse_declares_is_what_it_unpacks_to(size: int) -> None:
    library = pytest.importorskip("lzfse", reason="the extra `phone` is not installed")
    random = np.random.default_rng(size)
    for raw in (random.bytes(size), bytes(size), random.integers(0, 3, size).astype(np.uint8).tobytes()):
        packed = library.compress(raw)
        assert declared_size(packed) == size and unpacked(packed, size, "depth") == raw


def test_any_damage_of_lzfse_is_counted() -> None:
    library = pytest.importorskip("lzfse", reason="the extra `phone` is not installed")
    random = np.random.default_rng(5)
    raw = np.cumsum(random.normal(0, 0.01, 2000)).astype("<f4").tobytes()
    packed = library.compress(raw)
    damaged = [packed[:cut] for cut in range(0, len(packed), 97)]
    for place in range(0, len(packed), 41):
        changed = bytearray(packed)
        changed[place] ^= int(random.integers(1, 256))
        damaged.append(bytes(changed))
    for data in (b"", b"bvx2", b"bvx$", b"bvxn" + bytes(8), b"bvx-\xff\xff\xff\xff", *damaged):
        try:
            assert len(unpacked(data, len(raw), "depth")) == len(raw)
        except Unusable as problem:
            assert problem.reason == "undecodable_depth"


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"K": None}, "K holds a value that is not a number"),
        ({"K": [1, 2, 3]}, "K has 3 numbers, expected 9"),
        ({"poses": [[0] * 6]}, "poses, frame 0 has 6 numbers, expected 7"),
        ({"poses": [[0, 0, 0, 1, 0, 0, "a"]]}, "poses holds a value that is not a number"),
        ({"w": 0}, "are no size"),
        ({"perFrameIntrinsicCoeffs": [[1, 2]]}, "perFrameIntrinsicCoeffs, frame 0 has 2 numbers"),
        ({"frameTimestamps": ["now"]}, "is not a time stamp"),
    ],
)
def test_metadata_that_is_none(tmp_path: Path, take: Take, changes: dict[str, object], words: str) -> None:
    assert words in refused(write_r3d(tmp_path / "take.r3d", take, **changes))


def test_archives_that_are_none(tmp_path: Path, take: Take) -> None:
    path = tmp_path / "take.r3d"
    path.write_bytes(b"PK\x03\x04 and nothing more")
    assert "export the recording from the app again" in refused(path)
    with_entry(write_r3d(path, take), "metadata", None)
    assert "holds no file `metadata`" in refused(path)
    with_entry(write_r3d(path, take), "metadata", b"no JSON")
    assert "metadata: no JSON" in refused(path)


def test_a_pose_that_is_none_loses_one_frame(tmp_path: Path, take: Take) -> None:
    path = write_r3d(tmp_path / "take.r3d", take)
    with zipfile.ZipFile(path) as archive:
        poses = json.loads(archive.read("metadata"))["poses"]
    poses[1] = [0, 0, 0, 0, 1, 1, 1]
    poses[2] = [float("nan")] * 7
    assert problems(opened(write_r3d(path, take, poses=poses))) == [None, "non_rigid_pose", "non_finite_pose", None]


def test_pictures_that_were_turned_alone(tmp_path: Path, take: Take) -> None:
    path = write_r3d(tmp_path / "take.r3d", take)
    for index, picture in enumerate(take.pictures):
        with_entry(path, f"rgbd/{index}.jpg", jpeg(np.rot90(picture)))
    assert "pictures of 360x480 do not have the shape of 480x360, of which the intrinsics are: they were turned" in (
        refused(path)
    )


def test_pictures_of_four_thousand_pixels(tmp_path: Path) -> None:
    """An app that keeps still pictures of the sensor's size; the intrinsics are scaled."""
    take = Take(2)
    take.pictures = [cv2.resize(picture, (3840, 2880)) for picture in take.pictures]
    sequence = ingest(write_r3d(tmp_path / "take.r3d", take), tmp_path / "sequence")
    picture = sequence.info.cameras[0].picture
    assert picture is not None and (picture.width, picture.height) == (3840, 2880)
    assert picture.fx == pytest.approx(320 * 8) and picture.cx == pytest.approx((244.2 + 0.5) * 8 - 0.5)


def test_depth_beyond_millimetres_of_sixteen_bits(tmp_path: Path) -> None:
    """Float depth of high range: what no sequence holds is invalid, and nothing wraps around."""
    take = Take(2)
    take.depths[0][:10] = 70.0
    take.depths[0][10:20] = np.inf
    take.depths[0][20:30] = np.nan
    source = opened(write_r3d(tmp_path / "take.r3d", take))
    frame = source.entries[0].load()
    source.close()
    assert frame.depth is not None and not frame.depth[:30].any() and frame.depth[30:].all()
    assert frame.deviation is not None and not frame.deviation[:30].any()


def test_without_the_libraries(tmp_path: Path, take: Take, monkeypatch: pytest.MonkeyPatch) -> None:
    packed = write_r3d(tmp_path / "take.r3d", take)
    exported = write_record3d_export(tmp_path / "log", take)
    for module, path in (("lzfse", packed), ("OpenEXR", exported)):
        monkeypatch.setitem(sys.modules, module, None)
        with pytest.raises(MissingDependency, match=rf"{module} cannot be imported, which depth in .* needs") as caught:
            opened(path)
        assert caught.value.hint == "pip install 'scenewright[phone]'"


def test_exr_that_is_damaged(tmp_path: Path, take: Take) -> None:
    log = write_record3d_export(tmp_path / "log", take)
    data = (log / "depth" / "1.exr").read_bytes()
    (log / "depth" / "1.exr").write_bytes(data[: len(data) // 2])
    (log / "depth" / "2.exr").write_bytes(b"")
    (log / "depth" / "3.exr").write_bytes(png(np.ones((48, 64), np.uint16)))
    assert problems(opened(log)) == [None, "undecodable_depth", "undecodable_depth", "undecodable_depth"]


# --- Polycam ---------------------------------------------------------------------------------------------------


def test_a_key_frame_without_its_camera(tmp_path: Path, take: Take) -> None:
    root = write_polycam(tmp_path / "log", take) / "keyframes"
    cameras = sorted((root / "corrected_cameras").iterdir())
    cameras[1].unlink()
    cameras[2].write_text('{"fx": 320}')
    source = opened(root.parent)
    assert "1 key frames have no corrected camera and are left out" in source.notes
    assert problems(source) == [None, "missing_pose", "unreadable_pose", None]


def test_cameras_that_state_no_size(tmp_path: Path, take: Take) -> None:
    root = write_polycam(tmp_path / "log", take) / "keyframes" / "corrected_cameras"
    for path in root.iterdir():
        document = json.loads(path.read_text())
        path.write_text(json.dumps({key: value for key, value in document.items() if key != "width"}))
    assert "width and height state no size" in refused(root.parent)


# --- several ---------------------------------------------------------------------------------------------------


def test_a_folder_of_two_recordings(tmp_path: Path, take: Take) -> None:
    for name in ("kitchen", "office"):
        write_stray_scanner(tmp_path / "logs" / name, take)
    assert refused(tmp_path / "logs").endswith(f"holds 2 logs, kitchen, office (give {tmp_path / 'logs' / 'kitchen'})")
    (tmp_path / "logs" / "thumbnail.jpg").write_bytes(jpeg(take.pictures[0]))  # a picture beside them is no log
    assert "holds 2 logs, kitchen, office" in refused(tmp_path / "logs")


def test_a_folder_in_a_folder(tmp_path: Path, take: Take) -> None:
    write_polycam(tmp_path / "export" / "scan", take)
    assert "holds a log in scan" in refused(tmp_path / "export")
    write_r3d(tmp_path / "files" / "take.r3d", take)
    assert "holds a log in take.r3d" in refused(tmp_path / "files")


def test_a_video_that_says_it_is_hdr(tmp_path: Path, take: Take) -> None:
    log = write_stray_scanner(tmp_path / "log", take)
    assert not is_hdr(log / "rgb.mp4")
    box = b"\0\0\0\x13colrnclx" + b"\0\x09" + b"\0\x12" + b"\0\x09" + b"\0"  # BT.2020, HLG
    with (log / "rgb.mp4").open("ab") as file:
        file.write(len(box).to_bytes(4, "big") + box[4:])
    assert is_hdr(log / "rgb.mp4")
    assert any(note.startswith("WARNING: rgb.mp4 is HDR") for note in opened(log).notes)
