"""The same room through every folder layout gives the same poses, depth and colours."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from scenewright.stages.ingest.detection import log_format, open_log
from scenewright.stages.ingest.parameters import IngestParameters
from scenewright.stages.ingest.registry import all_layouts
from scenewright.stages.ingest.source import Unusable

from tests.unit.ingest.folder_writers import (
    FIRST_STAMP,
    write_colmap,
    write_image_folder,
    write_nerfstudio,
    write_replica,
    write_scannet,
    write_scenenn,
    write_tum,
)
from tests.unit.ingest.loading import loaded_frames
from tests.unit.ingest.tiny_room import CAMERA, frames, png, write_posed_images, write_redwood, write_seven_scenes

INTRINSICS = {"fx": CAMERA.fx, "fy": CAMERA.fy, "cx": CAMERA.cx, "cy": CAMERA.cy}


class Layout(NamedTuple):
    """How a layout is written and what comes of it."""

    format: str
    write: Any
    first_time: float = 0.0
    depth_tolerance: float = 0.0005
    """Half a millimetre; more where the file's unit is coarser."""
    written: dict = {}
    options: dict = {}


LAYOUTS = {
    "7scenes": Layout("7scenes", write_seven_scenes),
    "redwood": Layout("redwood", write_redwood),
    "posed-images": Layout("posed-images", write_posed_images, options=INTRINSICS),
    "tum": Layout("tum", write_tum, FIRST_STAMP + 0.004, 0.0007),
    "tum, depth first": Layout("tum", write_tum, FIRST_STAMP - 0.004, 0.0007, {"depth_shift": -0.004}),
    "scenenn": Layout("scenenn", write_scenenn),
    "scenenn, plain names": Layout("scenenn", write_scenenn, written={"plain": True}),
    "scannet": Layout("scannet", write_scannet),
    "nerfstudio": Layout("nerfstudio", write_nerfstudio),
    "replica": Layout("nerfstudio", write_replica, 0.0, 0.0006),
    "colmap": Layout("colmap", write_colmap),
    "colmap, text": Layout("colmap", write_colmap, written={"binary": False}),
    "images": Layout("images", write_image_folder),
}


@pytest.mark.parametrize("name", LAYOUTS)
def test_frames_come_out_as_they_went_in(tmp_path: Path, name: str) -> None:
    layout = LAYOUTS[name]
    recorded = frames(12)
    log = layout.write(tmp_path / "log", recorded, **layout.written)
    source, found = loaded_frames(log, **layout.options)
    assert source.format == layout.format
    assert source.camera == CAMERA
    assert [entry.problem for entry in source.entries] == [None] * 12
    times = [entry.time for entry in source.entries]
    np.testing.assert_allclose(times, layout.first_time + np.arange(12) / 30, atol=2e-6)
    for frame, entry, (color, depth, pose) in zip(found, source.entries, recorded, strict=True):
        np.testing.assert_allclose(frame.depth / 1000, depth, atol=layout.depth_tolerance)
        assert np.abs(frame.color.astype(int) - color).max() < 12  # JPEG; a swap of red and blue is > 100
        np.testing.assert_allclose(entry.world_from_camera, pose, atol=1e-6)


def colourless(log: Path) -> Path:
    """Take everything that is colour out of a log."""
    for name in ("color", "rgb", "image", "images"):
        shutil.rmtree(log / name, ignore_errors=True)
    for path in (*log.glob("*.color.jpg"), *log.glob("results/frame*"), log / "rgb.txt"):
        path.unlink(missing_ok=True)
    return log


@pytest.mark.parametrize("name", [name for name in LAYOUTS if name != "tum, depth first"])
def test_a_log_without_colour_has_the_same_depth_and_poses(tmp_path: Path, name: str) -> None:
    layout = LAYOUTS[name]
    recorded = frames(3)
    log = colourless(layout.write(tmp_path / "log", recorded, **layout.written))
    source, found = loaded_frames(log, **layout.options)
    assert source.format == layout.format
    assert source.camera == CAMERA
    assert not any(stream.role == "color" for stream in source.streams)
    assert len(found) == 3
    for frame, entry, (_, depth, pose) in zip(found, source.entries, recorded, strict=True):
        assert frame.color is None
        np.testing.assert_allclose(frame.depth / 1000, depth, atol=layout.depth_tolerance)
        np.testing.assert_allclose(entry.world_from_camera, pose, atol=1e-6)


