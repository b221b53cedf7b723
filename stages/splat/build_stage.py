"""The step `splat build`."""

from __future__ import annotations

import time
from collections import deque

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.schemas.sequence import Sequence
from scenewright.schemas.splat import Splat, SplatFile, SplatView
from scenewright.schemas.trajectory import Trajectory
from scenewright.stages.kit.formats.frames import FrameReader
from scenewright.stages.kit.formats.trajectories import write_tum
from scenewright.stages.kit.rendering.splatting.rasterizer import Rasterizer
from scenewright.stages.kit.stage import Context
from scenewright.stages.splat.building import LAST, Arrival, arrivals, carried_poses, placed_poses, train
from scenewright.stages.splat.checkpoints import read_checkpoint, write_checkpoint
from scenewright.stages.splat.methods.method import Method
from scenewright.stages.splat.parameters import BuildParameters
from scenewright.stages.splat.ply import write_gaussians
from scenewright.stages.splat.trainer import Trainer
from scenewright.stages.splat.triangulation import with_points
from scenewright.stages.splat.views import evenly, held_out, posed_frames, read_view
from scipy.spatial.transform import Rotation

CHECKPOINT_EVERY = 60.0
"""Time between two checkpoints of a training that may be killed [s]; by eye."""


def run(
    sequence: Sequence, trajectory: Trajectory | None = None, *, parameters: BuildParameters, context: Context
) -> Splat:
    """Learn Gaussians from the posed pictures of a sequence. The outcome is `ok`.

    Where no picture has depth, points are triangulated out of what the pictures show. Raises BadInput without colour,
    without two posed frames, or where every picture that is learned from is dark, or none has depth and none a point.
    """
    with FrameReader(sequence.path("frames.mcap")) as reader:
        posed = posed_frames(reader, sequence, trajectory)
        uses: dict[int, str] = {}
        learned_frames = _choose(posed, parameters, uses)
        poses = dict(posed)
        views = []
        for frame in learned_frames:
            view = read_view(reader, frame, poses[frame], parameters.width)
            if view is None:
                uses[frame] = "dark"
            else:
                views.append(view)
        if not views:
            raise BadInput(f"{sequence.root}: all {len(learned_frames)} images are dark", hint="record in more light")
        if all(view.depth is None or not view.depth.any() for view in views):
            with context.progress.step("points"):
                views = with_points(views, context.seed)
            if not any(view.depth is not None and view.depth.any() for view in views):
                raise BadInput(
                    f"{sequence.root}: no image has depth, and no feature is seen from two places",
                    hint="record depth, or images that overlap; scenewright inspect LOG checks the poses",
                )
        cameras = {view.camera_name: view.camera for view in views}
        trainer = Trainer(
            method_of(parameters.method),
            rasterizer_of(context.device),
            context.random(1),
            refine_poses=parameters.refine_poses,
            adjust_every=parameters.adjust_every,
            most=parameters.most_gaussians,
        )
        arriving = arrivals(views, parameters.steps_per_second)
        losses: deque[float] = deque(maxlen=LAST)
        if context.kept is not None and (before := read_checkpoint(context.kept, trainer, arriving)) is not None:
            context.logger.info("going on from step %d of a build that was stopped", trainer.steps)
            losses.extend(before)
        total, written = arriving[-1].step + parameters.steps - trainer.steps, time.monotonic()
        for loss in context.progress.track(
            train(trainer, arriving, parameters.steps), total=total, description="steps"
        ):
            losses.append(loss)
            if context.kept is not None and time.monotonic() - written > CHECKPOINT_EVERY:
                write_checkpoint(context.kept, trainer, losses)
                written = time.monotonic()
        if not len(trainer.gaussians):
            raise BadInput(f"{sequence.root}: no Gaussian is left after {trainer.steps} steps", hint="--method ours")
        times = reader.times
        names = {frame: reader.read(frame, ()).camera_name for frame, _ in posed}
        held_out_views = [
            read_view(reader, frame, poses[frame], parameters.width) for frame in uses if uses[frame] == "held_out"
        ]
    final = carried_poses(trainer, posed)
    aligned = dict(placed_poses(trainer, [view for view in held_out_views if view is not None]))
    final = [(frame, aligned.get(frame, pose)) for frame, pose in final]
    write_tum(context.output / "trajectory.tum", times[[frame for frame, _ in final]], np.array([p for _, p in final]))
    write_gaussians(context.output / "splat.ply", trainer.gaussians)
    info = SplatFile(
        method=parameters.method,
        gaussians=len(trainer.gaussians),
        harmonics_degree=int(np.sqrt(trainer.gaussians.harmonics.shape[1])) - 1,
        steps=trainer.steps,
        loss=float(np.mean(losses)) if losses else 0.0,
        refined=trainer.moves_poses,
        cameras=cameras,
        views=_listing(posed, uses, times, names, arriving, trainer),
    )
    info.write(context.output / "splat.json")
    summary = {
        "gaussians": info.gaussians,
        "learned": len(views),
        "held_out": sum(view.use == "held_out" for view in info.views),
        "dark": sum(view.use == "dark" for view in info.views),
        "steps": info.steps,
        "loss": round(info.loss, 4),
    }
    return Splat(context.output, summary=summary)


