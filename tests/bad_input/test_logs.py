"""Damaged and lying logs: refused with what was found, or frames left out and counted. Never a raw exception."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
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
from tests.unit.ingest.tiny_room import CAMERA, frames, jpeg, millimetres, png, write_posed_images, write_redwood

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


@pytest.mark.parametrize("content", [b"", b"\x89MCAP0\r\n", b"#ROSBAG V2.0\n" + bytes(100)])
def test_files_that_are_no_mcap(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "log.mcap"
    path.write_bytes(content)
    with pytest.raises(BadInput):
        ingest(path, tmp_path / "out")


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


DEPTH = millimetres(frames(1)[0][1])
BAD_IMAGES = {
    "8-bit depth": ({"depth": compressed(SECOND, png((DEPTH // 20).astype(np.uint8)), kind="png")}, "depth_not_16_bit"),
    "all zero": ({"depth": raw(SECOND, DEPTH * 0, "16UC1")}, "no_valid_depth"),
    "all 65535": ({"depth": raw(SECOND, DEPTH * 0 + 65535, "16UC1")}, "no_valid_depth"),
    "all NaN": ({"depth": raw(SECOND, np.full(DEPTH.shape, np.nan, "<f4"), "32FC1")}, "no_valid_depth"),
    "cut colour": ({"color": compressed(SECOND, jpeg(frames(1)[0][0])[:400])}, "undecodable_color"),
    "no colour bytes": ({"color": compressed(SECOND, b"")}, "undecodable_color"),
    "words as colour": ({"color": compressed(SECOND, b"not an image at all")}, "undecodable_color"),
    "other shape": ({"color": compressed(SECOND, jpeg(np.zeros((96, 96, 3), np.uint8)))}, "size_mismatch"),
}


@pytest.mark.parametrize("case", BAD_IMAGES)
def test_images_that_cannot_be_used_are_counted(tmp_path: Path, case: str) -> None:
    replaced, reason = BAD_IMAGES[case]
    if case == "8-bit depth":  # named as depth, so that it is not taken for a picture
        replaced = {"depth": None, "cam/depth": replaced["depth"]}
    sequence = ingest(_log(tmp_path / "log.mcap", **replaced), tmp_path / "out")
    assert sequence.outcome == "empty"
    assert sequence.info.drops == {reason: 1}
    assert reason in sequence.summary["reason"]


def test_raw_images_with_too_few_bytes_or_no_size(tmp_path: Path) -> None:
    short = raw(SECOND, DEPTH, "16UC1")
    short.data = short.data[:-1]
    assert ingest(_log(tmp_path / "a.mcap", depth=short), tmp_path / "a").info.drops == {"undecodable_depth": 1}
    flat = raw(SECOND, DEPTH, "16UC1")
    flat.step = 3
    assert ingest(_log(tmp_path / "b.mcap", depth=flat), tmp_path / "b").info.drops == {"undecodable_depth": 1}
    nothing = raw(SECOND, DEPTH, "16UC1")
    nothing.width = nothing.height = 0
    assert ingest(_log(tmp_path / "c.mcap", depth=nothing), tmp_path / "c").info.drops == {"undecodable_depth": 1}
    later = raw(2 * SECOND, DEPTH, "16UC1")
    color = [compressed(stamp, jpeg(frames(1)[0][0])) for stamp in (SECOND, 2 * SECOND)]
    info = ingest(_log(tmp_path / "d.mcap", depth=[nothing, later], color=color), tmp_path / "d").info
    assert info.frame_count == 1 and info.camera == CAMERA


def test_depth_of_another_size_within_a_log(tmp_path: Path) -> None:
    color, depth, pose = frames(1)[0]
    log = _log(
        tmp_path / "log.mcap",
        tf=[transform(SECOND, "map", "optical", pose), transform(2 * SECOND, "map", "optical", pose)],
        color=[compressed(SECOND, jpeg(color)), compressed(2 * SECOND, jpeg(color))],
        depth=[raw(SECOND, DEPTH, "16UC1"), raw(2 * SECOND, DEPTH[::2, ::2], "16UC1")],
    )
    info = ingest(log, tmp_path / "out").info
    assert info.frame_count == 1 and info.drops == {"size_mismatch": 1}


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


@pytest.mark.parametrize("quaternion", [(0, 0, 0, 0), (float("nan"), 0, 0, 1), (0, 0, 0, 5)])
def test_transforms_that_are_not_rigid_are_left_out(tmp_path: Path, quaternion: tuple[float, ...]) -> None:
    pose = frames(1)[0][2]
    bad = transform(SECOND, "map", "optical", pose)
    bad.rotation.x, bad.rotation.y, bad.rotation.z, bad.rotation.w = quaternion
    info = ingest(_log(tmp_path / "log.mcap", tf=bad), tmp_path / "out").info
    assert "pose" not in info.streams
    assert "1 of 1 messages of /tf do not decode" in info.damage[0]


def test_poses_beyond_the_horizon_are_left_out(tmp_path: Path) -> None:
    far = frames(1)[0][2].copy()
    far[0, 3] = 1e300
    log = _log(tmp_path / "log.mcap", tf=transform(SECOND, "map", "optical", far))
    assert ingest(log, tmp_path / "out").info.drops == {"implausible_pose": 1}


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


# --- folders ---------------------------------------------------------------------------------------------------


def test_damaged_trajectories_of_folders(tmp_path: Path) -> None:
    log = write_redwood(tmp_path / "redwood", frames(2))
    text = (log / "trajectory.log").read_text()
    for number, broken in enumerate([text[:-30], "0 0 1\n", text + text, text.replace("0", "x", 1), ""]):
        (log / "trajectory.log").write_text(broken)
        if broken == "":
            assert "pose" not in ingest(log, tmp_path / f"out{number}").info.streams
        else:
            with pytest.raises(BadInput, match="trajectory.log"):
                ingest(log, tmp_path / f"out{number}")


def test_mirrored_and_endless_poses_of_folders_are_counted(tmp_path: Path) -> None:
    recorded = frames(3)
    recorded[0][2][:3, 0] *= -1
    recorded[1][2][0, 3] = np.nan
    info = ingest(write_redwood(tmp_path / "log", recorded), tmp_path / "out").info
    assert info.drops == {"non_finite_pose": 1, "non_rigid_pose": 1} and info.frame_count == 1


def test_posed_images_need_a_pose_for_each(tmp_path: Path) -> None:
    log = write_posed_images(tmp_path / "log", frames(3))
    lines = (log / "pose.txt").read_text().splitlines()
    options = {"fx": 80.0, "fy": 80.0, "cx": 47.5, "cy": 35.5}
    (log / "pose.txt").write_text("\n".join(lines[:2]))
    with pytest.raises(BadInput, match="2 poses for 3 images"):
        ingest(log, tmp_path / "a", **options)
    (log / "pose.txt").write_text("\n".join([lines[0], "0 0 0 0 0 0 0", "nan 0 0 0 0 0 1"]))
    assert ingest(log, tmp_path / "b", **options).info.drops == {"non_finite_pose": 1, "non_rigid_pose": 1}
    (log / "pose.txt").write_text("1 2 3\n" * 3)
    with pytest.raises(BadInput, match="3 columns, expected 7"):
        ingest(log, tmp_path / "c", **options)


def test_unequal_numbers_of_colour_and_depth(tmp_path: Path) -> None:
    log = write_redwood(tmp_path / "log", frames(3))
    (log / "image" / "00001.jpg").unlink()
    with pytest.raises(BadInput, match="2 colour and 3 depth"):
        ingest(log, tmp_path / "out")


def test_palette_colour_is_read_and_palette_depth_refused(tmp_path: Path) -> None:
    from PIL import Image

    log = write_posed_images(tmp_path / "log", frames(2))
    picture = Image.fromarray(frames(1)[0][0]).convert("P")
    picture.save(log / "color" / "1.png")
    (log / "depth" / "2.pgm").unlink()
    picture.save(log / "depth" / "2.png")
    sequence = ingest(log, tmp_path / "out", fx=80.0, fy=80.0, cx=47.5, cy=35.5, gravity="none")
    assert sequence.info.drops == {"depth_not_16_bit": 1} and sequence.info.frame_count == 1
    with FrameReader(sequence.path("frames.mcap")) as reader:
        assert reader.read(0).color[..., 0].mean() > 150 > reader.read(0).color[..., 2].mean() + 50
