"""The step `ingest`: recognise the log, make the world upright, write the usable frames."""

from __future__ import annotations

from collections import Counter
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, get_args

import cv2
import numpy as np
from scenewright.schemas.errors import BadInput, UsageError
from scenewright.schemas.sequence import Gravity, Sequence, SequenceCamera, SequenceFile, StreamName
from scenewright.stages.ingest.detection import open_log
from scenewright.stages.ingest.images import depth_roughness
from scenewright.stages.ingest.key_frames import key_frames
from scenewright.stages.ingest.loading import loaded
from scenewright.stages.ingest.losses import ADVICE
from scenewright.stages.ingest.origins import named_sources
from scenewright.stages.ingest.own_poses import with_own_poses
from scenewright.stages.ingest.parameters import AUTO, IngestParameters
from scenewright.stages.ingest.pose_convention_names import CONVENTION_WORDS
from scenewright.stages.ingest.selection import NOT_SELECTED, largest_step, select
from scenewright.stages.ingest.source import Entry, LoadedFrame, LogSource, Unusable
from scenewright.stages.kit.formats.exif import orientation_of
from scenewright.stages.kit.formats.foxglove import millimetres_to_depth, nanoseconds
from scenewright.stages.kit.formats.frames import FrameWriter
from scenewright.stages.kit.formats.trajectories import write_tum
from scenewright.stages.kit.geometry.surface_samples import surface_samples
from scenewright.stages.kit.geometry.upright_world import REASON, make_upright
from scenewright.stages.kit.stage import Context

GRAVITY_FRAMES = 60
"""Frames whose depth is looked at to find the floor."""
PLAUSIBLE_MEDIAN_DEPTH = (0.15, 15.0)
"""Median depth [m] outside of which the depth unit is doubted; by eye."""
LARGE_STEP = 1.0
"""Step of the camera between two frames [m] that is reported; by eye."""
NO_POSES = "frames have no poses"
ROUGH = 0.05
"""Roughness of what is no depth; five times that of the roughest sensor."""
LIT_EVERY, DARK = 10, 8.0
"""Every so many frames' pictures are looked at; with a lower mean of 255 they show nothing."""


def run(log: Path, trajectory: Path | None = None, *, parameters: IngestParameters, context: Context) -> Sequence:
    """Write the usable frames of a log with calibration, gravity-aligned poses and the reasons for all others.

    A trajectory of one's own takes the place of the log's poses.
    """
    with context.progress.step("read the log"):
        source = open_log(Path(log), parameters)
    try:
        if trajectory is not None:
            source = with_own_poses(source, Path(trajectory), parameters)
        check_cameras(source, log)
        context.logger.info("%s: %s", log, source.rule)
        for line in source.damage:
            context.logger.warning("lost: %s", line)
        entries, drops = select(source.entries, parameters, source.has_poses)
        with context.progress.step("find gravity"):
            gravity = _find_gravity(source, entries, parameters, context)
        context.logger.info("gravity %s: %s", gravity.method, gravity.detail)
        if parameters.every == AUTO:
            entries = _key_frames(source, entries, drops, context)
        with context.progress.step("write frames"):
            written = _write_frames(source, entries, gravity, drops, parameters, context)
    finally:
        source.close()
    sources = named_sources(written.entries, source.entries, log if log.is_dir() else log.parent)
    if sources is not None:
        sources.write(context.output / "sources.json")
    return _finish(source, gravity, drops, written, parameters, context)


@dataclass
class _Written:
    """What was written, as far as the summary needs it."""

    entries: list[Entry] = field(default_factory=list)
    times: list[float] = field(default_factory=list)
    posed_times: list[float] = field(default_factory=list)
    poses: list[np.ndarray] = field(default_factory=list)
    cameras: list[str] = field(default_factory=list)
    """Camera of each frame."""
    pose_cameras: list[str] = field(default_factory=list)
    """Camera of each frame that has a pose."""
    orientations: int = 0
    """Pictures with an EXIF orientation that was taken off."""
    median_depths: list[float] = field(default_factory=list)
    roughness: list[float] = field(default_factory=list)
    """Of every tenth depth image (`depth_roughness`)."""
    brightness: list[float] = field(default_factory=list)
    """Mean of every tenth picture, 0 to 255."""
    streams: set[StreamName] = field(default_factory=set)

    @property
    def median_depth(self) -> float:
        """Median of the frames' median depths [m], 0 without depth."""
        return float(np.median(self.median_depths)) if self.median_depths else 0.0


