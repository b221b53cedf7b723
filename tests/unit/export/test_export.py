"""Export: what every layout holds, checked by reading it with nothing of ours, and what it says of the rest."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from scenewright.schemas.errors import UsageError
from scenewright.schemas.manifest import MANIFEST_NAME, Manifest
from scenewright.schemas.sequence import Sequence
from scenewright.stages.engine.digests import content_digest, record_files
from scenewright.stages.engine.discovery import all_stages
from scenewright.stages.engine.runner import run_stage
from scenewright.stages.engine.verification import verify
from scenewright.stages.export.formats.tum import LARGEST_MILLIMETRES
from scenewright.stages.export.formats.tum.writer import depth_units, stamp_text
from scenewright.stages.export.parameters import ExportParameters, check
from scenewright.stages.kit.formats.frames import FrameReader
from scipy.spatial.transform import Rotation

from tests.unit.export.sequences import CAMERA, OTHER, export, png, write_sequence
from tests.unit.ingest.tiny_room import camera_poses


def test_tum_by_its_published_format(tmp_path: Path) -> None:
    sequence = write_sequence(tmp_path / "sequence")
    done = export(sequence, tmp_path / "tum", layout="tum")
    root = done.root
    rows = {
        name: [line.split() for line in (root / name).read_text().splitlines() if not line.startswith("#")]
        for name in ("rgb.txt", "depth.txt", "groundtruth.txt")
    }
    assert [len(found) for found in rows.values()] == [5, 5, 5]
    poses = camera_poses(5)
    with FrameReader(sequence.path("frames.mcap")) as reader:
        for index, stamp in enumerate(reader.stamps):
            assert int(rows["rgb.txt"][index][0].replace(".", "")) == stamp
            assert (root / rows["rgb.txt"][index][1]).read_bytes() == reader.encoded(index)
            depth = cv2.imread(str(root / rows["depth.txt"][index][1]), cv2.IMREAD_UNCHANGED)
            assert depth.dtype == np.uint16
            metres = reader.read(index).depth
            np.testing.assert_array_equal(np.rint(np.where(metres > 13.1065, 0, metres) * 5000), depth)
            numbers = np.array(rows["groundtruth.txt"][index][1:], float)
            np.testing.assert_allclose(numbers[:3], poses[index][:3, 3], atol=1e-9)
            np.testing.assert_allclose(Rotation.from_quat(numbers[3:]).as_matrix(), poses[index][:3, :3], atol=1e-9)
    numbers = [float(word) for word in (root / "calibration.txt").read_text().split()]
    assert numbers == [CAMERA.fx, CAMERA.fy, CAMERA.cx, CAMERA.cy]
    assert done.info.depth_pixels_zeroed == 2 and done.summary["depth_pixels_zeroed"] == 2
    assert done.info.depth_limit == 13.106 and any("13.106 m" in note for note in done.info.notes)


@given(arrays(np.uint16, (3, 4)))
def test_tum_depth_is_exact_or_zero(millimetres: np.ndarray) -> None:
    units, zeroed = depth_units(millimetres)
    far = millimetres > LARGEST_MILLIMETRES
    assert zeroed == far.sum() and (units[far] == 0).all() and (units < 65535).all()
    np.testing.assert_array_equal(units[~far] / 5, millimetres[~far])


@given(st.integers(0, 2**62))
def test_stamps_are_written_exactly(stamp: int) -> None:
    seconds, _, rest = stamp_text(stamp).partition(".")
    assert int(seconds) * 10**9 + int(rest) == stamp and len(rest) == 9


def test_nerfstudio_by_its_published_format(tmp_path: Path) -> None:
    """OpenGL cameras: a pixel's ray, made as nerfstudio makes it, is the ray of our camera."""
    sequence = write_sequence(tmp_path / "sequence", cameras={"front": CAMERA, "left": OTHER}, picture=png)
    root = export(sequence, tmp_path / "nerf", layout="nerfstudio").root
    document = json.loads((root / "transforms.json").read_text())
    assert document["depth_unit_scale_factor"] == 0.001 and "fl_x" not in document
    poses = camera_poses(5)
    with FrameReader(sequence.path("frames.mcap")) as reader:
        for index, frame in enumerate(document["frames"]):
            camera = (CAMERA, OTHER)[index % 2]
            column, row = 7, 11
            ray = np.array(
                [(column + 0.5 - frame["cx"]) / frame["fl_x"], -(row + 0.5 - frame["cy"]) / frame["fl_y"], -1.0]
            )
            ours = np.array([(column - camera.cx) / camera.fx, (row - camera.cy) / camera.fy, 1.0])
            matrix = np.array(frame["transform_matrix"])
            np.testing.assert_allclose(matrix[:3, :3] @ ray, poses[index][:3, :3] @ ours, atol=1e-9)
            np.testing.assert_allclose(matrix[:3, 3], poses[index][:3, 3], atol=1e-9)
            assert (frame["w"], frame["h"]) == (camera.width, camera.height)
            assert frame["file_path"].endswith(".png")
            assert (root / frame["file_path"]).read_bytes() == reader.encoded(index)
            depth = cv2.imread(str(root / frame["depth_file_path"]), cv2.IMREAD_UNCHANGED)
            np.testing.assert_array_equal(depth, np.rint(reader.read(index).depth * 1000))
    one = export(write_sequence(tmp_path / "one"), tmp_path / "single", layout="nerfstudio").root
    document = json.loads((one / "transforms.json").read_text())
    assert (document["fl_x"], document["cx"]) == (CAMERA.fx, CAMERA.cx + 0.5) and "fl_x" not in document["frames"][0]


