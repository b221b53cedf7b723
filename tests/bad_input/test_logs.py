"""Damaged and lying logs: refused with what was found, or frames left out and counted. Never a raw exception."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.RawImage_pb2 import RawImage
from mcap.opcode import Opcode
from scenewright.schemas.errors import BadInput
from scenewright.stages.ingest.detection import open_log
from scenewright.stages.ingest.parameters import IngestParameters
from scenewright.stages.kit.formats.frames import FrameReader, FrameWriter
from scenewright.stages.kit.geometry.transforms import transform_from_yaw

from tests.real_data import real_data
from tests.unit.ingest.container_logs import mcap_records
from tests.unit.ingest.foxglove_logs import (
    CompressionType,
    LogWriter,
    calibration,
    compressed,
    raw,
    transform,
    write_simple_log,
)
from tests.unit.ingest.running import ingest
from tests.unit.ingest.tiny_room import CAMERA, frames, jpeg, millimetres, png

SECOND = 1_000_000_000


# --- the container ---------------------------------------------------------------------------------------------


def test_bit_flip_in_a_sequence_is_noticed(tmp_path: Path) -> None:
    path = tmp_path / "frames.mcap"
    with FrameWriter(path, CAMERA) as writer:
        for index, (color, depth, pose) in enumerate(frames(3)):
            writer.write(float(index), color, depth, pose)
    damaged = bytearray(path.read_bytes())
    chunk = next(record for record in mcap_records(bytes(damaged)) if record[0] == Opcode.CHUNK)
    damaged[(chunk[1] + chunk[2]) // 2] ^= 1
    path.write_bytes(damaged)
    with pytest.raises(BadInput), FrameReader(path) as reader:
        list(reader.frames())


def test_torn_log_gives_the_frames_of_its_whole_chunks(tmp_path: Path) -> None:
    path = write_simple_log(tmp_path / "torn.mcap", frames(3), chunk_size=8000)
    whole = path.read_bytes()
    chunks = [record for record in mcap_records(whole) if record[0] == Opcode.CHUNK]
    path.write_bytes(whole[: chunks[-1][1] + 100])
    info = ingest(path, tmp_path / "salvaged").info
    assert 0 < info.frame_count < 3
    assert any(f"byte {chunks[-1][1]}: the last 100 bytes are lost" in line for line in info.damage)
    expected = rf"byte {chunks[-1][1]}, of {chunks[-1][1] + 100} bytes: {len(chunks) - 1} whole chunks"
    with pytest.raises(BadInput, match=expected) as caught:
        ingest(path, tmp_path / "refused", damage="refuse")
    assert "--damage salvage" in str(caught.value)


# --- the messages ----------------------------------------------------------------------------------------------


def _log(path: Path, **replaced) -> Path:
    """Write a one-frame log in which some messages are replaced (None: left out)."""
    color, depth, pose = frames(1)[0]
    messages = {
        "/info": calibration(SECOND),
        "/tf": transform(SECOND, "map", "optical", pose),
        "/color": compressed(SECOND, jpeg(color)),
        "/depth": raw(SECOND, millimetres(depth), "16UC1"),
    }
    messages |= {"/" + name: message for name, message in replaced.items()}
    with LogWriter(path, CompressionType.NONE) as log:
        for topic, message in messages.items():
            for one in message if isinstance(message, list) else [message]:
                if one is not None:
                    log.write(topic, one, SECOND)
    return path


BAD_CALIBRATIONS = {
    "missing": (None, "no camera calibration"),
    "zero focal length": (calibration(0, K=[0.0] * 9), "no positive focal lengths"),
    "no K": (calibration(0, K=[]), "no camera calibration.*1 of 1 messages of /info do not decode.*'k' has "),
    "NaN": (calibration(0, K=[float("nan")] * 9), "no camera calibration.*'k' is not finite"),
    "negative": (calibration(0, K=[-80.0, 0, 40, 0, 80, 30, 0, 0, 1]), "no positive focal lengths"),
    "zero size": (calibration(0, width=0, height=0), "0x0"),
    "wrong shape": (calibration(0, width=100, height=100), "100x100, depth images are 96x72"),
    "unknown lens": (calibration(0, distortion_model="CylinderCamera", D=[0.1] * 4), "CylinderCamera"),
    "fisheye of five": (calibration(0, distortion_model="equidistant", D=[0.1] * 5), "'equidistant' with 5 coeff"),
    "tiny focal length": (calibration(0, K=[1e-9, 0, 40, 0, 80, 30, 0, 0, 1]), "focal length 1e-09"),
    "centre far away": (calibration(0, K=[80, 0, 4e9, 0, 80, 30, 0, 0, 1]), "centre 4e"),
    "endless distortion": (calibration(0, D=[float("inf")] * 5), "'d' is not finite"),
}


@pytest.mark.parametrize("case", BAD_CALIBRATIONS)
def test_calibrations_that_cannot_be(tmp_path: Path, case: str) -> None:
    message, complaint = BAD_CALIBRATIONS[case]
    log = _log(tmp_path / "log.mcap", info=message)
    with pytest.raises(BadInput, match=complaint):
        ingest(log, tmp_path / "out")
    k = CAMERA
    rescued = ingest(log, tmp_path / "rescued", fx=k.fx, fy=k.fy, cx=k.cx, cy=k.cy)
    assert rescued.outcome == "ok" and rescued.info.camera == CAMERA


COLOR, DEPTH = frames(1)[0][0], millimetres(frames(1)[0][1])
POSE = frames(1)[0][2]


def depth(**fields: Any) -> RawImage:
    """Return a depth image with some fields replaced."""
    image = raw(SECOND, DEPTH, "16UC1")
    for name, value in fields.items():
        setattr(image, name, value)
    return image


def edge(**fields: float) -> FrameTransform:
    """Return the pose of the camera with some numbers replaced; `x` to `w` are of its rotation, `far` is its place."""
    message = transform(SECOND, "map", "optical", POSE)
    message.translation.x = fields.pop("far", message.translation.x)
    for name, value in fields.items():
        setattr(message.rotation, name, value)
    return message


LEFT_OUT: dict[str, tuple[dict[str, Any], dict[str, int]]] = {
    "8-bit depth": (
        {"depth": None, "cam/depth": compressed(SECOND, png((DEPTH // 20).astype(np.uint8)), kind="png")},
        {"depth_not_16_bit": 1},  # named as depth, so that it is not taken for a picture
    ),
    "all zero": ({"depth": raw(SECOND, DEPTH * 0, "16UC1")}, {"no_valid_depth": 1}),
    "all 65535": ({"depth": raw(SECOND, DEPTH * 0 + 65535, "16UC1")}, {"no_valid_depth": 1}),
    "all NaN": ({"depth": raw(SECOND, np.full(DEPTH.shape, np.nan, "<f4"), "32FC1")}, {"no_valid_depth": 1}),
    "too few bytes": ({"depth": depth(data=depth().data[:-1])}, {"undecodable_depth": 1}),
    "rows of three bytes": ({"depth": depth(step=3)}, {"undecodable_depth": 1}),
    "no size": ({"depth": depth(width=0, height=0)}, {"undecodable_depth": 1}),
    "cut colour": ({"color": compressed(SECOND, jpeg(COLOR)[:400])}, {"undecodable_color": 1}),
    "no colour bytes": ({"color": compressed(SECOND, b"")}, {"undecodable_color": 1}),
    "words as colour": ({"color": compressed(SECOND, b"not an image at all")}, {"undecodable_color": 1}),
    "other shape": ({"color": compressed(SECOND, jpeg(np.zeros((96, 96, 3), np.uint8)))}, {"size_mismatch": 1}),
    "a pose beyond the horizon": ({"tf": edge(far=1e300)}, {"implausible_pose": 1}),
}


@pytest.mark.parametrize("case", LEFT_OUT)
def test_frames_that_cannot_be_used_are_counted(tmp_path: Path, case: str) -> None:
    replaced, drops = LEFT_OUT[case]
    sequence = ingest(_log(tmp_path / "log.mcap", **replaced), tmp_path / "out")
    assert sequence.outcome == "empty" and sequence.info.drops == drops
    assert all(reason in sequence.summary["reason"] for reason in drops)


@pytest.mark.parametrize(
    ("images", "drops"),
    [
        ([depth(width=0, height=0), raw(2 * SECOND, DEPTH, "16UC1")], {"undecodable_depth": 1}),
        ([raw(SECOND, DEPTH, "16UC1"), raw(2 * SECOND, DEPTH[::2, ::2], "16UC1")], {"size_mismatch": 1}),
    ],
)
def test_one_of_two_depth_images_is_used(tmp_path: Path, images: list[RawImage], drops: dict[str, int]) -> None:
    stamps = (SECOND, 2 * SECOND)
    log = _log(
        tmp_path / "log.mcap",
        tf=[transform(stamp, "map", "optical", POSE) for stamp in stamps],
        color=[compressed(stamp, jpeg(COLOR)) for stamp in stamps],
        depth=images,
    )
    info = ingest(log, tmp_path / "out").info
    assert info.frame_count == 1 and info.drops == drops and info.camera == CAMERA


def test_topics_of_unknown_encoding_are_listed_and_the_others_used(tmp_path: Path) -> None:
    path = _log(tmp_path / "a.mcap", depth=raw(SECOND, DEPTH, "16UC7"))
    assert ingest(path, tmp_path / "a").info.streams == ("color", "pose")
    source = open_log(path, IngestParameters())
    stream = next(stream for stream in source.streams if stream.name == "/depth")
    source.close()
    assert stream.role == "unreadable" and "unknown encoding '16UC7'" in stream.detail
    with pytest.raises(BadInput, match=r"no images that can be used \(/depth: unknown encoding"):
        ingest(_log(tmp_path / "b.mcap", depth=raw(SECOND, DEPTH, "16UC7"), color=None), tmp_path / "b")
    assert ingest(_log(tmp_path / "c.mcap", color=None), tmp_path / "c").info.streams == ("depth", "pose")
    with pytest.raises(BadInput, match=r"no depth images on topic '/deep'.*/depth"):
        ingest(_log(tmp_path / "d.mcap"), tmp_path / "d", depth_topic="/deep")


def test_log_without_any_message_is_empty(tmp_path: Path) -> None:
    with FrameWriter(tmp_path / "log.mcap", CAMERA):
        pass
    sequence = ingest(tmp_path / "log.mcap", tmp_path / "out")
    assert sequence.outcome == "empty" and "no frames in the log" in sequence.summary["reason"]


def test_trees_that_are_none(tmp_path: Path) -> None:
    loop = [transform(SECOND, "a", "optical", np.eye(4)), transform(SECOND, "optical", "a", np.eye(4))]
    with pytest.raises(BadInput, match="loop"):
        ingest(_log(tmp_path / "a.mcap", tf=loop), tmp_path / "a")
    own = transform(SECOND, "optical", "optical", np.eye(4))
    info = ingest(_log(tmp_path / "b.mcap", tf=own), tmp_path / "b").info
    assert "pose" not in info.streams and "from frame 'optical' to 'optical' is none" in info.damage[0]


def test_two_parents_of_the_camera_are_refused_until_one_is_chosen(tmp_path: Path) -> None:
    first, second = transform_from_yaw(0.1, np.ones(3)), transform_from_yaw(0.2, np.zeros(3))
    parents = [transform(SECOND, "a", "optical", first), transform(SECOND, "b", "optical", second)]
    log = _log(tmp_path / "log.mcap", tf=parents)
    with pytest.raises(BadInput, match="'optical', above the camera, has two parents, 'a' and 'b'.*--world-frame"):
        ingest(log, tmp_path / "refused")
    for world, pose in (("a", first), ("b", second)):
        sequence = ingest(log, tmp_path / world, world_frame=world, gravity="none")
        with FrameReader(sequence.path("frames.mcap")) as reader:
            np.testing.assert_allclose(reader.read(0).world_from_camera, pose, atol=1e-9)
    elsewhere = [
        transform(SECOND, "a", "gripper", first),
        transform(SECOND, "b", "gripper", second),
        transform(SECOND, "map", "optical", first),
    ]
    info = ingest(_log(tmp_path / "arm.mcap", tf=elsewhere), tmp_path / "arm").info
    assert "pose" in info.streams and any("'gripper' has 2 parents: 'a' and 'b'" in note for note in info.notes)


@pytest.mark.parametrize(
    "rotation", [{"x": 0, "y": 0, "z": 0, "w": 0}, {"x": float("nan"), "w": 1}, {"x": 0, "y": 0, "z": 0, "w": 5}]
)
def test_transforms_that_are_not_rigid_are_left_out(tmp_path: Path, rotation: dict[str, float]) -> None:
    info = ingest(_log(tmp_path / "log.mcap", tf=edge(**rotation)), tmp_path / "out").info
    assert "pose" not in info.streams
    assert "1 of 1 messages of /tf do not decode" in info.damage[0]


def test_messages_that_are_no_protobuf_are_counted(tmp_path: Path) -> None:
    path = _log(tmp_path / "log.mcap")
    data = bytearray(path.read_bytes())
    place = data.find(b"optical", data.find(b"map"))
    data[place - 1] = 0xFF  # the length of a string: now runs over the end
    for _, start, _end in (r for r in mcap_records(bytes(data)) if r[0] == Opcode.CHUNK):
        data[start + 9 + 24 : start + 9 + 28] = bytes(4)  # no checksum, as many recorders write
    path.write_bytes(data)
    info = ingest(path, tmp_path / "out").info
    assert "1 of 1 messages of /tf do not decode" in info.damage[0] and "pose" not in info.streams
    with pytest.raises(BadInput, match="1 of 1 messages of /tf do not decode.*--damage refuse"):
        ingest(path, tmp_path / "refused", damage="refuse")


def test_any_damage_inside_messages_is_survived(tmp_path: Path) -> None:
    """Without checksums damage reaches the messages: stamps, frames, sizes, encodings, calibration, transforms."""
    options = {"compression": CompressionType.NONE, "enable_crcs": False}
    whole = write_simple_log(tmp_path / "whole.mcap", frames(3), **options).read_bytes()
    words = (b"/tf", b"map", b"optical", b"camera_info", b"16UC1", b"jpeg", b"plumb")
    sites = [place for word in words for place in range(len(whole)) if whole.startswith(word, place)]
    random, outcomes = np.random.default_rng(0), set()
    for number in range(40):
        damaged = bytearray(whole)
        for place in random.choice(sites, 3) + random.integers(-40, 80, 3):
            damaged[place % len(damaged)] = random.integers(0, 256)
        path = tmp_path / "damaged.mcap"
        path.write_bytes(damaged)
        try:
            outcomes.add(ingest(path, tmp_path / f"out{number}").outcome)
        except BadInput as error:
            assert "damaged.mcap" in str(error) or "frame" in str(error)
            outcomes.add("bad input")
    assert "ok" in outcomes


@pytest.mark.parametrize("name", ["custom-camera-model.mcap", "empty-file.bag"])
def test_real_logs_that_cannot_be_used_are_refused_by_name(tmp_path: Path, name: str) -> None:
    with pytest.raises(BadInput, match=name):
        ingest(real_data("logs") / name, tmp_path / "out")
