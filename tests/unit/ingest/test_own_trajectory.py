"""A trajectory of one's own takes the place of a log's poses: `ingest --trajectory`, `fuse --trajectory`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scenewright.schemas.errors import BadInput
from scenewright.schemas.sequence import Sequence
from scenewright.schemas.trajectory import Trajectory
from scenewright.stages.engine.reading import open_outside
from scenewright.stages.engine.runner import _open_inputs
from scenewright.stages.evaluate.stage import _trajectory as evaluated
from scenewright.stages.fuse.parameters import STAGE as FUSE
from scenewright.stages.ingest.parameters import IngestParameters
from scenewright.stages.ingest.stage import run
from scenewright.stages.kit.formats.frames import FrameReader
from scenewright.stages.kit.geometry.transforms import inverse
from scenewright.stages.kit.own_trajectory import frame_poses
from scenewright.stages.kit.progress import SilentProgress
from scenewright.stages.kit.stage import Context

from tests.unit.ingest.folder_writers import stamp_text, tum_line, write_nerfstudio, write_tum
from tests.unit.ingest.message_logs import FIRST, SECOND, record_room, recorder
from tests.unit.ingest.running import ingest
from tests.unit.ingest.tiny_room import frames

COUNT = 6
FROM_FIRST = np.array([[1, 0, 0, 0.3], [0, 0.8, -0.6, 0], [0, 0.6, 0.8, 0.1], [0, 0, 0, 1]], dtype=float)
"""Where somebody's own SLAM puts its world: nothing is upright in it."""


def with_trajectory(log: Path, trajectory: Path, output: Path, **options: object) -> Sequence:
    output.mkdir()
    context = Context(output=output, seed=0, device="cpu", progress=SilentProgress())
    parameters = IngestParameters(**options)  # type: ignore[arg-type]
    return run(log, trajectory, parameters=parameters, context=context)


def poses_of(sequence: Sequence) -> np.ndarray:
    with FrameReader(sequence.path("frames.mcap")) as reader:
        return reader.poses()[1]


def lines(recorded: list, shift: float = 0.004) -> str:
    rows = [tum_line(stamp_text(k, shift), FROM_FIRST @ pose) for k, (*_, pose) in enumerate(recorded)]
    return "\n".join(["# timestamp tx ty tz qx qy qz qw", *rows])


@pytest.fixture
def log(tmp_path: Path) -> Path:
    return write_tum(tmp_path / "log", frames(COUNT), groundtruth=False)


@pytest.mark.parametrize("in_a_folder", [False, True])
@pytest.mark.parametrize("shift", [0.004, 0.0])  # of the depth images, or of the pictures
def test_ingest_takes_it_and_makes_its_world_upright(
    tmp_path: Path, log: Path, in_a_folder: bool, shift: float
) -> None:
    recorded = frames(COUNT)
    (tmp_path / "own").mkdir()
    path = tmp_path / "own" / "trajectory.tum"
    path.write_text(lines(recorded, shift))
    made = with_trajectory(log, path.parent if in_a_folder else path, tmp_path / "out", pose_convention="as-is")
    assert made.summary["posed_frames"] == COUNT
    assert "poses from trajectory.tum, by option, taken as world_from_camera" in made.info.notes
    found, true = poses_of(made), np.array([pose for *_, pose in recorded])
    tolerance = 1e-5 if shift else 0.2  # by their own pictures' stamps poses are interpolated
    np.testing.assert_allclose(inverse(found[0]) @ found[-1], inverse(true[0]) @ true[-1], atol=tolerance)
    np.testing.assert_allclose(found[:, 2, :3], true[:, 2, :3], atol=0.2 if not shift else 0.03)  # z is up


def test_units_of_its_stamps_and_positions(tmp_path: Path, log: Path) -> None:
    path, recorded = tmp_path / "own.txt", frames(COUNT)
    rows = lines(recorded).splitlines()[1:]
    numbers = [[float(value) for value in row.split()] for row in rows]
    millimetres = [" ".join(map(str, [1000 * value for value in row[1:4]] + row[4:])) for row in numbers]
    stamps = [row.split()[0].replace(".", "") + "000" for row in rows]
    path.write_text("\n".join(f"{stamp} {rest}" for stamp, rest in zip(stamps, millimetres, strict=True)))
    made = with_trajectory(log, path, tmp_path / "out", pose_scale=0.001)
    assert made.summary["posed_frames"] == COUNT and "own.txt: stamps in ns" in made.info.notes
    found, true = poses_of(made), np.array([pose for *_, pose in recorded])
    np.testing.assert_allclose(inverse(found[0]) @ found[-1], inverse(true[0]) @ true[-1], atol=1e-5)


