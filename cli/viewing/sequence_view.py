"""Sequences: the camera moves along its path, with pictures, depth, and a cloud of what all frames saw."""

from __future__ import annotations

import numpy as np
from scenewright.schemas.sequence import Sequence
from scenewright.schemas.trajectory import Trajectory
from scenewright.stages.kit.drawing.palette import instance_color
from scenewright.stages.kit.formats.frames import FrameReader
from scenewright.stages.kit.formats.trajectories import read_tum
from scenewright.stages.kit.geometry.cameras import back_project
from scenewright.stages.kit.geometry.transforms import apply
from scenewright.stages.kit.viewing.canvas import Canvas

MAXIMUM_FRAMES = 150
"""Most frames of a recording: more are thinned out, so that it stays in the tens of megabytes."""
CLOUD_FRAMES = 40
"""Most frames that a cloud is made of; by eye."""
CLOUD_GRID = 0.02
"""Edge of the cells of which a cloud has one point each [m]; by eye."""
CLOUD_DEPTH = 4.0
"""Largest depth of a cloud's points [m]; by eye."""
PATH_COLOR = (0.95, 0.55, 0.1)
"""Colour of the camera's path (sRGB, 0 to 1)."""


def draw_sequence(sequence: Sequence, canvas: Canvas) -> None:
    """Draw frames over time, the camera's path and the accumulated cloud."""
    info = sequence.info
    with FrameReader(sequence.path("frames.mcap")) as reader:
        if len(reader) == 0:
            canvas.document("sequence", f"No frames. Left out: {info.drops}")
            return
        _, poses = reader.poses()
        draw_path(canvas, poses)
        cloud = accumulated_cloud(reader)
        if cloud is not None:
            canvas.points("cloud", *cloud, radius=CLOUD_GRID / 2)
            canvas.enclose(*np.percentile(cloud[0], [2, 98], axis=0))
        canvas.label_names(
            "camera/labels", [(e.instance, e.class_name, instance_color(e.instance)) for e in info.label_table]
        )
        draw_frames(canvas, reader)
    gravity = info.gravity
    canvas.always()
    rows = "\n".join(f"- {note}" for note in info.notes)
    canvas.document("sequence", f"{info.rule}\n\ngravity {gravity.method}: {gravity.detail}\n\n{rows}")


def draw_frames(canvas: Canvas, reader: FrameReader) -> None:
    """Draw picture, depth and labels of the frames at their times, the camera at its pose."""
    for name, camera in reader.cameras.items() if len(reader) else ():
        canvas.camera(name, camera)
    every = -(-len(reader) // MAXIMUM_FRAMES)
    for frame in reader.frames(("depth", "labels"), every=every):
        canvas.time(frame.time)
        if frame.world_from_camera is not None:
            canvas.transform(frame.camera_name, frame.world_from_camera)
        color = reader.encoded(frame.index)
        if color is not None:
            canvas.picture(f"{frame.camera_name}/color", color)
        right = reader.encoded(frame.index, "right")
        if right is not None:
            canvas.picture(f"{frame.camera_name}/right", right)
        if frame.depth is not None:
            canvas.depth(f"{frame.camera_name}/depth", frame.depth)
        if frame.labels is not None:
            canvas.labels(f"{frame.camera_name}/labels", frame.labels)


def draw_trajectory(trajectory: Trajectory, canvas: Canvas) -> None:
    """Draw the camera's path."""
    draw_path(canvas, read_tum(trajectory.path("trajectory.tum"))[1])


def draw_path(canvas: Canvas, poses: np.ndarray) -> None:
    """Draw the line through the camera centres of poses (N, 4, 4)."""
    if len(poses) > 1:
        canvas.line("camera_path", [poses[:, :3, 3]], [PATH_COLOR])


def accumulated_cloud(reader: FrameReader) -> tuple[np.ndarray, np.ndarray] | None:
    """Return points (N, 3) and colours (N, 3) uint8 of posed frames on a 2 cm grid, or None without poses."""
    every = -(-len(reader) // CLOUD_FRAMES)
    points, colors = [], []
    for frame in reader.frames(("color", "depth"), every=every):
        if frame.world_from_camera is None or frame.depth is None or frame.color is None:
            continue
        camera_points = back_project(frame.depth, reader.cameras[frame.camera_name], stride=4).reshape(-1, 3)
        valid = (camera_points[:, 2] > 0) & (camera_points[:, 2] < CLOUD_DEPTH)
        points.append(apply(frame.world_from_camera, camera_points[valid]))
        colors.append(frame.color[::4, ::4].reshape(-1, 3)[valid])
    if not points:
        return None
    all_points, all_colors = np.concatenate(points), np.concatenate(colors)
    _, first = np.unique(np.floor(all_points / CLOUD_GRID).astype(np.int64), axis=0, return_index=True)
    return all_points[first], all_colors[first]