def _key_frames(source: LogSource, entries: list[Entry], drops: Counter[str], context: Context) -> list[Entry]:
    """Return the key frames, and count the others. Raises UsageError where frames have no poses."""
    if any(entry.world_from_camera is None for entry in entries):
        raise UsageError(
            "--every auto needs poses, and this log has none",
            hint="take every n-th frame (--every 5), or give poses of your own (--trajectory)",
        )
    cameras = {each.name: each.camera for each in source.cameras}
    shown = context.progress.track(entries, total=len(entries), description="key frames")
    chosen = key_frames(shown, cameras)
    drops[NOT_SELECTED] += len(entries) - len(chosen)
    context.logger.info("key frames: %d of %d", len(chosen), len(entries))
    return chosen


def check_cameras(source: LogSource, log: Path) -> None:
    """Refuse intrinsics of no camera: they would only show up as a room of nonsense. Raises BadInput."""
    for source_camera in source.cameras:
        camera = source_camera.camera
        if camera.width == 0:
            continue  # no image could be decoded, so there will be no frame either
        for name, focal, center, size in (
            ("x", camera.fx, camera.cx, camera.width),
            ("y", camera.fy, camera.cy, camera.height),
        ):
            if not (0.1 * size <= focal <= 100 * size and -size <= center <= 2 * size):
                raise BadInput(
                    f"{log}: focal length {focal:g} and centre {center:g} pixels along {name} cannot be those of an "
                    f"image of {size} pixels",
                    hint="give --fx --fy --cx --cy",
                )


def _find_gravity(source: LogSource, entries: list[Entry], parameters: IngestParameters, context: Context) -> Gravity:
    posed = [entry for entry in entries if entry.world_from_camera is not None]
    chosen = [posed[i] for i in np.unique(np.linspace(0, len(posed) - 1, min(len(posed), GRAVITY_FRAMES)).astype(int))]
    poses = np.array([entry.world_from_camera for entry in posed]).reshape(-1, 4, 4)
    cameras = {each.name: each.camera for each in source.cameras}

    def cloud() -> tuple[np.ndarray, np.ndarray]:
        samples = [(np.zeros((0, 3)), np.zeros((0, 3)))]
        for entry, images in context.progress.track(
            loaded(chosen), total=len(chosen), description="looking for the floor"
        ):
            # What cannot be used is counted when the frames are written.
            pose = entry.world_from_camera
            if isinstance(images, LoadedFrame) and images.depth is not None and pose is not None:
                depth = millimetres_to_depth(images.depth)
                samples.append(surface_samples(depth, cameras[entry.camera_name], pose))
        return np.concatenate([points for points, _ in samples]), np.concatenate([normals for _, normals in samples])

    untouched = parameters.pose_convention == "as-is"  # another reading of the poses is another world
    stated = source.world_up_detail if source.world_up == "z" and untouched else None
    measured = source.up_in_log if untouched else None
    return make_upright(parameters.gravity, parameters.up, stated, poses, cloud, context.random(0), measured)


def _write_frames(
    source: LogSource,
    entries: list[Entry],
    gravity: Gravity,
    drops: Counter[str],
    parameters: IngestParameters,
    context: Context,
) -> _Written:
    """Write frames.mcap: each frame by a thread, while the next is loaded."""
    world_from_log = np.array(gravity.world_from_log)
    unchanged = np.array_equal(world_from_log, np.eye(4))
    written = _Written()
    last_stamp = -1
    writing: Future[None] | None = None
    with (
        FrameWriter(
            context.output / "frames.mcap",
            source.camera,
            labels=source.has_labels,
            world_up="unknown" if gravity.method == "none" else "z",
            registered=all(each.registered for each in source.cameras),
            label_table=source.label_table,
            cameras={each.name: each.camera for each in source.cameras},
            baselines={each.name: each.baseline for each in source.cameras if each.baseline is not None},
            deviation=source.has_deviation,
            picture_cameras={each.name: each.picture for each in source.cameras if each.picture is not None},
        ) as writer,
        ThreadPoolExecutor(1, thread_name_prefix="write") as thread,
    ):
        for entry, images in context.progress.track(loaded(entries), total=len(entries), description="frames"):
            if parameters.max_frames is not None and len(written.times) >= parameters.max_frames:
                drops[NOT_SELECTED] += 1
                continue
            try:
                frame = _usable(images, parameters.maximum_depth)
            except Unusable as problem:
                drops[problem.reason] += 1
                context.logger.warning("frame %s left out: %s", entry.name, problem)
                continue
            pose = entry.world_from_camera
            if pose is not None and not unchanged:
                pose = world_from_log @ pose
            stamp = nanoseconds(entry.time)
            # Cameras that were triggered together share a stamp, frames of a sequence do not: a microsecond apart,
            # which is what float seconds since 1970 resolve.
            last_stamp = stamp if stamp > last_stamp else last_stamp + 1000
            time = last_stamp * 1e-9
            if writing is not None:
                writing.result()
            writing = thread.submit(
                writer.write,
                time,
                frame.color,
                frame.depth,
                pose,
                frame.labels,
                right=frame.right,
                deviation=frame.deviation,
                picture=frame.picture,
                camera_name=entry.camera_name,
            )
            _note(written, time, entry, frame, pose)
        if writing is not None:
            writing.result()
    return written


