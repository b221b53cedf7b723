"""Writing a folder of the TUM RGB-D layout."""

from __future__ import annotations

import numpy as np
from scenewright.stages.export.formats.tum import LARGEST_MILLIMETRES, UNITS_PER_MILLIMETRE
from scenewright.stages.export.frames import ExportJob
from scenewright.stages.export.pictures import picture_suffix, write_depth_png
from scenewright.stages.kit.geometry.transforms import quaternion_of


def depth_units(millimetres: np.ndarray) -> tuple[np.ndarray, int]:
    """Return (H, W) uint16 in 1/5000 m, 0 = invalid, and how many pixels are too far for that and became 0."""
    beyond = millimetres > LARGEST_MILLIMETRES
    units = np.where(beyond, 0, millimetres.astype(np.uint32) * UNITS_PER_MILLIMETRE).astype(np.uint16)
    return units, int(beyond.sum())


def stamp_text(stamp: int) -> str:
    """Return nanoseconds as decimal seconds, exactly."""
    return f"{stamp // 10**9}.{stamp % 10**9:09d}"


def pose_line(stamp: int, world_from_camera: np.ndarray) -> str:
    """Return `t tx ty tz qx qy qz qw` [s, m]."""
    numbers = [f"{value:.9f}" for value in world_from_camera[:3, 3]]
    numbers += [f"{value:.12f}" for value in quaternion_of(world_from_camera)]
    return " ".join([stamp_text(stamp), *numbers])


def write(job: ExportJob) -> None:
    """Write the frames of one camera; `calibration.txt` is `fx fy cx cy`, as ETH3D has it."""
    root, tally = job.root, job.tally
    camera = next(iter(job.cameras.values()))
    color_lines = ["# color images", "# timestamp filename"]
    depth_lines = ["# depth maps, 5000 units per metre, 0 invalid", "# timestamp filename"]
    pose_lines = ["# ground truth trajectory: world_from_camera, OpenCV camera", "# timestamp tx ty tz qx qy qz qw"]
    for name in ("rgb", "depth"):
        (root / name).mkdir()
    for frame in job.frames:
        stamp = stamp_text(frame.stamp)
        if frame.color is not None:
            name = f"rgb/{stamp}{picture_suffix(frame.color)}"
            (root / name).write_bytes(frame.color)
            color_lines.append(f"{stamp} {name}")
            tally.streams.add("color")
        if frame.depth is not None:
            units, zeroed = depth_units(frame.depth)
            write_depth_png(root / f"depth/{stamp}.png", units)
            depth_lines.append(f"{stamp} depth/{stamp}.png")
            tally.depth_pixels_zeroed += zeroed
            tally.streams.add("depth")
        if frame.world_from_camera is not None:
            pose_lines.append(pose_line(frame.stamp, frame.world_from_camera))
            tally.streams.add("pose")
        tally.frames += 1
    for name, lines in (("rgb.txt", color_lines), ("depth.txt", depth_lines), ("groundtruth.txt", pose_lines)):
        (root / name).write_text("\n".join(lines) + "\n", encoding="ascii")
    numbers = (camera.fx, camera.fy, camera.cx, camera.cy)
    (root / "calibration.txt").write_text(" ".join(repr(number) for number in numbers) + "\n", encoding="ascii")
