"""`evaluate --trajectory`: against the poses that the log gave, and what an estimate says of itself."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from scenewright.schemas.base import as_transform
from scenewright.schemas.sequence import Gravity
from scenewright.schemas.trajectory import FrameEstimate, LoopClosure, PosesFile, Trajectory
from scenewright.stages.evaluate.parameters import EvaluateParameters
from scenewright.stages.evaluate.stage import run
from scenewright.stages.kit.formats.trajectories import write_tum
from scenewright.stages.kit.geometry.transforms import transform_from_yaw
from scenewright.stages.kit.progress import SilentProgress
from scenewright.stages.kit.stage import Context

from tests.unit.poses.textured_room import round_walk, write_sequence

COUNT = 30
WALK = round_walk(COUNT)


def evaluated(tmp_path: Path, poses: np.ndarray, info: PosesFile | None = None, given: bool = True) -> dict:
    sequence = write_sequence(tmp_path / "sequence", WALK, with_color=False, with_pose=given)
    trajectory = Trajectory(tmp_path / "trajectory")
    trajectory.root.mkdir()
    write_tum(trajectory.path("trajectory.tum"), 0.1 * np.arange(COUNT), poses)
    if info is not None:
        info.write(trajectory.path("poses.json"))
    (tmp_path / "evaluation").mkdir()
    context = Context(tmp_path / "evaluation", 0, "cpu", SilentProgress())
    run(sequence=sequence, trajectory=trajectory, parameters=EvaluateParameters(plots=False), context=context)  # type: ignore[call-arg]
    return json.loads((tmp_path / "evaluation" / "metrics.json").read_text())


def test_the_poses_of_the_log_are_the_measure(tmp_path: Path) -> None:
    """Elsewhere in the world, but the same path: only the error before alignment knows."""
    found = evaluated(tmp_path, transform_from_yaw(0.5, np.array([1.0, 2.0, 0.0])) @ WALK)
    metrics = found["metrics"]
    assert metrics["trajectory/poses_associated"] == COUNT
    assert metrics["trajectory/ate_rmse_aligned_m"] == pytest.approx(0.0, abs=1e-6)
    assert metrics["trajectory/ate_rmse_m"] > 1.0
    assert metrics["trajectory/rpe_per_second_m"] == pytest.approx(0.0, abs=1e-6)
    assert any("poses that the log gave" in note for note in found["notes"])


def test_a_stretched_path_drifts_by_the_metre(tmp_path: Path) -> None:
    walk = WALK.copy()
    walk[:, :3, 3] = WALK[0, :3, 3] + 1.1 * (WALK[:, :3, 3] - WALK[0, :3, 3])
    metrics = evaluated(tmp_path, walk)["metrics"]
    # A chord of the circle of 0.3 m over one metre of arc, a tenth too long.
    chord = 2 * 0.3 * np.sin(1.0 / 0.3 / 2)
    assert metrics["trajectory/rpe_per_metre_m"] == pytest.approx(0.1 * chord, rel=0.1)
    assert metrics["trajectory/rpe_per_metre_rad"] == pytest.approx(0.0, abs=1e-6)


def test_what_an_estimate_says_of_itself_is_counted(tmp_path: Path) -> None:
    frames = [FrameEstimate(frame=k, time=0.1 * k, status="tracked") for k in range(COUNT)]
    frames[4] = FrameEstimate(frame=4, time=0.4, status="unposed", fault="no_depth")
    loops = [LoopClosure(first=0, second=20, found_by="place", weight=weight, overlap=0.5) for weight in (1.0, 0.1)]
    info = PosesFile(
        method="rgbd",
        camera="camera",
        world="first",
        frames=tuple(frames),
        loops=tuple(loops),
        drift=0.01,
        gravity=Gravity(method="none", world_from_log=as_transform(np.eye(4))),
    )
    metrics = evaluated(tmp_path, WALK, info, given=False)["metrics"]
    assert metrics["trajectory/frames"] == COUNT and metrics["trajectory/frames_unposed"] == 1
    assert metrics["trajectory/loops"] == 1 and metrics["trajectory/drift_per_metre"] == 0.01
    assert "trajectory/ate_rmse_m" not in metrics
