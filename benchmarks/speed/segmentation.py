"""Speed of per-frame segmentation beside named peers: medians over one run, on a generated room at 640x480.

    python -m benchmarks.speed.segmentation --out FOLDER [--quick] [--weights detector.onnx]

Peers do a comparable part each: OpenCV's RgbdNormals and Open3D's estimate_normals for the normals, OpenCV's
findPlanes as another way to cut a depth image up, and the same convexity algorithm written with numpy alone. Our own
network, and a whole frame by it (geometry, masks, both fused), stand beside them; its pictures are noise, which takes
as long.
"""

from __future__ import annotations

import os
import platform
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numba
import numpy as np
import trimesh
from pydantic import Field
from scenewright.schemas.scene_parts import Camera
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.kit.geometry.cameras import back_project, intrinsic_matrix
from scenewright.stages.kit.geometry.transforms import look_at
from scenewright.stages.kit.rendering.ray_casting import SceneRenderer
from scenewright.stages.segment.fusion import FusionSettings
from scenewright.stages.segment.fusion_ours import fuse
from scenewright.stages.segment.geometric import (
    GeometricSettings,
    depth_discontinuity,
    edge_map,
    label_regions,
    minimum_convexity,
    segment_depth,
    smooth_depth,
)
from scenewright.stages.segment.normals import surface_normals
from scenewright.stages.segment.panoptic import PanopticFrame, PanopticMask

from benchmarks.options import Measurement, asked
from benchmarks.results import write_measured

CAMERA = Camera(width=640, height=480, fx=560.0, fy=560.0, cx=319.5, cy=239.5)
VIEWS = 6
FLOOR_FRAMES_PER_SECOND = 5.0
"""What the geometric segmentation must reach on two cores."""


def rendered_frames() -> list[tuple[np.ndarray, np.ndarray]]:
    """Return (depth with sensor noise, true instances) of a room with furniture made of boxes and cylinders."""
    random = np.random.default_rng(0)
    meshes = []
    room = trimesh.creation.box(extents=(5, 5, 2.6), transform=trimesh.transformations.translation_matrix([0, 0, 1.3]))
    room.invert()
    meshes.append((1, room))
    for k in range(14):
        size = random.uniform([0.3, 0.3, 0.3], [1.2, 0.8, 1.2])
        place = np.array([*random.uniform(-2, 2, 2), size[2] / 2])
        box = trimesh.creation.box(extents=size)
        box.apply_transform(trimesh.transformations.rotation_matrix(random.uniform(0, 3), [0, 0, 1]))
        box.apply_translation(place)
        cup = trimesh.creation.cylinder(radius=0.05, height=0.12)
        cup.apply_translation(place + [0.05, 0.05, size[2] / 2 + 0.06])
        meshes += [(2 + 2 * k, box), (3 + 2 * k, cup)]
    renderer = SceneRenderer(meshes)
    frames = []
    for k in range(VIEWS):
        angle = 2 * np.pi * k / VIEWS
        eye = np.array([1.9 * np.cos(angle), 1.9 * np.sin(angle), 1.5])
        seen = renderer.render(CAMERA, look_at(eye, np.array([-0.5 * np.cos(angle), -0.5 * np.sin(angle), 0.4])))
        noise = (0.0012 + 0.0019 * (seen.depth - 0.4) ** 2) * random.standard_normal(seen.depth.shape)
        depth = np.where(seen.depth > 0, np.round((seen.depth + noise) * 1000) / 1000, 0).astype(np.float32)
        frames.append((depth, seen.instance))
    return frames


def numpy_normals(points: np.ndarray, window: int, step: int, distance_factor: float) -> np.ndarray:
    """The normals of stages/segment/normals.py with numpy alone: one shifted image per neighbour."""
    height, width = points.shape[:2]
    half = window // 2 // step * step
    padded = np.pad(points, ((half, half), (half, half), (0, 0)))
    count = np.zeros((height, width, 1))
    first, second = np.zeros((height, width, 3)), np.zeros((height, width, 3, 3))
    reach = (distance_factor * points[..., 2]) ** 2
    for dv in range(0, 2 * half + 1, step):
        for du in range(0, 2 * half + 1, step):
            neighbour = padded[dv : dv + height, du : du + width]
            offset = (neighbour - points).astype(np.float64)
            near = (neighbour[..., 2] > 0) & ((offset**2).sum(axis=-1) <= reach)
            offset *= near[..., None]
            count += near[..., None]
            first += offset
            second += offset[..., :, None] * offset[..., None, :]
    mean = first / np.maximum(count, 1)
    covariance = second / np.maximum(count, 1)[..., None] - mean[..., :, None] * mean[..., None, :]
    normals = np.linalg.eigh(covariance)[1][..., 0]
    normals *= np.where((normals * points).sum(axis=-1, keepdims=True) > 0, -1, 1)
    return np.where((count >= 4) & (points[..., 2:] > 0), normals, 0).astype(np.float32)


