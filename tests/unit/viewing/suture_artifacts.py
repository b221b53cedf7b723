"""Small artifacts of suturing, sealed as the runner does: one grey pair, one pose, one trial that failed."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from scenewright.schemas.base import as_transform
from scenewright.schemas.evaluation import MetricsFile
from scenewright.schemas.scene_parts import Camera
from scenewright.schemas.sequence import Gravity, SequenceCamera, SequenceFile
from scenewright.schemas.suture_needle import (
    NeedleEstimateRecord,
    NeedleFrame,
    SutureNeedleFile,
    SutureThreadFile,
    ThreadFrame,
)
from scenewright.schemas.suture_scene import StereoRigRecord, SutureSceneFile, SutureView
from scenewright.schemas.suture_trial import SutureEvent, SuturePerception, SutureRun, SutureTrialFile
from scenewright.stages.kit.formats.frames import FrameWriter
from scenewright.stages.kit.formats.trajectories import write_tum

from tests.unit.viewing.artifacts import seal

CAMERA = Camera(width=32, height=24, fx=60.0, fy=60.0, cx=15.5, cy=11.5)
RIG = StereoRigRecord(camera=CAMERA, baseline=0.06)
POSE = np.array([[1.0, 0, 0, 0.002], [0, 1.0, 0, 0], [0, 0, 1.0, 0.3], [0, 0, 0, 1.0]])
FROM_WORLD = np.array([[1.0, 0, 0, 0], [0, -1.0, 0, 0], [0, 0, -1.0, 0.35], [0, 0, 0, 1.0]])
CURVE = np.stack([np.linspace(0, 0.02, 5), np.zeros(5), np.full(5, 0.3)], axis=1)
PICTURE = cv2.imencode(".png", np.zeros((4, 4, 3), np.uint8))[1].tobytes()


def make_suture(run: Path) -> None:
    """Write one artifact of each kind."""
    make_scene(run)
    make_needle(run)
    make_thread(run)
    make_trial(run)
    make_evaluation(run)


def make_scene(run: Path) -> Path:
    """Write a scene of one frame."""
    root = run / "suture_scene"
    (root / "truth").mkdir(parents=True)
    grey = cv2.imencode(".png", np.full((24, 32, 3), 90, np.uint8))[1].tobytes()
    with FrameWriter(root / "frames.mcap", CAMERA, cameras={"camera": CAMERA}, baselines={"camera": 0.06}) as writer:
        writer.write(1.0, grey, None, np.linalg.inv(FROM_WORLD), right=grey, camera_name="camera")
    bodies = np.zeros((24, 32), np.uint8)
    bodies[11:13, 8:20] = 1
    for side in ("left", "right"):
        cv2.imwrite(str(root / "truth" / f"000000_{side}.png"), bodies)
    cv2.imwrite(str(root / "truth" / "000000_disparity.png"), np.full((24, 32), 1536, np.uint16))
    np.savez_compressed(root / "threads.npz", thread_000000=CURVE)
    write_tum(root / "trajectory.tum", np.array([1.0]), np.linalg.inv(FROM_WORLD)[None])
    SequenceFile(
        source_format="rendered",
        rule="suture scene",
        camera=CAMERA,
        streams=("color", "right", "pose"),
        cameras=(SequenceCamera(name="camera", camera=CAMERA, baseline=0.06, frame_count=1),),
        frame_count=1,
        frames_in_log=1,
        gravity=Gravity(method="given", world_from_log=as_transform(np.eye(4))),
        start_time=1.0,
        end_time=1.0,
    ).write(root / "sequence.json")
    SutureSceneFile(
        seed=0,
        arrangement="motion",
        rig=RIG,
        rig_name="two_cameras",
        needle_radius=0.012,
        calibration_error=0.15,
        bodies={"needle": 1, "thread": 2, "left_driver": 3, "right_driver": 4},
        views=(
            SutureView(
                frame=0,
                seed=0,
                holder="air",
                place="wound",
                camera_from_needle=as_transform(POSE),
                camera_from_world=as_transform(FROM_WORLD),
                right_eye_turn=(0.0, 0.0, 0.0),
                seen=0.9,
                degrees_from_edge_on=89.6,
            ),
        ),
    ).write(root / "scene.json")
    return seal(root, "suture_scene")


def make_needle(run: Path) -> Path:
    """Write one frame with a pose, and the same filtered."""
    root = run / "suture_needle"
    (root / "pictures").mkdir(parents=True)
    known = NeedleEstimateRecord(
        camera_from_needle=as_transform(POSE),
        tip_probability=0.97,
        abstained="",
        covariance=tuple(tuple(row) for row in np.diag([1e-7] * 3 + [1e-3] * 3).tolist()),
    )
    SutureNeedleFile(
        statement="the needle is known",
        estimator="ours",
        masks="truth",
        masks_from="the rendered truth",
        disparity="",
        rig=RIG,
        needle_radius=0.012,
        filtered=known,
        filter="still",
        frames=(NeedleFrame(frame=0, time=1.0, estimate=known, mask_pixels=(24, 24)),),
    ).write(root / "needle.json")
    (root / "pictures" / "000000.png").write_bytes(PICTURE)
    return seal(root, "suture_needle", sequence=run / "suture_scene")


def make_thread(run: Path) -> Path:
    """Write one frame with a curve."""
    root = run / "suture_thread"
    (root / "pictures").mkdir(parents=True)
    SutureThreadFile(
        statement="thread of 20 mm",
        masks="truth",
        masks_from="the rendered truth",
        rig=RIG,
        started_at_needle=True,
        frames=(ThreadFrame(frame=0, time=1.0, points=5, length=0.02, status="ok", mask_pixels=(24, 24)),),
    ).write(root / "thread.json")
    np.savez_compressed(root / "threads.npz", points_000000=CURVE, deviation_000000=np.full(5, 1e-4))
    (root / "pictures" / "000000.png").write_bytes(PICTURE)
    return seal(root, "suture_thread", sequence=run / "suture_scene")


def make_trial(run: Path) -> Path:
    """Write one trial of two sutures."""
    root = run / "suture_trial"
    root.mkdir()
    SutureTrialFile(
        statement="thesis, seed 0: 2 of 6 sutures in 300 s",
        runs=(
            SutureRun(
                arm="thesis",
                seed=0,
                sutures=2,
                sutures_neutral=2,
                attempts=3,
                seconds=300.0,
                errors="I",
                reasons=("the tip missed the raised edge",),
                error_sutures=(2,),
                error_seconds=(300.0,),
                looks=40,
                right=20,
                thread_length=0.3,
            ),
        ),
        perception=(SuturePerception(arm="thesis", model="thesis", measured=False, provenance="as printed"),),
        world={"speed": 0.007},
        recorded_arm="thesis",
        recorded_seed=0,
        events=(SutureEvent(seconds=4.0, suture=0, what="i: to the corner"),),
    ).write(root / "trial.json")
    (root / "trial.txt").write_text("thesis, seed 0: 2 of 6 sutures\n")
    tool = np.tile(np.eye(4), (2, 1, 1))
    np.savez_compressed(
        root / "frames.npz",
        panel=np.array(["i: to the corner"], dtype="U40"),
        suture=np.array([0], np.int32),
        seconds=np.array([4.0]),
        world_from_tool=tool[None],
        world_from_needle=POSE[None],
        thread=CURVE[None],
    )
    np.savez_compressed(
        root / "motions.npz",
        seconds=np.array([1.0, 2.0]),
        arm=np.array([0, 1], np.int8),
        world_from_tool=tool,
        world_from_needle=np.tile(POSE, (2, 1, 1)),
        joints=np.zeros((2, 6)),
    )
    (root / "strip.png").write_bytes(PICTURE)
    return seal(root, "suture_trial")


def make_evaluation(run: Path) -> Path:
    """Write figures of one arm."""
    root = run / "suture_evaluation"
    (root / "plots").mkdir(parents=True)
    MetricsFile(label="simulated", metrics={"thesis/trials/sutures_to_failure": 2.0}).write(root / "metrics.json")
    (root / "table.md").write_text("# Trials\n\n| arm | sutures |\n|---|---|\n| thesis | 2.00 |\n")
    (root / "plots" / "sutures.png").write_bytes(PICTURE)
    return seal(root, "suture_evaluation", trials=run / "suture_trial")