def _note(written: _Written, time: float, entry: Entry, loaded: LoadedFrame, pose: np.ndarray | None) -> None:
    if loaded.color is not None and len(written.times) % LIT_EVERY == 0:
        written.brightness.append(brightness_of(loaded.color))
    if loaded.depth is not None and len(written.times) % LIT_EVERY == 0:
        written.roughness.append(depth_roughness(loaded.depth))
    recorded = loaded.color if loaded.picture is None else loaded.picture
    if isinstance(recorded, bytes) and orientation_of(recorded) != 1:
        written.orientations += 1
    written.entries.append(entry)
    written.times.append(time)
    written.cameras.append(entry.camera_name)
    streams: dict[StreamName, object] = {
        "color": loaded.color,
        "depth": loaded.depth,
        "right": loaded.right,
        "labels": loaded.labels,
        "pose": pose,
        "deviation": loaded.deviation,
        "picture": loaded.picture,
    }
    written.streams |= {name for name, value in streams.items() if value is not None}
    if loaded.depth is not None:
        written.median_depths.append(float(np.median(loaded.depth[loaded.depth > 0])) / 1000)
    if pose is not None:
        written.posed_times.append(time)
        written.poses.append(pose)
        written.pose_cameras.append(entry.camera_name)


def _usable(loaded: LoadedFrame | Unusable, maximum_depth: float | None) -> LoadedFrame:
    """Return the frame without depth beyond the most that is asked for [m]. Raises Unusable."""
    if isinstance(loaded, Unusable):
        raise loaded
    if maximum_depth is None or loaded.depth is None:
        return loaded
    depth = np.where(loaded.depth <= maximum_depth * 1000, loaded.depth, np.uint16(0))
    if not depth.any():
        raise Unusable("no_valid_depth", f"nothing within {maximum_depth:g} m")
    return replace(loaded, depth=depth, deviation=None if loaded.deviation is None else loaded.deviation * (depth > 0))


def _finish(
    source: LogSource,
    gravity: Gravity,
    drops: Counter[str],
    written: _Written,
    parameters: IngestParameters,
    context: Context,
) -> Sequence:
    notes = [*source.notes, *_pose_notes(parameters), *_gravity_notes(gravity), *_warnings(source, written)]
    for note in notes:
        (context.logger.warning if note.startswith("WARNING") else context.logger.info)("%s", note)
    write_tum(
        context.output / "trajectory.tum", np.array(written.posed_times), np.array(written.poses).reshape(-1, 4, 4)
    )
    counts = Counter(written.cameras)
    SequenceFile(
        source_format=source.format,
        rule=source.rule,
        notes=tuple(notes),
        camera=source.camera,
        cameras=tuple(
            SequenceCamera(
                name=entry.name,
                camera=entry.camera,
                baseline=entry.baseline,
                picture=entry.picture,
                frame_count=counts[entry.name],
            )
            for entry in source.cameras
        ),
        streams=tuple(stream for stream in get_args(StreamName) if stream in written.streams),
        frame_count=len(written.times),
        frames_in_log=len(source.entries),
        drops=dict(sorted(drops.items())),
        damage=source.damage,
        other_cameras=source.other_cameras,
        gravity=gravity,
        label_table=source.label_table,
        color_depth_registered=all(entry.registered for entry in source.cameras),
        start_time=written.times[0] if written.times else 0.0,
        end_time=written.times[-1] if written.times else 0.0,
    ).write(context.output / "sequence.json")
    summary: dict[str, Any] = {
        "frames": len(written.times),
        "frames_in_log": len(source.entries),
        "dropped": sum(count for reason, count in drops.items() if reason != NOT_SELECTED),
        "gravity": gravity.method,
        "median_depth": round(written.median_depth, 3),
        "posed_frames": len(written.posed_times),
    }
    if len(source.cameras) > 1:
        summary["cameras"] = len(source.cameras)
    if source.damage:
        summary["damage"] = len(source.damage)
    if not written.times:
        worst = ", ".join(f"{reason} {count}" for reason, count in drops.most_common()) or "no frames in the log"
        advice = "; ".join(ADVICE[reason] for reason, _ in drops.most_common() if reason in ADVICE)
        summary["reason"] = f"no usable frame: {worst}" + (f" ({advice})" if advice else "")
        context.logger.warning("%s", summary["reason"])
    return Sequence(context.output, outcome="ok" if written.times else "empty", summary=summary)


