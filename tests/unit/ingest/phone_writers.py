"""Recordings of the tiny room as the apps of phones write them, from what their makers publish of the form.

Stray Scanner: the page on the format of strayrobots/scanner, OdometryEncoder.swift. Record3D: marek-simonik/record3d,
issues 7, 27, 36 and 93. Polycam: PolyCam/polyform, README. 3D Scanner App: its JSON files, as public scripts read them.
ARKitScenes: apple/ARKitScenes, tenFpsDataLoader.py. ScanNet++: scannetpp/scannetpp, iphone/. NeRFCapture:
jc211/NeRFCapture, DatasetWriter.swift. No reader of ours is used.
"""

from __future__ import annotations

import io
import json
import zipfile
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np
import pytest
from scenewright.schemas.scene_parts import Camera
from scipy.spatial.transform import Rotation

from tests.unit.ingest.tiny_room import camera_poses, jpeg, png, room_depth

FULL = Camera(width=480, height=360, fx=320.0, fy=321.0, cx=244.2, cy=177.4)
"""Of the pictures; the origin of pixels is at the centre of the first (ARCamera.h)."""
RATIO = 7.5
DEPTH = Camera(
    width=64, height=48, fx=320 / RATIO, fy=321 / RATIO, cx=(244.2 + 0.5) / RATIO - 0.5, cy=(177.4 + 0.5) / RATIO - 0.5
)
ARKIT_FROM_ROOM = np.array([[1.0, 0, 0, 0.3], [0, 0, 1, 0.1], [0, -1, 0, -0.2], [0, 0, 0, 1]])
"""ARKit's world has y up."""
ARKIT_FROM_OPENCV = np.diag([1.0, -1.0, -1.0, 1.0])
"""Camera axes: ARKit's y is up and its z is back."""
START = 5231.25
"""Seconds since the phone was started."""
RATE = 60
ROTATED = b"".join(value.to_bytes(4, "big", signed=True) for value in (0, 0x10000, 0, -0x10000, 0, 0, 0, 0, 0x40000000))
"""Matrix of a track that players turn by a quarter (ISO/IEC 14496-12, 8.3.2)."""


@dataclass
class Take:
    """What a phone saw. `world_from_camera` (N, 4, 4) has OpenCV axes, in ARKit's world."""

    count: int = 6
    world_from_camera: np.ndarray = field(init=False)
    depths: list[np.ndarray] = field(init=False)
    """(H, W) float32 [m]"""
    levels: list[np.ndarray] = field(init=False)
    pictures: list[np.ndarray] = field(init=False)
    intrinsics: np.ndarray = field(init=False)
    """(N, 4) fx fy cx cy of each picture."""

    def __post_init__(self) -> None:
        poses = camera_poses(self.count)
        self.world_from_camera = ARKIT_FROM_ROOM @ poses
        self.depths = [room_depth(DEPTH, pose) for pose in poses]
        self.levels = [np.tile(np.arange(DEPTH.width) * 3 // DEPTH.width, (DEPTH.height, 1)) for _ in poses]
        self.pictures = [picture(index) for index in range(self.count)]
        self.intrinsics = np.tile([FULL.fx, FULL.fy, FULL.cx, FULL.cy], (self.count, 1))

    def time(self, index: int) -> float:
        return START + index / RATE


def picture(index: int) -> np.ndarray:
    """Return (H, W, 3) uint8 RGB: red grows to the right, green downward, blue from frame to frame."""
    image = np.zeros((FULL.height, FULL.width, 3), np.uint8)
    image[..., 0] = np.linspace(0, 240, FULL.width)
    image[..., 1] = np.linspace(0, 240, FULL.height)[:, None]
    image[..., 2] = 20 * index
    return image


def millimetres(depth: np.ndarray) -> bytes:
    """Return a PNG of uint16 millimetres."""
    return png(np.rint(depth * 1000).astype(np.uint16))


def write_video(path: Path, pictures: list[np.ndarray], *, turned: bool = True) -> None:
    """Write an MP4 whose track says, as that of a phone held upright, that players shall turn it."""
    height, width = pictures[0].shape[:2]
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"mp4v"), RATE, (width, height))
    for image in pictures:
        writer.write(np.ascontiguousarray(image[..., ::-1]))
    writer.release()
    data = bytearray(path.read_bytes())
    if turned:
        matrix = data.index(b"tkhd") + 4 + 40
        data[matrix : matrix + 36] = ROTATED
    path.write_bytes(bytes(data))