def test_ros2_by_the_decoder_of_the_mcap_project(tmp_path: Path) -> None:
    sequence = write_sequence(tmp_path / "sequence", baseline=0.12, labels=True)
    path = export(sequence, tmp_path / "ros2", layout="mcap", dialect="ros2").path("log.mcap")
    seen: dict[str, list] = {}
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        assert reader.get_header().profile == "ros2"
        for schema, channel, message, body in reader.iter_decoded_messages():
            assert schema.encoding == "ros2msg" and channel.message_encoding == "cdr"
            seen.setdefault(channel.topic, []).append((message.log_time, body))
    assert {topic: len(rows) for topic, rows in seen.items()} == dict.fromkeys(
        (
            "/tf",
            "/camera/color/camera_info",
            "/camera/color/image_raw/compressed",
            "/camera/depth/camera_info",
            "/camera/depth/image_raw",
            "/camera/labels/image_raw",
            "/camera/right/camera_info",
            "/camera/right/image_raw/compressed",
        ),
        5,
    )
    poses = camera_poses(5)
    with FrameReader(sequence.path("frames.mcap")) as frames:
        for index, stamp in enumerate(frames.stamps):
            for rows in seen.values():
                assert rows[index][0] == stamp
            color = seen["/camera/color/image_raw/compressed"][index][1]
            assert bytes(color.data) == frames.encoded(index) and color.format == "jpeg"
            assert color.header.stamp.sec * 10**9 + color.header.stamp.nanosec == stamp
            depth = seen["/camera/depth/image_raw"][index][1]
            pixels = np.frombuffer(depth.data, "<u2").reshape(depth.height, depth.width)
            assert (depth.encoding, depth.step, depth.is_bigendian) == ("16UC1", 2 * CAMERA.width, 0)
            np.testing.assert_array_equal(pixels, np.rint(frames.read(index).depth * 1000))
            transform = seen["/tf"][index][1].transforms[0]
            found = [getattr(transform.transform.translation, axis) for axis in "xyz"]
            np.testing.assert_allclose(found, poses[index][:3, 3], atol=1e-12)
            quaternion = [getattr(transform.transform.rotation, axis) for axis in "xyzw"]
            np.testing.assert_allclose(Rotation.from_quat(quaternion).as_matrix(), poses[index][:3, :3], atol=1e-12)
            assert (transform.header.frame_id, transform.child_frame_id) == ("world", "camera")
    info, right = seen["/camera/color/camera_info"][0][1], seen["/camera/right/camera_info"][0][1]
    np.testing.assert_array_equal(info.k, [CAMERA.fx, 0, CAMERA.cx, 0, CAMERA.fy, CAMERA.cy, 0, 0, 1])
    assert right.p[3] == pytest.approx(-0.12 * CAMERA.fx) and info.header.frame_id == "camera"


def test_every_n_th_frame_and_chosen_streams(tmp_path: Path) -> None:
    sequence = write_sequence(tmp_path / "sequence", labels=True)
    done = export(sequence, tmp_path / "a", layout="mcap", every=2, streams=("depth", "pose"))
    with FrameReader(done.path("log.mcap")) as reader:
        assert len(reader) == 3 and reader.streams == ("depth", "pose")
    assert done.info.left_out == {"not_selected": 2} and done.info.streams == ("depth", "pose")
    assert any("color" in note and "labels" in note for note in done.info.notes)