def _pose_notes(parameters: IngestParameters) -> list[str]:
    """What the options made of the log's poses."""
    notes = []
    if parameters.pose_convention != "as-is":
        words = CONVENTION_WORDS[parameters.pose_convention]
        notes.append(f"poses given by option as {parameters.pose_convention}: {words}")
    if parameters.pose_scale != 1:
        notes.append(f"positions of the log multiplied by {parameters.pose_scale:g}, by option")
    return notes


def _gravity_notes(gravity: Gravity) -> list[str]:
    """Why up may be wrong."""
    reason = REASON.search(gravity.detail)
    if reason is None or reason[1] != "doubtful":
        return []
    return [f"WARNING: up may be wrong: {reason[2]} (--gravity given --up AXIS)"]


def brightness_of(picture: np.ndarray | bytes) -> float:
    """Return the mean of a picture (H, W, 3) uint8, or of a JPEG's or PNG's bytes, 0 to 255."""
    if isinstance(picture, bytes):
        small = cv2.imdecode(np.frombuffer(picture, np.uint8), cv2.IMREAD_REDUCED_GRAYSCALE_8)
        return 255.0 if small is None else float(small.mean())
    return float(picture[::8, ::8].mean())


def _warnings(source: LogSource, written: _Written) -> list[str]:
    """What looks odd about the frames that were written."""
    notes = []
    low, high = PLAUSIBLE_MEDIAN_DEPTH
    if written.median_depths and not low <= written.median_depth <= high:
        notes.append(
            f"WARNING: median depth is {written.median_depth:.3g} m; is the depth unit right (depth_scale)? "
            "`scenewright inspect` tells"
        )
    if written.roughness and (rough := float(np.median(written.roughness))) > ROUGH:
        notes.append(
            f"WARNING: neighbouring pixels of depth differ by {100 * rough:.0f} %, as in no depth image: is it stored "
            "otherwise (--depth-bits)? `scenewright inspect` tells"
        )
    if written.brightness and (lit := float(np.median(written.brightness))) < DARK:
        notes.append(
            f"WARNING: the images are all but black ({lit:.0f} of 255): a lens cap, or night; what is mapped has the "
            "shape that depth gives, and names say nothing"
        )
    poses = np.array(written.poses).reshape(-1, 4, 4)
    names = np.array(written.pose_cameras, dtype=str)
    step = max((largest_step(poses[names == name]) for name in sorted(set(written.pose_cameras))), default=0.0)
    if step > LARGE_STEP:
        notes.append(f"WARNING: the camera jumps {step:.2f} m between two frames")
    if written.times and not written.poses and not any(note.startswith(NO_POSES) for note in source.notes):
        notes.append(NO_POSES)
    if written.times and "color" not in written.streams:
        notes.append(
            "WARNING: frames have no colour: what is mapped has the shape that depth gives, names are guessed from "
            "shape alone, and steps that need images refuse"
        )
    if written.orientations:
        notes.append(
            f"{written.orientations} images state an EXIF orientation: the calibration is taken to be of the pixels "
            "as they are stored, and the orientation is left out"
        )
    if written.times and "depth" not in written.streams and "depth" not in source.missing:
        notes.append("frames have no depth")
    if source.other_cameras:
        notes.append(f"other cameras of the log: {', '.join(source.other_cameras)} (--camera NAME, --camera all)")
    return notes