def test_transforms_that_name_depth_alone_are_a_log_without_colour(tmp_path: Path) -> None:
    log = colourless(write_nerfstudio(tmp_path / "log", frames(2)))
    document = json.loads((log / "transforms.json").read_text())
    for frame in document["frames"]:
        del frame["file_path"]
    (log / "transforms.json").write_text(json.dumps(document))
    source, found = loaded_frames(log)
    assert [frame.color for frame in found] == [None, None] and all(frame.depth is not None for frame in found)
    assert [entry.name for entry in source.entries] == ["depth/frame_1.png", "depth/frame_2.png"]


@pytest.mark.parametrize("name", LAYOUTS)
def test_layout_is_recognised_as_itself_and_by_no_rule_before(tmp_path: Path, name: str) -> None:
    layout = LAYOUTS[name]
    log = layout.write(tmp_path / "log", frames(2), **layout.written)
    first = next(declared for declared in all_layouts() if log_format(declared).matches(log))
    assert first.name == layout.format
    assert open_log(log, IngestParameters(**layout.options)).format == layout.format


@pytest.mark.parametrize("name", LAYOUTS)
def test_streams_are_described(tmp_path: Path, name: str) -> None:
    layout = LAYOUTS[name]
    log = layout.write(tmp_path / "log", frames(3), **layout.written)
    streams = open_log(log, IngestParameters(**layout.options)).streams
    assert {stream.role for stream in streams} >= {"color", "depth", "pose"}
    assert all(stream.count == 3 and stream.detail for stream in streams)
    if layout.format == "tum":
        depths = next(stream for stream in streams if stream.role == "depth")
        np.testing.assert_allclose(depths.stamps * 1e-9, layout.first_time + np.arange(3) / 30, atol=1e-6)


@pytest.mark.parametrize("name", LAYOUTS)
def test_assumptions_are_stated(tmp_path: Path, name: str) -> None:
    layout = LAYOUTS[name]
    log = layout.write(tmp_path / "log", frames(2), **layout.written)
    notes = " | ".join(open_log(log, IngestParameters(**layout.options)).notes)
    assert "depth unit assumed: 1/" in notes
    assert "intrinsics" in notes


@pytest.mark.parametrize("name", LAYOUTS)
def test_depth_scale_and_intrinsics_options_count(tmp_path: Path, name: str) -> None:
    layout = LAYOUTS[name]
    log = layout.write(tmp_path / "log", frames(1), **layout.written)
    factor = {"tum": 5000.0, "replica": 6553.5}.get(name.split(",")[0], 1000.0)
    options = layout.options | {"depth_scale": 2 * factor, "fx": 70.0}
    source, found = loaded_frames(log, **options)
    assert source.camera == CAMERA.model_copy(update={"fx": 70.0})
    np.testing.assert_allclose(found[0].depth / 1000, frames(1)[0][1] / 2, atol=0.001)


@pytest.mark.parametrize("name", LAYOUTS)
def test_names_with_spaces_and_letters_of_the_world(tmp_path: Path, name: str) -> None:
    layout = LAYOUTS[name]
    log = layout.write(tmp_path / "Küche mit Tisch 測試", frames(1), **layout.written)
    assert len(loaded_frames(log, **layout.options)[1]) == 1


@pytest.mark.parametrize("name", LAYOUTS)
def test_every_bad_image_is_counted_by_its_reason(tmp_path: Path, name: str) -> None:
    """Depth images that cannot be used, in every layout: a reason, never a crash."""
    layout = LAYOUTS[name]
    log = layout.write(tmp_path / "log", frames(7), **layout.written)
    source = open_log(log, IngestParameters(**layout.options))
    images = sorted(
        (path for path in log.rglob("*") if path.suffix in (".png", ".pgm") and "depth" in str(path.relative_to(log))),
        key=lambda path: [int(part) for part in "".join(c if c.isdigit() else " " for c in path.stem).split()][-2:],
    )
    whole = images[1].read_bytes()
    huge = bytearray(png(np.zeros((72, 96), np.uint16)))
    huge[16:24] = (60000).to_bytes(4, "big") * 2
    bad = {
        "undecodable_depth": whole[: len(whole) // 2],
        "no_valid_depth": png(np.full((72, 96), 65535, np.uint16)),
        "depth_not_16_bit": png(np.full((72, 96), 100, np.uint8)),
        "size_mismatch": png(np.full((30, 40), 1000, np.uint16)),
        "undecodable_depth ": bytes(huge),
        "undecodable_depth  ": b"",
    }
    for path, data in zip(images[1:], bad.values(), strict=True):
        path.write_bytes(data)
    reasons = []
    for entry in source.entries:
        try:
            entry.load()
        except Unusable as problem:
            reasons.append(problem.reason)
        else:
            reasons.append("")
    assert reasons == ["", *(reason.strip() for reason in bad)]
