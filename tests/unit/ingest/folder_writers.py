"""Writers of the tiny room in every folder layout that ingest reads."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.kit.geometry.transforms import inverse, quaternion_of

from tests.unit.ingest.tiny_room import CAMERA, frames, jpeg, millimetres, png

OPENGL_FROM_OPENCV = np.diag([1.0, -1.0, -1.0, 1.0])
FIRST_STAMP = 1305031102.175304
"""Seconds since 1970, with the digits that the TUM data set prints."""


def tum_line(time: str, pose: np.ndarray) -> str:
    """Return `t tx ty tz qx qy qz qw`."""
    numbers = [*pose[:3, 3], *quaternion_of(pose)]
    return " ".join([time, *(f"{float(value):.9f}" for value in numbers)])


def stamp_text(index: int, shift: float = 0.0) -> str:
    """Return the stamp of frame `index` at 30 Hz, `shift` seconds late."""
    return f"{FIRST_STAMP + index / 30 + shift:.6f}"


def write_tum(root: Path, recorded: list, *, depth_shift: float = 0.004, groundtruth: bool = True) -> Path:
    """Write a TUM RGB-D folder: depth is `depth_shift` seconds late, poses are those of the depth images."""
    (root / "rgb").mkdir(parents=True)
    (root / "depth").mkdir()
    lists: dict[str, list[str]] = {name: ["# a comment"] for name in ("rgb.txt", "depth.txt", "groundtruth.txt")}
    for index, (color, depth, pose) in enumerate(recorded):
        color_time, depth_time = stamp_text(index), stamp_text(index, depth_shift)
        (root / "rgb" / f"{color_time}.png").write_bytes(png(color))
        (root / "depth" / f"{depth_time}.png").write_bytes(png(np.rint(depth * 5000).astype(np.uint16)))
        lists["rgb.txt"].append(f"{color_time} rgb/{color_time}.png")
        lists["depth.txt"].append(f"{depth_time} depth/{depth_time}.png")
        lists["groundtruth.txt"].append(tum_line(depth_time, pose))
    if not groundtruth:
        del lists["groundtruth.txt"]
    for name, lines in lists.items():
        (root / name).write_text("\n".join(lines) + "\n")
    k = CAMERA
    (root / "calibration.txt").write_text(f"{k.fx} {k.fy} {k.cx} {k.cy}\n")
    return root


def write_numbered_tum(root: Path, stamps: list[float], *, pairs: bool, units: float = 5000.0) -> Path:
    """Write a TUM folder without poses whose pictures are numbered and have these stamps."""
    lists: dict[str, list[str]] = {"rgb": [], "depth": []}
    for name in lists:
        (root / name).mkdir(parents=True)
    for index, (color, depth, _) in enumerate(frames(len(stamps))):
        for name, image in (("rgb", color), ("depth", np.rint(depth * units).astype(np.uint16))):
            (root / name / f"{name}{index:05d}.png").write_bytes(png(image))
            lists[name].append(f"{stamps[index]:.9f} {name}/{name}{index:05d}.png")
    if pairs:
        lists = {"associations": [" ".join(row) for row in zip(lists["rgb"], lists["depth"], strict=True)]}
    for name, rows in lists.items():
        (root / f"{name}.txt").write_text("\n".join(rows) + "\n")
    (root / "calibration.txt").write_text(f"{CAMERA.fx} {CAMERA.fy} {CAMERA.cx} {CAMERA.cy}\n")
    return root


def write_scenenn(root: Path, recorded: list, *, plain: bool = False) -> Path:
    """Write a SceneNN folder; `plain` is the variant rgb/00001.png, else image/image00001.png."""
    color_folder, prefixes = ("rgb", ("", "")) if plain else ("image", ("image", "depth"))
    (root / color_folder).mkdir(parents=True)
    (root / "depth").mkdir()
    times, poses = [], []
    for index, (color, depth, pose) in enumerate(recorded):
        (root / color_folder / f"{prefixes[0]}{index + 1:05d}.png").write_bytes(png(color))
        (root / "depth" / f"{prefixes[1]}{index + 1:05d}.png").write_bytes(png(millimetres(depth)))
        times.append(f"{index + 1} {round(index * 1e6 / 30)}")
        poses.append(f"{index} {index} {index + 1}")
        poses += [" ".join(repr(float(value)) for value in row) for row in pose]
    (root / "timestamp.txt").write_text("\n".join(times) + "\n")
    (root / "trajectory.log").write_text("\n".join(poses) + "\n")
    (root / "231.xml").write_text("<annotation/>")
    k = CAMERA
    size = f"depth_width {k.width}\ndepth_height {k.height}\n"
    (root / "asus.ini").write_text(f"{size}fx {k.fx}\nfy {k.fy}\ncx {k.cx}\ncy {k.cy}\n")
    return root


def write_scannet(root: Path, recorded: list, color_camera: Camera = CAMERA) -> Path:
    """Write a ScanNet export; colour must be of `color_camera`."""
    for name in ("color", "depth", "pose", "intrinsic"):
        (root / name).mkdir(parents=True)
    for index, (color, depth, pose) in enumerate(recorded):
        (root / "color" / f"{index}.jpg").write_bytes(jpeg(color))
        (root / "depth" / f"{index}.png").write_bytes(png(millimetres(depth)))
        np.savetxt(root / "pose" / f"{index}.txt", pose)
    for name, k in (("color", color_camera), ("depth", CAMERA)):
        matrix = np.eye(4)
        matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2] = k.fx, k.fy, k.cx, k.cy
        np.savetxt(root / "intrinsic" / f"intrinsic_{name}.txt", matrix)
        np.savetxt(root / "intrinsic" / f"extrinsic_{name}.txt", np.eye(4))
    return root


def write_nerfstudio(root: Path, recorded: list, *, depth: bool = True, **fields: object) -> Path:
    """Write images/, depth/ and transforms.json; `fields` are added to the document (None: taken out)."""
    (root / "images").mkdir(parents=True)
    frames = []
    for index, (color, depth_image, pose) in enumerate(recorded):
        frame = {"file_path": f"images/frame_{index + 1}.png", "transform_matrix": (pose @ OPENGL_FROM_OPENCV).tolist()}
        (root / frame["file_path"]).write_bytes(png(color))
        if depth:
            (root / "depth").mkdir(exist_ok=True)
            frame["depth_file_path"] = f"depth/frame_{index + 1}.png"
            (root / frame["depth_file_path"]).write_bytes(png(millimetres(depth_image)))
        frames.append(frame)
    k = CAMERA
    document = {
        "camera_model": "OPENCV",
        "fl_x": k.fx,
        "fl_y": k.fy,
        "cx": k.cx + 0.5,
        "cy": k.cy + 0.5,
        "w": k.width,
        "h": k.height,
        "k1": 0.0,
        "k2": 0.0,
        "p1": 0.0,
        "p2": 0.0,
        "frames": frames[::-1],
    } | fields
    document = {key: value for key, value in document.items() if value is not None}
    (root / "transforms.json").write_text(json.dumps(document))
    return root


def write_replica(root: Path, recorded: list) -> Path:
    """Write traj.txt, results/ and cam_params.json, in the folder above as the rendering does."""
    (root / "results").mkdir(parents=True)
    rows = []
    for index, (color, depth, pose) in enumerate(recorded):
        (root / "results" / f"frame{index:06d}.jpg").write_bytes(jpeg(color))
        (root / "results" / f"depth{index:06d}.png").write_bytes(png(np.rint(depth * 6553.5).astype(np.uint16)))
        rows.append(" ".join(repr(float(value)) for value in pose.reshape(-1)))
    (root / "traj.txt").write_text("\n".join(rows) + "\n")
    k = CAMERA
    camera = {"w": k.width, "h": k.height, "fx": k.fx, "fy": k.fy, "cx": k.cx, "cy": k.cy, "scale": 6553.5}
    (root.parent / "cam_params.json").write_text(json.dumps({"camera": camera}))
    return root


def write_colmap(root: Path, recorded: list, *, binary: bool = True, depth: bool = True) -> Path:
    """Write images/, depth/ and sparse/0 with COLMAP's own library."""
    import pycolmap

    (root / "images").mkdir(parents=True)
    (root / "sparse" / "0").mkdir(parents=True)
    k = CAMERA
    model = pycolmap.Reconstruction()
    parameters = [k.fx, k.fy, k.cx + 0.5, k.cy + 0.5]
    camera = pycolmap.Camera(model="PINHOLE", width=k.width, height=k.height, params=parameters, camera_id=1)
    model.add_camera_with_trivial_rig(camera)
    for index, (color, depth_image, pose) in enumerate(recorded):
        name = f"frame_{index + 1}.png"
        (root / "images" / name).write_bytes(png(color))
        if depth:
            (root / "depth").mkdir(exist_ok=True)
            (root / "depth" / name).write_bytes(png(millimetres(depth_image)))
        image = pycolmap.Image(name=name, camera_id=1, image_id=len(recorded) - index)
        model.add_image_with_trivial_frame(image, pycolmap.Rigid3d(inverse(pose)[:3]))
    (model.write_binary if binary else model.write_text)(str(root / "sparse" / "0"))
    return root


