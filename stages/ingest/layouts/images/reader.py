"""Plain images with a calibration file: colour, with depth or a right eye when they are there, poses when they are.

Read are color|rgb|image(s)/, left/ and right/ (also KITTI's image_0/ image_1/), files whose names say what they are
(`NAME.color.png`, Middlebury's im0.png im1.png), and one video. A stereo calibration without a right image means that
both eyes lie side by side in every picture.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scenewright.schemas.errors import BadInput, UsageError
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.ingest.clocks import in_file_order, order_note, stamps_problem
from scenewright.stages.ingest.folders.calibration_files import FolderCalibration
from scenewright.stages.ingest.folders.calibration_search import NAMES as CALIBRATION_NAMES
from scenewright.stages.ingest.folders.calibration_search import calibration_of, find_calibration, refuse_several
from scenewright.stages.ingest.folders.exr_depth import require_exr
from scenewright.stages.ingest.folders.files import (
    all_intrinsics_given,
    camera_from_options,
    color_image_size,
    depth_form,
    depth_image_size,
    file_bytes,
    raw_depth,
    stream,
    text_stream,
)
from scenewright.stages.ingest.folders.pose_files import Pose, columns_of, pose_file, read_pose_list
from scenewright.stages.ingest.folders.stamped_poses import StampedPoses, coverage_notes
from scenewright.stages.ingest.folders.video_frames import VideoFrames
from scenewright.stages.ingest.foreign import unread_tables
from scenewright.stages.ingest.images import DepthForm, decode_as_calibrated, depth_millimetres, usable_color
from scenewright.stages.ingest.layouts.images.image_pairs import FolderImages, find_images, has_images, stamps_of
from scenewright.stages.ingest.lenses import Lens, lens_of
from scenewright.stages.ingest.messages.records import CalibrationRecord
from scenewright.stages.ingest.parameters import IngestParameters
from scenewright.stages.ingest.source import (
    Entry,
    FrameFiles,
    LoadedFrame,
    LogSource,
    SourceCamera,
    StreamInfo,
    Unusable,
)
from scenewright.stages.ingest.stereo import in_metres, stereo_lenses
from scenewright.stages.kit.formats.stamps import exact_stamps
from scenewright.stages.kit.formats.trajectories import read_text

TIMES = ("times.txt", "timestamps.txt", "timestamp.txt")
OPTIONS = ("fx", "fy", "cx", "cy")
PAIR_HINT = "add calibration.yaml (M1 D1 M2 D2 R T), calib.txt (KITTI, Middlebury), or left.yaml and right.yaml"


def matches(root: Path) -> str | None:
    """Return the rule that matched, or None."""
    if not root.is_dir():
        return None
    words = has_images(root)
    if words is None:
        return None
    file = calibration_of(root)
    return f"folder with {words}" + (f" and {file.name}" if file else "") + ": plain images"


@dataclass(frozen=True)
class _Eyes:
    """How pictures become those of the camera."""

    left: Lens
    right: Lens | None = None
    baseline: float | None = None
    side_by_side: bool = False
    """Whether one picture holds both eyes, the left one first."""
    notes: tuple[str, ...] = ()


def open_source(root: Path, parameters: IngestParameters, rule: str) -> LogSource:
    """List the frames of a folder of images. Raises BadInput for unknown intrinsics, damaged files and images that
    cannot be paired."""
    images = find_images(root)
    if images is None:
        raise BadInput(
            f"{root}: holds no images in color/, left/ and right/, or with names that say what they are",
            hint="name the folders or the images so",
        )
    video = VideoFrames(images.video) if images.video else None
    names = images.names if video is None else tuple(f"frame {index}" for index in range(video.count))
    require_exr(path.name for path in images.depths if path)
    has_depth = any(images.depths)
    calibration = _calibration(root, images, parameters)
    size = _size(images, video, has_depth, (calibration.left.width, calibration.left.height))
    eyes = _eyes(calibration, size, any(images.rights), root, parameters.baseline)
    units = calibration.depth_units
    form, unit_note = depth_form(parameters, 1000.0, () if images.depth_is_disparity else images.depths, units)
    if images.depth_is_disparity:
        unit_note = "depth computed from the disparity: Z = fx * baseline / (disparity + doffs)"
    times, time_note = _times(root, names, video, parameters)
    pictures = [color or depth for color, depth in zip(images.colors, images.depths, strict=True)]
    stems = [path.stem if path else name for path, name in zip(pictures, images.names, strict=True)]
    poses, pose_notes = _poses(root, names, stems, times, calibration, parameters)
    entries = []
    for index, name in enumerate(names):
        pose, problem = poses[index]
        load = (
            _video_loader(video, index, eyes)
            if video is not None
            else _loader(images, index, eyes, has_depth, form, calibration.disparity_offset)
        )
        files = FrameFiles() if video is not None else FrameFiles(images.colors[index], images.depths[index])
        stamp = int(times[index]) if time_note.startswith("times from") else None
        entries.append(Entry(name, times[index] * 1e-9, pose, load, problem, files=files, stamp=stamp))
    notes = (
        *calibration.notes,
        *eyes.notes,
        *images.notes,
        *((unit_note,) if has_depth else ()),
        time_note,
        *pose_notes,
    )
    has_right = eyes.right is not None
    camera = SourceCamera("camera", eyes.left.camera, eyes.baseline if has_right else None)
    return LogSource(
        "images",
        rule,
        (camera,),
        tuple(entries),
        notes,
        streams=_streams(images, names, times, time_note, sum(pose is not None for pose, _ in poses)),
        close=video.close if video else lambda: None,
    )


# --- cameras ---------------------------------------------------------------------------------------------------


def _calibration(root: Path, images: FolderImages, parameters: IngestParameters) -> FolderCalibration:
    """Return the calibration of the folder, or what the options say."""
    options = [name for name in OPTIONS if getattr(parameters, name) is not None]
    if all_intrinsics_given(parameters) and not any(images.rights):
        camera = camera_from_options(None, parameters, str(root))
        beside = unread_tables(root, CALIBRATION_NAMES)
        unread = (f"not read: {beside}, which may hold poses or intrinsics",) if beside else ()
        return FolderCalibration(_pinhole_record(camera), notes=("intrinsics given by option", *unread))
    calibration = find_calibration(root, images.camera_number)
    if calibration is None:
        refuse_several(root)
        beside = unread_tables(root, CALIBRATION_NAMES)
        why = f"{root}: there is no calibration file" + (f" (not read: {beside})" if beside else "")
        camera_from_options(None, parameters, why)
        raise BadInput(f"{root}: there is no calibration file for left and right images", hint=PAIR_HINT)
    if options and calibration.right is not None:
        raise UsageError(f"--{options[0]} cannot describe a stereo pair", hint="change the calibration file instead")
    if options:
        matrix = list(calibration.left.K)
        for name, index in zip(OPTIONS, (0, 4, 2, 5), strict=True):
            matrix[index] = matrix[index] if getattr(parameters, name) is None else getattr(parameters, name)
        listed = ", ".join(f"{name} {getattr(parameters, name):g}" for name in options)
        notes = (*calibration.notes, f"intrinsics given by option: {listed}")
        calibration = replace(
            calibration, left=replace(calibration.left, K=tuple(matrix), P=()), rectified=False, notes=notes
        )
    return calibration


def _pinhole_record(camera: Camera) -> CalibrationRecord:
    matrix = (camera.fx, 0.0, camera.cx, 0.0, camera.fy, camera.cy, 0.0, 0.0, 1.0)
    return CalibrationRecord(0, "", camera.width, camera.height, "plumb_bob", (), matrix, (), ())


def _size(
    images: FolderImages, video: VideoFrames | None, has_depth: bool, stated: tuple[int, int]
) -> tuple[int, int] | None:
    """Return (width, height) of the depth images, of the pictures where there are none."""
    if video is not None:
        return video.size
    if has_depth:
        return depth_image_size(path for path in images.depths if path)
    return color_image_size((path for path in images.colors if path), stated)


def _eyes(
    calibration: FolderCalibration, size: tuple[int, int] | None, has_right: bool, root: Path, given: float | None
) -> _Eyes:
    """Return the lenses for pictures of `size`; `given` [m] is the baseline that the options say."""
    width, height = size or (calibration.left.width, calibration.left.height)
    side_by_side = calibration.right is not None and not has_right and _is_double(calibration.left, width, height)
    if side_by_side:
        width //= 2
    if not width * height:  # no image can be decoded, so there will be no frame; the log is described all the same
        matrix = calibration.left.K
        fx, _, cx, _, fy, cy, *_ = matrix
        return _Eyes(
            Lens(
                Camera.of_outside(root, width=0, height=0, fx=fx, fy=fy, cx=cx, cy=cy, hint="correct the calibration"),
                (0, 0),
            )
        )
    sized = [_with_size(each, width, height) for each in (calibration.left, calibration.right) if each is not None]
    if has_right and len(sized) < 2:
        raise BadInput(f"{root}: the calibration is of one camera, the images are pairs", hint=PAIR_HINT)
    if not (has_right or side_by_side):
        lens = lens_of(sized[0], (width, height), calibration.rectified, str(root), "images")
        return _Eyes(lens, notes=lens.notes)
    shape, flat = (width, height), calibration.rectified
    left, right, baseline = stereo_lenses(
        (sized[0], sized[1]),
        (shape, shape),
        (flat, flat),
        calibration.left_from_right,
        ("left", "right"),
        str(root),
        given,
    )
    baseline, unit_note = (baseline, None) if given is not None else in_metres(baseline, str(root))
    notes = [f"stereo pair, baseline {abs(baseline) * 1000:.4g} mm", *([unit_note] if unit_note else ()), *left.notes]
    if side_by_side:
        notes.append("each image holds both eyes side by side, left first")
    if calibration.disparity_offset:
        notes.append(
            f"right image moved by doffs {calibration.disparity_offset:g} pixels, so that one camera describes both: "
            "Z = fx * baseline / disparity"
        )
    return _Eyes(left, right, baseline, side_by_side, tuple(notes))


def _is_double(record: CalibrationRecord, width: int, height: int) -> bool:
    """Whether a picture holds two of a calibration. Where that states no size, its centre is in the left half."""
    if record.width:
        return width * record.height >= 1.9 * record.width * height
    return bool(record.K[2] < 0.4 * width and width > 1.9 * height)


def _with_size(record: CalibrationRecord, width: int, height: int) -> CalibrationRecord:
    """Return a calibration that states its size; one that does not is taken to be of the images."""
    return record if record.width else replace(record, width=width, height=height)


# --- images ----------------------------------------------------------------------------------------------------


def _loader(
    images: FolderImages, index: int, eyes: _Eyes, has_depth: bool, form: DepthForm, disparity_offset: float | None
) -> Callable[[], LoadedFrame]:
    color, depth, right = images.colors[index], images.depths[index], images.rights[index]

    def load() -> LoadedFrame:
        if eyes.side_by_side:
            left, second = _halves(_decode(color, "color", (0, 0)), eyes)
            return LoadedFrame(left, _depth() if has_depth else None, right=second)
        return LoadedFrame(
            _picture(color, eyes.left, "color") if any(images.colors) else None,
            _depth() if has_depth else None,
            right=None if eyes.right is None else _picture(right, eyes.right, "right"),
        )

    def _depth() -> np.ndarray:
        if depth is None:
            raise Unusable("missing_depth")
        raw = eyes.left.pixels(raw_depth(depth), "depth")
        if not images.depth_is_disparity:
            return depth_millimetres(raw, eyes.left.camera, form)
        metres = depth_of_disparity(raw, eyes.left.camera, abs(eyes.baseline or 0.0), disparity_offset or 0.0)
        return depth_millimetres(metres, eyes.left.camera, DepthForm(1.0))

    return load


def _video_loader(video: VideoFrames, index: int, eyes: _Eyes) -> Callable[[], LoadedFrame]:
    def load() -> LoadedFrame:
        image = video.frame(index)
        if eyes.side_by_side:
            left, right = _halves(image, eyes)
            return LoadedFrame(left, None, right=right)
        return LoadedFrame(eyes.left.picture(image), None)

    return load


def _halves(image: np.ndarray, eyes: _Eyes) -> tuple[np.ndarray, np.ndarray]:
    assert eyes.right is not None
    middle = image.shape[1] // 2
    return eyes.left.picture(image[:, :middle]), eyes.right.picture(image[:, middle : 2 * middle])


def _picture(path: Path | None, lens: Lens, stream_name: str) -> np.ndarray | bytes:
    """Return a file's picture without distortion; its own bytes where these can be kept."""
    if lens.maps is not None:
        return lens.picture(_decode(path, stream_name, lens.size))
    if path is None:
        raise Unusable(f"missing_{stream_name}")
    return usable_color(file_bytes(path, stream_name), lens.camera)