def method_of(name: str) -> Method:
    """Return a method by its name."""
    from scenewright.stages.splat.methods import ours, thesis

    return {"ours": ours.METHOD, "thesis": thesis.METHOD}[name]


def rasterizer_of(device: str) -> Rasterizer:
    """Return what draws on a device. Raises MissingDependency for `cuda` without gsplat."""
    if device == "cuda":
        from scenewright.stages.kit.rendering.splatting.gpu import GpuRasterizer

        return GpuRasterizer()
    from scenewright.stages.kit.rendering.splatting.compiled import CompiledRasterizer

    return CompiledRasterizer()


def _choose(posed: list[tuple[int, np.ndarray]], parameters: BuildParameters, uses: dict[int, str]) -> list[int]:
    """Return the frames to learn from, and write what becomes of the others into `uses`."""
    frames = [frame for frame, _ in posed]
    chosen = evenly(frames, parameters.most_views)
    held_out_frames = {chosen[k] for k in held_out(len(chosen), parameters.hold_out_every)}
    learned = [frame for frame in chosen if frame not in held_out_frames]
    uses.update({frame: "left_out" for frame in frames})
    uses.update({frame: "held_out" for frame in held_out_frames})
    uses.update({frame: "learned" for frame in learned})
    return learned


def _listing(
    posed: list[tuple[int, np.ndarray]],
    uses: dict[int, str],
    times: np.ndarray,
    names: dict[int, str],
    arriving: list[Arrival],
    trainer: Trainer,
) -> tuple[SplatView, ...]:
    arrived = {arrival.view.frame: arrival.step for arrival in arriving}
    changes = {}
    for each in trainer.views if trainer.moves_poses else ():
        change = each.camera_from_world @ np.linalg.inv(each.view.camera_from_world)
        turned = float(np.linalg.norm(Rotation.from_matrix(change[:3, :3]).as_rotvec()))
        centers = [-pose[:3, :3].T @ pose[:3, 3] for pose in (each.camera_from_world, each.view.camera_from_world)]
        changes[each.view.frame] = (round(float(np.linalg.norm(centers[0] - centers[1])), 6), round(turned, 6))
    return tuple(
        SplatView.model_validate(
            {
                "frame": frame,
                "time": float(times[frame]),
                "camera": names[frame],
                "use": uses[frame],
                "arrived": arrived.get(frame),
                "moved": changes[frame][0] if frame in changes else None,
                "turned": changes[frame][1] if frame in changes else None,
            }
        )
        for frame, _ in posed
    )