def test_what_a_layout_cannot_hold_is_counted(tmp_path: Path) -> None:
    two = write_sequence(tmp_path / "two", cameras={"front": CAMERA, "left": OTHER})
    done = export(two, tmp_path / "tum", layout="tum")
    assert done.info.left_out == {"other_camera": 2} and done.info.cameras == ("front",)
    assert any("cameras not written: left" in note for note in done.info.notes)
    left = export(two, tmp_path / "left", layout="tum", camera="left")
    assert left.info.frame_count == 2
    assert (left.root / "calibration.txt").read_text() == "60.0 61.0 31.0 24.5\n"
    lacking = write_sequence(tmp_path / "lacking", without={1: ("pose",), 2: ("color",), 3: ("depth",)})
    done = export(lacking, tmp_path / "nerf", layout="nerfstudio")
    assert done.info.left_out == {"missing_pose": 1, "missing_color": 1} and done.info.frame_count == 3
    frames = json.loads((done.root / "transforms.json").read_text())["frames"]
    assert ["depth_file_path" in frame for frame in frames] == [True, False, True]


def test_nothing_to_write_is_an_outcome(tmp_path: Path) -> None:
    unposed = write_sequence(tmp_path / "sequence", 2, without={0: ("pose",), 1: ("pose",)})
    done = export(unposed, tmp_path / "nerf", layout="nerfstudio")
    assert done.outcome == "empty" and "missing_pose 2" in done.summary["reason"]
    assert export(unposed, tmp_path / "tum", layout="tum").outcome == "ok"


def test_same_sequence_same_bytes(tmp_path: Path) -> None:
    sequence = write_sequence(tmp_path / "sequence", labels=True)
    for options in ({"layout": "tum"}, {"layout": "nerfstudio"}, {"layout": "mcap", "dialect": "ros2"}):
        name = "-".join(options.values())
        first, again = (export(sequence, tmp_path / f"{name}-{k}", **options).root for k in "ab")
        files = sorted(path.relative_to(first) for path in first.rglob("*") if path.is_file())
        assert files and files == sorted(path.relative_to(again) for path in again.rglob("*") if path.is_file())
        assert all((first / path).read_bytes() == (again / path).read_bytes() for path in files)


@pytest.mark.parametrize(
    ("options", "words"), [({"streams": ("colour",)}, "no stream 'colour'"), ({"dialect": "ros2"}, "is about MCAP")]
)
def test_options_that_cannot_work_are_refused(options: dict, words: str) -> None:
    with pytest.raises(UsageError, match=words):
        check(ExportParameters(**options), {})


def test_an_unknown_camera_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="it has: camera"):
        export(write_sequence(tmp_path / "sequence"), tmp_path / "out", camera="rear")


def test_an_export_is_a_log_by_its_payload(tmp_path: Path) -> None:
    """Made again with the same bytes, it is the same log, though its manifest and timings are new."""
    source = write_sequence(tmp_path / "sequence").root
    records = record_files(source, ())
    Manifest(
        kind="sequence",
        schema_version=Sequence.schema_version,
        stage="test",
        key="k",
        content_digest=content_digest(records),
        files=records,
    ).write(source / MANIFEST_NAME)
    out, again = tmp_path / "tum", tmp_path / "again"
    export_stage, ingest_stage = all_stages()["export"], all_stages()["ingest"]
    parameters = ingest_stage.parameters(gravity="given")
    run_stage(export_stage, {"sequence": source}, out, ExportParameters())
    first = run_stage(ingest_stage, {"log": out}, again, parameters)
    manifest = (out / MANIFEST_NAME).read_text()
    run_stage(export_stage, {"sequence": source}, out, ExportParameters(), force=True, command=("another",))
    assert (out / MANIFEST_NAME).read_text() != manifest
    assert run_stage(ingest_stage, {"log": out}, again, parameters).status == "up to date"
    assert [(f.path.name, f.problems) for f in verify(again)] == [("again", ()), ("tum", ()), ("sequence", ())]
    (out / "groundtruth.txt").write_text("")
    assert verify(again)[0].problems and first.status == "made"
