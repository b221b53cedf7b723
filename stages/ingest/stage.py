"""The step `ingest`: recognise the log, make the world upright, write the usable frames."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any, Literal

import numpy as np

from schemas.errors import BadInput
from schemas.sequence import Gravity, Sequence, SequenceFile
from stages.ingest.alignment import align
from stages.ingest.detection import open_log
from stages.ingest.parameters import IngestParameters
from stages.ingest.selection import NOT_SELECTED, largest_step, select
from stages.ingest.source import Entry, LoadedFrame, LogSource, Unusable
from stages.ingest.surface_samples import surface_samples
from stages.kit.formats.foxglove import millimetres_to_depth
from stages.kit.formats.frames import FrameWriter
from stages.kit.formats.trajectories import write_tum
from stages.kit.stage import Context

GRAVITY_FRAMES = 60
"""Frames whose depth is looked at to find the floor."""
PLAUSIBLE_MEDIAN_DEPTH = (0.15, 15.0)
LARGE_STEP = 1.0
StreamName = Literal["color", "depth", "right", "labels", "pose"]


def run(log: Path, *, parameters: IngestParameters, context: Context) -> Sequence:
    """Write the usable frames of a log with calibration, gravity-aligned poses and the reasons for all others."""
    with context.progress.step("read the log"):
        source = open_log(Path(log), parameters)
    try:
        _check_camera(source, log)
        context.logger.info("%s: %s", log, source.rule)
        entries, drops = select(source.entries, parameters, source.has_poses)
        with context.progress.step("find gravity"):
            gravity = _find_gravity(source, entries, parameters, context)
        context.logger.info("gravity %s: %s", gravity.method, gravity.detail)
        with context.progress.step("write frames"):
            times, poses, median_depth = _write_frames(source, entries, gravity, drops, parameters, context)
    finally:
        source.close()
    return _finish(source, gravity, drops, times, poses, median_depth, context)


def _check_camera(source: LogSource, log: Path) -> None:
    """Refuse intrinsics of no camera: they would only show up as a room of nonsense."""
    camera = source.camera
    if camera.width == 0:
        return  # no image could be decoded, so there will be no frame either
    for name, focal, center, size in (
        ("x", camera.fx, camera.cx, camera.width),
        ("y", camera.fy, camera.cy, camera.height),
    ):
        if not (0.1 * size <= focal <= 100 * size and -size <= center <= 2 * size):
            raise BadInput(
                f"{log}: focal length {focal:g} and centre {center:g} pixels along {name} cannot be those of an image "
                f"of {size} pixels",
                hint="give --fx --fy --cx --cy",
            )


def _find_gravity(source: LogSource, entries: list[Entry], parameters: IngestParameters, context: Context) -> Gravity:
    posed = [entry for entry in entries if entry.world_from_camera is not None]
    chosen = [posed[i] for i in np.unique(np.linspace(0, len(posed) - 1, min(len(posed), GRAVITY_FRAMES)).astype(int))]
    poses = np.array([entry.world_from_camera for entry in posed]).reshape(-1, 4, 4)

    def cloud() -> tuple[np.ndarray, np.ndarray]:
        samples = [(np.zeros((0, 3)), np.zeros((0, 3)))]
        for entry in context.progress.track(chosen, total=len(chosen), description="looking for the floor"):
            try:
                loaded = entry.load()
            except Unusable:
                continue  # counted when the frames are written
            depth = millimetres_to_depth(loaded.depth)
            samples.append(surface_samples(depth, source.camera, entry.world_from_camera))
        return np.concatenate([points for points, _ in samples]), np.concatenate([normals for _, normals in samples])

    stated = source.world_up_detail if source.world_up == "z" else None
    return align(parameters.gravity, parameters.up, stated, poses, cloud, context.random(0))


def _write_frames(
    source: LogSource,
    entries: list[Entry],
    gravity: Gravity,
    drops: Counter[str],
    parameters: IngestParameters,
    context: Context,
) -> tuple[list[float], list[np.ndarray], float]:
    """Write frames.mcap; returns times, poses and the median of the frames' median depths [m]."""
    world_from_log = np.array(gravity.world_from_log)
    unchanged = np.array_equal(world_from_log, np.eye(4))
    times: list[float] = []
    poses: list[np.ndarray] = []
    medians: list[float] = []
    with FrameWriter(
        context.output / "frames.mcap",
        source.camera,
        labels=source.has_labels,
        world_up="unknown" if gravity.method == "none" else "z",
        registered=source.registered,
        label_table=source.label_table,
    ) as writer:
        for entry in context.progress.track(entries, total=len(entries), description="frames"):
            if parameters.max_frames is not None and writer.frame_count >= parameters.max_frames:
                drops[NOT_SELECTED] += 1
                continue
            try:
                loaded = _within(entry.load(), parameters.maximum_depth)
            except Unusable as problem:
                drops[problem.reason] += 1
                context.logger.warning("frame %s left out: %s", entry.name, problem)
                continue
            pose = entry.world_from_camera
            if pose is not None and not unchanged:
                pose = world_from_log @ pose
            writer.write(entry.time, loaded.color, loaded.depth, pose, loaded.labels)
            times.append(entry.time)
            medians.append(float(np.median(loaded.depth[loaded.depth > 0])) / 1000)
            if pose is not None:
                poses.append(pose)
    return times, poses, float(np.median(medians)) if medians else 0.0


