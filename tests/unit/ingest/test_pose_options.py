"""--pose-convention and --pose-scale: a log whose poses are meant otherwise gives the same sequence."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scenewright.schemas.sequence import Sequence
from scenewright.stages.kit.formats.trajectories import read_tum
from scenewright.stages.kit.geometry.transforms import inverse

from tests.unit.ingest.running import ingest
from tests.unit.ingest.tiny_room import frames, write_seven_scenes

OPENGL = np.diag([1.0, -1.0, -1.0, 1.0])


def _poses(sequence: Sequence) -> np.ndarray:
    return read_tum(sequence.path("trajectory.tum"))[1]


@pytest.mark.parametrize(
    ("convention", "written"),
    [("inverse", inverse), ("opengl", lambda pose: pose @ OPENGL), ("inverse-opengl", lambda p: inverse(p @ OPENGL))],
)
def test_poses_in_another_convention(tmp_path: Path, convention: str, written) -> None:
    room = frames(4)
    plain = ingest(write_seven_scenes(tmp_path / "plain", room), tmp_path / "a", gravity="none")
    other = [(color, depth, written(pose)) for color, depth, pose in room]
    same = ingest(
        write_seven_scenes(tmp_path / "other", other), tmp_path / "b", gravity="none", pose_convention=convention
    )
    np.testing.assert_allclose(_poses(same), _poses(plain), atol=1e-6)
    assert any(convention in note for note in same.info.notes)


def test_positions_in_millimetres(tmp_path: Path) -> None:
    room = frames(4)
    plain = ingest(write_seven_scenes(tmp_path / "plain", room), tmp_path / "a", gravity="none")
    large = [
        (color, depth, np.diag([1000.0, 1000, 1000, 1]) @ pose @ np.diag([1e-3, 1e-3, 1e-3, 1]))
        for color, depth, pose in room
    ]
    same = ingest(write_seven_scenes(tmp_path / "large", large), tmp_path / "b", gravity="none", pose_scale=0.001)
    np.testing.assert_allclose(_poses(same), _poses(plain), atol=1e-6)


def test_a_stated_up_is_not_believed_of_reinterpreted_poses(tmp_path: Path) -> None:
    room = frames(4)
    first = ingest(write_seven_scenes(tmp_path / "plain", room), tmp_path / "a", gravity="floor")
    again = ingest(first.path("frames.mcap"), tmp_path / "b", pose_convention="opengl")
    assert first.info.gravity.method == "floor_plane" and again.info.gravity.method != "given"
