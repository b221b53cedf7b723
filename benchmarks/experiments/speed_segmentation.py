"""Speed of per-frame segmentation beside named peers: medians over frames of a corridor at 640x480.

Peers do a comparable part each: OpenCV's RgbdNormals and Open3D's estimate_normals for the normals, OpenCV's
findPlanes as another way to cut a depth image up, and the same convexity algorithm written with numpy alone. Our own
network, and a whole frame by it (geometry, masks, both fused), stand beside them; its pictures are noise, which takes
as long.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import cv2
import numpy as np
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.kit.geometry.cameras import back_project, intrinsic_matrix
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
from scenewright.stages.segment.panoptic import PanopticFrame

from benchmarks.corridor import CAMERA, make_frames
from benchmarks.experiment import Bench, Experiment, Results, Trial, median
from benchmarks.timing import Clock

VIEWS = 6
OURS, NETWORK, BY_NETWORK = "ours", "our network", "a frame by our network"
ON_GRID = "whole, on its grid"
PARTS = ("whole", ON_GRID, "smoothing", "normals", "convexity", "labels", "fusion", NETWORK, BY_NETWORK)
PEERS = (
    ("numpy", "whole"),
    ("numpy", "normals"),
    ("opencv-fals", "normals"),
    ("opencv-sri", "normals"),
    ("opencv-findPlanes", "whole"),
    ("open3d", "normals"),
)
Work = Callable[[int], object]
"""What is timed, on the frame of a number."""


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


def works() -> dict[tuple[str, str], Work]:
    """Return what is timed of every method and part."""
    frames = make_frames(VIEWS)
    settings = GeometricSettings(grid_columns=0)
    depths = [frame.depth for frame in frames]
    smooth = [smooth_depth(depth) for depth in depths]
    points = [back_project(depth, CAMERA) for depth in smooth]
    window, step = settings.normal_window, settings.normal_step
    normals = [surface_normals(cloud, window=window, step=step) for cloud in points]
    jumps = [depth_discontinuity(depth) for depth in smooth]
    edges = [edge_map(d, p, n, j, settings) for d, p, n, j in zip(smooth, points, normals, jumps, strict=True)]
    segmented = [segment_depth(depth, CAMERA) for depth in depths]
    panoptic = [frame.masks for frame in frames]
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

    from scenewright.stages.segment.backends.network.backend import load_predictor
    from scenewright.stages.segment.backends.network.features import mount_of_pose
    from scenewright.stages.segment.backends.network.weights import BUNDLED

    predictor = load_predictor(BUNDLED, load_vocabulary())
    nowhere = mount_of_pose(None, gravity_known=False, floor_is_zero=False)
    picture = np.random.default_rng(1).integers(0, 255, (480, 640, 3), dtype=np.uint8)

    def network(k: int) -> PanopticFrame:
        return predictor.predict(pick(depths, k), picture, CAMERA, nowhere)

    def by_network(k: int) -> object:
        found, geometric = network(k), segment_depth(pick(depths, k), CAMERA)
        return fuse(geometric.labels, found, geometric.points, FusionSettings())

    def fused(k: int) -> object:
        return fuse(pick(segmented, k).labels, pick(panoptic, k), pick(segmented, k).points, FusionSettings())

    def labelled(k: int) -> object:
        return label_regions(pick(edges, k), pick(points, k), pick(normals, k), minimum_pixels=200, ratio=0.01)

    return {
        (OURS, "whole"): lambda k: segment_depth(pick(depths, k), CAMERA, settings),  # as the others: every pixel
        (OURS, ON_GRID): lambda k: segment_depth(pick(depths, k), CAMERA),
        (OURS, "smoothing"): lambda k: smooth_depth(pick(depths, k)),
        (OURS, "normals"): lambda k: surface_normals(pick(points, k), window=window, step=step),
        (OURS, "convexity"): lambda k: minimum_convexity(pick(points, k), pick(normals, k)),
        (OURS, "labels"): labelled,
        (OURS, "fusion"): fused,
        (OURS, NETWORK): network,
        (OURS, BY_NETWORK): by_network,
        ("numpy", "whole"): lambda k: numpy_segmentation(pick(depths, k), settings),
        ("numpy", "normals"): lambda k: numpy_normals(pick(points, k), window, step, 0.05),
        ("opencv-fals", "normals"): lambda k: opencv["FALS"].apply(pick(homogeneous, k)),
        ("opencv-sri", "normals"): lambda k: opencv["SRI"].apply(pick(homogeneous, k)),
        ("opencv-findPlanes", "whole"): planes,
        ("open3d", "normals"): lambda k: open3d_normals(pick(smooth, k)),
    }


def measure(bench: Bench, trials: Sequence[Trial]) -> Iterable[tuple[Trial, dict[str, float]]]:
    """Yield what each frame took, after one that warms up."""
    timed, warm = works(), set()
    for trial in trials:
        work, clock = timed[trial.arm, trial.case], Clock()
        if work not in warm:
            work(0)
            warm.add(work)
        with clock.lap():
            work(int(trial.seed))
        yield trial, {"time": 1000 * clock.wall[0], "processor time": 1000 * clock.processor[0]}


def beside_ours(results: Results) -> Mapping[str, float | None]:
    """Return frames a second, and the time over ours, by the wall."""
    figures: dict[str, float | None] = {}
    for case in results.cases:
        ours = results.value(OURS, case, "time")
        for arm in results.arms(case):
            if (time := results.value(arm, case, "time")) is not None:
                figures[f"{arm}/{case}/frames per s"] = 1000 / time
                figures[f"{arm}/{case}/over ours"] = time / ours if ours else None
    return figures


EXPERIMENT = Experiment(
    name="speed_segmentation",
    title="Segmentation beside its peers",
    simulated="Six views of a corridor with noise.",
    knows="Depth alone; our network depth and a picture of noise.",
    does_not_show="Quality: numpy's and findPlanes' results are not the same segments (numpy leaves edge pixels "
    "unlabelled, findPlanes finds planes alone).",
    arms={name: name for name in (OURS, *dict.fromkeys(arm for arm, _ in PEERS))},
    cases=PARTS,
    reporting=tuple(map(str, range(1, 31))),
    quick_seeds=6,
    runs=lambda arm, case: arm == OURS or (arm, case) in PEERS,
    together=lambda trial: "",
    measure=measure,
    record=dict[str, float],
    measures={name: median(name, "ms", interval=False) for name in ("time", "processor time")},
    more_figures=beside_ours,
)