def _decode(path: Path | None, stream_name: str, size: tuple[int, int]) -> np.ndarray:
    if path is None:
        raise Unusable(f"missing_{stream_name}")
    image = decode_as_calibrated(file_bytes(path, stream_name), size)
    if image is None:
        raise Unusable(f"undecodable_{stream_name}", path.name)
    return image


def depth_of_disparity(disparity: np.ndarray, camera: Camera, baseline: float, offset: float) -> np.ndarray:
    """Return depth (H, W) float32 [m, 0 invalid] of a disparity (H, W) [pixel] in the left image; `baseline` [m].

    `offset` [pixel] is by how much further right the principal point of the right image lies (Middlebury's doffs). What
    is not positive and finite is invalid.
    """
    total = np.asarray(disparity, dtype=np.float64) + offset
    valid = np.isfinite(disparity) & (disparity > 0) & (total > 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = camera.fx * baseline / total
    return np.where(valid, depth, 0.0).astype(np.float32)


# --- times and poses -------------------------------------------------------------------------------------------


def _times(
    root: Path, names: tuple[str, ...], video: VideoFrames | None, parameters: IngestParameters
) -> tuple[np.ndarray, str]:
    """Return the stamp of every frame (N,) int64 [ns], and where it is from."""
    path = next((root / name for name in TIMES if (root / name).is_file()), None)
    if path is not None:
        texts = [line.split("#", 1)[0].strip() for line in read_text(path).splitlines()]
        rows = [(f"{path}: line {line}", text) for line, text in enumerate(texts, start=1) if text]
        if len(rows) != len(names):
            raise BadInput(f"{path}: {len(rows)} times for {len(names)} images", hint="one line an image, in order")
        column = exact_stamps([text for _, text in rows], [where for where, _ in rows])
        stamps = np.array([stamp for stamp in column.stamps if stamp is not None], np.int64)
        poses = pose_file(root)
        are_looked_up = poses is not None and poses.is_file() and columns_of(poses) == 8
        problem = None if are_looked_up else stamps_problem(stamps.tolist(), names)
        if problem is not None:
            return in_file_order(len(names), parameters.frame_rate), order_note(f"{path.name}: {problem}", parameters)
        words = column.note or "seconds"
        return stamps, f"times from {path.name}, {words.removeprefix('stamps in ')}"
    named = stamps_of(names)
    if named is not None:
        return named, "times from the file names"
    rate = video.rate if video is not None and 0 < video.rate < 1e5 else parameters.frame_rate
    where = "of the video" if rate != parameters.frame_rate else "assumed"
    stamps = np.rint(np.arange(len(names)) * 1e9 / rate).astype(np.int64)
    return stamps, f"times {where}: order / {rate:g} per second"


def _poses(
    root: Path,
    names: tuple[str, ...],
    files: list[str],
    times: np.ndarray,
    calibration: FolderCalibration,
    parameters: IngestParameters,
) -> tuple[list[Pose], tuple[str, ...]]:
    """Return the pose of each frame, and what was assumed of them."""
    path = pose_file(root)
    if path is None:
        return [(None, None)] * len(names), ()
    poses = read_pose_list(path, list(names), files)
    notes: tuple[str, ...] = (f"poses from {path.name}, assumed to be world_from_camera",)
    if isinstance(poses, StampedPoses):
        matrices = [poses.at(int(stamp), parameters) for stamp in times]
        covered = coverage_notes(poses, [int(t) for t in times], [pose is not None for pose in matrices], parameters)
        notes = (*notes, *poses.notes, *covered)
        poses = [(pose, None) for pose in matrices]
    offset = calibration.posed_from_left
    if offset is not None and np.abs(offset - np.eye(4)).max() > 0:
        notes = (*notes, f"poses moved by {offset[0, 3]:.4g} m along x: KITTI states those of camera 0")
        with np.errstate(invalid="ignore"):  # poses that are not finite are counted later
            poses = [(None if pose is None else pose @ offset, problem) for pose, problem in poses]
    return poses, notes


def _streams(
    images: FolderImages, names: tuple[str, ...], times: np.ndarray, time_note: str, posed: int
) -> tuple[StreamInfo, ...]:
    recorded = time_note.startswith(("times from", "times of"))
    if images.video is not None:
        return (StreamInfo(images.video.name, "color", "video", times if recorded else times[:0], len(names)),)
    streams = []
    for role, paths in (("color", images.colors), ("depth", images.depths), ("right", images.rights)):
        present = np.array([path is not None for path in paths], dtype=bool)
        if role in images.places:
            stamps = times[present] if recorded else None
            streams.append(stream(images.places[role], role, [path for path in paths if path], stamps))  # type: ignore[arg-type]
    if posed:
        streams.append(text_stream("poses", "pose", posed))
    return tuple(streams)
