"""The step `suture scene`: stereo pairs of the needle world as a sequence, and beside them the truth."""

from __future__ import annotations

from collections.abc import Iterator

import cv2
import numpy as np
from scenewright.schemas.base import as_transform, as_vector
from scenewright.schemas.scene_parts import Camera
from scenewright.schemas.sequence import Gravity, SequenceCamera, SequenceFile
from scenewright.schemas.suture_scene import StereoRigRecord, SutureScene, SutureSceneFile, SutureView
from scenewright.stages.kit.formats.frames import FrameWriter
from scenewright.stages.kit.formats.trajectories import write_tum
from scenewright.stages.kit.geometry.transforms import apply, inverse
from scenewright.stages.kit.stage import Context
from scenewright.stages.suture.motion_reports import reported_motion
from scenewright.stages.suture.parameters import SceneParameters
from scenewright.stages.suture.rig import ENDOSCOPE, NEEDLE_RADIUS, TWO_CAMERAS, StereoRig
from scenewright.stages.suture.truth_files import BODIES, write_truth
from scenewright.stages.suture.world.render import StereoView, render
from scenewright.stages.suture.world.sampling import seen_scene
from scenewright.stages.suture.world.scene import NeedleScene, moved_scene, random_motions

RIGS: dict[str, StereoRig] = {"two_cameras": TWO_CAMERAS, "endoscope": ENDOSCOPE}
SEED_OF_MOTION = 6
"""First number of the seed from which motions of the needle are drawn."""
RATE = 10.0
"""Frames a second."""
CAMERA_NAME = "camera"


def run(*, parameters: SceneParameters, context: Context) -> SutureScene:
    """Render the frames of a seed. The left camera's pose is in the world whose origin is on the pad, z up."""
    rig = RIGS[parameters.rig]
    camera = camera_of(rig)
    times, poses, views = [], [], []
    threads: dict[str, np.ndarray] = {}
    (context.output / "truth").mkdir()
    frames = enumerate(_frames(parameters, rig, context.seed))
    with FrameWriter(
        context.output / "frames.mcap", camera, cameras={CAMERA_NAME: camera}, baselines={CAMERA_NAME: rig.baseline}
    ) as writer:
        for index, (scene, motion) in context.progress.track(frames, total=parameters.frames, description="rendering"):
            view = render(scene)
            assert view.left.image is not None and view.right.image is not None
            pose = inverse(scene.camera_from_world)
            time = 1.0 + index / RATE
            writer.write(time, _png(view.left.image), None, pose, right=_png(view.right.image), camera_name=CAMERA_NAME)
            write_truth(context.output / "truth", index, view)
            threads[f"thread_{index:06d}"] = apply(scene.camera_from_world, scene.thread)
            times.append(time)
            poses.append(pose)
            views.append(_view(index, scene, view, motion))
    np.savez_compressed(context.output / "threads.npz", allow_pickle=False, **threads)
    write_tum(context.output / "trajectory.tum", np.array(times), np.array(poses))
    _sequence(parameters, camera, rig, times).write(context.output / "sequence.json")
    SutureSceneFile(
        seed=context.seed,
        arrangement=parameters.arrangement,
        rig=StereoRigRecord(camera=camera, baseline=rig.baseline),
        rig_name=parameters.rig,
        needle_radius=NEEDLE_RADIUS,
        calibration_error=parameters.calibration_error,
        bodies=BODIES,
        views=tuple(views),
    ).write(context.output / "scene.json")
    holders = sorted({view.holder for view in views})
    summary = {"frames": len(views), "arrangement": parameters.arrangement, "holder": ", ".join(holders)}
    return SutureScene(root=context.output, summary=summary)


def camera_of(rig: StereoRig) -> Camera:
    """Return the left camera of a rig."""
    cx, cy = rig.centre
    return Camera(width=rig.width, height=rig.height, fx=rig.focal, fy=rig.focal, cx=cx, cy=cy)


def _frames(parameters: SceneParameters, rig: StereoRig, seed: int) -> Iterator[tuple[NeedleScene, np.ndarray | None]]:
    """Yield every frame's scene, and how the needle moved since the frame before as kinematics report it."""
    holder = None if parameters.holder == "any" else parameters.holder
    needle_place = None if parameters.place == "any" else parameters.place
    if parameters.arrangement == "views":
        for index in range(parameters.frames):
            yield seen_scene(seed + index, rig, holder, needle_place, parameters.calibration_error)[0], None
        return
    first, _ = seen_scene(seed, rig, holder, needle_place, parameters.calibration_error)
    random = np.random.default_rng([SEED_OF_MOTION, seed])
    motions = random_motions(first, parameters.frames)
    for index, motion in enumerate(motions):
        scene = moved_scene(first, motion, index) if parameters.frames > 1 else first
        step = None
        if index > 0:
            moved = motion @ inverse(motions[index - 1])
            at = first.camera_from_world @ moved @ inverse(first.camera_from_world)
            step = reported_motion(at, scene.pose.centre, random)
        yield scene, step


def _view(index: int, scene: NeedleScene, view: StereoView, motion: np.ndarray | None) -> SutureView:
    return SutureView(
        frame=index,
        seed=scene.seed,
        holder=scene.holder,  # type: ignore[arg-type]
        place=scene.place,  # type: ignore[arg-type]
        camera_from_needle=as_transform(scene.pose.camera_from_needle),
        camera_from_world=as_transform(scene.camera_from_world),
        right_eye_turn=as_vector(scene.right_eye_turn),
        seen=round(view.seen, 4),
        degrees_from_edge_on=round(scene.pose.degrees_from_edge_on(), 4),
        reported_motion=None if motion is None else as_transform(motion),
    )


def _sequence(parameters: SceneParameters, camera: Camera, rig: StereoRig, times: list[float]) -> SequenceFile:
    left_camera = SequenceCamera(name=CAMERA_NAME, camera=camera, baseline=rig.baseline, frame_count=len(times))
    return SequenceFile(
        source_format="rendered",
        rule="suture scene",
        notes=(f"rendered needle world, {parameters.arrangement}, rig {parameters.rig}",),
        camera=camera,
        cameras=(left_camera,),
        streams=("color", "right", "pose"),
        frame_count=len(times),
        frames_in_log=len(times),
        gravity=Gravity(method="given", world_from_log=as_transform(np.eye(4)), detail="the pad is z = 0"),
        start_time=times[0],
        end_time=times[-1],
    )


def _png(picture: np.ndarray) -> bytes:
    """Return a picture (H, W, 3) uint8 RGB as PNG: JPEG would smear the wire."""
    written, data = cv2.imencode(".png", picture[..., ::-1], [cv2.IMWRITE_PNG_COMPRESSION, 3])
    if not written:
        raise OSError("an image could not be encoded")
    return bytes(data)
