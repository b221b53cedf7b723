"""One take, written by an independent hand as three apps write it, is one sequence, to the millimetre."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from scenewright.schemas.errors import BadInput
from scenewright.schemas.sequence import Sequence
from scenewright.stages.ingest.confidence_levels import deviation_of_levels
from scenewright.stages.ingest.detection import open_log
from scenewright.stages.ingest.folders.quarter_turns import quarters_to_upright, turned_camera, turned_pose
from scenewright.stages.ingest.parameters import IngestParameters
from scenewright.stages.kit.formats.foxglove import decode_color
from scenewright.stages.kit.formats.frames import FrameReader
from scenewright.stages.kit.geometry.cameras import back_project, project
from scenewright.stages.kit.geometry.transforms import apply, inverse, look_at

from tests.real_data import real_data
from tests.unit.ingest.folder_writers import write_colmap, write_nerfstudio, write_scannet
from tests.unit.ingest.loading import loaded_frames
from tests.unit.ingest.phone_writers import (
    ARKIT_FROM_ROOM,
    DEPTH,
    FULL,
    Take,
    unpack_r3d,
    write_arkit_scenes,
    write_nerfcapture,
    write_polycam,
    write_r3d,
    write_record3d_export,
    write_scanner_app,
    write_scannetpp,
    write_stray_scanner,
)
from tests.unit.ingest.running import ingest
from tests.unit.ingest.tiny_room import CAMERA, frames, room_depth

WRITERS: dict[str, tuple[str, Callable[[Path, Take], Path]]] = {
    "stray": ("stray-scanner", lambda root, take: write_stray_scanner(root, take)),
    "old-stray": ("stray-scanner", lambda root, take: write_stray_scanner(root, take, intrinsics=False)),
    "record3d-exr": ("record3d", lambda root, take: write_record3d_export(root, take)),
    "record3d-below": ("record3d", lambda root, take: write_record3d_export(root / "EXR_RGBD", take).parent),
    "r3d": ("record3d", lambda root, take: write_r3d(root / "take.r3d", take)),
    "r3d-unpacked": ("record3d", lambda root, take: unpack_r3d(write_r3d(root / "take.r3d", take), root / "take")),
    "polycam": ("polycam", lambda root, take: write_polycam(root, take)),
    "polycam-original": ("polycam", lambda root, take: write_polycam(root, take, corrected=False)),
    "polycam-keyframes": ("polycam", lambda root, take: write_polycam(root, take) / "keyframes"),
}
WITHOUT_CONFIDENCE = ("record3d-exr", "record3d-below")


@pytest.fixture(scope="module")
def take() -> Take:
    return Take()


OTHERS: dict[str, tuple[Callable[[Path, Take], Path], tuple[int, ...]]] = {
    "scanner-app": (write_scanner_app, (0, 2, 4)),
    "arkit-scenes": (write_arkit_scenes, (0, 1, 2, 3, 4, 5)),
    "scannetpp": (write_scannetpp, (0, 1, 2, 3, 4, 5)),
    "nerfstudio": (write_nerfcapture, (0, 1, 2, 3, 4, 5)),
}


@pytest.mark.parametrize("name", OTHERS)
def test_other_recordings_of_phones_give_the_take(tmp_path: Path, take: Take, name: str) -> None:
    write, numbers = OTHERS[name]
    source, frames = loaded_frames(write(tmp_path / "log", take))
    assert source.format == name and len(frames) == len(numbers)
    half = 0.5 / 7.5 if name == "nerfstudio" else 0.0  # pixels of transforms.json begin at the edge of the first
    assert source.camera.cx == pytest.approx(DEPTH.cx - half, abs=1e-4)
    picture = source.cameras[0].picture
    assert picture is not None and (picture.width, picture.height) == (FULL.width, FULL.height)
    for index, entry, frame in zip(numbers, source.entries, frames, strict=True):
        assert np.abs(entry.world_from_camera - take.world_from_camera[index]).max() < 1e-3
        assert entry.time == pytest.approx(take.time(index), abs=6e-4)
        assert np.abs(frame.depth / 1000 - take.depths[index]).max() < 1.1e-3
        assert (frame.deviation is not None) == (name in ("scanner-app", "arkit-scenes"))
        found = frame.picture if isinstance(frame.picture, np.ndarray) else _decoded(frame.picture)
        assert np.abs(found.astype(int) - take.pictures[index]).mean() < 6


def test_files_that_nerfcapture_names_and_never_wrote_are_no_depth(tmp_path: Path, take: Take) -> None:
    source, frames = loaded_frames(write_nerfcapture(tmp_path / "log", take, depth=False))
    assert len(frames) == take.count and all(frame.depth is None and frame.picture is None for frame in frames)
    assert (source.camera.width, source.camera.height) == (FULL.width, FULL.height)


def test_depth_that_is_still_packed(tmp_path: Path, take: Take) -> None:
    log = write_scannetpp(tmp_path / "log", take)
    shutil.rmtree(log / "iphone" / "depth")
    (log / "iphone" / "depth.bin").write_bytes(bytes(8))
    with pytest.raises(BadInput, match=r"packed in depth.bin \(take the depth out .* iphone.prepare_iphone_data"):
        open_log(log, IngestParameters())


def test_stray_scanner_without_its_matrix(tmp_path: Path, take: Take) -> None:
    log = write_stray_scanner(tmp_path / "log", take)
    (log / "camera_matrix.csv").unlink()
    source, frames = loaded_frames(log)
    assert source.camera.cx == pytest.approx(DEPTH.cx) and len(frames) == take.count


@pytest.mark.parametrize("write", [write_nerfstudio, write_colmap])
def test_other_layouts_keep_pictures_that_are_larger_than_depth(tmp_path: Path, write: Callable) -> None:
    """The reader of the layout is given colour of twice the size; what it says of intrinsics stays."""
    log = write(tmp_path / "log", frames(3))
    for path in sorted(path for path in log.rglob("*") if path.suffix in (".png", ".jpg")):
        image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
        if image.dtype == np.uint8:
            cv2.imwrite(str(path), cv2.resize(image, None, fx=2, fy=2, interpolation=cv2.INTER_NEAREST))
    source, loaded = loaded_frames(log)
    assert (source.camera.width, source.camera.height) == (CAMERA.width, CAMERA.height)
    picture = source.cameras[0].picture
    assert picture is not None and (picture.width, picture.height) == (2 * CAMERA.width, 2 * CAMERA.height)
    for frame in loaded:
        found = frame.picture if isinstance(frame.picture, np.ndarray) else _decoded(frame.picture)
        assert found.shape[:2] == (2 * CAMERA.height, 2 * CAMERA.width)
        assert np.abs(found[::2, ::2].astype(int) - frame.color).mean() < 4


def test_scannet_keeps_pictures_of_their_own_camera(tmp_path: Path) -> None:
    log = write_scannet(tmp_path / "log", frames(3))
    for path in (log / "color").iterdir():
        cv2.imwrite(str(path), cv2.resize(cv2.imread(str(path)), None, fx=2, fy=2))
    source, loaded = loaded_frames(log)
    picture = source.cameras[0].picture
    assert picture is not None and picture.width > source.camera.width
    stored = cv2.imread(str(sorted((log / "color").iterdir())[0]))
    assert (_decoded(loaded[0].picture)[..., ::-1] == stored).all()


@pytest.mark.parametrize("name", WRITERS)
def test_each_app_gives_the_take(tmp_path: Path, take: Take, name: str) -> None:
    form, write = WRITERS[name]
    source, frames = loaded_frames(write(tmp_path / "log", take))
    assert source.format == form and len(frames) == take.count and not source.damage
    camera, picture_camera = source.camera, source.cameras[0].picture
    assert (camera.width, camera.height) == (DEPTH.width, DEPTH.height)
    for key in ("fx", "fy", "cx", "cy"):
        assert getattr(camera, key) == pytest.approx(getattr(DEPTH, key), abs=1e-5)
        assert picture_camera is not None
        assert getattr(picture_camera, key) == pytest.approx(getattr(FULL, key), abs=1e-4)
    for index, (entry, frame) in enumerate(zip(source.entries, frames, strict=True)):
        assert entry.world_from_camera is not None and frame.depth is not None
        assert np.abs(entry.world_from_camera - take.world_from_camera[index]).max() < 1e-6
        assert entry.time - take.time(0) == pytest.approx(index / 60, abs=1e-6)
        metres = frame.depth.astype(np.float32) / 1000
        assert np.abs(metres - take.depths[index]).max() < 1e-3
        if name in WITHOUT_CONFIDENCE:
            assert frame.deviation is None
        else:
            assert frame.deviation == pytest.approx(deviation_of_levels(take.levels[index], metres))
        assert isinstance(frame.color, np.ndarray) and frame.color.shape == (48, 64, 3)
        assert abs(int(frame.color[24, 60, 0]) - 240 * 60.5 / 64) < 8 and abs(int(frame.color[44, 8, 1]) - 222) < 8
        picture = frame.picture if isinstance(frame.picture, np.ndarray) else _decoded(frame.picture)
        assert picture.shape == (360, 480, 3)
        assert np.abs(picture.astype(int) - take.pictures[index]).mean() < 6


def _decoded(data: bytes | None) -> np.ndarray:
    image = decode_color(data or b"")
    assert image is not None
    return image


@pytest.fixture(scope="module")
def sequences(tmp_path_factory: pytest.TempPathFactory, take: Take) -> dict[str, Sequence]:
    folder = tmp_path_factory.mktemp("phones")
    names = ("stray", "record3d-exr", "r3d", "polycam")
    return {name: ingest(WRITERS[name][1](folder / name, take), folder / f"{name}_sequence") for name in names}


def test_all_apps_come_out_as_one_sequence(take: Take, sequences: dict[str, Sequence]) -> None:
    readers = {name: FrameReader(sequence.path("frames.mcap")) for name, sequence in sequences.items()}
    first = readers["stray"]
    heights = first.poses()[1][:, 2, 3]
    assert np.ptp(heights) < 1e-3 and heights.mean() == pytest.approx(1.5, abs=0.01)  # y of ARKit's world is up
    for name, reader in readers.items():
        info = sequences[name].info
        expected = {"color", "depth", "pose", "picture"} | ({"deviation"} if name != "record3d-exr" else set())
        assert set(info.streams) == expected and set(reader.streams) == expected
        assert info.cameras[0].picture == reader.picture_cameras["camera"]
        assert len(reader) == take.count and info.drops == {}
        assert reader.times - reader.times[0] == pytest.approx(first.times - first.times[0], abs=1e-6)
        for theirs, ours in zip(first.frames(("depth",)), reader.frames(("depth",)), strict=True):
            assert theirs.depth is not None and ours.depth is not None
            assert np.abs(theirs.depth - ours.depth).max() <= 1.001e-3
            assert np.abs(theirs.world_from_camera - ours.world_from_camera).max() < 1e-3
    for reader in readers.values():
        reader.close()


def test_intrinsics_that_change_are_brought_to_the_median(tmp_path: Path) -> None:
    """The lens that focuses and is held still: the same ray is another pixel in each picture."""
    take = Take()
    shifts = np.array([-30.0, -15, 0, 0, 15, 30])
    take.intrinsics[:, 2] += shifts
    for index, shift in enumerate(shifts):
        take.depths[index] = np.roll(take.depths[index], round(shift / 7.5), axis=1)
    source, frames = loaded_frames(write_polycam(tmp_path / "log", take))
    assert source.camera.cx == pytest.approx(DEPTH.cx, abs=1e-6)
    assert "5 different intrinsics: images are resampled to the median ones" in source.notes
    still = Take()
    for index, frame in enumerate(frames):
        inner = slice(6, DEPTH.width - 6)
        assert frame.depth is not None
        assert np.abs(frame.depth[:, inner] / 1000 - still.depths[index][:, inner]).max() < 1e-3


def test_which_cameras_of_polycam_are_taken_is_said(tmp_path: Path, take: Take) -> None:
    corrected = open_log(write_polycam(tmp_path / "a", take), IngestParameters())
    assert "corrected_images/ and corrected_cameras/ are taken in the place of images/ and cameras/" in corrected.notes
    original = open_log(write_polycam(tmp_path / "b", take, corrected=False), IngestParameters())
    assert any(note.startswith("WARNING: images/ and cameras/ are taken") for note in original.notes)


def test_files_that_are_missing_keep_their_numbers(tmp_path: Path, take: Take) -> None:
    root = write_record3d_export(tmp_path / "log", take)
    for index in (0, 3):
        (root / "rgb" / f"{index}.jpg").unlink()
        (root / "depth" / f"{index}.exr").unlink()
    source, frames = loaded_frames(root)
    kept = [1, 2, 4, 5]
    assert len(frames) == 4 and any("6 poses for 4 frames" in note for note in source.notes)
    for entry, index in zip(source.entries, kept, strict=True):
        assert np.abs(entry.world_from_camera - take.world_from_camera[index]).max() < 1e-6
        assert entry.time == pytest.approx(take.time(index))


def test_upright_phones_give_upright_pictures_as_the_app_turns_all_of_them(tmp_path: Path) -> None:
    """Record3D writes portrait pictures, depth, K and poses: all are turned alike."""
    take = Take(3)
    take.pictures = [np.ascontiguousarray(np.rot90(image, -1)) for image in take.pictures]
    take.depths = [np.ascontiguousarray(np.rot90(depth, -1)) for depth in take.depths]
    take.levels = [np.ascontiguousarray(np.rot90(level, -1)) for level in take.levels]
    center = (FULL.height - 1 - FULL.cy, FULL.cx)
    take.intrinsics = np.tile([FULL.fy, FULL.fx, *center], (3, 1))
    # A pixel (u, v) goes to (height - 1 - v, u): x of the turned camera is -y, its y is x.
    turned_from_landscape = np.array([[0, -1.0, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    take.world_from_camera = take.world_from_camera @ inverse(turned_from_landscape)
    changes = {"w": 360, "h": 480, "dw": 48, "dh": 64, "K": [FULL.fy, 0, 0, 0, FULL.fx, 0, *center, 1]}
    source, frames = loaded_frames(write_r3d(tmp_path / "take.r3d", take, **changes))
    plain = Take(3)
    for index, (entry, frame) in enumerate(zip(source.entries, frames, strict=True)):
        points = apply(
            entry.world_from_camera, back_project(frame.depth / np.float32(1000), source.camera)[20, 30][None]
        )
        pixel, _ = project(apply(inverse(plain.world_from_camera[index]), points), DEPTH)
        assert pixel[0] == pytest.approx([20, 48 - 1 - 30], abs=0.02)


def held_upright(take: Take) -> Take:
    """The phone turned: the sensor's pictures lie on their side, their x axis looks down."""
    turned = Take(take.count)
    sensor_from_upright = np.array([[0.0, 1, 0, 0], [-1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    turned.world_from_camera = take.world_from_camera @ inverse(sensor_from_upright)
    turned.depths = [room_depth(DEPTH, pose) for pose in inverse(ARKIT_FROM_ROOM) @ turned.world_from_camera]
    return turned


@pytest.mark.parametrize("write", [write_stray_scanner, write_polycam])
def test_a_phone_held_upright_gives_upright_frames(tmp_path: Path, take: Take, write: Callable) -> None:
    """What the app shows upright is stored on its side: pictures, depth, confidence, intrinsics and poses are turned
    alike, so that a ray of the upright camera meets the room where it is."""
    sideways = held_upright(take)
    source, frames = loaded_frames(write(tmp_path / "log", sideways))
    assert (source.camera.width, source.camera.height) == (DEPTH.height, DEPTH.width)
    assert source.cameras[0].picture is not None and source.cameras[0].picture.width == FULL.height
    assert any("turned a quarter clockwise, so that they stand upright" in note for note in source.notes)
    for index, (entry, frame) in enumerate(zip(source.entries, frames, strict=True)):
        assert np.abs(entry.world_from_camera - take.world_from_camera[index]).max() < 1e-6
        expected = room_depth(source.camera, inverse(ARKIT_FROM_ROOM) @ entry.world_from_camera)
        assert np.abs(frame.depth / 1000 - expected).max() < 1.1e-3
        levels = np.rot90(sideways.levels[index], -1)
        assert frame.deviation == pytest.approx(deviation_of_levels(levels, frame.depth.astype(np.float32) / 1000))
        found = frame.picture if isinstance(frame.picture, np.ndarray) else _decoded(frame.picture)
        assert np.abs(found.astype(int) - np.rot90(sideways.pictures[index], -1)).mean() < 6
    left, _ = loaded_frames(tmp_path / "log", turn=False)
    assert (left.camera.width, left.camera.height) == (DEPTH.width, DEPTH.height)
    assert np.abs(left.entries[0].world_from_camera - sideways.world_from_camera[0]).max() < 1e-6


@pytest.mark.parametrize("quarters", range(4))
def test_how_far_pictures_are_turned(quarters: int) -> None:
    """However the phone is held, up comes out up; one that looks at the floor is left as it is."""
    level = look_at(np.array([0, 0, 1.0]), np.array([2.0, 1, 0.8]))
    held = turned_pose(level, -quarters % 4)
    assert held is not None and quarters_to_upright([held], np.array([0, 0, 1.0])) == quarters
    camera = turned_camera(turned_camera(FULL, quarters), (4 - quarters) % 4)
    assert camera == FULL
    down = look_at(np.array([0, 0, 2.0]), np.array([0.05, 0, 0.0]), up=(0, 1, 0))
    turned = turned_pose(down, quarters)
    assert turned is not None and quarters_to_upright([turned], np.array([0, 0, 1.0])) == 0


def test_the_selfie_camera_has_no_poses(tmp_path: Path, take: Take) -> None:
    poses = [[0, 0, 0, 1, 0, 0, 0]] * take.count
    source = open_log(write_r3d(tmp_path / "take.r3d", take, poses=poses), IngestParameters())
    assert not source.has_poses and "selfie camera" in source.missing["pose"]
    source.close()


def test_a_real_recording_agrees_with_itself(tmp_path: Path) -> None:
    """Frames 0.3 s apart and up to 3 s apart, carried into each other: with OpenCV's axes they would be 3 to 10 cm
    apart."""
    pytest.importorskip("OpenEXR", reason="the extra `phone` is not installed")
    sequence = ingest(real_data("door_handle_record3d"), tmp_path / "sequence")
    assert sequence.info.frame_count == 19 and sequence.info.drops == {}
    with FrameReader(sequence.path("frames.mcap")) as reader:
        frames, camera = list(reader.frames(("depth",))), reader.camera
        assert (camera.width, camera.height) == (192, 256)
        assert (reader.picture_cameras["camera"].width, reader.picture_cameras["camera"].height) == (1440, 1920)

    def apart(first: int, second: int) -> float:
        one, other = frames[first], frames[second]
        points = back_project(one.depth, camera)[one.depth > 0]
        pixels, z = project(apply(inverse(other.world_from_camera) @ one.world_from_camera, points), camera)
        ahead = np.isfinite(pixels).all(axis=1)
        pixels, z = np.rint(pixels[ahead]).astype(int), z[ahead]
        seen = ((pixels >= 0) & (pixels < [camera.width, camera.height])).all(axis=1)
        measured = other.depth[pixels[seen, 1], pixels[seen, 0]]
        return float(np.median(np.abs(measured - z[seen])[measured > 0]))

    neighbours = [apart(k, k + 1) for k in range(18)]
    assert max(neighbours) < 0.007
    assert np.median([apart(a, b) for a in range(18) for b in range(a + 1, min(a + 11, 19))]) < 0.007
