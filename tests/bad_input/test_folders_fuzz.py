"""Any damage to any file that describes a folder log ends in BadInput, or in a log whose frames load or say why not."""

from __future__ import annotations

import contextlib
import math
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scenewright.schemas.errors import BadInput, UsageError
from scenewright.stages.ingest.detection import open_log
from scenewright.stages.ingest.folders.calibration_files import read_calibration
from scenewright.stages.ingest.folders.depth_arrays import ARRAY_SUFFIXES, depth_array
from scenewright.stages.ingest.folders.pose_files import read_pose_list
from scenewright.stages.ingest.folders.stamped_poses import StampedPoses, exact_stamp
from scenewright.stages.ingest.layouts.colmap.model import read_model
from scenewright.stages.ingest.parameters import IngestParameters
from scenewright.stages.ingest.source import LogSource, Unusable

from tests.unit.ingest.folder_writers import (
    write_colmap,
    write_image_folder,
    write_nerfstudio,
    write_replica,
    write_scannet,
    write_scenenn,
    write_tum,
)
from tests.unit.ingest.tiny_room import frames, write_posed_images, write_redwood, write_seven_scenes

FAST = settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
EXTREMES = (
    b"nan",
    b"-inf",
    b"1e400",
    b"-1",
    b"0",
    b"99999999999999999999",
    b"1e-320",
    b"",
    b"x",
    b"../",
    b"\0",
    b"\xff",
)
"""What numbers and words in a file are replaced by."""
DESCRIBING = (".txt", ".json", ".log", ".ini", ".yaml", ".bin", ".freiburg")


class Edit(NamedTuple):
    """One change to a file; places are shares of its length."""

    start: float
    length: int
    content: bytes


EDITS = st.lists(
    st.builds(
        Edit,
        st.floats(0, 1, exclude_max=True),
        st.integers(0, 12),
        st.one_of(st.sampled_from(EXTREMES), st.binary(max_size=8)),
    ),
    min_size=1,
    max_size=3,
)


def damaged(data: bytes, edits: list[Edit]) -> bytes:
    """Return the bytes with parts replaced."""
    for edit in edits:
        place = math.floor(edit.start * len(data))
        data = data[:place] + edit.content + data[place + edit.length :]
    return data


WRITERS = {
    "7scenes": write_seven_scenes,
    "redwood": write_redwood,
    "posed-images": write_posed_images,
    "tum": write_tum,
    "scenenn": write_scenenn,
    "scannet": write_scannet,
    "nerfstudio": write_nerfstudio,
    "replica": write_replica,
    "colmap": write_colmap,
    "colmap text": lambda root, recorded: write_colmap(root, recorded, binary=False),
    "images": write_image_folder,
}


@pytest.mark.parametrize("layout", WRITERS)
def test_any_damage_to_a_describing_file(tmp_path: Path, layout: str) -> None:
    log = WRITERS[layout](tmp_path / "scenes" / "log", frames(3))
    files = sorted(path for path in (tmp_path / "scenes").rglob("*") if path.suffix in DESCRIBING)
    whole = {path: path.read_bytes() for path in files}
    options = {"fx": 80.0, "fy": 80.0, "cx": 47.5, "cy": 35.5} if layout == "posed-images" else {}
    check_source(open_log(log, IngestParameters(**options)))

    @FAST
    @given(st.sampled_from(files), EDITS)
    def check(path: Path, edits: list[Edit]) -> None:
        path.write_bytes(damaged(whole[path], edits))
        try:
            check_source(open_log(log, IngestParameters(**options)))
        except (BadInput, UsageError) as error:
            assert "\n" not in str(error)
        finally:
            path.write_bytes(whole[path])

    check()


def check_source(source: LogSource) -> None:
    """Every pose is None or (4, 4), every time a number, and the first frame loads or says why not."""
    for entry in source.entries:
        assert isinstance(entry.time, float)
        assert entry.world_from_camera is None or np.shape(entry.world_from_camera) == (4, 4)
    for entry in source.entries[:1]:
        try:
            entry.load()
        except Unusable as problem:
            assert problem.reason and " " not in problem.reason
    source.close()


CALIBRATIONS = {
    "calibration.yaml": b"%YAML:1.0\n---\nM1: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n"
    b"   data: [ 80., 0., 47.5, 0., 80., 35.5, 0., 0., 1. ]\nD1: [0, 0, 0, 0]\n"
    b"M2: [80, 0, 47.5, 0, 80, 35.5, 0, 0, 1]\nR: [1, 0, 0, 0, 1, 0, 0, 0, 1]\nT: [-0.1, 0, 0]\n",
    "camera.json": b'{"width": 96, "height": 72, "camera": {"fx": 80, "fy": 80, "cx": 47.5, "cy": 35.5, "k1": 0.1}}',
    "calib.txt": b"P0: 80 0 47.5 0 0 80 35.5 0 0 0 1 0\nP1: 80 0 47.5 -8 0 80 35.5 0 0 0 1 0\n",
    "intrinsics.txt": b"cam0=[80 0 47; 0 80 35; 0 0 1]\ncam1=[80 0 50; 0 80 35; 0 0 1]\ndoffs=3\nbaseline=100\n",
}


@pytest.mark.parametrize("name", CALIBRATIONS)
def test_any_damage_to_a_calibration(tmp_path: Path, name: str) -> None:
    path = tmp_path / name

    @FAST
    @given(st.one_of(EDITS.map(lambda edits: damaged(CALIBRATIONS[name], edits)), st.binary(max_size=200)))
    def check(data: bytes) -> None:
        path.write_bytes(data)
        try:
            found = read_calibration(path)
        except BadInput as error:
            assert name in str(error)
        else:
            assert found.left.K[0] > 0 and np.isfinite(found.left.K).all()

    check()


@FAST
@given(text=st.text(alphabet="0123456789.-+einfa# \n\t", max_size=200))
def test_any_text_as_poses(tmp_path: Path, text: str) -> None:
    path = tmp_path / "poses.txt"
    path.write_text(text)
    try:
        found = read_pose_list(path, ["a", "b"])
    except BadInput:
        return
    assert isinstance(found, StampedPoses) or len(found) == 2


@FAST
@given(st.text(max_size=30))
def test_any_text_as_a_stamp(text: str) -> None:
    with contextlib.suppress(BadInput):
        assert 0 <= exact_stamp(text, "here") < 9 * 10**18


@FAST
@given(cameras=st.binary(max_size=120), images=st.binary(max_size=200))
def test_any_bytes_as_a_sparse_model(tmp_path: Path, cameras: bytes, images: bytes) -> None:
    (tmp_path / "cameras.bin").write_bytes(cameras)
    (tmp_path / "images.bin").write_bytes(images)
    with contextlib.suppress(BadInput):
        read_model(tmp_path)


STARTS = {".npy": b"\x93NUMPY\x01\x00\x76\x00{'descr': '<f4', 'fortran_order': ", ".pfm": b"Pf\n", ".bin": b"3&2&1&"}


@FAST
@given(suffix=st.sampled_from(ARRAY_SUFFIXES), tail=st.binary(max_size=200))
def test_any_bytes_as_an_array(suffix: str, tail: bytes) -> None:
    for data in (tail, STARTS[suffix] + tail):
        try:
            image = depth_array(data, suffix)
        except Unusable:
            continue
        assert image.ndim == 2 and image.size * 2 <= len(data)