def stray_row(take: Take, index: int, *, intrinsics: bool) -> str:
    """Return a line of odometry.csv. The app turns ARKit's camera about x, so that the axes are OpenCV's."""
    pose = take.world_from_camera[index]
    numbers = [*pose[:3, 3], *Rotation.from_matrix(pose[:3, :3]).as_quat()]
    fields = [f"{take.time(index):.6f}", f"{index:06d}", *(f"{number:.9f}" for number in numbers)]
    if intrinsics:
        fields += [*(f"{number:.6f}" for number in take.intrinsics[index]), "", ""]
    return ", ".join(fields)


def write_stray_scanner(root: Path, take: Take, *, intrinsics: bool = True) -> Path:
    """Write a folder of Stray Scanner; older versions of the app have no intrinsics in odometry.csv."""
    for name in ("depth", "confidence"):
        (root / name).mkdir(parents=True)
    names = "timestamp, frame, x, y, z, qx, qy, qz, qw"
    names += ", fx, fy, cx, cy, distortion_center_x, distortion_center_y" if intrinsics else ""
    rows = [stray_row(take, index, intrinsics=intrinsics) for index in range(take.count)]
    (root / "odometry.csv").write_text("\n".join([names, *rows]) + "\n")
    (root / "camera_matrix.csv").write_text(f"{FULL.fx}, 0.0, {FULL.cx}\n0.0, {FULL.fy}, {FULL.cy}\n0.0, 0.0, 1.0")
    (root / "imu.csv").write_text("timestamp, a_x, a_y, a_z, alpha_x, alpha_y, alpha_z\n")
    for index in range(take.count):
        (root / "depth" / f"{index:06d}.png").write_bytes(millimetres(take.depths[index]))
        (root / "confidence" / f"{index:06d}.png").write_bytes(png(take.levels[index].astype(np.uint8)))
    write_video(root / "rgb.mp4", take.pictures)
    return root


def record3d_metadata(take: Take, **changes: object) -> str:
    """Return the JSON of a recording: K and poses as OpenGL has them, column by column and quaternion first."""
    poses = take.world_from_camera @ ARKIT_FROM_OPENCV
    document = {
        "w": FULL.width,
        "h": FULL.height,
        "dw": DEPTH.width,
        "dh": DEPTH.height,
        "fps": RATE,
        "K": [FULL.fx, 0, 0, 0, FULL.fy, 0, FULL.cx, FULL.cy, 1],
        "perFrameIntrinsicCoeffs": take.intrinsics.tolist(),
        "frameTimestamps": [take.time(index) for index in range(take.count)],
        "initPose": [0, 0, 0, 1, 0, 0, 0],
        "poses": [[*Rotation.from_matrix(pose[:3, :3]).as_quat(), *pose[:3, 3]] for pose in poses],
        "cameraType": 1,
    }
    return json.dumps({key: value for key, value in {**document, **changes}.items() if value is not None})


def write_record3d_pictures(root: Path, take: Take, **changes: object) -> Path:
    """Write the export as EXR and JPG without its depth."""
    (root / "rgb").mkdir(parents=True)
    (root / "metadata.json").write_text(record3d_metadata(take, **changes))
    for index in range(take.count):
        (root / "rgb" / f"{index}.jpg").write_bytes(jpeg(take.pictures[index]))
    return root