def test_poses_may_be_named_by_the_pictures_of_the_log(tmp_path: Path) -> None:
    recorded = frames(COUNT)
    log, path = write_nerfstudio(tmp_path / "log", recorded), tmp_path / "own.txt"
    rows = [tum_line(f"frame_{k + 1}.png", pose) for k, (*_, pose) in enumerate(recorded)]
    path.write_text("\n".join(rows[::-1]))
    made = with_trajectory(log, path, tmp_path / "out", gravity="none")
    np.testing.assert_allclose(poses_of(made), [pose for *_, pose in recorded], atol=1e-6)


@pytest.mark.parametrize("digits", [0, 3, 6, 9])
def test_a_bag_takes_one_whatever_its_own_transforms_say(tmp_path: Path, digits: int) -> None:
    recorded = frames(COUNT)
    with recorder(tmp_path / "bag") as bag:
        record_room(bag, [(color, depth, np.eye(4)) for color, depth, _ in recorded])
    stamps = (
        [(FIRST + k * SECOND // 10) // 10 ** (9 - digits) for k in range(COUNT)]
        if digits
        else [f"{FIRST // SECOND + k / 10:.6f}" for k in range(COUNT)]
    )
    rows = [tum_line(str(stamp), pose) for stamp, (*_, pose) in zip(stamps, recorded, strict=True)]
    (tmp_path / "own.tum").write_text("\n".join(rows))
    made = with_trajectory(bag.path, tmp_path / "own.tum", tmp_path / "out", gravity="none")
    np.testing.assert_allclose(poses_of(made), [pose for *_, pose in recorded], atol=1e-6)


@pytest.mark.parametrize("take", ["ingest", "fuse"])
def test_another_clock_is_refused_with_the_offset(tmp_path: Path, log: Path, take: str) -> None:
    path = tmp_path / "own.tum"
    path.write_text(lines(frames(COUNT), shift=120.0))
    with pytest.raises(BadInput, match=r"begin (119\.996|120) s after the frames"):
        if take == "ingest":
            with_trajectory(log, path, tmp_path / "out")
        else:
            own_poses(ingest(log, tmp_path / "sequence"), path)


def own_poses(sequence: Sequence, path: Path) -> list[np.ndarray | None]:
    trajectory = open_outside(path, Trajectory)
    assert trajectory is not None
    with FrameReader(sequence.path("frames.mcap")) as reader:
        return frame_poses(trajectory, sequence, reader, 0.02)


@pytest.mark.parametrize("in_a_folder", [False, True])
def test_steps_take_a_file_in_place_of_an_artifact(tmp_path: Path, log: Path, in_a_folder: bool) -> None:
    recorded = frames(COUNT)
    (tmp_path / "own").mkdir()
    path = tmp_path / "own" / "trajectory.tum"
    path.write_text(lines(recorded))
    found = np.array(own_poses(ingest(log, tmp_path / "sequence"), path.parent if in_a_folder else path))
    true = np.array([pose for *_, pose in recorded])
    np.testing.assert_allclose(inverse(found[0]) @ found[-1], inverse(true[0]) @ true[-1], atol=1e-6)
    np.testing.assert_allclose(found[:, 2, :3], true[:, 2, :3], atol=0.03)
    assert open_outside(tmp_path, Trajectory) is None and open_outside(path, Sequence) is None
    assert len(evaluated(open_outside(path, Trajectory))[0]) == COUNT  # type: ignore[index]
    (opened,) = _open_inputs(FUSE, {"trajectory": path})
    assert opened.kind == "external" and isinstance(opened.value, Trajectory) and not opened.was_written()
    with pytest.raises(BadInput, match=r"neither an artifact nor trajectory\.tum"):
        _open_inputs(FUSE, {"trajectory": tmp_path})
