"""A sequence remembers what its log called each frame: file names and stamps."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path

import pytest
from scenewright.schemas.errors import BadInput
from scenewright.schemas.sequence import FrameSources

from tests.unit.ingest.folder_writers import (
    stamp_text,
    write_image_folder,
    write_nerfstudio,
    write_replica,
    write_scannet,
    write_scenenn,
    write_tum,
)
from tests.unit.ingest.running import ingest
from tests.unit.ingest.tiny_room import CAMERA, frames, write_posed_images, write_redwood, write_seven_scenes

GIVEN = {"fx": CAMERA.fx, "fy": CAMERA.fy, "cx": CAMERA.cx, "cy": CAMERA.cy}


@pytest.mark.parametrize(
    ("write", "color", "depth", "options"),
    [
        (write_seven_scenes, "frame-000001.color.jpg", "frame-000001.depth.png", GIVEN),
        (write_redwood, "image/00001.jpg", "depth/00001.png", {}),
        (write_posed_images, "color/2.png", "depth/2.pgm", GIVEN),
        (write_replica, "results/frame000001.jpg", "results/depth000001.png", {}),
        (write_scannet, "color/1.jpg", "depth/1.png", {}),
        (write_scenenn, "image/image00002.png", "depth/depth00002.png", {}),
        (write_nerfstudio, "images/frame_2.png", "depth/frame_2.png", {}),
        (write_image_folder, None, None, {}),
    ],
)
def test_file_names_of_every_layout(
    tmp_path: Path, write: Callable[..., Path], color: str | None, depth: str | None, options: dict[str, float]
) -> None:
    log = write(tmp_path / "log" / "scene", frames(3))
    sources = ingest(log, tmp_path / "out", **options).sources
    assert sources is not None and len(sources.color) == len(sources.depth) == 3 and sources.left_out == ()
    assert color is None or sources.color[1] == color
    assert depth is None or sources.depth[1] == depth
    assert all((log / name).is_file() for names in (sources.color, sources.depth) for name in names if name)


def test_stamps_are_the_log_s_own_and_pictures_left_out_are_named(tmp_path: Path) -> None:
    log = write_tum(tmp_path / "log", frames(4))
    sequence = ingest(log, tmp_path / "out", every=2)
    assert sequence.sources == FrameSources(
        color=tuple(f"rgb/{stamp_text(k)}.png" for k in (0, 2)),
        depth=tuple(f"depth/{stamp_text(k, 0.004)}.png" for k in (0, 2)),
        stamps=tuple(int(stamp_text(k).replace(".", "")) * 1000 for k in (0, 2)),
        left_out=tuple(f"rgb/{stamp_text(k)}.png" for k in (1, 3)),
    )
    assert sequence.info.start_time == pytest.approx(float(stamp_text(0, 0.004)), abs=1e-6)  # of the depth


def test_names_that_are_no_utf8_are_written_all_the_same(tmp_path: Path) -> None:
    log = write_redwood(tmp_path / "log", frames(2))
    (log / "image" / "00001.jpg").rename(os.fsdecode(os.fsencode(log / "image") + b"/00001\xff.jpg"))
    ingest(log, tmp_path / "out")
    assert FrameSources.read(tmp_path / "out" / "sources.json").color == ("image/00000.jpg", "image/00001\ufffd.jpg")


def test_lists_of_different_lengths_are_refused(tmp_path: Path) -> None:
    (tmp_path / "sources.json").write_text(json.dumps({"color": ["a.png"], "depth": ["a.png", "b.png"]}))
    with pytest.raises(BadInput, match="different lengths"):
        FrameSources.read(tmp_path / "sources.json")
