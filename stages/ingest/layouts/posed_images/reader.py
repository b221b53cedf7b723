"""Folders of posed images: color|rgb|image/ (or none), depth/, pose.txt with a line `tx ty tz qx qy qz qw` an image.

The poses are world_from_camera (as in slambook2's diningroom); intrinsics come from options. Folders with a
calibration file, or with other pose lines, are the plain images of layouts/images.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.ingest.folders.calibration_search import calibration_of
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
    natural_key,
    stream,
    text_stream,
)
from scenewright.stages.ingest.folders.pose_files import columns_of
from scenewright.stages.ingest.parameters import IngestParameters
from scenewright.stages.ingest.source import Entry, FrameFiles, LogSource, SourceCamera
from scenewright.stages.kit.formats.trajectories import number_rows, transform_from_numbers

COLOR_FOLDERS = ("color", "rgb", "image")
POSES = ("pose.txt", "poses.txt")


def matches(root: Path) -> str | None:
    """Return the rule that matched, or None."""
    color = first_subfolder(root, COLOR_FOLDERS)
    poses = next((name for name in POSES if (root / name).is_file()), None)
    if poses is None or not (root / "depth").is_dir():
        return None
    if calibration_of(root) is not None or columns_of(root / poses) in (8, 12, 13, 16, 17):
        return None
    return f"folder with {f'{color.name}/, ' if color else ''}depth/ and {poses}: posed images"


def open_source(root: Path, parameters: IngestParameters, rule: str) -> LogSource:
    """List the frames of a posed image folder. Raises BadInput when poses or intrinsics are not to be had."""
    color_folder = first_subfolder(root, COLOR_FOLDERS)
    pose_file = next(root / name for name in POSES if (root / name).is_file())
    colors = images_of_subfolder(color_folder, COLOR_SUFFIXES)
    depths = images_by_stem(root / "depth", DEPTH_SUFFIXES)
    rows = number_rows(pose_file, 7)
    stems = sorted(colors.keys() | depths.keys(), key=natural_key)
    if len(rows) != len(stems):
        raise BadInput(f"{pose_file}: {len(rows)} poses for {len(stems)} images", hint="one line an image, in order")
    camera = camera_from_options(depth_image_size(list(depths.values())), parameters, f"{root}: posed images")
    form, unit_note = depth_form(parameters, 1000.0, depths.values())
    entries = []
    for index, (stem, (line, numbers)) in enumerate(zip(stems, rows, strict=True)):
        pose, problem = _pose(numbers, f"{pose_file}: line {line}")
        files = FrameFiles(colors.get(stem), depths.get(stem))
        loader = image_loader(files.color, files.depth, camera, form, has_color=bool(colors))
        entries.append(Entry(stem, index / parameters.frame_rate, pose, loader, problem, files=files))
    notes = (
        "intrinsics given by option",
        unit_note,
        f"times assumed: {parameters.frame_rate:g} frames per second",
        "poses assumed: tx ty tz qx qy qz qw, world_from_camera",
    )
    streams = (
        *((stream(color_folder.name, "color", colors.values()),) if color_folder else ()),
        stream("depth", "depth", depths.values()),
        text_stream(pose_file.name, "pose", len(rows)),
    )
    return LogSource("posed-images", rule, (SourceCamera("camera", camera),), tuple(entries), notes, streams=streams)


def _pose(numbers: np.ndarray, where: str) -> tuple[np.ndarray | None, str | None]:
    if not np.isfinite(numbers).all():
        return None, "non_finite_pose"
    try:
        return transform_from_numbers(numbers, where), None
    except BadInput:
        return None, "non_rigid_pose"
