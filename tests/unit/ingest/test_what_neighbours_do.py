"""What one reader does its neighbour does: floating point depth, backslashes in names, OpenCV's two files."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from scenewright.schemas.errors import BadInput
from scenewright.stages.ingest.detection import open_log
from scenewright.stages.ingest.parameters import IngestParameters
from scenewright.stages.kit.geometry.transforms import transform_from

from tests.unit.ingest.folder_writers import tum_line, write_image_folder, write_nerfstudio, write_tum
from tests.unit.ingest.loading import loaded_frames
from tests.unit.ingest.test_layout_stereo import BASELINE, LEFT, POINTS, _opencv_file, in_right, spots, write_pair
from tests.unit.ingest.tiny_room import frames, write_redwood

COUNT = 3


def as_floats(folder: Path, suffix: str, metres_per_unit: float, factor: float = 1.0) -> None:
    """Write depth pictures again as floating point, `factor` times metres."""
    for path in sorted(folder.glob("*.png")):
        depth = cv2.imread(str(path), cv2.IMREAD_UNCHANGED).astype(np.float32) * np.float32(metres_per_unit * factor)
        target = path.with_suffix(suffix)
        path.unlink()
        if suffix == ".npy":
            np.save(target, depth)
        else:
            cv2.imwrite(str(target), depth)


@pytest.mark.parametrize("suffix", [".npy", ".tiff"])
@pytest.mark.parametrize(("factor", "unit"), [(1.0, "1/1 m, as it is floating point"), (1000.0, "1/1000 m")])
def test_floating_point_depth_is_in_metres_unless_the_data_say_otherwise(
    tmp_path: Path, suffix: str, factor: float, unit: str
) -> None:
    recorded = frames(COUNT)
    log = write_image_folder(tmp_path / "log", recorded)
    as_floats(log / "depth", suffix, 0.001, factor)
    source, found = loaded_frames(log)
    assert f"depth unit assumed: {unit}" in source.notes
    for frame, (_, depth, _) in zip(found, recorded, strict=True):
        np.testing.assert_allclose(frame.depth / 1000, depth, atol=0.0006)
    given, _ = loaded_frames(log, depth_scale=factor)
    assert f"depth unit given by option: 1/{factor:g} m" in given.notes


@pytest.mark.parametrize("layout", ["redwood", "tum", "nerfstudio"])
def test_floating_point_depth_in_other_layouts(tmp_path: Path, layout: str) -> None:
    recorded, root = frames(COUNT), tmp_path / "log"
    write = {"redwood": write_redwood, "tum": write_tum, "nerfstudio": write_nerfstudio}[layout]
    log = write(root, recorded)
    as_floats(log / "depth", ".tiff", 1 / 5000 if layout == "tum" else 0.001)
    for name in ("depth.txt", "transforms.json"):
        if (log / name).is_file():
            (log / name).write_text((log / name).read_text().replace('depth/frame_1.png"', 'depth/frame_1.tiff"'))
    if layout == "tum":
        (log / "depth.txt").write_text((log / "depth.txt").read_text().replace(".png", ".tiff"))
    if layout == "nerfstudio":
        document = json.loads((log / "transforms.json").read_text())
        for frame in document["frames"]:
            frame["depth_file_path"] = frame["depth_file_path"].replace(".png", ".tiff")
        (log / "transforms.json").write_text(json.dumps(document))
    _, found = loaded_frames(log)
    for frame, (_, depth, _) in zip(found, recorded, strict=True):
        np.testing.assert_allclose(frame.depth / 1000, depth, atol=0.0007)


def test_a_stated_unit_goes_before_the_habit(tmp_path: Path) -> None:
    log = write_nerfstudio(tmp_path / "log", frames(COUNT), depth_unit_scale_factor=0.01)
    assert "depth unit assumed: 1/100 m" in open_log(log, IngestParameters()).notes


@pytest.mark.parametrize("layout", ["nerfstudio", "tum", "poses"])
def test_backslashes_separate_folders_where_no_file_is_called_so(tmp_path: Path, layout: str) -> None:
    recorded = frames(COUNT)
    if layout == "tum":
        log = write_tum(tmp_path / "log", recorded)
        for name in ("rgb.txt", "depth.txt"):
            (log / name).write_text((log / name).read_text().replace("/", "\\"))
    elif layout == "nerfstudio":
        log = write_nerfstudio(tmp_path / "log", recorded)
        (log / "transforms.json").write_text((log / "transforms.json").read_text().replace("/frame_", "\\\\frame_"))
    else:
        log = write_image_folder(tmp_path / "log", recorded)
        rows = [tum_line(f"rgb\\rgb_{index}.png", pose) for index, (*_, pose) in enumerate(recorded)]
        (log / "poses.txt").write_text("\n".join(rows))
    source, found = loaded_frames(log)
    assert len(found) == COUNT and source.has_poses
    for frame, (_, depth, _) in zip(found, recorded, strict=True):
        np.testing.assert_allclose(frame.depth / 1000, depth, atol=0.0007)


def test_backslashes_lead_out_of_no_folder(tmp_path: Path) -> None:
    log = write_tum(tmp_path / "log", frames(1))
    (log / "rgb.txt").write_text("1.0 ..\\..\\secret.png\n")
    with pytest.raises(BadInput, match="leads out of the folder"):
        open_log(log, IngestParameters())


def test_intrinsics_and_extrinsics_of_opencv_are_read_together(tmp_path: Path) -> None:
    left_from_right = transform_from(np.eye(3), np.array([BASELINE, 0.0, 0.0]))
    log = write_pair(tmp_path / "log", spots(LEFT, POINTS), spots(LEFT, in_right(POINTS, left_from_right)))
    _opencv_file(log / "both.yml", LEFT, LEFT, left_from_right, 1.0, 0, 0, 0, 0)
    text = (log / "both.yml").read_text()
    (log / "both.yml").unlink()
    cut = text.index("R: !!")
    (log / "intrinsics.yml").write_text(text[:cut])
    with pytest.raises(BadInput, match=r"has no R and T.*extrinsics\.yml"):
        open_log(log, IngestParameters())
    (log / "extrinsics.yml").write_text(text[: text.index("M1")] + text[cut:])
    source = open_log(log, IngestParameters())
    assert source.cameras[0].baseline == pytest.approx(BASELINE, rel=1e-6)
    assert {"intrinsics read from intrinsics.yml", "R and T read from extrinsics.yml"} <= set(source.notes)
