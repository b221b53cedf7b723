"""Logs of strangers: up, scale and stereo sign that the data show, stamps and file names, and what neighbours read.

Right values come from the ray caster: all depth points lie within 3 mm of the true surfaces when the first pose is laid
on the true one (more where the unit itself is coarser), and true up is z to a degree.
"""

from __future__ import annotations

import json
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from PIL import Image
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.kit.formats.frames import FrameReader
from scenewright.stages.kit.geometry.transforms import quaternion_of

from tests.strangers import rooms
from tests.strangers.calls import CLEAR_CODES, Said, advised, call, first_option, inspect
from tests.strangers.logs import (
    orientation,
    units,
    with_orientation,
    write_bag,
    write_images,
    write_nerfstudio,
    write_tum,
)
from tests.strangers.rooms import CAMERA, Y_UP, depth_error, path, pitched, shots, tilt
from tests.unit.ingest.folder_writers import tum_line
from tests.unit.ingest.message_logs import RosRecorder, recorder
from tests.unit.ingest.tiny_room import jpeg, png


def heading(degrees: float) -> np.ndarray:
    """log_from_world (4, 4) of a world that is level and looks somewhere: SLAM starts where the robot stood."""
    cosine, sine = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    turned = np.eye(4)
    turned[:2, :2] = [[cosine, -sine], [sine, cosine]]
    turned[:3, 3] = [0.4, -0.7, 0.0]
    return turned


def ingest(log: Path, out: Path, *options: str | Path) -> Said:
    return call("ingest", "--log", log, "--out", out, *options)


def read(log: Path, out: Path, *options: str | Path) -> Said:
    said = ingest(log, out, *options)
    assert said.code == 0, said.text
    return said


# ---- 1: up ---------------------------------------------------------------------------------------------------------


def upright(log: Path, poses: np.ndarray, tmp_path: Path, axis: str | None = "z") -> None:
    """Up is right within a degree; or a warning of `ingest` speaks of --up, and following it makes it right.

    `axis` is what the user of the log knows to be up, for a warning that asks for it; None: no axis of the log is.
    """
    said = read(log, tmp_path / "sequence")
    assert depth_error(tmp_path / "sequence", poses) < 0.003
    if tilt(tmp_path / "sequence", poses) < 1.0:
        return
    warnings = " ".join(line for line in said.err.splitlines() if line.startswith("WARNING"))
    off = f"up is {tilt(tmp_path / 'sequence', poses):.1f} deg off without a warning that speaks of --up: {said.err}"
    assert "--up" in warnings, off
    named = [value.lstrip("+") for value in advised(warnings, "--up") if value.strip("+-") in ("x", "y", "z")]
    if named or axis:
        read(log, tmp_path / "again", "--gravity", "given", "--up", named[0] if named else str(axis))
        assert tilt(tmp_path / "again", poses) < 1.0


def test_a_phone_that_looks_down_at_a_table_has_y_up(tmp_path: Path) -> None:
    """Phone poses with y up, looking 55 deg down: up is y of the log (jc211/NeRFCapture #4)."""
    poses = path(12, 55)
    upright(write_nerfstudio(tmp_path / "log", shots(poses, Y_UP @ heading(23))), poses, tmp_path, "y")


def test_a_phone_held_in_portrait(tmp_path: Path) -> None:
    """Landscape pictures of a phone held upright: every camera's up is level, y of the log is up
    (jc211/NeRFCapture #7)."""
    poses = path(12, 20, roll=90)
    upright(write_nerfstudio(tmp_path / "log", shots(poses, Y_UP @ heading(23))), poses, tmp_path, "y")


def test_a_head_camera_on_its_side_that_looks_down(tmp_path: Path) -> None:
    """A robot whose camera is mounted in portrait and tilts 58 deg down, map z up: no tilt
    (facebookresearch/fairo #1097)."""
    poses = path(12, 58, roll=90)
    upright(write_bag(tmp_path / "log", shots(poses, heading(23))), poses, tmp_path)


def test_a_camera_mounted_upside_down(tmp_path: Path) -> None:
    """A camera mounted upside down, its mounting in the transforms, map z up: no tilt (realsenseai/librealsense
    #13121, luxonis/depthai #200)."""
    poses = path(12, 25, roll=180)
    upright(write_bag(tmp_path / "log", shots(poses, heading(23))), poses, tmp_path)


