"""Writing a folder of the nerfstudio layout."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.export.frames import ExportJob
from scenewright.stages.export.pictures import picture_suffix, write_depth_png

OPENCV_FROM_OPENGL = np.diag([1.0, -1.0, -1.0, 1.0])
"""OpenGL cameras look along -z with y up, ours along +z with y down."""
PIXEL_CENTER = 0.5
"""Our first pixel has its centre at 0, nerfstudio's at 0.5."""


def intrinsics(camera: Camera) -> dict[str, float | int]:
    """Return the keys of transforms.json that describe a camera without distortion."""
    return {
        "w": camera.width,
        "h": camera.height,
        "fl_x": camera.fx,
        "fl_y": camera.fy,
        "cx": camera.cx + PIXEL_CENTER,
        "cy": camera.cy + PIXEL_CENTER,
    }


def write(job: ExportJob) -> None:
    """Write the frames, named by their place in the sequence. Those without colour or pose have no place in the format
    and are counted.

    `timestamp` [s] and `camera_name` are ours; other readers pass over them.
    """
    root, cameras, tally = job.root, job.cameras, job.tally
    for name in ("images", "depth"):
        (root / name).mkdir()
    rows = []
    for frame in job.frames:
        if frame.world_from_camera is None or frame.color is None:
            tally.left_out["missing_pose" if frame.world_from_camera is None else "missing_color"] += 1
            continue
        row: dict[str, Any] = {
            "file_path": f"images/frame_{frame.index:06d}{picture_suffix(frame.color)}",
            "transform_matrix": (frame.world_from_camera @ OPENCV_FROM_OPENGL).tolist(),
            "timestamp": frame.stamp * 1e-9,
        }
        (root / row["file_path"]).write_bytes(frame.color)
        tally.streams |= {"color", "pose"}
        if frame.depth is not None:
            row["depth_file_path"] = f"depth/frame_{frame.index:06d}.png"
            write_depth_png(root / row["depth_file_path"], frame.depth)
            tally.streams.add("depth")
        if len(cameras) > 1:
            row |= {"camera_name": frame.camera_name, **intrinsics(cameras[frame.camera_name])}
        rows.append(row)
        tally.frames += 1
    document: dict[str, Any] = {"camera_model": "OPENCV", "k1": 0.0, "k2": 0.0, "p1": 0.0, "p2": 0.0}
    if len(cameras) == 1:
        document |= intrinsics(next(iter(cameras.values())))
    document |= {"depth_unit_scale_factor": 0.001, "frames": rows}
    (root / "transforms.json").write_text(json.dumps(document, indent=1, allow_nan=False) + "\n", encoding="ascii")