def numpy_convexity(points: np.ndarray, normals: np.ndarray, window: int, mask_threshold: float) -> np.ndarray:
    """The mutual minimum convexity of stages/segment/geometric.py with numpy alone."""
    height, width = points.shape[:2]
    half = window // 2
    points_around = np.pad(points, ((half, half), (half, half), (0, 0)))
    normals_around = np.pad(normals, ((half, half), (half, half), (0, 0)))
    result = np.ones((height, width), dtype=np.float32)
    for dv in range(2 * half + 1):
        for du in range(2 * half + 1):
            neighbour = points_around[dv : dv + height, du : du + width]
            its_normal = normals_around[dv : dv + height, du : du + width]
            over = ((neighbour - points) * (normals - its_normal)).sum(axis=-1)
            concave = (-over <= mask_threshold) & (neighbour[..., 2] > 0)
            result = np.minimum(result, np.where(concave, (normals * its_normal).sum(axis=-1), 1))
    return np.where(points[..., 2] > 0, result, 1)


def numpy_segmentation(depth: np.ndarray, settings: GeometricSettings) -> np.ndarray:
    """Smoothing by OpenCV as ours, normals and convexity with numpy, labels by OpenCV; edge pixels stay unlabelled."""
    depth = smooth_depth(depth, window=settings.smoothing_window, deviation=settings.smoothing_deviation)
    points = back_project(depth, CAMERA)
    normals = numpy_normals(points, settings.normal_window, settings.normal_step, settings.normal_distance_factor)
    convexity = numpy_convexity(points, normals, settings.convexity_window, settings.convexity_mask_threshold)
    convex = (convexity > settings.convexity_threshold) & ~depth_discontinuity(depth) & (depth > 0)
    return cv2.connectedComponents(convex.astype(np.uint8), connectivity=4)[1]


def open3d_normals(depth: np.ndarray) -> np.ndarray:
    """Normals of the valid points by Open3D's hybrid neighbourhood search (30 neighbours within 5 cm)."""
    import open3d

    cloud = open3d.geometry.PointCloud()
    points = back_project(depth, CAMERA)[depth > 0]
    cloud.points = open3d.utility.Vector3dVector(points.astype(np.float64))
    cloud.estimate_normals(open3d.geometry.KDTreeSearchParamHybrid(radius=0.05, max_nn=30))
    return np.asarray(cloud.normals)


@dataclass(frozen=True)
class Timing:
    """Medians per frame [s]: time on the wall, and processor time of all threads (less moved by other load)."""

    wall: float
    processor: float


def median_seconds(work: Callable[[int], object], repeats: int) -> Timing:
    """Return the median times of `work(k)` over `repeats` calls after one that warms up."""
    work(0)
    wall, processor = [], []
    for k in range(repeats):
        started, started_processor = time.perf_counter(), time.process_time()
        work(k)
        wall.append(time.perf_counter() - started)
        processor.append(time.process_time() - started_processor)
    return Timing(float(np.median(wall)), float(np.median(processor)))