def test_a_camera_that_looks_at_the_ceiling(tmp_path: Path) -> None:
    """An upward facing camera sees no floor; the log's z is up (uzh-rpg/rpg_svo #149)."""
    poses = path(12, -35)
    upright(write_tum(tmp_path / "log", shots(poses, heading(23))), poses, tmp_path)


def test_only_a_table_top_and_some_floor(tmp_path: Path) -> None:
    """A wrist camera over a table, 62 to 68 deg down, base frame z up: no tilt (stereolabs/zed-python-api #224)."""
    steps = np.linspace(0, 1, 12)
    poses = np.array([pitched((-0.35 + 0.5 * t, -0.7 + 0.3 * t, 1.25), 70 - 20 * t, 62 + 6 * t) for t in steps])
    upright(write_tum(tmp_path / "log", shots(poses, heading(23))), poses, tmp_path)


def test_a_bin_picking_camera_that_looks_straight_down(tmp_path: Path) -> None:
    """A camera over a bin, 88 deg down: z of the log is up (osrf/autodock #15 asks for tilted mounts)."""
    poses = path(12, 86, height=1.9)
    upright(write_bag(tmp_path / "log", shots(poses, heading(23))), poses, tmp_path)


@pytest.mark.parametrize("pitch", [30, 44])
def test_a_world_that_is_the_first_camera(tmp_path: Path, pitch: int) -> None:
    """Odometry starts at the identity: no axis of the log is up, the floor tells it (isl-org/Open3D #3276)."""
    poses = path(12, pitch)
    upright(write_tum(tmp_path / "log", shots(poses, np.linalg.inv(poses[0]))), poses, tmp_path, None)


# ---- 1: scale and byte order -----------------------------------------------------------------------------------------


def mended(log: Path, poses: np.ndarray, tmp_path: Path, option: str, within: float = 0.003) -> None:
    """The log is read right at once; or `inspect` names this option first, and following it makes it right."""
    if ingest(log, tmp_path / "sequence").code == 0 and depth_error(tmp_path / "sequence", poses) < within:
        return
    report, said = inspect(log, "--frames", "8")
    text = " ".join(str(finding["fix"]) for finding in report.get("findings", [])) + " " + said.err
    first = first_option(text, "--depth-scale", "--pose-scale")
    assert first == option, f"{first} is advised, {option} is right: {text}"
    read(log, tmp_path / "again", option, advised(text, option)[0])
    assert depth_error(tmp_path / "again", poses) < within


POSES = path(12)


@pytest.mark.parametrize("per_metre", [4000, 8000])
def test_depth_in_quarters_and_eighths_of_a_millimetre(tmp_path: Path, per_metre: int) -> None:
    """Depth stored as 4000 a metre (yindaz/DeepCompletionRelease #9), or shifted by three bits
    (laughtervv/DepthAwareCNN #34), poses in metres: --depth-scale, to the half per cent."""
    log = write_images(tmp_path / "log", shots(POSES), per_metre=per_metre)
    mended(log, POSES, tmp_path, "--depth-scale", within=0.015)


def test_depth_in_sixty_five_and_a_half_a_metre(tmp_path: Path) -> None:
    """depth * 65535 / 1000, so 15 mm a step: --depth-scale 65.535 to a per cent (y-zheng18/point_odyssey #14)."""
    log = write_images(tmp_path / "log", shots(POSES), per_metre=65.535)
    mended(log, POSES, tmp_path, "--depth-scale", within=0.03)


def test_a_bag_with_depth_five_thousand_a_metre(tmp_path: Path) -> None:
    """A TUM sequence turned into a bag without changing its depth: --depth-scale 5000 (BatFaceWayne/POV_Surgery
    #4)."""
    log = write_bag(tmp_path / "log", shots(POSES), pixels=lambda depth: units(depth, 5000))
    mended(log, POSES, tmp_path, "--depth-scale", within=0.015)


@pytest.mark.parametrize(("scale", "what"), [(1000, "millimetres"), (100, "centimetres")])
def test_positions_in_other_units(tmp_path: Path, scale: int, what: str) -> None:
    """Right depth, positions in mm (bluestyle97/PNVS #1) or cm (city-super/MatrixCity #25): --pose-scale."""
    log = write_tum(tmp_path / "log", shots(POSES), scale=scale)
    mended(log, POSES, tmp_path, "--pose-scale")


