"""Outlines painted in frames say what the surface that they see is; broken ones are told in one line."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scenewright.schemas.errors import BadInput
from scenewright.schemas.sequence import Sequence
from scenewright.stages.kit.formats.frames import FrameReader
from scenewright.stages.kit.formats.numpy_files import read_arrays
from scenewright.stages.truth.outlines import PaintedFrame, painted_labels, read_outlines
from scenewright.stages.truth.painted_points import without_seams
from scenewright.stages.truth.parameters import SupportsParameters
from scenewright.stages.truth.supports import run

from tests.unit.ingest.tiny_room import CAMERA, TABLE
from tests.unit.truth.test_supports import BY_BOXES, MADE, context, sequence, written

__all__ = ["sequence"]
NODES = ("floor", "table", "tray", "far")
WHOLE = [[0, 0], [CAMERA.width, 0], [CAMERA.width, CAMERA.height], [0, CAMERA.height]]


def document(*frames: dict[str, Any], **top: Any) -> dict[str, Any]:
    """A file of outlines."""
    head = {"format": "scenewright-outlines", "version": 1, "scene": "tiny room", "made": MADE}
    return {**head, "frames": list(frames), **top}


def frame(time: float, *outlines: tuple[str | None, Any], **more: Any) -> dict[str, Any]:
    """A painted frame; `more` goes into its last outline."""
    rows: list[dict[str, Any]] = [
        {"points": points} if name is None else {"name": name, "points": points} for name, points in outlines
    ]
    rows[-1].update(more)
    return {"time": time, "outlines": rows}


def file_of(folder: Path, told: dict[str, Any]) -> Path:
    """Write a file of outlines."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "outlines.json"
    path.write_text(json.dumps(told))
    return path


def owners(sequence: Sequence, folder: Path, told: dict[str, Any]) -> tuple[np.ndarray, np.ndarray]:
    """Points and nodes that the step makes of outlines."""
    truth = run(
        written(folder, BY_BOXES),
        sequence,
        outlines=file_of(folder, told),
        parameters=SupportsParameters(),
        context=context(folder / "truth"),
    )
    points, owner = read_arrays(truth.path("visible.npz"), "points", "instance")
    return points, owner


def table_outline(sequence: Sequence, index: int) -> tuple[float, list[list[float]]]:
    """Time of a frame and the corners in it of a square on the table's top, 60 cm wide."""
    with FrameReader(sequence.path("frames.mcap")) as reader:
        shown = list(reader.frames(streams=("depth",)))[index]
    assert shown.world_from_camera is not None
    corners = np.array([[x, y, TABLE[1][2]] for x, y in ((-0.3, -0.3), (0.3, -0.3), (0.3, 0.3), (-0.3, 0.3))])
    inside = (corners - shown.world_from_camera[:3, 3]) @ shown.world_from_camera[:3, :3]
    pixels = inside[:, :2] / inside[:, 2:] * (CAMERA.fx, CAMERA.fy) + (CAMERA.cx + 0.5, CAMERA.cy + 0.5)
    return shown.time, pixels.tolist()


def test_an_outline_of_one_frame_holds_in_all(sequence, tmp_path):
    """Painted in the first frame alone, the square is the tray for what any frame sees of it, and nothing else is."""
    time, corners = table_outline(sequence, 0)
    points, owner = owners(sequence, tmp_path, document(frame(time, ("tray", corners))))
    tray = points[owner == 3]
    assert set(owner.tolist()) == {0, 3} and len(tray) > 500
    np.testing.assert_allclose(tray[:, 2], TABLE[1][2], atol=0.01)
    assert (np.abs(tray[:, :2]) < 0.33).all()
    well_inside = (np.abs(points[:, :2]) < 0.27).all(axis=1) & (np.abs(points[:, 2] - TABLE[1][2]) < 0.01)
    assert (owner[well_inside] == 3).mean() > 0.99