def _within(loaded: LoadedFrame, maximum_depth: float | None) -> LoadedFrame:
    if maximum_depth is None:
        return loaded
    depth = np.where(loaded.depth <= maximum_depth * 1000, loaded.depth, np.uint16(0))
    if not depth.any():
        raise Unusable("no_valid_depth", f"nothing within {maximum_depth:g} m")
    return LoadedFrame(loaded.color, depth, loaded.labels)


def _finish(
    source: LogSource,
    gravity: Gravity,
    drops: Counter[str],
    times: list[float],
    poses: list[np.ndarray],
    median_depth: float,
    context: Context,
) -> Sequence:
    notes = list(source.notes)
    low, high = PLAUSIBLE_MEDIAN_DEPTH
    if times and not low <= median_depth <= high:
        notes.append(f"WARNING: median depth is {median_depth:.3g} m; is the depth unit right (depth_scale)?")
    step = largest_step(np.array(poses).reshape(-1, 4, 4))
    if step > LARGE_STEP:
        notes.append(f"WARNING: the camera jumps {step:.2f} m between two frames")
    if times and not poses:
        notes.append("frames have no poses")
    for note in notes:
        (context.logger.warning if note.startswith("WARNING") else context.logger.info)("%s", note)
    write_tum(context.output / "trajectory.tum", np.array(times[: len(poses)]), np.array(poses).reshape(-1, 4, 4))
    streams: list[StreamName] = ["color", "depth"] if times else []
    if times and source.has_labels:
        streams.append("labels")
    if poses:
        streams.append("pose")
    SequenceFile(
        source_format=source.format,
        rule=source.rule,
        notes=tuple(notes),
        camera=source.camera,
        streams=tuple(streams),
        frame_count=len(times),
        frames_in_log=len(source.entries),
        drops=dict(sorted(drops.items())),
        gravity=gravity,
        label_table=source.label_table,
        color_depth_registered=source.registered,
        start_time=times[0] if times else 0.0,
        end_time=times[-1] if times else 0.0,
    ).write(context.output / "sequence.json")
    summary: dict[str, Any] = {
        "frames": len(times),
        "frames_in_log": len(source.entries),
        "dropped": sum(count for reason, count in drops.items() if reason != NOT_SELECTED),
        "gravity": gravity.method,
        "median_depth": round(median_depth, 3),
    }
    if not times:
        worst = ", ".join(f"{reason} {count}" for reason, count in drops.most_common()) or "no frames in the log"
        summary["reason"] = f"no usable frame: {worst}"
        context.logger.warning("%s", summary["reason"])
    return Sequence(context.output, outcome="ok" if times else "empty", summary=summary)
