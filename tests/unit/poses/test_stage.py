"""The whole step on small rendered logs: a closed walk, blank frames, depth alone, bad input, the same bytes twice."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scenewright.schemas.errors import BadInput, UsageError
from scenewright.schemas.sequence import Sequence
from scenewright.schemas.trajectory import FrameEstimate, LoopClosure, PosesFile, Trajectory
from scenewright.stages.kit.formats.frames import Frame, FrameReader
from scenewright.stages.kit.formats.trajectories import read_tum
from scenewright.stages.kit.geometry.transforms import inverse
from scenewright.stages.kit.measurement.pose_error import trajectory_error
from scenewright.stages.kit.progress import SilentProgress
from scenewright.stages.kit.registration.rigid_motion import between, exponential
from scenewright.stages.kit.stage import Context
from scenewright.stages.poses.contradiction import contradicted
from scenewright.stages.poses.frame_poses import FramePose
from scenewright.stages.poses.parameters import PosesParameters, check
from scenewright.stages.poses.stage import outcome_of, ranges, run

from tests.unit.poses.textured_room import CAMERA, round_walk, write_sequence

FRAMES = 49
WALK = round_walk(FRAMES)


def poses(sequence: Sequence, out: Path, **options: object) -> Trajectory:
    """Run the step in this process."""
    out.mkdir(parents=True)
    context = Context(out, seed=0, device="cpu", progress=SilentProgress())
    return run(sequence, parameters=PosesParameters(width=160, **options), context=context)  # type: ignore[arg-type]


def aligned_error(made: Trajectory, true: np.ndarray = WALK) -> float:
    """Root mean square distance of the camera centres after rigid alignment [m]."""
    error = trajectory_error(0.1 * np.arange(len(true)), true, *read_tum(made.path("trajectory.tum")))
    assert error is not None
    return error.rmse_aligned


@pytest.fixture(scope="module")
def closed(tmp_path_factory: pytest.TempPathFactory) -> tuple[Sequence, Trajectory]:
    """A walk all the way round, estimated."""
    folder = tmp_path_factory.mktemp("closed")
    sequence = write_sequence(folder / "sequence", WALK)
    return sequence, poses(sequence, folder / "poses")


def test_a_closed_walk_is_found_and_stands_upright(closed: tuple[Sequence, Trajectory]) -> None:
    _, made = closed
    assert made.outcome == "ok" and made.summary["posed"] == FRAMES
    assert aligned_error(made) < 0.015
    info = made.info
    assert info.world == "upright" and info.gravity.method == "floor_plane"
    times, found = read_tum(made.path("trajectory.tum"))
    np.testing.assert_allclose(times, 0.1 * np.arange(FRAMES), atol=1e-6)
    np.testing.assert_allclose(found[:, 2, 3], 1.3, atol=0.03)  # the cameras' height over the floor
    np.testing.assert_allclose(found[:, 2, 2], WALK[:, 2, 2], atol=0.02)  # how far they look down


def test_the_walk_closes_its_loop(closed: tuple[Sequence, Trajectory]) -> None:
    info = closed[1].info
    ends = [loop for loop in info.loops if loop.first < 10 and loop.second > FRAMES - 10 and loop.weight > 0.5]
    assert ends, "first and last frames see the same wall"
    assert info.frames[0].status == "key" and all(0 < frame.confidence <= 1 for frame in info.frames)
    assert info.path_length == pytest.approx(2 * np.pi * 0.3, rel=0.1)
    assert all(frame.uncertainty is not None and frame.uncertainty < 0.05 for frame in info.frames)


def test_the_same_bytes_again(closed: tuple[Sequence, Trajectory], tmp_path: Path) -> None:
    sequence, made = closed
    again = poses(sequence, tmp_path / "again")
    for name in ("trajectory.tum", "poses.json"):
        assert again.path(name).read_bytes() == made.path(name).read_bytes()


def test_poses_of_the_sequence_are_only_its_world(tmp_path: Path) -> None:
    short = WALK[:12]
    sequence = write_sequence(tmp_path / "sequence", short, with_pose=True)
    made = poses(sequence, tmp_path / "poses", loop_closure=False)
    assert made.info.world == "sequence"
    _, found = read_tum(made.path("trajectory.tum"))
    assert np.linalg.norm(found[:, :3, 3] - short[:, :3, 3], axis=1).max() < 0.02
    first = poses(sequence, tmp_path / "first", loop_closure=False, world="first")
    _, own = read_tum(first.path("trajectory.tum"))
    np.testing.assert_allclose(own[0], np.eye(4), atol=1e-9)
    np.testing.assert_allclose(inverse(own[3]) @ own[9], inverse(found[3]) @ found[9], atol=1e-6)


def drifted(true: np.ndarray, turn: float, stretch: float) -> np.ndarray:
    """Poses (N, 4, 4) whose every step turns by so much too much [rad] and is so many times as long."""
    result, bend = [true[0]], exponential(np.array([0.0, turn, 0.0, 0.0, 0.0, 0.0]))
    for motion in inverse_steps(true):
        motion[:3, 3] *= stretch
        result.append(result[-1] @ motion @ bend)
    return np.array(result)


def inverse_steps(poses: np.ndarray) -> list[np.ndarray]:
    return [inverse(a) @ b for a, b in pairwise(poses)]


def end_error(path: np.ndarray, true: np.ndarray = WALK) -> float:
    """Distance by which the last pose is off, seen from the first [m]."""
    return float(np.linalg.norm((between(path[0], path[-1]) - between(true[0], true[-1]))[:3, 3]))


def test_given_poses_that_drift_are_refined(tmp_path: Path) -> None:
    """Once round and 14 degrees too far: the loop of the whole way is 8 cm from where the given poses put it."""
    given = drifted(WALK, np.radians(0.3), 1.05)
    sequence = write_sequence(tmp_path / "sequence", WALK, with_pose=True, given=given)
    made = poses(sequence, tmp_path / "poses", method="refine")
    before = trajectory_error(0.1 * np.arange(FRAMES), WALK, 0.1 * np.arange(FRAMES), given)
    found = read_tum(made.path("trajectory.tum"))[1]
    assert before is not None and before.rmse_aligned > 0.03 and end_error(given) > 0.07
    assert made.outcome == "ok" and made.info.method == "refine"
    assert aligned_error(made) < 0.1 * before.rmse_aligned and end_error(found) < 0.1 * end_error(given)
    assert made.info.world == "sequence"  # about where the given poses are
    np.testing.assert_allclose((found - given)[:, :3, 3].mean(axis=0), 0, atol=1e-6)


def test_given_poses_that_are_right_stay(tmp_path: Path) -> None:
    short = WALK[:16]
    sequence = write_sequence(tmp_path / "sequence", short, with_pose=True)
    found = read_tum(poses(sequence, tmp_path / "poses", method="refine").path("trajectory.tum"))[1]
    assert np.linalg.norm((found - short)[:, :3, 3], axis=1).max() < 0.003


def test_a_jump_of_given_poses_that_the_depth_denies(tmp_path: Path) -> None:
    """A phone that finds itself again moves its world: the motion of that step is that of the depth."""
    short = WALK[:16]
    given = short.copy()
    given[8:] = exponential(np.array([0.0, 0.0, 0.1, 0.3, -0.2, 0.1])) @ given[8:]
    sequence = write_sequence(tmp_path / "sequence", short, with_pose=True, given=given)
    made = poses(sequence, tmp_path / "poses", method="refine", loop_closure=False)
    assert made.outcome == "ok" and aligned_error(made, short) < 0.005


def test_frames_that_the_given_poses_or_the_depth_lack(tmp_path: Path) -> None:
    """Blank frames stay where they were put; what nobody placed is looked for."""
    short = WALK[:16]
    sequence = write_sequence(
        tmp_path / "sequence", short, with_pose=True, blank=(6, 7), given=[*short[:11], None, None, *short[13:]]
    )
    made = poses(sequence, tmp_path / "poses", method="refine")
    assert made.outcome == "ok" and aligned_error(made, short) < 0.005


def test_depth_alone(tmp_path: Path) -> None:
    corner = WALK[4:10]  # before a plain wall depth alone would slide
    sequence = write_sequence(tmp_path / "sequence", corner, with_color=False)
    made = poses(sequence, tmp_path / "poses")
    assert made.outcome == "ok" and aligned_error(made, corner) < 0.02


def test_blank_frames_are_bridged_and_named(tmp_path: Path) -> None:
    sequence = write_sequence(tmp_path / "sequence", WALK[:16], blank=(6, 7))
    made = poses(sequence, tmp_path / "poses", loop_closure=False)
    assert made.outcome == "tracking_lost"
    unposed = [(frame.frame, frame.fault) for frame in made.info.frames if frame.status == "unposed"]
    assert unposed == [(6, "no_depth"), (7, "no_depth")]
    assert "2 of 16 frames have no pose (no_depth 2): 6-7" in made.summary["reason"]
    times, _ = read_tum(made.path("trajectory.tum"))
    assert len(times) == 14 and aligned_error(made, WALK[:16]) < 0.02


def test_a_jump_splits_the_path_and_the_smaller_part_has_no_pose(tmp_path: Path) -> None:
    """The camera is carried to the other side of the room: nothing is seen twice."""
    walk = np.concatenate([WALK[:10], WALK[24:28]])
    sequence = write_sequence(tmp_path / "sequence", walk)
    made = poses(sequence, tmp_path / "poses")
    assert made.outcome == "tracking_lost" and made.info.parts == 2
    unposed = {frame.frame: frame.fault for frame in made.info.frames if frame.status == "unposed"}
    assert unposed == {10: "lost", 11: "not_joined", 12: "not_joined", 13: "not_joined"}


def test_a_jump_and_back_is_joined_by_a_loop(tmp_path: Path) -> None:
    """Tracking is lost twice, but the third stretch sees what the first saw."""
    walk = np.concatenate([WALK[:9], WALK[30:33], WALK[3:11]])
    sequence = write_sequence(tmp_path / "sequence", walk)
    made = poses(sequence, tmp_path / "poses")
    unposed = [frame.frame for frame in made.info.frames if frame.status == "unposed"]
    assert unposed == [9, 10, 11] and made.info.frames[12].fault == "lost"
    assert aligned_error(made, walk) < 0.02


def test_all_frames_blank(tmp_path: Path) -> None:
    sequence = write_sequence(tmp_path / "sequence", WALK[:4], blank=range(4))
    made = poses(sequence, tmp_path / "poses")
    assert made.outcome == "empty" and len(made.info.frames) == 4
    assert len(read_tum(made.path("trajectory.tum"))[0]) == 0


@pytest.mark.parametrize(
    ("count", "settings", "options", "words"),
    [
        (3, {"with_depth": False}, {}, "no depth"),
        (1, {}, {}, "has 1 frame, a path needs two"),
        (0, {}, {}, "no frames"),
        (3, {"with_color": False}, {"method": "sfm"}, "have no colour"),
        (3, {"with_color": False}, {"bundle_adjustment": True}, "have no colour"),
        (3, {}, {"world": "sequence"}, "has a pose in the sequence"),
        (3, {}, {"method": "refine"}, "has a pose in the sequence"),
    ],
)
def test_bad_input_is_one_line(
    tmp_path: Path, count: int, settings: dict[str, bool], options: dict[str, object], words: str
) -> None:
    sequence = write_sequence(tmp_path / "sequence", WALK[:count], **settings)  # type: ignore[arg-type]
    with pytest.raises(BadInput, match=words) as caught:
        poses(sequence, tmp_path / "poses", **options)
    assert "\n" not in caught.value.message and caught.value.hint


def test_options_that_do_not_go_together() -> None:
    with pytest.raises(UsageError, match="sfm needs colour"):
        check(PosesParameters(method="sfm", use_color=False), {})
    for parameters in (PosesParameters(method="sfm"), PosesParameters(use_color=False)):
        with pytest.raises(UsageError, match="--features"):
            check(parameters, {"features": "xfeat"})
    with pytest.raises(UsageError, match="bundle-adjustment needs colour"):
        check(PosesParameters(bundle_adjustment=True, use_color=False), {})


def test_ranges() -> None:
    assert ranges([3, 4, 5, 9, 12, 13]) == "3-5, 9, 12-13"
    assert ranges([1, 3, 5], most=2) == "1, 3, ..."


def test_bundle_adjustment_does_not_contradict_the_depth(tmp_path: Path) -> None:
    """Features of a camera that only turns have no parallax: what adjustment makes of them must not be taken."""
    sequence = write_sequence(tmp_path / "sequence", WALK[:10])
    adjusted = poses(sequence, tmp_path / "adjusted", bundle_adjustment=True)
    assert adjusted.outcome == "ok" and aligned_error(adjusted, WALK[:10]) < 0.015


@pytest.mark.slow
def test_structure_from_motion_has_metres(tmp_path: Path) -> None:
    """A camera that also moves sideways, so that features have parallax."""
    walk = round_walk(40, turns=0.4)
    walk[:, :3, 3] += np.column_stack([np.linspace(-0.4, 0.4, 40), np.zeros(40), 0.1 * np.sin(np.arange(40) / 5)])
    sequence = write_sequence(tmp_path / "sequence", walk)
    made = poses(sequence, tmp_path / "poses", method="sfm", sfm_frames=20)
    info = made.info
    assert made.summary["posed"] > 30 and aligned_error(made, walk) < 0.05
    assert {frame.status for frame in info.frames} >= {"tracked", "interpolated"}


def test_a_path_that_denies_the_places_it_comes_back_to_is_not_ok() -> None:
    def path(kept: int, denied: int) -> PosesFile:
        loops = [LoopClosure(first=0, second=9, found_by="place", weight=w, overlap=0.6) for w in (0.9, 0.1)]
        frame = FrameEstimate(frame=0, time=0.0, status="tracked", fault="", confidence=1.0)
        return PosesFile.model_construct(frames=(frame,), loops=(*[loops[0]] * kept, *[loops[1]] * denied))

    assert outcome_of(path(34, 4)) == "ok" and outcome_of(path(28, 30)) == "contradictory"
    assert outcome_of(path(1, 1)) == "ok", "of two places one may look like another"


@pytest.mark.parametrize("scale", [1.0, 0.2])
@pytest.mark.parametrize("wrong", [(), (4,), (3, 4, 11)])
def test_frames_that_the_depth_of_others_contradicts(tmp_path: Path, wrong: tuple[int, ...], scale: float) -> None:
    """Also where the unit of the depth is wrong, and every length with it."""
    sequence = write_sequence(tmp_path / "sequence", WALK[:16])
    placed = WALK[:16].copy()
    placed[list(wrong), :3, 3] += (0.4, 0.3, 0.2)
    placed[:, :3, 3] *= scale
    path = [FramePose(k, pose, "key" if k % 2 else "tracked") for k, pose in enumerate(placed)]
    with FrameReader(sequence.path("frames.mcap")) as reader:
        assert contradicted(Rescaled(reader, scale), CAMERA, path, 0.75, 4.5) == set(wrong)  # type: ignore[arg-type]


class Rescaled:
    """A reader of frames whose depth is multiplied."""

    def __init__(self, reader: FrameReader, scale: float) -> None:
        self.reader, self.scale = reader, scale

    def read(self, index: int, streams: tuple[str, ...]) -> Frame:
        frame = self.reader.read(index, streams)
        assert frame.depth is not None
        return replace(frame, depth=frame.depth * np.float32(self.scale))


def test_one_wrong_frame_has_no_pose_and_many_are_contradictory() -> None:
    def outcome(wrong: int) -> str:
        good = FrameEstimate(frame=0, time=0.0, status="tracked")
        bad = FrameEstimate(frame=1, time=0.0, status="unposed", fault="contradicted")
        return outcome_of(PosesFile.model_construct(frames=(*[good] * (20 - wrong), *[bad] * wrong), loops=()))

    assert [outcome(wrong) for wrong in (0, 1, 3, 4)] == ["ok", "tracking_lost", "tracking_lost", "contradictory"]