def test_most_frames_decide_and_no_name_says_nothing(sequence, tmp_path):
    """Two frames say table and one says tray; what is wiped in all of them is of nothing."""
    frames = [table_outline(sequence, k) for k in range(3)]
    told = [frame(t, (name, c)) for (t, c), name in zip(frames, ("table", "tray", "table"), strict=True)]
    _, owner = owners(sequence, tmp_path / "votes", document(*told))
    assert (owner == 2).sum() > 20 * (owner == 3).sum() > 0
    wiped = [frame(t, ("table", WHOLE), (None, c)) for t, c in frames]
    points, owner = owners(sequence, tmp_path / "wiped", document(*wiped))
    middle = (np.abs(points[:, :2]) < 0.2).all(axis=1) & (np.abs(points[:, 2] - TABLE[1][2]) < 0.01)
    assert middle.any() and not owner[middle].any() and (owner == 2).sum() > 5000


def test_later_outlines_lie_over_earlier_ones_and_end_where_they_say():
    depth = np.where(np.arange(8) < 4, 1.0, 3.0) * np.ones((6, 8))
    depth[0, 0] = 0
    all_of_it = [[0, 0], [8, 0], [8, 6], [0, 6]]
    told = PaintedFrame.model_validate(frame(0, ("floor", all_of_it), ("tray", [[2, 1], [6, 1], [6, 5], [2, 5]])))
    labels = painted_labels(told, {"floor": 1, "tray": 3}, depth)
    assert (labels[1:5, 2:6] == 3).all() and (labels == 3).sum() == 16 and (labels == 1).sum() == 32
    told = PaintedFrame.model_validate(frame(0, ("floor", all_of_it), ("tray", all_of_it), farthest=2.0))
    labels = painted_labels(told, {"floor": 1, "tray": 3}, depth)
    assert (labels[:, :4] == 3).all() and (labels[:, 4:] == 1).all()


def test_seams_of_depth_are_closed_and_no_more():
    depth = np.full((5, 7), 2.0)
    depth[:, 2] = 0
    depth[:, 4:] = 0
    depth[:, 3] = 1.5
    closed = without_seams(depth)
    assert (closed[:, 2] == 1.5).all() and (closed[:, 4] == 1.5).all() and not closed[:, 5:].any()
    assert not without_seams(np.zeros((3, 3))).any()


SQUARE = ("tray", [[0, 0], [4, 0], [4, 4]])


@pytest.mark.parametrize(
    ("told", "message"),
    [
        (document(frame(0, SQUARE), version=2), "version"),
        (document(frame(0, SQUARE), format="scenewright-supports"), "format"),
        (document(), "frames"),
        (document({"time": 0, "outlines": []}), "frames.0.outlines"),
        (document(frame(-1, SQUARE)), "frames.0.time"),
        (document(frame(0, SQUARE), frame(0, SQUARE)), "two frames have the time 0 s"),
        (document(frame(0, ("tray", [[0, 0], [4, 0]]))), "frames.0.outlines.0.points"),
        (document(frame(0, ("tray", [[0, 0], [4, 0], [1e9, 4]]))), "frames.0.outlines.0.points.2.0"),
        (document(frame(0, SQUARE, farthest=0)), "frames.0.outlines.0.farthest"),
        (document(frame(0, SQUARE, depth=3)), "frames.0.outlines.0.depth"),
        (document(frame(0.5, SQUARE, ("plate", SQUARE[1]))), "outline 2 of the frame at 0.5 s.*no node plate"),
    ],
)
def test_what_cannot_be_is_told_in_one_line(tmp_path, told, message):
    with pytest.raises(BadInput, match=message) as raised:
        read_outlines(file_of(tmp_path, told), NODES)
    assert "outlines.json" in str(raised.value) and "\n" not in str(raised.value)


def test_frames_that_are_not_there(sequence, tmp_path, caplog):
    """Some: a warning with their number. All: an error that says which frames were painted."""
    time, corners = table_outline(sequence, 0)
    _, owner = owners(sequence, tmp_path / "some", document(frame(time, ("tray", corners)), frame(77.5, SQUARE)))
    assert (owner == 3).any()
    assert "1 of 2 painted frames are not in" in caplog.text and "77.5 s" in caplog.text
    with pytest.raises(BadInput, match="time of a painted one") as raised:
        owners(sequence, tmp_path / "none", document(frame(77.5, SQUARE)))
    assert "77.5 to 77.5 s" in raised.value.hint and "outlines.json" in str(raised.value)
