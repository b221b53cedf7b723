"""How much of the level surface that was seen is in the map of `fuse`, and how much of the map is nowhere.

Cases: `board_<degrees>`, a board seen at an angle, exact (`_exact`) or with the noise of a structured-light camera; and
`room_<metres>`, generated rooms walked through at an eye height, with noise. Arms: `ours`; `before`, the same map drawn
by the size of steps alone; `open3d`, its voxel block grid with the same voxels, truncation and frames.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import open3d as o3d
from pydantic import Field
from scenewright.stages.fuse import FuseParameters, VoxelBlocks, extract_surface, integrate, smoothed_tsdf
from scenewright.stages.kit.stage import Parameters

from benchmarks.experiment import Bench, Experiment, Measure, Trial, mean, median, statistic
from benchmarks.experiments.surface.measuring import Surfaced, judge, seen_level_points
from benchmarks.experiments.surface.scenes import FARTHEST, Scene, board_at, camera_of, room_at

ANGLES, HEIGHTS = (5, 10, 15, 20, 30, 50, 90), (0.8, 1.2, 1.6)
RECIPES = ("room", "kitchen", "office", "bedroom")
BOARDS = tuple(f"board-{seed}" for seed in range(7100, 7105))
ROOMS = tuple(f"{recipe}-{seed}" for seed in (7100, 7101, 7102) for recipe in RECIPES)
TUNING_BOARDS, TUNING_ROOMS = ("board-0",), ("office-40", "kitchen-40", "room-40", "bedroom-41")
FUSE = FuseParameters.model_validate({})
NEAREST = FUSE.minimum_depth


class SurfaceParameters(Parameters):
    """Options of the experiment."""

    width: int = Field(640, ge=80, le=1920, description="Of the images [pixels]")
    frames: int = Field(48, ge=4, description="Of a room's path")


def seeds_of(bench: Bench, case: str) -> Sequence[str]:
    """Boards or rooms."""
    if case.startswith("board"):
        return TUNING_BOARDS if bench.tuning else BOARDS[: 1 if bench.quick else None]
    return TUNING_ROOMS if bench.tuning else ROOMS[: 1 if bench.quick else None]


def scene_of(bench: Bench, case: str, seed: str) -> Scene:
    """Record what a case asks for."""
    camera = camera_of(bench.parameters.width)
    number = int(seed.rsplit("-", 1)[1])
    kind, amount, *exact = case.split("_")
    if kind == "board":
        return board_at(float(amount), camera, np.random.default_rng([number, int(amount)]), not exact)
    random = np.random.default_rng([number, round(1000 * float(amount))])
    return room_at(Path(bench.out, "rooms"), seed, float(amount), camera, random, True, bench.parameters.frames)


def measure(bench: Bench, trials: Sequence[Trial]) -> Iterator[tuple[Trial, Surfaced]]:
    """Yield what every arm makes of one scene."""
    scene = scene_of(bench, trials[0].case, trials[0].seed)
    points = seen_level_points(scene)
    arms = {trial.arm: trial for trial in trials}
    if "ours" in arms or "before" in arms:
        blocks, seconds = mapped(scene)
        for arm in ("ours", "before"):
            if arm == "before":  # points everywhere, one a cell: only the size of a step decides
                blocks.hits[:] = 1
            if arm in arms:
                tsdf = smoothed_tsdf(blocks, FUSE.smoothing)
                started = time.process_time()
                drawn = extract_surface(blocks, minimum_weight=FUSE.minimum_weight, tsdf=tsdf)
                spent = time.process_time() - started
                yield arms[arm], judge(scene, points, drawn.vertices, drawn.faces, seconds, spent)
    if "open3d" in arms:
        yield arms["open3d"], of_open3d(scene, points)


def mapped(scene: Scene) -> tuple[VoxelBlocks, float]:
    """Return the map of a scene and the processor seconds a frame."""
    size = FUSE.voxel_size
    truncation = FUSE.truncation_voxels * size
    integrate(
        VoxelBlocks(size),
        scene.frames[0].depth,
        scene.camera,
        scene.frames[0].world_from_camera,
        truncation=truncation,
        near=NEAREST,
        far=FARTHEST,
    )  # compiled before the clock runs
    blocks, started = VoxelBlocks(size), time.process_time()
    for frame in scene.frames:
        integrate(
            blocks,
            frame.depth,
            scene.camera,
            frame.world_from_camera,
            truncation=truncation,
            near=NEAREST,
            far=FARTHEST,
        )
    return blocks, (time.process_time() - started) / len(scene.frames)


def of_open3d(scene: Scene, points: np.ndarray) -> Surfaced:
    """Return what Open3D's voxel block grid (Dong et al. 2022) makes of a scene."""
    one = o3d.core.SizeVector([1])
    kinds = (o3d.core.float32, o3d.core.float32)
    grid = o3d.t.geometry.VoxelBlockGrid(("tsdf", "weight"), kinds, (one, one), FUSE.voxel_size, 8, 20000)
    camera = scene.camera
    matrix = o3d.core.Tensor.from_numpy(np.array([[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1.0]]))
    started = time.process_time()
    for frame in scene.frames:
        image = o3d.t.geometry.Image(np.ascontiguousarray(frame.depth))
        pose = o3d.core.Tensor.from_numpy(np.linalg.inv(frame.world_from_camera))
        touched = grid.compute_unique_block_coordinates(
            image, matrix, pose, 1.0, FARTHEST, trunc_voxel_multiplier=FUSE.truncation_voxels
        )
        grid.integrate(touched, image, matrix, pose, 1.0, FARTHEST, trunc_voxel_multiplier=FUSE.truncation_voxels)
    seconds = (time.process_time() - started) / len(scene.frames)
    started = time.process_time()
    mesh = grid.extract_triangle_mesh(weight_threshold=1.0)
    vertices, faces = mesh.vertex.positions.numpy(), mesh.triangle.indices.numpy()
    return judge(scene, points, vertices, faces, seconds, time.process_time() - started)


def times(factor: float, name: str, unit: str) -> Measure:
    """Return the mean over scenes, in a unit that reads well."""
    figure = statistic(name, np.mean)
    return Measure(lambda records: None if (value := figure(records)) is None else factor * value, unit)


EXPERIMENT = Experiment(
    name="surface",
    title="Seen surface that is in the map",
    simulated="Boards and generated rooms; a structured-light camera's noise, quantisation and dropouts; exact poses.",
    knows="Exact poses and intrinsics.",
    does_not_show="Errors of poses and of registration; cameras other than a structured-light one.",
    arms={"ours": "ours", "before": "by the size of steps alone", "open3d": "Open3D"},
    cases=(
        *(f"board_{angle}{ending}" for ending in ("", "_exact") for angle in ANGLES),
        *(f"room_{height}" for height in HEIGHTS),
    ),
    seeds_of=seeds_of,
    together=lambda trial: (trial.case, trial.seed),
    measure=measure,
    record=Surfaced,
    measures={
        "level_mapped": times(100, "level_mapped", "%"),
        "off_truth": times(100, "off_truth", "%"),
        "error": times(1000, "error", "mm"),
        "vertices": mean("vertices", interval=False),
        "frame_ms": median("frame_ms", "ms", interval=False),
        "draw_ms": median("draw_ms", "ms", interval=False),
    },
    parameters=SurfaceParameters,
    quick={"frames": 24},
    steps=("synthesize", "library build"),
)