def measure(repeats: int, weights: Path | None) -> dict[str, Timing]:
    """Return the time per frame of every part and peer (method/part -> medians)."""
    frames = rendered_frames()
    settings = GeometricSettings()
    depths = [depth for depth, _ in frames]
    smooth = [smooth_depth(depth) for depth in depths]
    points = [back_project(depth, CAMERA) for depth in smooth]
    window, step = settings.normal_window, settings.normal_step
    normals = [surface_normals(cloud, window=window, step=step) for cloud in points]
    edges = [edge_map(d, p, n, settings) for d, p, n in zip(smooth, points, normals, strict=True)]
    segmented = [segment_depth(depth, CAMERA) for depth in depths]
    panoptic = []
    for _, instance in frames:
        numbers = np.unique(instance[instance > 0]).tolist()
        panoptic.append(PanopticFrame(instance.astype(np.int32), {n: PanopticMask(4, n > 1) for n in numbers}))
    opencv = {
        name: cv2.RgbdNormals_create(  # type: ignore[attr-defined]
            480, 640, cv2.CV_32F, intrinsic_matrix(CAMERA), 5, 50, method
        )
        for name, method in (
            ("FALS", cv2.RGBD_NORMALS_RGBD_NORMALS_METHOD_FALS),
            ("SRI", cv2.RGBD_NORMALS_RGBD_NORMALS_METHOD_SRI),
        )
    }

    def pick(items: list[Any], k: int) -> Any:
        return items[k % VIEWS]

    # OpenCV wants four channels, and NaN where there is no depth.
    homogeneous = [np.dstack([np.where(p == 0, np.float32(np.nan), p), np.ones_like(p[..., :1])]) for p in points]

    def planes(k: int) -> object:
        cloud = pick(homogeneous, k)
        return cv2.findPlanes(cloud, opencv["FALS"].apply(cloud))

    slow = max(2, repeats // 5)
    seconds = {
        "ours/whole": median_seconds(lambda k: segment_depth(pick(depths, k), CAMERA), repeats),
        "ours/smoothing": median_seconds(lambda k: smooth_depth(pick(depths, k)), repeats),
        "ours/normals": median_seconds(lambda k: surface_normals(pick(points, k), window=window, step=step), repeats),
        "ours/convexity": median_seconds(lambda k: minimum_convexity(pick(points, k), pick(normals, k)), repeats),
        "ours/labels": median_seconds(
            lambda k: label_regions(pick(edges, k), pick(points, k), pick(normals, k), minimum_pixels=200, ratio=0.01),
            repeats,
        ),
        "ours/fusion": median_seconds(
            lambda k: fuse(pick(segmented, k).labels, pick(panoptic, k), pick(segmented, k).points, FusionSettings()),
            repeats,
        ),
        "numpy/whole": median_seconds(lambda k: numpy_segmentation(pick(depths, k), settings), slow),
        "numpy/normals": median_seconds(lambda k: numpy_normals(pick(points, k), window, step, 0.05), slow),
        "opencv-fals/normals": median_seconds(lambda k: opencv["FALS"].apply(pick(homogeneous, k)), repeats),
        "opencv-sri/normals": median_seconds(lambda k: opencv["SRI"].apply(pick(homogeneous, k)), repeats),
        "opencv-findPlanes/whole": median_seconds(planes, repeats),
        "open3d/normals": median_seconds(lambda k: open3d_normals(pick(smooth, k)), slow),
    }
    from scenewright.stages.segment.backends.network.backend import load_predictor
    from scenewright.stages.segment.backends.network.features import mount_of_pose
    from scenewright.stages.segment.backends.network.weights import BUNDLED

    predictor = load_predictor(BUNDLED, load_vocabulary())
    nowhere = mount_of_pose(None, gravity_known=False, floor_is_zero=False)
    picture = np.random.default_rng(1).integers(0, 255, (480, 640, 3), dtype=np.uint8)

    def by_network(k: int) -> object:
        found, geometric = (
            predictor.predict(pick(depths, k), picture, CAMERA, nowhere),
            segment_depth(pick(depths, k), CAMERA),
        )
        return fuse(geometric.labels, found, geometric.points, FusionSettings())

    seconds["ours/network"] = median_seconds(
        lambda k: predictor.predict(pick(depths, k), picture, CAMERA, nowhere), slow
    )
    seconds["ours/frame-by-network"] = median_seconds(by_network, slow)
    if weights is not None:
        from scenewright.stages.segment.backends.detector.yolox import Detector

        for name, side in (("detector-whole-image", 0), ("detector-tiles", 480)):
            detector = Detector(weights, score_threshold=0.3, suppression_overlap=0.5, tile_side=side)
            seconds[f"ours/{name}"] = median_seconds(partial(_detect, detector, picture), slow)
    return seconds


def _detect(detector: Any, color: np.ndarray, k: int) -> object:
    return detector.detect(color)


def table(seconds: dict[str, Timing], repeats: int) -> str:
    """Return the table as Markdown: every part, its time, and its ratio to ours."""
    lines = ["| part | method | ms per frame | processor ms | frames/s | time / ours |", "|---|---|---|---|---|---|"]
    for name, value in sorted(seconds.items(), key=lambda item: (item[0].split("/")[1], item[1].wall)):
        method, part = name.split("/")
        ratio = value.wall / seconds[f"ours/{part}"].wall
        lines.append(
            f"| {part} | {method} | {value.wall * 1000:.1f} | {value.processor * 1000:.1f} | {1 / value.wall:.1f} "
            f"| {ratio:.2f} |"
        )
    verdict = 1 / seconds["ours/whole"].wall
    lines += [
        "",
        f"Geometric segmentation: {verdict:.1f} frames/s at 640x480 (floor {FLOOR_FRAMES_PER_SECOND:g}), median of "
        f"{repeats} frames, {VIEWS} views of a generated room with sensor noise; {os.cpu_count()} cores, "
        f"{platform.machine()}, load average {os.getloadavg()[0]:.1f} at the end. numpy's and findPlanes' results are "
        "not the same segments: numpy leaves edge pixels unlabelled, findPlanes finds planes alone.",
    ]
    return "\n".join(lines) + "\n"


class Options(Measurement):
    """Options."""

    weights: Path | None = Field(None, description="ONNX detector to time as well")


def main() -> None:
    """Measure, print the table, write metrics.json and table.md."""
    numba.config.THREADING_LAYER = "omp"  # type: ignore[attr-defined] # the default probes TBB first and warns about its version
    arguments = asked(Options)
    repeats = 6 if arguments.quick else 30
    seconds = measure(repeats, arguments.weights)
    text = table(seconds, repeats)
    metrics = {f"{name}/seconds_per_frame": value.wall for name, value in seconds.items()}
    metrics |= {f"{name}/processor_seconds_per_frame": value.processor for name, value in seconds.items()}
    write_measured(arguments.out, metrics, text)


if __name__ == "__main__":
    main()
