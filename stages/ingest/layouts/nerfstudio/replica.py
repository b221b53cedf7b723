"""Replica as rendered for RGB-D mapping: traj.txt (4x4 camera-to-world a line), results/frame*.jpg (or none) and
depth*.png, cam_params.json in the folder or the one above it. Cameras are OpenCV's, depth is 1/6553.5 m."""

from __future__ import annotations

from pathlib import Path

from scenewright.schemas.errors import BadInput
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.ingest.folders.files import (
    camera_from_options,
    depth_form,
    depth_image_size,
    image_loader,
    images_by_number,
    overridden,
    pinhole,
    read_json,
    resized_camera,
    stream,
    text_stream,
)
from scenewright.stages.ingest.parameters import IngestParameters
from scenewright.stages.ingest.source import Entry, FrameFiles, LogSource, SourceCamera
from scenewright.stages.kit.formats.trajectories import number_rows

TRAJECTORY, RESULTS, CAMERA = "traj.txt", "results", "cam_params.json"
AS_WRITTEN = 'write it so: {"camera": {"w", "h", "fx", "fy", "cx", "cy", "scale"}}'
UNITS_PER_METRE = 6553.5
"""Stored depth per metre where the file does not say; Replica's own camera parameters."""
RENDERED = ((1200, 680), (600.0, 600.0, 599.5, 339.5))
"""Size and intrinsics of these renderings, for folders from which cam_params.json was left out."""


def matches(root: Path) -> str | None:
    """Return the rule that matched, or None."""
    if not (root / TRAJECTORY).is_file():
        return None
    frame_kind = next((name for name in ("frame", "depth") if any(root.glob(f"{RESULTS}/{name}*"))), None)
    return f"folder with {TRAJECTORY} and {RESULTS}/{frame_kind}*: Replica" if frame_kind else None


def open_source(root: Path, parameters: IngestParameters, rule: str) -> LogSource:
    """List the frames of a Replica folder. Raises BadInput for a damaged trajectory or unknown intrinsics."""
    colors = images_by_number(root / RESULTS, (".jpg", ".jpeg", ".png"), "frame")
    depths = images_by_number(root / RESULTS, (".png",), "depth")
    rows = number_rows(root / TRAJECTORY, 16)
    numbers = sorted(colors.keys() | depths.keys())
    size = depth_image_size(depths.values())
    path = next((folder / CAMERA for folder in (root, root.parent) if (folder / CAMERA).is_file()), None)
    default_units = UNITS_PER_METRE
    if path is not None:
        camera, default_units = _read_camera(path, size)
        source = f"intrinsics read from {path.name}"
    elif size == RENDERED[0]:
        camera, source = pinhole(RENDERED[1], size, str(root)), "intrinsics assumed: Replica, 600 600 599.5 339.5"
    else:
        camera, source = camera_from_options(size, parameters, f"{root}: there is no {CAMERA}"), "no cam_params.json"
    camera, notes_of_options = overridden(camera, parameters)
    form, unit_note = depth_form(parameters, default_units)
    entries = tuple(
        Entry(
            f"frame {number}",
            number / parameters.frame_rate,
            rows[number][1].reshape(4, 4) if number < len(rows) else None,
            image_loader(colors.get(number), depths.get(number), camera, form, has_color=bool(colors)),
            files=FrameFiles(colors.get(number), depths.get(number)),
        )
        for number in numbers
    )
    notes = (
        source,
        *notes_of_options,
        unit_note,
        f"poses assumed: line n of {TRAJECTORY} belongs to image n, counted from 0",
        f"times assumed: frame number / {parameters.frame_rate:g} per second",
    )
    streams = (
        *((stream(f"{RESULTS}/frame", "color", colors.values()),) if colors else ()),
        stream(f"{RESULTS}/depth", "depth", depths.values()),
        text_stream(TRAJECTORY, "pose", len(rows)),
    )
    return LogSource("nerfstudio", rule, (SourceCamera("camera", camera),), entries, notes, streams=streams)


def _read_camera(path: Path, size: tuple[int, int] | None) -> tuple[Camera, float]:
    """Return the camera and depth units per metre in `{"camera": {w h fx fy cx cy scale}}`."""
    document = read_json(path)
    fields = document.get("camera", document) if isinstance(document, dict) else None
    if not isinstance(fields, dict):
        raise BadInput(f"{path}: has no camera", hint=AS_WRITTEN)
    try:
        stated = (int(fields["w"]), int(fields["h"]))
        numbers = [fields[name] for name in ("fx", "fy", "cx", "cy")]
        units = float(fields.get("scale", UNITS_PER_METRE))
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise BadInput(
            f"{path}: no camera with w, h, fx, fy, cx, cy ({type(error).__name__}: {error})", hint=AS_WRITTEN
        ) from None
    if not 0 < units < 1e9 or not all(0 < value < 1e5 for value in stated):
        raise BadInput(f"{path}: size {stated[0]}x{stated[1]} or scale {units:g} is impossible", hint=AS_WRITTEN)
    return resized_camera(pinhole(numbers, stated, str(path)), size, str(path)), units