@pytest.mark.parametrize("scale", [3.7, 0.31])
def test_structure_from_motion_has_a_scale_of_its_own(tmp_path: Path, scale: float) -> None:
    """Metric depth beside poses of COLMAP: the poses are to be scaled, though 1000 / 3.7 is near 256
    (cdcseacave/openMVS #1062)."""
    log = write_nerfstudio(tmp_path / "log", shots(POSES), scale=scale)
    mended(log, POSES, tmp_path, "--pose-scale", within=0.012)


def bytes_are_spoken_of(log: Path, tmp_path: Path) -> None:
    if ingest(log, tmp_path / "sequence").code == 0 and depth_error(tmp_path / "sequence", POSES) < 0.003:
        return
    report, said = inspect(log, "--frames", "8")
    text = Said(0, json.dumps(report.get("findings", "")), said.err).text
    assert Said(0, text, "").names("byte|endian"), text
    for option in ("--depth-scale", "--pose-scale"):
        for value in advised(text, option):
            read(log, tmp_path / option.strip("-"), option, value)
            assert depth_error(tmp_path / option.strip("-"), POSES) < 0.02, f"{option} {value} is advised and wrong"


def test_a_pgm_that_is_little_endian(tmp_path: Path) -> None:
    """16-bit PGM is big-endian; many write it as the machine has it: bytes are named (nothings/stb #1828)."""

    def little(file: Path, depth: np.ndarray) -> None:
        head = f"P5\n{CAMERA.width} {CAMERA.height}\n65535\n".encode()
        file.with_suffix(".pgm").write_bytes(head + units(depth, 1000).astype("<u2").tobytes())

    bytes_are_spoken_of(write_images(tmp_path / "log", shots(POSES), depth=little), tmp_path)


def test_a_camera_that_sends_big_endian_without_the_flag(tmp_path: Path) -> None:
    """Mono16 in big-endian where little is declared: bytes are named (AravisProject/aravis #924)."""
    log = write_bag(tmp_path / "log", shots(POSES), pixels=lambda depth: units(depth, 1000).byteswap())
    bytes_are_spoken_of(log, tmp_path)


# ---- 1: stereo -------------------------------------------------------------------------------------------------------

EYES = Camera(width=320, height=240, fx=260.0, fy=260.0, cx=159.5, cy=119.5)
BASELINE = 0.06


def right_of(pose: np.ndarray) -> np.ndarray:
    moved = pose.copy()
    moved[:3, 3] += BASELINE * pose[:3, 0]
    return moved


def stereo_poses() -> np.ndarray:
    return path(2, 20)


def stereo_depth_is_right(sequence: Path, out: Path) -> bool:
    """Return whether `disparity` gives the true depth: median error under 3 %."""
    return disparity(sequence, out)[1]


def disparity(sequence: Path, out: Path) -> tuple[Said, bool]:
    """Return what `disparity` said, and whether it gives the true depth."""
    said = call("disparity", "--sequence", sequence, "--out", out)
    if said.code != 0:
        return said, False
    with FrameReader(out / "frames.mcap") as reader:
        frames = [frame.depth for frame in reader.frames(streams=("depth",))]
    true = [rooms.seen(pose, EYES)[1] for pose in stereo_poses()]
    ratios = [image[image > 0] / wanted[image > 0] for image, wanted in zip(frames, true, strict=True)]
    together = np.concatenate(ratios)
    enough = len(together) > 0.3 * sum(image.size for image in frames)
    return said, bool(enough and abs(np.median(together) - 1) < 0.03)


def stereo_is_right_or_clear(log: Path, tmp_path: Path) -> None:
    """Within three commands that the messages give, depth is right; or one says what lies.

    Exchanging the eyes may be advised once: who does it and is told to exchange them again goes in a circle.
    """
    options: list[str] = []
    exchanged = False
    for turn in range(3):
        sequence = tmp_path / f"sequence{turn}"
        said = ingest(log, sequence, *options)
        if said.code == 0:
            said, right = disparity(sequence, tmp_path / f"disparity{turn}")
            if right:
                return
        assert said.code in CLEAR_CODES, f"wrong depth without a word: {said.text}"
        assert said.names("baseline|apart|P\\[3\\]|\\bTx\\b|T_cn_cnm1|sign|swapped|exchang"), said.text
        line = [text for text in said.err.splitlines() if text.startswith("error")][-1]
        options = []
        for option in ("--color-topic", "--right-topic", "--baseline", "--baseline-sign"):
            options += [word for value in advised(line, option)[:1] for word in (option, value)]
        exchanges = Said(0, line, "").names("swap|exchang") and "--baseline" not in " ".join(options)
        assert not (exchanges and exchanged), f"sent in a circle: {said.text}"
        exchanged = exchanged or exchanges
        if not options:
            return  # it says what is wrong, and promises nothing
    raise AssertionError("no command that was given leads to the depth")


