"""The EXIF orientation of pictures: taken off, or applied where the calibration is of the turned picture."""

from __future__ import annotations

import io
import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image
from scenewright.stages.export.frames import Tally, export_frames
from scenewright.stages.kit.formats.exif import orientation_of, turned, without_orientation
from scenewright.stages.kit.formats.frames import FrameReader

from tests.unit.ingest.folder_writers import write_nerfstudio
from tests.unit.ingest.running import ingest
from tests.unit.ingest.tiny_room import CAMERA, frames

ASPECT = np.arange(24 * 16 * 3, dtype=np.uint8).reshape(16, 24, 3) // 3
MODEL = "a camera"


def tagged(image: np.ndarray, orientation: int, form: str = "JPEG") -> bytes:
    """Return a picture (H, W, 3) uint8 RGB that says it is turned, and by which camera it was taken."""
    exif = Image.Exif()
    exif[0x0110], exif[0x0112], exif[0x0132] = MODEL, orientation, "2026:01:01 00:00:00"
    data = io.BytesIO()
    Image.fromarray(image).save(data, form, exif=exif, **({"quality": 95} if form == "JPEG" else {}))
    return data.getvalue()


def pixels(data: bytes, flags: int = cv2.IMREAD_IGNORE_ORIENTATION) -> np.ndarray:
    return cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR_RGB | flags)


@pytest.mark.parametrize("form", ["JPEG", "PNG"])
@pytest.mark.parametrize("orientation", range(1, 9))
def test_the_tag_goes_and_every_pixel_and_other_tag_stays(orientation: int, form: str) -> None:
    data = tagged(ASPECT, orientation, form)
    assert orientation_of(data) == orientation
    clean = without_orientation(data)
    assert orientation_of(clean) == 1 and len(clean) == len(data)
    exif = Image.open(io.BytesIO(clean)).getexif()
    assert 0x0112 not in exif and exif[0x0110] == MODEL and exif[0x0132] == "2026:01:01 00:00:00"
    np.testing.assert_array_equal(pixels(clean), pixels(data))
    np.testing.assert_array_equal(pixels(clean, 0), pixels(data))  # OpenCV turns nothing any more
    if form == "JPEG":
        np.testing.assert_array_equal(turned(pixels(data), orientation), pixels(data, 0))
    assert without_orientation(clean) == clean


@pytest.mark.parametrize("cut", [4, 20, 40, 60, 90])
def test_broken_exif_is_left_alone(cut: int) -> None:
    data = tagged(ASPECT, 6)[:cut]
    assert orientation_of(data) in (1, 6) and len(without_orientation(data)) == cut
    assert orientation_of(b"") == orientation_of(b"GIF89a") == 1


@pytest.mark.parametrize("calibration", ["stored", "turned"])
def test_pictures_fit_their_intrinsics_in_the_sequence_and_its_exports(tmp_path: Path, calibration: str) -> None:
    recorded = frames(3)
    log = write_nerfstudio(tmp_path / "log", recorded)
    document = json.loads((log / "transforms.json").read_text())
    for frame, (color, _, _) in zip(document["frames"][::-1], recorded, strict=True):
        stored = color if calibration == "stored" else np.rot90(color)  # orientation 6 turns it back
        frame["file_path"] = frame["file_path"].replace(".png", ".jpg")
        (log / frame["file_path"]).write_bytes(tagged(np.ascontiguousarray(stored), 6))
    (log / "transforms.json").write_text(json.dumps(document))
    sequence = ingest(log, tmp_path / "out")
    assert (sequence.info.camera.width, sequence.info.camera.height) == (CAMERA.width, CAMERA.height)
    assert any("3 images state an EXIF orientation" in note for note in sequence.info.notes) == (
        calibration == "stored"
    )
    with FrameReader(sequence.path("frames.mcap")) as reader:
        exported = list(export_frames(reader, range(3), 1, ("color",), ("camera",), Tally()))
    for index, (color, _, _) in enumerate(recorded):
        data = exported[index].color
        assert data is not None and orientation_of(data) == 1
        assert np.abs(pixels(data, 0).astype(int) - color).mean() < 3
        if calibration == "stored":
            original = (log / f"images/frame_{index + 1}.jpg").read_bytes()
            np.testing.assert_array_equal(pixels(data), pixels(original))  # not encoded again


def test_pictures_without_depth_may_be_turned_too(tmp_path: Path) -> None:
    recorded = frames(2)
    log = write_nerfstudio(tmp_path / "log", recorded, depth=False)
    for index, (color, _, _) in enumerate(recorded, start=1):
        (log / f"images/frame_{index}.png").write_bytes(tagged(np.ascontiguousarray(np.rot90(color)), 6, "PNG"))
    sequence = ingest(log, tmp_path / "out")
    with FrameReader(sequence.path("frames.mcap")) as reader:
        found = [frame.color for frame in reader.frames(("color",))]
    for image, (color, _, _) in zip(found, recorded, strict=True):
        assert image is not None and np.abs(image.astype(int) - color).mean() < 3
