"""ARKitScenes' raw recordings: lowres_depth/ID_TIME.png (mm), confidence/, pictures (wide/, vga_wide/ or lowres_wide/),
*_intrinsics/ID_TIME.pincam (w h fx fy cx cy), lowres_wide.traj (time, axis-angle and shift of camera_from_world).

The frames are those of the depth; apple/ARKitScenes, threedod/benchmark_scripts/utils/tenFpsDataLoader.py.
"""

from __future__ import annotations

import re
from functools import partial
from pathlib import Path

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.ingest.folders.files import (
    color_image_size,
    depth_image_size,
    file_bytes,
    files_of,
    raw_depth,
    stream,
    text_stream,
)
from scenewright.stages.ingest.folders.frame_loading import FrameReads
from scenewright.stages.ingest.folders.phone_frames import PhoneFrame, PhoneLog, level_image, phone_source
from scenewright.stages.ingest.folders.stamped_poses import StampedPoses
from scenewright.stages.ingest.parameters import IngestParameters
from scenewright.stages.ingest.source import FrameFiles, LogSource
from scenewright.stages.ingest.transform_tree import TransformTree
from scenewright.stages.kit.formats.stamps import LATEST_STAMP
from scenewright.stages.kit.formats.trajectories import number_rows, read_text
from scenewright.stages.kit.geometry.transforms import inverse, transform_from
from scipy.spatial.transform import Rotation

TRAJECTORY, DEPTH = "lowres_wide.traj", "lowres_depth"
PICTURES = ("wide", "vga_wide", "lowres_wide")
"""Folders of pictures, the largest first."""
TIMED = re.compile(r"(?:.*_)?(\d{1,9}\.\d{1,9})")
SAME = 2_000_000
"""Time between depth and what belongs to it [ns]: names are rounded to a millisecond."""


def matches(path: Path) -> str | None:
    """Return the rule that matched, or None."""
    return f"folder with {TRAJECTORY} and {DEPTH}/: ARKitScenes" if _root(path) is not None else None


def _root(path: Path) -> Path | None:
    candidates = [path, path / f"{path.name}_frames"]
    return next((root for root in candidates if (root / TRAJECTORY).is_file() and (root / DEPTH).is_dir()), None)


def open_source(path: Path, parameters: IngestParameters, rule: str) -> LogSource:
    """List the frames of a recording. Raises BadInput where the intrinsics of no picture are there."""
    root = _root(path)
    assert root is not None
    depths, levels = _timed(root / DEPTH, ".png"), _timed(root / "confidence", ".png")
    pictures = next((name for name in PICTURES if _timed(root / name, ".png")), "lowres_wide")
    colors, cameras = _timed(root / pictures, ".png"), _timed(root / f"{pictures}_intrinsics", ".pincam")
    poses = _trajectory(root / TRAJECTORY)
    if not cameras:
        raise BadInput(f"{root}: there is no {pictures}_intrinsics/*.pincam", hint="download that asset of the scene")
    usual = _pincam(next(iter(cameras.values())))
    frames = []
    for stamp, depth in depths.items():
        color, level = _near(colors, stamp), _near(levels, stamp)
        camera = _near(cameras, stamp)
        frames.append(
            PhoneFrame(
                name=depth.name,
                time=stamp * 1e-9,
                intrinsics=(usual if camera is None else _pincam(camera))[2:],
                pose=poses.at(_settled(poses.stamps, stamp), parameters),
                reads=FrameReads(
                    None if color is None else partial(file_bytes, color, "color"),
                    partial(raw_depth, depth),
                    None if level is None else partial(level_image, level),
                ),
                files=FrameFiles(color, depth),
                stamp=stamp,
            )
        )
    log = PhoneLog(
        where=str(root),
        frames=frames,
        full_size=(round(usual[0]), round(usual[1])),
        picture_size=color_image_size(colors.values()),
        depth_size=depth_image_size(depths.values()),
        units_per_metre=1000.0,
        notes=(f"intrinsics read from {pictures}_intrinsics/, poses from {TRAJECTORY}, times from the names",),
        streams=(
            *((stream(pictures, "color", colors.values(), np.array(list(colors), np.int64)),) if colors else ()),
            stream(DEPTH, "depth", depths.values(), np.array(list(depths), np.int64)),
            text_stream(TRAJECTORY, "pose", len(poses.stamps), poses.stamps),
        ),
    )
    return phone_source("arkit-scenes", rule, log, parameters)


def _timed(folder: Path, suffix: str) -> dict[int, Path]:
    """Return stamp [ns] -> file of a folder whose names end with a time in seconds, in order."""
    found = ((TIMED.fullmatch(path.stem), path) for path in files_of(folder, (suffix,))) if folder.is_dir() else ()
    return dict(sorted((round(float(match[1]) * 1e9), path) for match, path in found if match))


def _near(files: dict[int, Path], stamp: int) -> Path | None:
    """Return the file of a time, names being rounded."""
    if stamp in files:
        return files[stamp]
    stamps = np.array(list(files), np.int64)
    if not len(stamps):
        return None
    at = int(stamps[np.abs(stamps - stamp).argmin()])
    return files[at] if abs(at - stamp) <= SAME else None


def _settled(stamps: np.ndarray, stamp: int) -> int:
    """Return the stamp [ns] of a pose where one is of this time but for its rounding, else the time itself."""
    nearest = int(stamps[np.abs(stamps - stamp).argmin()]) if len(stamps) else stamp
    return nearest if abs(nearest - stamp) <= SAME else stamp


def _pincam(path: Path) -> tuple[float, ...]:
    """Return w h fx fy cx cy. Raises BadInput."""
    try:
        numbers = tuple(float(field) for field in read_text(path).split())
    except ValueError:
        numbers = ()
    if len(numbers) != 6 or not all(1 <= value <= 1e5 for value in numbers[:2]):
        raise BadInput(f"{path}: is not w h fx fy cx cy", hint="download that asset of the scene again")
    return numbers


def _trajectory(path: Path) -> StampedPoses:
    tree, stamps = TransformTree(), []
    for _, row in number_rows(path, 7):
        if np.isfinite(row).all() and 0 <= row[0] < LATEST_STAMP:
            stamps.append(round(row[0] * 1e9))
            camera_from_world = transform_from(Rotation.from_rotvec(row[1:4]).as_matrix(), row[4:])
            tree.add("world", "camera", stamps[-1], inverse(camera_from_world))
    return StampedPoses(np.array(stamps, np.int64), tree, ())
