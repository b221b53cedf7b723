"""One take, written by an independent hand as three apps write it, is one sequence, to the millimetre."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scenewright.schemas.sequence import Sequence
from scenewright.stages.ingest.confidence_levels import deviation_of_levels
from scenewright.stages.ingest.detection import open_log
from scenewright.stages.ingest.parameters import IngestParameters
from scenewright.stages.kit.formats.foxglove import decode_color
from scenewright.stages.kit.formats.frames import FrameReader
from scenewright.stages.kit.geometry.cameras import back_project, project
from scenewright.stages.kit.geometry.transforms import apply, inverse

from tests.real_data import real_data
from tests.unit.ingest.loading import loaded_frames
from tests.unit.ingest.phone_writers import (
    DEPTH,
    FULL,
    Take,
    unpack_r3d,
    write_polycam,
    write_r3d,
    write_record3d_export,
    write_stray_scanner,
)
from tests.unit.ingest.running import ingest

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
