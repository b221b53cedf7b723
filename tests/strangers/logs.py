"""Writers of logs as strangers have them: every unit, stamp and name can be another."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scenewright.schemas.scene_parts import Camera

from tests.strangers.rooms import CAMERA, Shot
from tests.unit.ingest.folder_writers import OPENGL_FROM_OPENCV, tum_line
from tests.unit.ingest.message_logs import FIRST, SECOND, RosRecorder, recorder
from tests.unit.ingest.tiny_room import jpeg, png

STEP = SECOND // 10


def stamps(count: int, start: int = FIRST, step: int = STEP) -> list[int]:
    """Return header stamps [ns]."""
    return [start + k * step for k in range(count)]


def seconds(stamp: int) -> str:
    """Return a stamp as TUM writes it."""
    return f"{stamp // SECOND}.{stamp % SECOND // 1000:06d}"


def units(depth: np.ndarray, per_metre: float) -> np.ndarray:
    """Return uint16 depth."""
    return np.clip(np.rint(depth * per_metre), 0, 65535).astype(np.uint16)


def write_tum(
    root: Path,
    recorded: Sequence[Shot],
    *,
    per_metre: float = 5000,
    scale: float = 1.0,
    poses: Callable[[int, np.ndarray], str] | None = None,
    lists: bool = True,
) -> Path:
    """Write rgb/, depth/, their lists, groundtruth.txt and calibration.txt.

    `scale` multiplies the positions, `poses` returns a line of groundtruth.txt from a stamp [ns] and a pose; without
    `lists` the folders have no lists.
    """
    (root / "rgb").mkdir(parents=True)
    (root / "depth").mkdir()
    rows: dict[str, list[str]] = {"rgb.txt": [], "depth.txt": [], "groundtruth.txt": []}
    for stamp, (color, depth, pose) in zip(stamps(len(recorded)), recorded, strict=True):
        time, moved = seconds(stamp), pose.copy()
        moved[:3, 3] *= scale
        (root / "rgb" / f"{time}.png").write_bytes(png(color))
        (root / "depth" / f"{time}.png").write_bytes(png(units(depth, per_metre)))
        rows["rgb.txt"].append(f"{time} rgb/{time}.png")
        rows["depth.txt"].append(f"{time} depth/{time}.png")
        rows["groundtruth.txt"].append(poses(stamp, moved) if poses else tum_line(time, moved))
    if not lists:
        rows = {"groundtruth.txt": rows["groundtruth.txt"]}
    for name, lines in rows.items():
        (root / name).write_text("\n".join(lines) + "\n")
    (root / "calibration.txt").write_text(f"{CAMERA.fx} {CAMERA.fy} {CAMERA.cx} {CAMERA.cy}\n")
    return root


def write_images(
    root: Path,
    recorded: Sequence[Shot],
    *,
    names: Callable[[int], str] = "{:04d}".format,
    per_metre: float = 1000,
    scale: float = 1.0,
    posed: bool = True,
    camera: Camera = CAMERA,
    intrinsics: bool = True,
    color: Callable[[np.ndarray], tuple[str, bytes]] = lambda pixels: (".jpg", jpeg(pixels)),
    depth: Callable[[Path, np.ndarray], None] | None = None,
) -> Path:
    """Write rgb/, depth/ of the same names, intrinsics.txt and poses.txt of 4x4 rows."""
    (root / "rgb").mkdir(parents=True)
    (root / "depth").mkdir()
    rows = []
    for index, (picture, image, pose) in enumerate(recorded):
        ending, data = color(picture)
        (root / "rgb" / (names(index) + ending)).write_bytes(data)
        if depth is None:
            (root / "depth" / (names(index) + ".png")).write_bytes(png(units(image, per_metre)))
        else:
            depth(root / "depth" / names(index), image)
        moved = pose.copy()
        moved[:3, 3] *= scale
        rows.append(" ".join(repr(float(value)) for value in moved.reshape(-1)))
    if posed:
        (root / "poses.txt").write_text("\n".join(rows) + "\n")
    if intrinsics:
        (root / "intrinsics.txt").write_text(f"{camera.fx} 0 {camera.cx}\n0 {camera.fy} {camera.cy}\n0 0 1\n")
    return root


def write_nerfstudio(
    root: Path,
    recorded: Sequence[Shot],
    *,
    names: Callable[[int], str] = "images/frame_{:05d}.jpg".format,
    data: Callable[[np.ndarray], bytes] = jpeg,
    depth: Callable[[Path, np.ndarray], str] | None = None,
    opengl: bool = True,
    scale: float = 1.0,
    **fields: Any,
) -> Path:
    """Write pictures, depth/ and transforms.json; `depth` writes one depth and returns its ending."""
    frames = []
    for index, (color, image, pose) in enumerate(recorded):
        name = names(index)
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_bytes(data(color))
        (root / "depth").mkdir(exist_ok=True)
        stem = root / "depth" / f"{index:05d}"
        if depth is None:
            ending = ".png"
            stem.with_suffix(ending).write_bytes(png(units(image, 1000)))
        else:
            ending = depth(stem, image)
        moved = pose.copy()
        moved[:3, 3] *= scale
        matrix = moved @ OPENGL_FROM_OPENCV if opengl else moved
        frames.append(
            {"file_path": name, "depth_file_path": f"depth/{stem.name}{ending}", "transform_matrix": matrix.tolist()}
        )
    k = CAMERA
    document = {"fl_x": k.fx, "fl_y": k.fy, "cx": k.cx + 0.5, "cy": k.cy + 0.5, "w": k.width, "h": k.height}
    (root / "transforms.json").write_text(
        json.dumps({"camera_model": "PINHOLE", **document, "frames": frames, **fields})
    )
    return root


def write_bag(
    folder: Path,
    recorded: Sequence[Shot],
    *,
    dialect: str = "ros2-mcap",
    header: Callable[[int], int] = lambda stamp: stamp,
    pixels: Callable[[np.ndarray], np.ndarray] = lambda depth: units(depth, 1000),
    data: Callable[[np.ndarray], bytes] = jpeg,
    transforms: Callable[[RosRecorder, int, np.ndarray], None] | None = None,
    static: Callable[[RosRecorder, int], None] | None = None,
    **info: Any,
) -> Path:
    """Write colour (compressed), registered depth, calibration and map -> camera_optical.

    `header` turns the time of recording into the stamp of the header; `pixels` makes depth pixels of metres.
    """
    with recorder(folder, dialect) as log:
        for stamp, (color, depth, pose) in zip(stamps(len(recorded)), recorded, strict=True):
            head, frame = header(stamp), "camera_optical"
            if static is not None:
                static(log, stamp)
            if transforms is not None:
                transforms(log, stamp, pose)
            else:
                log.transform("/tf", stamp, "map", frame, pose)
            log.info("/camera/color/camera_info", head, frame, CAMERA, log_time=stamp, **info)
            log.compressed("/camera/color/image_raw/compressed", head, data(color), "jpeg", frame, log_time=stamp)
            topic = "/camera/aligned_depth_to_color/image_raw"
            log.image(topic, head, pixels(depth), "16UC1", frame, log_time=stamp)
        return log.path


def with_orientation(data: bytes, value: int) -> bytes:
    """Return a JPEG with an EXIF block that holds the orientation alone (EXIF 2.3, APP1 after SOI)."""
    tiff = b"MM\x00*\x00\x00\x00\x08" + b"\x00\x01" + b"\x01\x12\x00\x03\x00\x00\x00\x01" + bytes([0, value, 0, 0])
    body = b"Exif\x00\x00" + tiff + b"\x00\x00\x00\x00"
    return data[:2] + b"\xff\xe1" + (len(body) + 2).to_bytes(2, "big") + body + data[2:]


def orientation(data: bytes) -> int:
    """Return the orientation that another reader would apply; 1 where none is written."""
    from io import BytesIO

    from PIL import Image

    return int(Image.open(BytesIO(data)).getexif().get(0x0112, 1))