def write_stereo_bag(folder: Path, left_p3: float, right_p3: float, dialect: str = "ros1") -> Path:
    """A rectified pair; P[3] of both calibrations as given."""
    poses = stereo_poses()
    with recorder(folder, dialect) as log:
        for k, pose in enumerate(poses):
            stamp = 1_700_000_000_000_000_000 + k * 100_000_000
            log.transform("/tf", stamp, "map", "left_optical", pose)
            for eye, camera_pose, shift in (("left", pose, left_p3), ("right", right_of(pose), right_p3)):
                c = EYES
                p = [c.fx, 0.0, c.cx, shift, 0.0, c.fy, c.cy, 0.0, 0.0, 0.0, 1.0, 0.0]
                log.info(f"/stereo/{eye}/camera_info", stamp, "left_optical", c, P=p)
                log.image(f"/stereo/{eye}/image_rect", stamp, rooms.seen(camera_pose, c)[0], "rgb8", "left_optical")
        return log.path


def write_stereo_folder(root: Path, names: tuple[str, str] = ("left", "right")) -> Path:
    for name, mover in zip(names, (lambda pose: pose, right_of), strict=True):
        (root / name).mkdir(parents=True)
        for k, pose in enumerate(stereo_poses()):
            (root / name / f"{k:06d}.png").write_bytes(png(rooms.seen(mover(pose), EYES)[0]))
    return root


def test_a_right_pair_as_it_should_be(tmp_path: Path) -> None:
    """The same pair with P[3] = -fx B in the right eye, so that the tests below mean something: 0.06 m."""
    log = write_stereo_bag(tmp_path / "log", 0.0, -EYES.fx * BASELINE)
    read(log, tmp_path / "sequence")
    assert stereo_depth_is_right(tmp_path / "sequence", tmp_path / "disparity")


def test_the_baseline_stands_in_the_left_calibration(tmp_path: Path) -> None:
    """P[3] is -fx B in the left camera_info and 0 in the right one; pictures are not exchanged: 0.06 m
    (introlab/rtabmap_ros #108)."""
    stereo_is_right_or_clear(write_stereo_bag(tmp_path / "log", -EYES.fx * BASELINE, 0.0), tmp_path)


def test_the_baseline_in_millimetres(tmp_path: Path) -> None:
    """P[3] was written in pixel millimetres: 60 m apart is no pair of eyes (introlab/rtabmap_ros #93)."""
    stereo_is_right_or_clear(write_stereo_bag(tmp_path / "log", 0.0, -EYES.fx * BASELINE * 1000), tmp_path)