def write_record3d_export(root: Path, take: Take, **changes: object) -> Path:
    """Write the export as EXR and JPG."""
    library = pytest.importorskip("OpenEXR", reason="the extra `phone` is not installed")
    write_record3d_pictures(root, take, **changes)
    (root / "depth").mkdir()
    header = {"compression": library.ZIP_COMPRESSION, "type": library.scanlineimage}
    for index in range(take.count):
        with library.File(header, {"R": take.depths[index].astype(np.float32)}) as file:
            file.write(str(root / "depth" / f"{index}.exr"))
    return root


def write_r3d(path: Path, take: Take, **changes: object) -> Path:
    """Write an .r3d file."""
    library = pytest.importorskip("lzfse", reason="the extra `phone` is not installed")
    path.parent.mkdir(parents=True, exist_ok=True)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_STORED) as archive:
        archive.writestr("metadata", record3d_metadata(take, **changes))
        archive.writestr("icon", jpeg(take.pictures[0]))
        for index in range(take.count):
            archive.writestr(f"rgbd/{index}.jpg", jpeg(take.pictures[index]))
            archive.writestr(f"rgbd/{index}.depth", library.compress(take.depths[index].astype("<f4").tobytes()))
            archive.writestr(f"rgbd/{index}.conf", library.compress(take.levels[index].astype(np.uint8).tobytes()))
    return path


def unpack_r3d(path: Path, root: Path) -> Path:
    """Unpack an .r3d file into a folder."""
    with zipfile.ZipFile(io.BytesIO(path.read_bytes())) as archive:
        for name in archive.namelist():
            (root / name).parent.mkdir(parents=True, exist_ok=True)
            (root / name).write_bytes(archive.read(name))
    return root


def write_polycam(root: Path, take: Take, *, corrected: bool = True) -> Path:
    """Write a raw export; the app corrects cameras only of recordings that are not too long."""
    folders = {"images": "cameras", **({"corrected_images": "corrected_cameras"} if corrected else {})}
    for name in (*folders, *folders.values(), "depth", "confidence"):
        (root / "keyframes" / name).mkdir(parents=True)
    for index in range(take.count):
        name = f"{round(take.time(index) * 1e6)}"
        for images, cameras in folders.items():
            pose = take.world_from_camera[index] @ ARKIT_FROM_OPENCV
            if corrected and cameras == "cameras":
                pose = pose + np.array([[0, 0, 0, 0.05]] * 3 + [[0] * 4])  # drift
            camera = dict(zip(("fx", "fy", "cx", "cy"), take.intrinsics[index].tolist(), strict=True))
            camera |= {f"t_{row}{column}": pose[row, column] for row in range(3) for column in range(4)}
            camera |= {"width": FULL.width, "height": FULL.height, "blur_score": 120.5, "timestamp": int(name)}
            (root / "keyframes" / images / f"{name}.jpg").write_bytes(jpeg(take.pictures[index]))
            (root / "keyframes" / cameras / f"{name}.json").write_text(json.dumps(camera))
        levels = np.array([0, 127, 255], np.uint8)[take.levels[index]]
        (root / "keyframes" / "depth" / f"{name}.png").write_bytes(millimetres(take.depths[index]))
        (root / "keyframes" / "confidence" / f"{name}.png").write_bytes(png(levels))
    (root / "mesh_info.json").write_text("{}")
    return root


def write_scanner_app(root: Path, take: Take) -> Path:
    """Write `All Data` of the 3D Scanner App; every second frame has a picture."""
    root.mkdir(parents=True)
    for index in range(take.count):
        pose = take.world_from_camera[index] @ ARKIT_FROM_OPENCV
        fx, fy, cx, cy = take.intrinsics[index].tolist()
        document = {
            "cameraPoseARFrame": pose.reshape(-1).tolist(),
            "intrinsics": [fx, 0, cx, 0, fy, cy, 0, 0, 1],
            "time": take.time(index),
            "frame_index": index,
        }
        (root / f"frame_{index:05d}.json").write_text(json.dumps(document))
        (root / f"depth_{index:05d}.png").write_bytes(millimetres(take.depths[index]))
        (root / f"conf_{index:05d}.png").write_bytes(png(take.levels[index].astype(np.uint8)))
        if index % 2 == 0:
            (root / f"frame_{index:05d}.jpg").write_bytes(jpeg(take.pictures[index]))
    (root / "info.json").write_text("{}")
    return root


