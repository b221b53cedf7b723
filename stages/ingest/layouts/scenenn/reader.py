"""SceneNN folders: image|rgb/, depth/ (mm), trajectory.log (camera-to-world), timestamp.txt, asus.ini.

Two variants circulate: `image/image00001.png` with `depth/depth00001.png` as the data set's playback tool writes them,
and `rgb/00001.png` with `depth/00001.png`. Both number frames from 1, while the entries of trajectory.log count from 0;
folders numbered from 0 are matched one to one. Meshes (.ply) and annotations (.xml) are left alone: `truth scenenn`
reads them.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.ingest.folders.files import (
    COLOR_SUFFIXES,
    DEPTH_SUFFIXES,
    all_intrinsics_given,
    camera_from_options,
    depth_form,
    depth_image_size,
    first_subfolder,
    image_loader,
    images_by_number,
    overridden,
    pinhole,
    resized_camera,
    stream,
    text_stream,
)
from scenewright.stages.ingest.parameters import IngestParameters
from scenewright.stages.ingest.source import Entry, FrameFiles, LogSource, SourceCamera
from scenewright.stages.kit.formats.trajectories import read_numbered_open3d_log, read_text

COLOR_FOLDERS = ("image", "rgb")
TRAJECTORY, TIMES = "trajectory.log", "timestamp.txt"
INTRINSICS = ("asus.ini", "kinect2.ini", "intrinsic/asus.ini", "intrinsic/kinect2.ini", "../intrinsic/asus.ini")
ASUS = (544.47329, 544.47329, 320.0, 240.0)
"""The Asus Xtion of the data set at 640x480, as programs for it state it in agreement."""
LATEST_MICROSECONDS = 9 * 10**15
"""Latest time that is believed [microseconds]; larger ones would overflow 64-bit nanoseconds."""


def matches(root: Path) -> str | None:
    """Return the rule that matched, or None. trajectory.log alone is the Redwood layout."""
    color = first_subfolder(root, COLOR_FOLDERS)
    if not (root / "depth").is_dir() or not (root / TRAJECTORY).is_file():
        return None
    sign = next((name for name in (TIMES, *INTRINSICS) if (root / name).is_file()), None)
    if sign is None and any(root.glob("depth/depth[0-9]*.png")):
        sign = "depth/depth<number>.png"
    color_folder = f"{color.name}/, " if color else ""
    return f"folder with {color_folder}depth/, {TRAJECTORY} and {sign}: SceneNN" if sign else None


def open_source(root: Path, parameters: IngestParameters, rule: str) -> LogSource:
    """List the frames of a SceneNN folder. Raises BadInput for damaged trajectory, times or unknown intrinsics."""
    color_folder = first_subfolder(root, COLOR_FOLDERS)
    colors = images_by_number(color_folder, COLOR_SUFFIXES) if color_folder else {}
    depths = images_by_number(root / "depth", DEPTH_SUFFIXES)
    numbers = sorted(colors.keys() | depths.keys())
    first = min(1, numbers[0]) if numbers else 0
    entries_of_log = read_numbered_open3d_log(root / TRAJECTORY)
    poses = {number + first: pose for number, pose in entries_of_log}
    if len(poses) < len(entries_of_log):
        raise BadInput(f"{root / TRAJECTORY}: two entries have the same frame number", hint="delete one of them")
    stray = len(poses.keys() - set(numbers))
    times = _times(root)
    camera, notes = _camera(root, depth_image_size(depths.values()), parameters)
    form, unit_note = depth_form(parameters, 1000.0, depths.values())
    entries = [
        Entry(
            name=f"frame {number}",
            time=times.get(number, 0) * 1e-6 if times else (number - first) / parameters.frame_rate,
            world_from_camera=poses.get(number),
            load=image_loader(colors.get(number), depths.get(number), camera, form, has_color=bool(colors)),
            problem="missing_time" if times and number not in times else None,
            files=FrameFiles(colors.get(number), depths.get(number)),
            stamp=times[number] * 1000 if number in times else None,
        )
        for number in numbers
    ]
    notes = (
        *notes,
        unit_note,
        f"poses assumed: entry n of {TRAJECTORY} belongs to image n + {first}",
        f"times from {TIMES}, microseconds"
        if times
        else f"times assumed: frame number / {parameters.frame_rate:g} per second",
        *((f"{stray} poses of {TRAJECTORY} belong to no image",) if stray else ()),
    )
    stamps = {number: microseconds * 1000 for number, microseconds in times.items()}
    streams = (
        *((stream(color_folder.name, "color", colors.values(), _stamps(colors, stamps)),) if color_folder else ()),
        stream("depth", "depth", depths.values(), _stamps(depths, stamps)),
        text_stream(TRAJECTORY, "pose", len(poses)),
    )
    return LogSource("scenenn", rule, (SourceCamera("camera", camera),), tuple(entries), notes, streams=streams)


def _stamps(paths: dict[int, Path], stamps: dict[int, int]) -> np.ndarray:
    return np.array([stamps[number] for number in paths if number in stamps], np.int64)


def _times(root: Path) -> dict[int, int]:
    """Return frame number -> microseconds of timestamp.txt, empty when there is none."""
    path = root / TIMES
    if not path.is_file():
        return {}
    times: dict[int, int] = {}
    for line, text in enumerate(read_text(path).splitlines(), start=1):
        fields = text.split()
        if not fields:
            continue
        # Older copies have the number and one time, the data set's playback tool writes that of colour, then of depth.
        if len(fields) not in (2, 3) or not all(field.isdecimal() and len(field) < 18 for field in fields):
            raise BadInput(
                f"{path}: line {line}: expected a frame number and one or two times in whole microseconds",
                hint="correct that line",
            )
        times[int(fields[0])] = min(int(fields[1]), LATEST_MICROSECONDS)
    return times


def _camera(root: Path, size: tuple[int, int] | None, parameters: IngestParameters) -> tuple[Camera, tuple[str, ...]]:
    path = next((root / name for name in INTRINSICS if (root / name).is_file()), None)
    if path is not None:
        camera = resized_camera(_read_ini(path), size, str(path))
        camera, notes_of_options = overridden(camera, parameters)
        return camera, (f"intrinsics read from {path.name}", *notes_of_options)
    if all_intrinsics_given(parameters) or size not in (None, (640, 480)):
        why = f"{root}: there is no {INTRINSICS[0]}"
        return camera_from_options(size, parameters, why), ("intrinsics given by option",)
    camera, notes_of_options = overridden(pinhole(ASUS, size or (640, 480), str(root)), parameters)
    return camera, ("intrinsics assumed: Asus Xtion of SceneNN, 544.47329 544.47329 320 240", *notes_of_options)


def _read_ini(path: Path) -> Camera:
    """Return the camera in lines `key value`: depth_width, depth_height, fx, fy, and cx, cy or the middle."""
    values: dict[str, float] = {}
    for line, text in enumerate(read_text(path).splitlines(), start=1):
        fields = text.replace("=", " ").split()
        if not fields or fields[0].startswith(("#", ";", "[")):
            continue
        try:
            values[fields[0].lower()] = float(fields[1])
        except (IndexError, ValueError):
            raise BadInput(f"{path}: line {line}: expected a name and a number", hint="correct that line") from None
    width, height = values.get("depth_width", 640.0), values.get("depth_height", 480.0)
    if not (1 <= width <= 1e5 and 1 <= height <= 1e5):
        raise BadInput(f"{path}: images of {width:g}x{height:g} pixels", hint="write width and height in pixels")
    numbers = (values.get("fx"), values.get("fy"), values.get("cx", width / 2), values.get("cy", height / 2))
    return pinhole(numbers, (round(width), round(height)), str(path))