def test_a_camchain_with_its_translation_turned_round(tmp_path: Path) -> None:
    """T_cn_cnm1 multiplied by -1, as the thread suggests: 0.06 m, or it says so (ethz-asl/kalibr #408)."""
    log = write_stereo_folder(tmp_path / "log")
    k = EYES
    camera = (
        f"intrinsics: [{k.fx}, {k.fy}, {k.cx}, {k.cy}]\n  distortion_coeffs: [0, 0, 0, 0]\n  resolution: [320, 240]"
    )
    matrix = [[1, 0, 0, BASELINE], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
    (log / "camchain.yaml").write_text(f"cam0:\n  {camera}\ncam1:\n  {camera}\n  T_cn_cnm1: {matrix}\n")
    stereo_is_right_or_clear(log, tmp_path)


def test_projections_with_the_other_sign(tmp_path: Path) -> None:
    """calib.txt in KITTI's form with +fx B in P1: 0.06 m, or it says so (introlab/rtabmap_ros #517)."""
    log = write_stereo_folder(tmp_path / "log", ("image_0", "image_1"))
    rows = []
    for number, shift in enumerate((0.0, EYES.fx * BASELINE)):
        row = [EYES.fx, 0, EYES.cx, shift, 0, EYES.fy, EYES.cy, 0, 0, 0, 1, 0]
        rows.append(f"P{number}: " + " ".join(f"{value:.9e}" for value in row))
    (log / "calib.txt").write_text("\n".join(rows) + "\n")
    stereo_is_right_or_clear(log, tmp_path)


# ---- 1: scans --------------------------------------------------------------------------------------------------------


def room_mesh(scale: float, turn: np.ndarray) -> trimesh.Trimesh:
    """The room's surfaces with a vertex every 6 cm."""
    parts = []
    for number, bounds in enumerate(rooms.SCENE):
        box = trimesh.creation.box(bounds=bounds).subdivide_to_size(0.06)
        if number == 0:
            box.invert()
        parts.append(box)
    mesh = trimesh.util.concatenate(parts)
    mesh.vertices = mesh.vertices @ turn.T * scale
    return mesh


def map_is_right(folder: Path) -> bool:
    """Return whether the floor of a map is level, at 0, and 4 x 3 m, and its ceiling 2.4 m over it."""
    document = json.loads((folder / "entities.json").read_text())
    by_class: dict[str, Any] = {entity["class_name"]: entity for entity in document["entities"]}
    if not {"floor", "ceiling"} <= set(by_class):
        return False
    low, high = (np.array(by_class["floor"][name]) for name in ("box_minimum", "box_maximum"))
    size = np.sort((high - low)[:2])
    top = by_class["ceiling"]["box_maximum"][2]
    return bool(np.allclose(size, [3.0, 4.0], atol=0.1) and abs(low[2]) < 0.1 and abs(top - 2.4) < 0.1)


def scan_is_right_or_clear(folder: Path, tmp_path: Path, *follow: str) -> None:
    """The map is right; or the command names what to say, and saying it makes it right."""
    said = call("fuse", "--from-mesh", folder, "--out", tmp_path / "map")
    if said.code == 0 and map_is_right(tmp_path / "map"):
        return
    assert said.names(*follow[::2]), f"wrong without naming {follow[::2]}: {said.text}"
    again = call("fuse", "--from-mesh", folder, *follow, "--out", tmp_path / "again")
    assert again.code == 0 and map_is_right(tmp_path / "again"), again.text


MINUS_Y = np.array([[1.0, 0, 0], [0, 0, -1.0], [0, 1.0, 0]])
"""Turns z up into -y up."""


def test_a_scan_in_metres_with_z_up(tmp_path: Path) -> None:
    """The same scan as it should be, so that the tests below mean something: 4 x 3 x 2.4 m."""
    room_mesh(1.0, np.eye(3)).export(tmp_path / "scan.ply")
    scan_is_right_or_clear(tmp_path / "scan.ply", tmp_path)


def test_a_scan_in_centimetres(tmp_path: Path) -> None:
    """A scan of a game engine's editor, 400 x 300 x 240: --unit cm (gazebosim/gz-sim #2656 is of such meshes)."""
    room_mesh(100.0, np.eye(3)).export(tmp_path / "scan.ply")
    scan_is_right_or_clear(tmp_path / "scan.ply", tmp_path, "--unit", "cm")


def test_a_scan_with_minus_y_up(tmp_path: Path) -> None:
    """A mesh of splats or of COLMAP, whose world is the first camera's: --up -y (Anttwo/SuGaR #147)."""
    room_mesh(1.0, MINUS_Y).export(tmp_path / "scan.ply")
    scan_is_right_or_clear(tmp_path / "scan.ply", tmp_path, "--up", "-y")


def test_points_in_millimetres(tmp_path: Path) -> None:
    """Points of a fusion in mm, 4000 across: --unit mm (jzhzhang/ROSEFusion #38)."""
    points, _ = trimesh.sample.sample_surface(room_mesh(1000.0, np.eye(3)), 8000, seed=0)
    np.savez(tmp_path / "scan.npz", points=points.astype(np.float32))
    scan_is_right_or_clear(tmp_path / "scan.npz", tmp_path, "--unit", "mm")


# ---- 4: trajectories and EXIF ----------------------------------------------------------------------------------------


def posed_or_clear(said: Said, sequence: Path, *words: str) -> None:
    """All frames are read with their poses, or a line names these words."""
    if said.code == 0:
        with FrameReader(sequence / "frames.mcap") as reader:
            posed = sum(frame.world_from_camera is not None for frame in reader.frames(streams=()))
        if posed == len(POSES):
            assert depth_error(sequence, POSES) < 0.003
            return
    assert said.names(*words), f"poses are lost, and {words} are not named: {said.text}"


def test_a_trajectory_in_nanoseconds_with_a_point(tmp_path: Path) -> None:
    """ORB-SLAM3 writes 1700000000000000000.000000: 12 posed frames (MichaelGrupp/evo #297)."""
    log = write_tum(tmp_path / "log", shots(POSES), poses=lambda stamp, pose: tum_line(f"{stamp}.000000", pose))
    posed_or_clear(ingest(log, tmp_path / "sequence"), tmp_path / "sequence", "groundtruth.txt", r"\bns\b|nanosecond")


def test_a_trajectory_with_commas_and_the_scalar_first(tmp_path: Path) -> None:
    """EuRoC's columns (ns, p, qw qx qy qz, with commas) under TUM's name: right, or the file and why
    (MichaelGrupp/evo #379, #159)."""

    def line(stamp: int, pose: np.ndarray) -> str:
        x, y, z, w = quaternion_of(pose)
        return ",".join([str(stamp), *(f"{value:.9f}" for value in [*pose[:3, 3], w, x, y, z])])

    log = write_tum(tmp_path / "log", shots(POSES), poses=line)
    posed_or_clear(ingest(log, tmp_path / "sequence"), tmp_path / "sequence", "groundtruth.txt", "comma|column|EuRoC")


def test_a_trajectory_that_counts_from_its_own_start(tmp_path: Path) -> None:
    """Stamps start at 1.0 s, those of the pictures in 2023: no pose fits, which is said of the file
    (koide3/glim #52)."""
    log = write_tum(
        tmp_path / "log",
        shots(POSES),
        poses=lambda stamp, pose: tum_line(f"{1 + (stamp - 1_700_000_000_000_000_000) / 1e9:.6f}", pose),
    )
    words = ("groundtruth", "12 (poses|lines)|(poses|lines).*12|no pose.*(near|fit|within)|stamp|clock")
    posed_or_clear(ingest(log, tmp_path / "sequence"), tmp_path / "sequence", *words)


def nothing(log: RosRecorder, stamp: int, pose: np.ndarray) -> None:
    """A bag without transforms."""


@pytest.mark.parametrize("unit", ["s", "ns"])
def test_ones_own_trajectory_for_a_bag(tmp_path: Path, unit: str) -> None:
    """A SLAM's text file beside a bag without transforms: `ingest --trajectory` takes it, in s and in ns
    (koide3/glim #52, MIT-SPARK/Hydra #72)."""
    log = write_bag(tmp_path / "log", shots(POSES), transforms=nothing)
    rows = []
    for k, pose in enumerate(POSES):
        stamp = 1_700_000_000_000_000_000 + k * 100_000_000
        rows.append(tum_line(str(stamp) if unit == "ns" else f"{stamp / 1e9:.6f}", pose))
    (tmp_path / "mine.txt").write_text("# timestamp tx ty tz qx qy qz qw\n" + "\n".join(rows) + "\n")
    read(log, tmp_path / "sequence", "--trajectory", tmp_path / "mine.txt")
    assert depth_error(tmp_path / "sequence", POSES) < 0.003


def stored_colors(sequence: Path) -> list[bytes]:
    """Return the JPEGs of a sequence as any other reader of MCAP finds them."""
    from mcap.reader import make_reader
    from mcap_protobuf.decoder import DecoderFactory

    with (sequence / "frames.mcap").open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        return [message.data for _, channel, _, message in reader.iter_decoded_messages(["/camera/color"])]


def pictures_are_those_of_the_depth(pictures: list[bytes], sequence: Path) -> None:
    """No picture asks another reader to turn it, and each shows what its depth shows."""
    with FrameReader(sequence / "frames.mcap") as reader:
        depths = [frame.depth for frame in reader.frames(streams=("depth",))]
    for data, depth, pose in zip(pictures, depths, POSES, strict=True):
        assert orientation(data) == 1, f"EXIF orientation {orientation(data)} is passed on"
        color, true, _ = rooms.seen(pose)
        for quarter in range(4):
            if depth.shape == np.rot90(true, quarter).shape and np.allclose(depth, np.rot90(true, quarter), atol=2e-3):
                shown = np.asarray(Image.open(BytesIO(data)).convert("RGB")).astype(int)
                assert np.abs(shown - np.rot90(color, quarter)).mean() < 12
                break
        else:
            raise AssertionError("depth is neither as recorded nor turned")


@pytest.mark.parametrize("value", [3, 8])
def test_phone_pictures_keep_no_orientation(tmp_path: Path, value: int) -> None:
    """Plain pictures of a phone held upside down (3) or upright (8), depth as stored: neither the sequence nor an
    export passes the tag on (coralnet/coralnet #107, mapillary/OpenSfM #467)."""
    log = write_images(
        tmp_path / "log", shots(POSES), color=lambda pixels: (".jpg", with_orientation(jpeg(pixels), value))
    )
    read(log, tmp_path / "sequence")
    pictures_are_those_of_the_depth(stored_colors(tmp_path / "sequence"), tmp_path / "sequence")
    for layout in ("tum", "nerfstudio"):
        assert (
            call("export", "--sequence", tmp_path / "sequence", "--layout", layout, "--out", tmp_path / layout).code
            == 0
        )
        for file in [*(tmp_path / layout).rglob("*.jpg"), *(tmp_path / layout).rglob("*.jpeg")]:
            assert orientation(file.read_bytes()) == 1, file


def test_a_bag_of_a_phone_keeps_no_orientation(tmp_path: Path) -> None:
    """CompressedImage of a phone's JPEGs with the tag: the sequence has none (Weed-AI/Weed-AI #674)."""
    log = write_bag(tmp_path / "log", shots(POSES), data=lambda pixels: with_orientation(jpeg(pixels), 6))
    read(log, tmp_path / "sequence")
    pictures_are_those_of_the_depth(stored_colors(tmp_path / "sequence"), tmp_path / "sequence")


def test_headers_of_images_without_a_stamp(tmp_path: Path) -> None:
    """An anonymizer zeroed the headers of the images, transforms keep theirs: log time counts, 3 mm, or a line
    (autowarefoundation/autoware_rosbag2_anonymizer #4, weisongwen/UrbanLoco #5)."""
    log = write_bag(tmp_path / "log", shots(POSES), header=lambda stamp: 0)
    posed_or_clear(ingest(log, tmp_path / "sequence"), tmp_path / "sequence", "stamp", "log time|header")


# ---- 5: what the neighbour reads -------------------------------------------------------------------------------------


@pytest.mark.parametrize("order", ["rgb depth", "depth rgb", "pose depth rgb"])
def test_a_list_of_pairs_is_all_there_is(tmp_path: Path, order: str) -> None:
    """associate.py's file alone, in either order, or with the poses before: 3 mm, or the file is named
    (silencht/SG-SLAM #44, jiexiong2016/GCNv2_SLAM #28)."""
    log = write_tum(tmp_path / "log", shots(POSES), lists=False)
    poses = (log / "groundtruth.txt").read_text().split("\n")
    rows = []
    for k, file in enumerate(sorted((log / "rgb").iterdir())):
        time = file.stem
        parts = {"rgb": f"{time} rgb/{file.name}", "depth": f"{time} depth/{file.name}", "pose": poses[k]}
        rows.append(" ".join(parts[name] for name in order.split()))
    (log / "associations.txt").write_text("\n".join(rows) + "\n")
    said = ingest(log, tmp_path / "sequence")
    posed_or_clear(said, tmp_path / "sequence", "associations.txt|rgb.txt")


def test_float_depth_in_metres_in_transforms_json(tmp_path: Path) -> None:
    """.npy depth in metres, float16 as phones write it, without depth_unit_scale_factor: 3 mm, or --depth-scale 1
    (marek-simonik/record3d #53)."""

    def half(stem: Path, depth: np.ndarray) -> str:
        np.save(stem.with_suffix(".npy"), depth.astype(np.float16))
        return ".npy"

    mended(write_nerfstudio(tmp_path / "log", shots(POSES), depth=half), POSES, tmp_path, "--depth-scale")


def test_float_depth_in_millimetres(tmp_path: Path) -> None:
    """.npy of float32 in mm: 3 mm, or --depth-scale 1000, and never 2000 m without a word (mit-acl/roman #53)."""
    log = write_images(
        tmp_path / "log",
        shots(POSES),
        depth=lambda file, depth: np.save(file.with_suffix(".npy"), (depth * 1000).astype(np.float32)),
    )
    mended(log, POSES, tmp_path, "--depth-scale")


def test_poses_with_stamps_in_milliseconds(tmp_path: Path) -> None:
    """Pictures and poses stamped with 13 digits: 12 posed frames (facebookresearch/projectaria_tools #114 asks for
    such stamps)."""
    names = [str(1_700_000_000_000 + 100 * k) for k in range(len(POSES))]
    log = write_images(tmp_path / "log", shots(POSES), names=names.__getitem__, posed=False)
    (log / "poses.txt").write_text("\n".join(tum_line(name, pose) for name, pose in zip(names, POSES, strict=True)))
    posed_or_clear(ingest(log, tmp_path / "sequence"), tmp_path / "sequence", "poses.txt", "stamp|time")


@pytest.mark.parametrize(
    ("kind", "name"), [("orb-slam", "TUM1.yaml"), ("camodocal", "cam0_pinhole.yaml"), ("ros", "ost.yaml")]
)
def test_calibration_files_of_one_camera(tmp_path: Path, kind: str, name: str) -> None:
    """ORB-SLAM's settings (raulmur/ORB_SLAM2 #556), camodocal's file (HKUST-Aerial-Robotics/GVINS-Dataset #7) or
    camera_calibration's (ros-perception/image_pipeline #840) beside the pictures: 3 mm, or the file is named."""
    log = write_images(tmp_path / "log", shots(POSES), intrinsics=False)
    k = CAMERA
    text = {
        "orb-slam": f'%YAML:1.0\n---\nCamera.type: "PinHole"\nCamera.fx: {k.fx}\nCamera.fy: {k.fy}\nCamera.cx: {k.cx}\n'
        f"Camera.cy: {k.cy}\nCamera.k1: 0.0\nCamera.width: {k.width}\nCamera.height: {k.height}\n"
        "DepthMapFactor: 1000.0\n",
        "camodocal": f"%YAML:1.0\n---\nmodel_type: PINHOLE\ncamera_name: cam0\nimage_width: {k.width}\n"
        f"image_height: {k.height}\ndistortion_parameters:\n   k1: 0.0\n   k2: 0.0\n   p1: 0.0\n   p2: 0.0\n"
        f"projection_parameters:\n   fx: {k.fx}\n   fy: {k.fy}\n   cx: {k.cx}\n   cy: {k.cy}\n",
        "ros": f"image_width: {k.width}\nimage_height: {k.height}\ncamera_name: head\n"
        "camera_matrix:\n  rows: 3\n  cols: 3\n"
        f"  data: [{k.fx}, 0, {k.cx}, 0, {k.fy}, {k.cy}, 0, 0, 1]\ndistortion_model: plumb_bob\n"
        "distortion_coefficients:\n  rows: 1\n  cols: 5\n  data: [0, 0, 0, 0, 0]\n",
    }[kind]
    (log / name).write_text(text)
    posed_or_clear(ingest(log, tmp_path / "sequence"), tmp_path / "sequence", name)


def test_backslashes_before_the_depth_too(tmp_path: Path) -> None:
    """transforms.json written on Windows, both paths with backslashes: 12 frames (nerfstudio-project/nerfstudio
    #1278 mixes them)."""
    log = write_nerfstudio(tmp_path / "log", shots(POSES))
    document = json.loads((log / "transforms.json").read_text())
    for frame in document["frames"]:
        for name in ("file_path", "depth_file_path"):
            frame[name] = ".\\" + frame[name].replace("/", "\\")
    (log / "transforms.json").write_text(json.dumps(document))
    posed_or_clear(ingest(log, tmp_path / "sequence"), tmp_path / "sequence", "backslash|separator")


def test_transforms_of_the_mount_are_missing(tmp_path: Path) -> None:
    """The bag has map -> odom -> base_link and no /tf_static: the frames and /tf_static are named
    (foxglove/foxglove-sdk #834 records a part of the topics)."""

    def base(log: RosRecorder, stamp: int, pose: np.ndarray) -> None:
        log.transform("/tf", stamp, "map", "odom", np.eye(4))
        log.transform("/tf", stamp, "odom", "base_link", pose)

    log = write_bag(tmp_path / "log", shots(POSES), transforms=base)
    said = ingest(log, tmp_path / "sequence")
    assert said.names("camera_optical", "base_link", "/tf_static"), said.text
