"""ingest(export(sequence)) == sequence: poses to 1e-6, depth to the layout's unit, pictures byte by byte.

nerfstudio's format has neither times nor names of cameras.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from scenewright.stages.kit.formats.frames import FrameReader

from tests.unit.export.sequences import CAMERA, OTHER, assert_same_frames, export, png, write_sequence
from tests.unit.ingest.running import ingest
from tests.unit.ingest.tiny_room import jpeg

LAYOUTS = {
    "tum": {"layout": "tum"},
    "nerfstudio": {"layout": "nerfstudio"},
    "foxglove": {"layout": "mcap"},
    "ros2": {"layout": "mcap", "dialect": "ros2"},
}


def round_trip(tmp_path: Path, name: str, sequence: Any, **options: Any) -> Path:
    """Export and ingest again; the world is kept as it is."""
    done = export(sequence, tmp_path / name, **LAYOUTS[name])
    log = done.root / done.info.log
    again = ingest(log, tmp_path / f"{name}-again", gravity="given", up="z", **options)
    assert again.outcome == "ok", again.summary
    return again.path("frames.mcap")


@pytest.mark.parametrize("name", LAYOUTS)
@pytest.mark.parametrize("picture", [jpeg, png])
@pytest.mark.parametrize("start", [0.0, 1.7e9 + 0.123456])
def test_one_camera(tmp_path: Path, name: str, picture: Any, start: float) -> None:
    sequence = write_sequence(tmp_path / "sequence", picture=picture, start=start)
    again = round_trip(tmp_path, name, sequence)
    deepest = 13.1065 if name == "tum" else None
    assert_same_frames(sequence.path("frames.mcap"), again, deepest=deepest, named=name != "nerfstudio")


@pytest.mark.parametrize("name", ["foxglove", "ros2"])
def test_labels_and_their_table(tmp_path: Path, name: str) -> None:
    sequence = write_sequence(tmp_path / "sequence", labels=True)
    again = round_trip(tmp_path, name, sequence)
    assert_same_frames(sequence.path("frames.mcap"), again, streams=("depth", "labels"))
    with FrameReader(sequence.path("frames.mcap")) as one, FrameReader(again) as two:
        assert one.label_table == two.label_table != ()


@pytest.mark.parametrize("name", ["nerfstudio", "foxglove", "ros2"])
def test_several_cameras(tmp_path: Path, name: str) -> None:
    sequence = write_sequence(tmp_path / "sequence", 6, cameras={"front": CAMERA, "left": OTHER})
    again = round_trip(tmp_path, name, sequence, camera=("all",))
    assert_same_frames(sequence.path("frames.mcap"), again, named=name != "nerfstudio")


@pytest.mark.parametrize("name", ["foxglove", "ros2"])
def test_stereo(tmp_path: Path, name: str) -> None:
    sequence = write_sequence(tmp_path / "sequence", baseline=0.12)
    again = round_trip(tmp_path, name, sequence)
    assert_same_frames(sequence.path("frames.mcap"), again)
    with FrameReader(again) as reader:
        assert reader.baselines == pytest.approx({"camera": 0.12})


@pytest.mark.parametrize("name", ["foxglove", "ros2"])
def test_what_is_known_of_the_world_survives(tmp_path: Path, name: str) -> None:
    """A log that says that z is up needs no floor, and one that says colour is elsewhere is believed."""
    done = export(write_sequence(tmp_path / "sequence", registered=False), tmp_path / name, **LAYOUTS[name])
    again = ingest(done.path("log.mcap"), tmp_path / "again")
    assert again.info.gravity.method == "given" and not again.info.color_depth_registered
