"""Rows of poses find their images by name, number, stamp or order, whatever the names look like."""

from __future__ import annotations

import random
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scenewright.schemas.errors import BadInput
from scenewright.stages.ingest.folders.pose_files import read_pose_list
from scenewright.stages.ingest.folders.stamped_poses import StampedPoses
from scipy.spatial.transform import Rotation

NAMES = {
    "padded": lambda number: f"{number:05d}",
    "bare": str,
    "prefixed": lambda number: f"frame-{number:06d}",
    "decimal": lambda number: f"{1305031100 + number * 0.033:.6f}",
    "words": lambda number: "chair" + "abcdefghij"[number % 10] + "abcdefghij"[number // 10 % 10],
}
LABELS = {
    "stem": lambda name, number: name,
    "file": lambda name, number: f"{name}.png",
    "path": lambda name, number: f"color/{name}.jpg",
    "number": lambda name, number: str(number),
}


def pose_of(number: int) -> np.ndarray:
    """A camera (4, 4) that depends on the number of its image."""
    matrix = np.eye(4)
    matrix[:3, :3] = Rotation.from_rotvec([0.1, 0.01 * number, -0.2]).as_matrix()
    matrix[:3, 3] = [number, 0.5, -1]
    return matrix


def numbers_of(pose: np.ndarray, columns: int) -> str:
    """The pose in 7, 12 or 16 numbers."""
    if columns == 7:
        values = [*pose[:3, 3], *Rotation.from_matrix(pose[:3, :3]).as_quat()]
    else:
        values = list(pose.flatten()[:columns])
    return " ".join(repr(float(value)) for value in values)


@given(
    naming=st.sampled_from(sorted(NAMES)),
    labelling=st.sampled_from(sorted(LABELS)),
    columns=st.sampled_from([7, 12, 16]),
    numbers=st.lists(st.integers(1, 99), min_size=2, max_size=12, unique=True),
    seed=st.integers(0, 9),
    left_out=st.integers(0, 1),
)
def test_a_named_pose_is_that_of_its_image(
    naming: str, labelling: str, columns: int, numbers: list[int], seed: int, left_out: int
) -> None:
    if labelling == "number" and naming in ("words", "decimal"):
        labelling = "stem"
    names = {number: NAMES[naming](number) for number in sorted(numbers)}
    listed = numbers[left_out:]
    random.Random(seed).shuffle(listed)
    rows = [f"{LABELS[labelling](names[number], number)} {numbers_of(pose_of(number), columns)}" for number in listed]
    with TemporaryDirectory() as folder:
        path = Path(folder, "poses.txt")
        path.write_text("\n".join(rows) + "\n")
        found = read_pose_list(path, list(names.values()))
    assert not isinstance(found, StampedPoses)
    for number, (pose, problem) in zip(names, found, strict=True):
        assert problem is None
        if number in listed:
            np.testing.assert_allclose(pose, pose_of(number), atol=1e-9)
        else:
            assert pose is None


@given(
    numbers=st.lists(st.integers(0, 99), min_size=3, max_size=12, unique=True),
    offset=st.floats(0.001, 0.999),
    naming=st.sampled_from(["padded", "bare", "prefixed"]),
)
def test_seconds_that_are_no_names_are_stamps(numbers: list[int], offset: float, naming: str) -> None:
    """One stamp may even look like an image's number: 0."""
    names = [NAMES[naming](number) for number in sorted(numbers)]
    stamps = ["0", *(repr(number + offset) for number in range(1, len(numbers)))]
    with TemporaryDirectory() as folder:
        path = Path(folder, "poses.txt")
        rows = [f"{t} {numbers_of(pose_of(k), 7)}" for k, t in enumerate(stamps)]
        path.write_text("\n".join(rows) + "\n")
        found = read_pose_list(path, names)
    assert isinstance(found, StampedPoses)
    assert len(found.stamps) == len(stamps)


@pytest.mark.parametrize("columns", [7, 12, 16])
def test_numbers_of_no_image_are_refused_or_stamps(tmp_path: Path, columns: int) -> None:
    path = tmp_path / "poses.txt"
    path.write_text("\n".join(f"{900 + k}.5 {numbers_of(pose_of(k), columns)}" for k in range(3)) + "\n")
    if columns == 7:
        assert isinstance(read_pose_list(path, ["00001", "00002", "00003"]), StampedPoses)
    else:
        with pytest.raises(BadInput, match="name no image of the log"):
            read_pose_list(path, ["00001", "00002", "00003"])


def test_two_rows_of_one_image_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "poses.txt"
    rows = [f"{label} {numbers_of(pose_of(1), 16)}" for label in ("1", "2", "01")]
    path.write_text("\n".join(rows) + "\n")
    with pytest.raises(BadInput, match="line 3: a second pose for '01'"):
        read_pose_list(path, ["frame-01", "frame-02"])
