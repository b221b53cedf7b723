"""`scenewright poses`: camera poses for a sequence that has none, or to compare with those it has."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.schemas.sequence import Sequence
from scenewright.schemas.trajectory import FrameEstimate, LoopClosure, PosesFile, Trajectory
from scenewright.stages.kit.formats.frames import FrameReader, require_depth
from scenewright.stages.kit.formats.trajectories import write_tum
from scenewright.stages.kit.stage import Context
from scenewright.stages.poses.contradiction import contradicted
from scenewright.stages.poses.drift import drift_of, loop_closures, path_length
from scenewright.stages.poses.estimation import estimate
from scenewright.stages.poses.features import Corners, orb_corners
from scenewright.stages.poses.frame_poses import FramePose, frame_poses
from scenewright.stages.poses.parameters import PosesParameters
from scenewright.stages.poses.world import choose_world, given_poses, without_poses
from scenewright.stages.poses.xfeat import XFeat

MOST_CONTRADICTED, FEWEST_LOOPS = 0.15, 10
"""A path is not to be trusted that denies more than this share of its loops, of so many at least. Of four good paths
none to a tenth was denied, of three that were off by a decimetre and more 16 to 52 % (docs/MAPPING.md)."""

CONTRADICTED = "contradicted"
"""Fault of a frame that the depth of the others contradicts where the path had put it."""


@dataclass(frozen=True)
class Result:
    """Poses in the world of the first key frame, whatever made them."""

    poses: list[FramePose]
    loops: tuple[LoopClosure, ...] = ()
    variance_factor: float | None = None
    parts: int = 1
    counts: tuple[tuple[str, int], ...] = ()
    """For the summary."""


def run(
    sequence: Sequence, features: Path | None = None, *, parameters: PosesParameters, context: Context
) -> Trajectory:
    """Estimate the pose of every frame of the main camera; write trajectory.tum and poses.json.

    `features` is the file of a network that finds corners (XFeat); None: ORB.

    Frames that could not be placed have no line in trajectory.tum, so that `fuse` skips them, and the outcome is then
    `tracking_lost`; `contradictory` when the path denies the places that it comes back to; `empty` when no two frames
    could be placed. Raises BadInput for a sequence without depth, without
    colour where the method needs it, or with fewer than two frames of its main camera.
    """
    require_depth(sequence)
    corners = orb_corners if features is None else XFeat(features)
    with FrameReader(sequence.path("frames.mcap")) as reader:
        camera_name, frames = main_camera(reader, sequence)
        check_streams(reader, sequence, parameters)
        check_world(reader, frames, sequence, parameters)
        result = METHODS[parameters.method].estimate(reader, frames, camera_name, parameters, context, corners)
        result = _without_contradicted(result, reader, camera_name, parameters, context)
        return _finish(reader, camera_name, result, parameters, context)


def main_camera(reader: FrameReader, sequence: Sequence) -> tuple[str, list[int]]:
    """Return the name of the main camera and its frames. Raises BadInput when it has fewer than two."""
    if len(reader) == 0:
        raise BadInput(f"{sequence.root}: it has no frames", hint="look at the drops in its sequence.json")
    name = sequence.info.cameras[0].name
    frames = [index for index in range(len(reader)) if reader.read(index, ()).camera_name == name]
    if len(frames) < 2:
        count = f"{len(frames)} frame{'s' * (len(frames) != 1)}"
        raise BadInput(
            f"{sequence.root}: its main camera {name!r} has {count}, a path needs two",
            hint="ingest the whole log, or another camera of it: --camera NAME",
        )
    return name, frames


def check_streams(reader: FrameReader, sequence: Sequence, parameters: PosesParameters) -> None:
    """Raise BadInput when colour is needed and there is none."""
    if METHODS[parameters.method].needs_color(parameters) and "color" not in reader.streams:
        raise BadInput(
            f"{sequence.root}: its frames have no colour", hint="use --method rgbd without --bundle-adjustment"
        )


def check_world(reader: FrameReader, frames: list[int], sequence: Sequence, parameters: PosesParameters) -> None:
    """Raise BadInput, before any work, when the world or the motions of a sequence without poses are asked for."""
    if (parameters.world == "sequence" or parameters.method == "refine") and not given_poses(reader, frames):
        raise without_poses(f"{sequence.root}: none of its frames", parameters.method)


def _dense(
    reader: FrameReader,
    frames: list[int],
    camera_name: str,
    parameters: PosesParameters,
    context: Context,
    corners: Corners,
) -> Result:
    estimated = estimate(reader, frames, camera_name, parameters, context, corners)
    if parameters.bundle_adjustment:
        from scenewright.stages.poses.bundle_adjustment import adjust

        with context.progress.step("bundle adjustment"):
            estimated = adjust(estimated, reader.cameras[camera_name], context.logger)
    loops = loop_closures(estimated)
    loops_kept = sum(loop.weight >= 0.5 for loop in loops)
    counts = (
        ("key_frames", len(estimated.track.keys)),
        ("loops", loops_kept),
        ("loops_rejected", len(loops) - loops_kept),
    )
    for how, count in sorted(estimated.track.rescues.items()):
        context.logger.info("tracking was rescued %d times: %s", count, how)
    part_count = len(set(estimated.parts.tolist()))
    return Result(frame_poses(estimated), loops, estimated.solution.variance_factor, part_count, counts)


def _structure(
    reader: FrameReader,
    frames: list[int],
    camera_name: str,
    parameters: PosesParameters,
    context: Context,
    corners: Corners,
) -> Result:
    from scenewright.stages.poses.structure_from_motion import reconstruct

    poses, part_count = reconstruct(reader, frames, camera_name, parameters, context)
    return Result(poses, parts=part_count)


@dataclass(frozen=True)
class Method:
    """A way of estimating poses."""

    estimate: Callable[[FrameReader, list[int], str, PosesParameters, Context, Corners], Result]
    """Of the given frames of the camera of this name."""
    needs_color: Callable[[PosesParameters], bool]


METHODS = {
    "rgbd": Method(_dense, lambda parameters: parameters.bundle_adjustment),
    "refine": Method(_dense, lambda parameters: parameters.bundle_adjustment),
    "sfm": Method(_structure, lambda parameters: True),
}


def _without_contradicted(
    result: Result, reader: FrameReader, camera_name: str, parameters: PosesParameters, context: Context
) -> Result:
    """Return the result without the poses that the depth of the other frames contradicts."""
    with context.progress.step("contradictions"):
        wrong = contradicted(
            reader, reader.cameras[camera_name], result.poses, parameters.minimum_agreement, parameters.maximum_depth
        )
    poses = [
        FramePose(pose.frame, None, "unposed", CONTRADICTED) if pose.frame in wrong else pose for pose in result.poses
    ]
    return replace(result, poses=poses)


def _finish(
    reader: FrameReader, camera_name: str, result: Result, parameters: PosesParameters, context: Context
) -> Trajectory:
    posed = [pose for pose in result.poses if pose.world_from_camera is not None]
    if len(posed) < 2:
        posed = []
    estimated = np.array([pose.world_from_camera for pose in posed]).reshape(-1, 4, 4)
    indices = [pose.frame for pose in posed]
    with context.progress.step("world"):
        world, gravity = choose_world(parameters.world, reader, indices, estimated, context.random(5))
    context.logger.info("world %s: %s", world, gravity.detail)
    placed = np.array(gravity.world_from_log) @ estimated
    times = reader.times
    write_tum(context.output / "trajectory.tum", times[indices], placed)
    placed_frames = set(indices)
    info = PosesFile(
        method=parameters.method,
        camera=camera_name,
        gravity=gravity,
        world=world,
        frames=tuple(
            FrameEstimate(
                frame=pose.frame,
                time=float(times[pose.frame]),
                status=pose.status if pose.frame in placed_frames else "unposed",
                fault=pose.fault or ("" if pose.frame in placed_frames else "not_joined"),
                confidence=round(pose.confidence, 4) if pose.frame in placed_frames else 0.0,
                uncertainty=round(pose.uncertainty, 6)
                if pose.frame in placed_frames and pose.uncertainty is not None
                else None,
            )
            for pose in result.poses
        ),
        loops=result.loops,
        drift=drift_of(result.loops),
        variance_factor=result.variance_factor,
        parts=max(result.parts, 1),
        path_length=path_length(placed[:, :3, 3]),
    )
    info.write(context.output / "poses.json")
    return Trajectory(context.output, outcome=outcome_of(info), summary=_summary(info, result, context))


def outcome_of(info: PosesFile) -> str:
    """Return `ok`, `contradictory` when the path and the places that it comes back to deny each other, `tracking_lost`
    when a frame has no pose, `empty` when none has."""
    unposed = sum(frame.status == "unposed" for frame in info.frames)
    if unposed == len(info.frames):
        return "empty"
    if is_contradictory(info):
        return "contradictory"
    return "tracking_lost" if unposed else "ok"


def contradicted_share(loops: Iterable[LoopClosure]) -> float:
    """Return the share of the loops that the path denies: both were aligned surface on surface, one of them wrongly."""
    denied = [loop.weight < 0.5 for loop in loops]
    return sum(denied) / max(len(denied), FEWEST_LOOPS)


def wrong_frames(info: PosesFile) -> int:
    """Return how many frames the depth of the others contradicted where the path had put them."""
    return sum(frame.fault == CONTRADICTED for frame in info.frames)


def is_contradictory(info: PosesFile) -> bool:
    """Whether the path denies too many of its loops, or of its frames."""
    too_many = wrong_frames(info) > MOST_CONTRADICTED * len(info.frames)
    return too_many or contradicted_share(info.loops) > MOST_CONTRADICTED


def _summary(info: PosesFile, result: Result, context: Context) -> dict[str, object]:
    unposed = [frame for frame in info.frames if frame.status == "unposed"]
    summary: dict[str, object] = {
        "frames": len(info.frames),
        "posed": len(info.frames) - len(unposed),
        **dict(result.counts),
        "path_length": round(info.path_length, 3),
        "gravity": info.gravity.method,
        "world": info.world,
    }
    if info.drift is not None:
        summary["drift"] = round(info.drift, 5)
    if unposed:
        reasons = Counter(frame.fault for frame in unposed)
        where = ranges([frame.frame for frame in unposed])
        summary["reason"] = (
            f"{len(unposed)} of {len(info.frames)} frames have no pose "
            f"({', '.join(f'{reason} {count}' for reason, count in sorted(reasons.items()))}): {where}"
        )
        context.logger.warning("%s", summary["reason"])
    if is_contradictory(info):
        denied = sum(loop.weight < 0.5 for loop in info.loops)
        what = f"{denied} of {len(info.loops)} places that look the same"
        if contradicted_share(info.loops) <= MOST_CONTRADICTED:
            what = f"the depth of {wrong_frames(info)} of {len(info.frames)} frames"
        advice = "record more pictures a second, or turn more slowly"
        if info.method == "refine":
            advice = "compare it with that of --method rgbd, which does not look at the given poses"
        summary["reason"] = f"the path denies {what}: it may be off by decimetres; {advice}"
        context.logger.warning("%s", summary["reason"])
    return summary


def ranges(numbers: list[int], most: int = 6) -> str:
    """Return ascending numbers as text: `3-7, 12, 40-41`, at most `most` ranges."""
    spans: list[list[int]] = []
    for number in numbers:
        if spans and number == spans[-1][1] + 1:
            spans[-1][1] = number
        else:
            spans.append([number, number])
    texts = [str(a) if a == b else f"{a}-{b}" for a, b in spans[:most]]
    return ", ".join(texts) + (", ..." if len(spans) > most else "")