def write_image_folder(root: Path, recorded: list, *, poses: bool = True) -> Path:
    """Write rgb/, depth/, intrinsics.txt and KITTI rows in poses.txt."""
    (root / "rgb").mkdir(parents=True)
    (root / "depth").mkdir()
    rows = []
    for index, (color, depth, pose) in enumerate(recorded):
        (root / "rgb" / f"rgb_{index}.png").write_bytes(png(color))
        (root / "depth" / f"depth_{index}.png").write_bytes(png(millimetres(depth)))
        rows.append(" ".join(repr(float(value)) for value in pose[:3].reshape(-1)))
    if poses:
        (root / "poses.txt").write_text("\n".join(rows) + "\n")
    k = CAMERA
    (root / "intrinsics.txt").write_text(f"{k.fx} 0 {k.cx}\n0 {k.fy} {k.cy}\n0 0 1\n")
    return root


def distorted(image: np.ndarray, camera: Camera, coefficients: list[float], *, fisheye: bool = False) -> np.ndarray:
    """Return the image (H, W[, 3]) of a pinhole camera as a lens with OpenCV `coefficients` would have taken it."""
    matrix = np.array([[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1]])
    v, u = np.mgrid[: camera.height, : camera.width].astype(np.float64)
    pixels = np.stack([u, v], axis=-1).reshape(-1, 1, 2)
    undo = cv2.fisheye.undistortPoints if fisheye else cv2.undistortPoints
    rays = undo(pixels, matrix, np.array(coefficients, dtype=float)).reshape(camera.height, camera.width, 2)
    across = (rays[..., 0] * camera.fx + camera.cx).astype(np.float32)
    down = (rays[..., 1] * camera.fy + camera.cy).astype(np.float32)
    return cv2.remap(image, across, down, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
