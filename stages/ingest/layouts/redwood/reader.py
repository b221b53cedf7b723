"""Redwood / Open3D folders: image|color|rgb/, depth/, trajectory.log (world_from_camera), camera_intrinsic.json."""

from __future__ import annotations

import math
from pathlib import Path

from scenewright.schemas.errors import BadInput
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.ingest.folders.files import (
    COLOR_SUFFIXES,
    DEPTH_SUFFIXES,
    camera_from_options,
    depth_form,
    depth_image_size,
    first_subfolder,
    image_loader,
    images_by_stem,
    images_of_subfolder,
    overridden,
    read_json,
    stream,
    text_stream,
)
from scenewright.stages.ingest.parameters import IngestParameters
from scenewright.stages.ingest.source import Entry, FrameFiles, LogSource, SourceCamera
from scenewright.stages.kit.formats.trajectories import read_open3d_log

COLOR_FOLDERS = ("image", "color", "rgb")
TRAJECTORY = "trajectory.log"
INTRINSICS = ("camera_intrinsic.json", "intrinsic.json")
PRIMESENSE = {"fx": 525.0, "fy": 525.0, "cx": 319.5, "cy": 239.5}
"""Open3D's `PinholeCameraIntrinsicParameters.PrimeSenseDefault` for 640 x 480 [px]."""


def matches(root: Path) -> str | None:
    """Return the rule that matched, or None."""
    if not (root / "depth").is_dir() or not (root / TRAJECTORY).is_file():
        return None
    color = first_subfolder(root, COLOR_FOLDERS)
    return f"folder with {f'{color.name}/, ' if color else ''}depth/ and {TRAJECTORY}: Redwood/Open3D"


def open_source(root: Path, parameters: IngestParameters, rule: str) -> LogSource:
    """List the frames of a Redwood folder. Raises BadInput for a damaged trajectory or intrinsics."""
    color_folder = first_subfolder(root, COLOR_FOLDERS)
    colors = list(images_of_subfolder(color_folder, COLOR_SUFFIXES).values())
    depths = list(images_by_stem(root / "depth", DEPTH_SUFFIXES).values())
    poses = read_open3d_log(root / TRAJECTORY)
    camera, notes = _camera(root, depth_image_size(depths), parameters)
    camera, notes_of_options = overridden(camera, parameters)
    form, unit_note = depth_form(parameters, 1000.0, depths)
    if colors and len(colors) != len(depths):
        raise BadInput(
            f"{root}: {len(colors)} colour and {len(depths)} depth images are not pairs",
            hint="the format pairs images by order: add the missing ones, or delete their partners",
        )
    if len(poses) > len(depths):
        raise BadInput(f"{root / TRAJECTORY}: {len(poses)} poses for {len(depths)} images")
    paired: list[Path | None] = [*colors] if colors else [None] * len(depths)
    entries = tuple(
        Entry(
            name=depth.name,
            time=index / parameters.frame_rate,
            world_from_camera=poses[index] if index < len(poses) else None,
            load=image_loader(color, depth, camera, form, has_color=bool(colors)),
            files=FrameFiles(color, depth),
        )
        for index, (color, depth) in enumerate(zip(paired, depths, strict=True))
    )
    notes = (*notes, *notes_of_options, unit_note, f"times assumed: {parameters.frame_rate:g} frames per second")
    streams = (
        *((stream(color_folder.name, "color", colors),) if color_folder else ()),
        stream("depth", "depth", depths),
        text_stream(TRAJECTORY, "pose", len(poses)),
    )
    return LogSource("redwood", rule, (SourceCamera("camera", camera),), entries, notes, streams=streams)


def _camera(root: Path, size: tuple[int, int] | None, parameters: IngestParameters) -> tuple[Camera, tuple[str, ...]]:
    width, height = size or (0, 0)
    for name in INTRINSICS:
        path = root / name
        if path.exists():
            return _read_intrinsics(path, size), (f"intrinsics read from {name}",)
    if size is not None and size != (640, 480):
        why = f"{root}: images are {width}x{height} and there is no {INTRINSICS[0]} (Open3D layout)"
        return camera_from_options(size, parameters, why), ()
    note = "intrinsics assumed: PrimeSense default, fx = fy = 525, cx = 319.5, cy = 239.5"
    return Camera(width=width, height=height, **PRIMESENSE), (note,)


def _read_intrinsics(path: Path, size: tuple[int, int] | None) -> Camera:
    try:
        document = read_json(path)
        matrix = [float(value) for value in document["intrinsic_matrix"]]  # column major
        width, height = int(document["width"]), int(document["height"])
        fx, fy, cx, cy = matrix[0], matrix[4], matrix[6], matrix[7]
    except (ValueError, KeyError, TypeError, IndexError, OverflowError) as error:
        raise BadInput(f"{path}: no Open3D intrinsics ({type(error).__name__}: {error})") from None
    if not all(map(math.isfinite, matrix)) or fx <= 0 or fy <= 0 or min(width, height) < 1:
        raise BadInput(f"{path}: focal lengths {fx:g}, {fy:g} are not positive")
    if size is not None and size != (width, height):
        raise BadInput(f"{path}: is for {width}x{height}, the depth images are {size[0]}x{size[1]}")
    return Camera.of_outside(path, width=width, height=height, fx=fx, fy=fy, cx=cx, cy=cy)
