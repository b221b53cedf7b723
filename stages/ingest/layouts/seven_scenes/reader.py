"""7-Scenes folders: frame-000000.color.jpg|png, frame-000000.depth.png, frame-000000.pose.txt (world_from_camera)."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.ingest.color_registration import registered_loader
from scenewright.stages.ingest.folders.files import (
    camera_from_options,
    depth_form,
    depth_image_size,
    image_loader,
    overridden,
    stream,
)
from scenewright.stages.ingest.parameters import IngestParameters
from scenewright.stages.ingest.source import Entry, FrameFiles, LogSource, SourceCamera
from scenewright.stages.kit.formats.trajectories import read_matrix
from scenewright.stages.kit.geometry.transforms import transform_from

FILE = re.compile(r"frame-(\d+)\.(color|depth|pose)\.(jpg|jpeg|png|txt)$")
DEFAULT_FOCAL_LENGTH, DEFAULT_CENTER = 585.0, (320.0, 240.0)
"""What the data set's page states for its Kinect at 640x480."""
COLOR_CAMERA = Camera(width=640, height=480, fx=527.0, fy=527.0, cx=322.4, cy=240.0)
"""Colour camera of the 7-Scenes Kinect for 640 x 480 [px]; fitted, as is where it stands."""
COLOR_FROM_DEPTH = transform_from(np.eye(3), np.array([-0.0307, 0.0, 0.0]))
"""The colour camera beside the depth camera. The data set does not state them: fitted on 15 frames of the red kitchen
so that depth jumps fall on colour edges (focal length, principal point and baseline left free); the mean normalised
colour gradient under the jumps rises from 0.24 unregistered to 1.03, and is 0.71 with a calibration in circulation."""
REGISTERED_NOTE = "colour resampled into the depth camera (7-Scenes does not register them; calibration fitted by us)"

UNREGISTERED_NOTE = "colour and depth of 7-Scenes are not registered (other lens, 3 cm apart)"
OTHER_CAMERA_NOTE = "not the camera of 7-Scenes: colour and depth taken to be registered, as in other layouts"


def matches(root: Path) -> str | None:
    """Return the rule that matched, or None."""
    if root.is_dir() and any(FILE.match(path.name) and ".depth." in path.name for path in root.iterdir()):
        return "folder with frame-<number>.depth.png files: 7-Scenes"
    return None


def open_source(root: Path, parameters: IngestParameters, rule: str) -> LogSource:
    """List the frames of a 7-Scenes folder. Raises BadInput for damaged intrinsics."""
    files: dict[int, dict[str, Path]] = {}
    for path in sorted(root.iterdir()):
        match = FILE.match(path.name)
        if match:
            files.setdefault(int(match[1]), {})[match[2]] = path
    size = depth_image_size([images["depth"] for _, images in sorted(files.items()) if "depth" in images])
    camera, notes = _camera(root, size, parameters)
    camera, notes_of_options = overridden(camera, parameters)
    form, unit_note = depth_form(parameters, 1000.0, [images.get("depth") for _, images in sorted(files.items())])
    theirs = _is_seven_scenes_kinect(camera)  # other people record in this layout too
    register = parameters.register_color and theirs
    has_color = any("color" in images for images in files.values())
    entries = []
    for number in sorted(files):
        images = files[number]
        pose, problem = _pose(images.get("pose"))
        color, depth = images.get("color"), images.get("depth")
        load = image_loader(color, depth, camera, form, has_color=has_color, decoded=register)
        if register:
            load = registered_loader(load, camera, COLOR_CAMERA, COLOR_FROM_DEPTH)
        entries.append(
            Entry(
                name=f"frame-{number:06d}",
                time=number / parameters.frame_rate,
                world_from_camera=pose,
                load=load,
                problem=problem,
                files=FrameFiles(color, depth),
            )
        )
    notes = (
        *notes,
        *notes_of_options,
        unit_note,
        f"times assumed: frame number / {parameters.frame_rate:g} per second",
        REGISTERED_NOTE if register else UNREGISTERED_NOTE if theirs else OTHER_CAMERA_NOTE,
    )
    cameras = (SourceCamera("camera", camera, registered=register or not theirs),)
    streams = (
        *((stream("*.color", "color", [i["color"] for i in files.values() if "color" in i]),) if has_color else ()),
        stream("*.depth", "depth", [images["depth"] for images in files.values() if "depth" in images]),
        stream("*.pose.txt", "pose", [images["pose"] for images in files.values() if "pose" in images]),
    )
    return LogSource("7scenes", rule, cameras, tuple(entries), notes, streams=streams)


def _is_seven_scenes_kinect(camera: Camera) -> bool:
    """Whether this is the data set's own depth camera, whose place beside the colour camera is known."""
    return (camera.width, camera.height) == (640, 480) and abs(camera.fx - DEFAULT_FOCAL_LENGTH) < 1


def _camera(root: Path, size: tuple[int, int] | None, parameters: IngestParameters) -> tuple[Camera, tuple[str, ...]]:
    width, height = size or (0, 0)
    path = root / "camera-intrinsics.txt"
    if path.exists():
        matrix = read_matrix(path, 3, 3)
        if not np.isfinite(matrix).all() or matrix[0, 0] <= 0 or matrix[1, 1] <= 0:
            raise BadInput(
                f"{path}: focal lengths {matrix[0, 0]:g}, {matrix[1, 1]:g} are not positive",
                hint="write it row by row: fx 0 cx, 0 fy cy, 0 0 1",
            )
        (fx, _, cx), (_, fy, cy), _ = matrix
        camera = Camera.of_outside(
            path,
            width=width,
            height=height,
            fx=fx,
            fy=fy,
            cx=cx,
            cy=cy,
            hint="write it row by row: fx 0 cx, 0 fy cy, 0 0 1",
        )
        return camera, (f"intrinsics read from {path.name}",)
    if size is not None and size != (640, 480):
        why = f"{root}: images are {width}x{height} and there is no {path.name}"
        return camera_from_options(size, parameters, why), ()
    camera = Camera(
        width=width,
        height=height,
        fx=DEFAULT_FOCAL_LENGTH,
        fy=DEFAULT_FOCAL_LENGTH,
        cx=DEFAULT_CENTER[0],
        cy=DEFAULT_CENTER[1],
    )
    return camera, ("intrinsics assumed: 7-Scenes default, fx = fy = 585, cx = 320, cy = 240",)


def _pose(path: Path | None) -> tuple[np.ndarray | None, str | None]:
    if path is None:
        return None, None
    try:
        return read_matrix(path), None
    except BadInput:
        return None, "unreadable_pose"