def write_arkit_scenes(root: Path, take: Take) -> Path:
    """Write a raw recording; names have milliseconds, poses are of camera_from_world."""
    for name in ("lowres_depth", "confidence", "wide", "wide_intrinsics"):
        (root / name).mkdir(parents=True)
    rows = []
    for index in range(take.count):
        stem = f"41069021_{take.time(index):.3f}"
        (root / "lowres_depth" / f"{stem}.png").write_bytes(millimetres(take.depths[index]))
        (root / "confidence" / f"{stem}.png").write_bytes(png(take.levels[index].astype(np.uint8)))
        (root / "wide" / f"{stem}.png").write_bytes(png(take.pictures[index]))
        numbers = " ".join(f"{number:.6f}" for number in take.intrinsics[index])
        (root / "wide_intrinsics" / f"{stem}.pincam").write_text(f"{FULL.width} {FULL.height} {numbers}")
        view = np.linalg.inv(take.world_from_camera[index])
        values = [take.time(index), *Rotation.from_matrix(view[:3, :3]).as_rotvec(), *view[:3, 3]]
        rows.append(" ".join(f"{value:.9f}" for value in values))
    (root / "lowres_wide.traj").write_text("\n".join(rows) + "\n")
    return root


def write_scannetpp(root: Path, take: Take) -> Path:
    """Write the folder `iphone` of a scene, whose depth was taken out of depth.bin."""
    (root / "iphone" / "depth").mkdir(parents=True)
    write_video(root / "iphone" / "rgb.mp4", take.pictures, turned=False)
    (root / "iphone" / "rgb.mp4").rename(root / "iphone" / "rgb.mkv")
    document = {}
    for index in range(take.count):
        fx, fy, cx, cy = take.intrinsics[index].tolist()
        document[f"frame_{index:06d}"] = {
            "pose": np.eye(4).tolist(),
            "aligned_pose": take.world_from_camera[index].tolist(),
            "intrinsic": [[fx, 0, cx], [0, fy, cy], [0, 0, 1]],
            "timestamp": take.time(index),
        }
        (root / "iphone" / "depth" / f"frame_{index:06d}.png").write_bytes(millimetres(take.depths[index]))
    (root / "iphone" / "pose_intrinsic_imu.json").write_text(json.dumps(document))
    return root


def write_nerfcapture(root: Path, take: Take, *, depth: bool = True) -> Path:
    """Write a NeRFCapture recording; the app names files of depth that only its streaming script writes."""
    (root / "images").mkdir(parents=True)
    frames = []
    for index in range(take.count):
        (root / "images" / f"{index}.png").write_bytes(png(take.pictures[index]))
        if depth:
            stored = np.rint(take.depths[index] / 10 * 65535).astype(np.uint16)
            (root / "images" / f"{index}.depth.png").write_bytes(png(stored))
        fx, fy, cx, cy = take.intrinsics[index].tolist()
        frames.append(
            {
                "file_path": f"images/{index}",
                "depth_path": f"images/{index}.depth.png",
                "transform_matrix": (take.world_from_camera[index] @ ARKIT_FROM_OPENCV).tolist(),
                "timestamp": take.time(index),
                "fl_x": fx,
                "fl_y": fy,
                "cx": cx,
                "cy": cy,
                "w": FULL.width,
                "h": FULL.height,
            }
        )
    (root / "transforms.json").write_text(json.dumps({"integer_depth_scale": 10 / 65535, "frames": frames}))
    return root
