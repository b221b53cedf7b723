"""Labelled fusion beside Open3D's VoxelBlockGrid without labels: frames/s, peak memory, surface error.

A room of boxes, whose surface is known, is seen by a walking depth camera with the axial noise of Nguyen, Izadi &
Lovell (2012), millimetre steps and a range of 4 m. Every run of an arm has a process of its own and the same decoded
frames; figures are medians over runs. Memory is the growth of the process's peak over what it held before the first
frame (libraries loaded, kernels compiled, frames in memory).

Arms: `ours` is everything that fuse does with a frame: overlap with the map, association, integration of depth and
colour, label vote, counts, merges. `ours-vote` integrates depth and colour and votes, with labels given. `open3d`
integrates depth alone, `open3d-color` depth and colour; both with truncation 4 voxels and float32.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence

import numpy as np
from pydantic import Field
from scenewright.schemas.scene_parts import Camera
from scenewright.schemas.segments import FrameSegment
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.kit.geometry.cameras import back_project, intrinsic_matrix
from scenewright.stages.kit.geometry.transforms import look_at
from scenewright.stages.kit.stage import Parameters

from benchmarks.experiment import Bench, Experiment, Results, Trial, median
from benchmarks.timing import AS_THE_COMMAND_LINE, Clock, alone, medians, memory, reset_peak

CAMERA = Camera(width=640, height=480, fx=525.0, fy=525.0, cx=319.5, cy=239.5)
RANGE = 4.0
TRUNCATION_VOXELS = 4.0
ARMS = {
    "ours": "ours",
    "ours-vote": "ours, vote only",
    "open3d": "Open3D, no labels, no colour",
    "open3d-color": "Open3D, no labels, colour",
}
CASES = {"2cm": 0.02, "1cm": 0.01}
ERROR_CASE = "2cm"
UNITS = {
    "frames per s": "",
    "frames per s, all": "",
    "processor time": "ms",
    "peak memory": "MB",
    "meshing": "s",
    "mean error": "mm",
    "p95 error": "mm",
    "area": "m²",
}


class FusionParameters(Parameters):
    """Options of the experiment."""

    frames: int = Field(100, ge=3, description="Frames of a run")


def room() -> list[tuple[str, np.ndarray, np.ndarray]]:
    """Return the boxes (class, minimum (3,), maximum (3,)) of the room; the first is the room itself, seen from inside.

    Thin boards and legs are there on purpose: they are what a truncation distance breaks.
    """
    parts = [("wall", (-2.5, -2.0, 0.0), (2.5, 2.0, 2.6))]
    for x, y, length, width, height in ((0.0, 0.0, 1.4, 0.8, 0.75), (-1.9, 1.2, 1.0, 0.7, 0.45)):
        parts.append(("table", (x - length / 2, y - width / 2, height - 0.04), (x + length / 2, y + width / 2, height)))
        for side_x in (-1, 1):
            for side_y in (-1, 1):
                leg_x, leg_y = x + side_x * (length / 2 - 0.05), y + side_y * (width / 2 - 0.05)
                parts.append(
                    ("table", (leg_x - 0.025, leg_y - 0.025, 0.0), (leg_x + 0.025, leg_y + 0.025, height - 0.04))
                )
    parts += [
        ("cabinet", (1.6, 1.2, 0.0), (2.4, 1.9, 1.8)),
        ("sofa", (-2.4, -1.9, 0.0), (-1.5, -1.0, 0.45)),
        ("box", (-0.2, -0.1, 0.75), (0.1, 0.1, 1.0)),
        ("cup", (0.3, 0.1, 0.75), (0.4, 0.2, 0.87)),
    ]
    return [(name, np.array(low), np.array(high)) for name, low, high in parts]


def true_scene():  # type: ignore[no-untyped-def]  # open3d has no types
    """Return the room as an open3d RaycastingScene; geometry ids follow `room()`."""
    import open3d as o3d
    import trimesh

    scene = o3d.t.geometry.RaycastingScene()
    for _, low, high in room():
        mesh = trimesh.creation.box(
            extents=high - low, transform=trimesh.transformations.translation_matrix((low + high) / 2)
        )
        scene.add_triangles(mesh.vertices.astype(np.float32), mesh.faces.astype(np.uint32))
    return scene


def render_frames(count: int) -> dict[str, np.ndarray]:
    """Return depth (N, H, W) float32 [m], color (N, H, W, 3) uint8, ids (N, H, W) uint16, poses (N, 4, 4)."""
    import open3d as o3d

    scene, random = true_scene(), np.random.default_rng(0)
    palette = random.integers(30, 226, (len(room()), 3)).astype(np.uint8)
    frames: dict[str, list[np.ndarray]] = {"depth": [], "color": [], "ids": [], "poses": []}
    for angle in 2 * np.pi * np.arange(count) / count:
        eye = np.array([1.7 * np.cos(angle), 1.3 * np.sin(angle), 1.5 + 0.2 * np.sin(3 * angle)])
        pose = look_at(eye, np.array([-0.9 * np.cos(angle), -0.7 * np.sin(angle), 0.5]))
        directions = back_project(np.ones((CAMERA.height, CAMERA.width), dtype=np.float32), CAMERA) @ pose[:3, :3].T
        rays = np.concatenate([np.broadcast_to(eye, directions.shape), directions], axis=-1)
        hit = scene.cast_rays(o3d.core.Tensor(rays.astype(np.float32)))  # type: ignore[call-overload]
        depth = hit["t_hit"].numpy()
        depth = depth + (0.0012 + 0.0019 * (depth - 0.4) ** 2) * random.standard_normal(depth.shape)
        ids = hit["geometry_ids"].numpy().astype(np.int64)
        frames["depth"].append(np.where(depth <= RANGE, np.round(depth * 1000) / 1000, 0).astype(np.float32))
        frames["color"].append(palette[ids])
        frames["ids"].append((ids + 1).astype(np.uint16))
        frames["poses"].append(pose)
    return {name: np.array(images) for name, images in frames.items()}


Step = Callable[[int], None]
Mesh = Callable[[], tuple[np.ndarray, np.ndarray]]


def ours(frames: dict[str, np.ndarray], voxel_size: float, whole: bool) -> tuple[Step, Mesh]:
    """Return what integrates frame k, and what gives the mesh. `whole`: with association, counts and merges."""
    from scenewright.stages.fuse.integration import integrate
    from scenewright.stages.fuse.parameters import FuseParameters
    from scenewright.stages.fuse.smoothing import smoothed_tsdf
    from scenewright.stages.fuse.stage import new_mapper
    from scenewright.stages.fuse.surface import extract_surface

    options = FuseParameters.model_validate(
        {"voxel_size": voxel_size, "truncation_voxels": TRUNCATION_VOXELS, "maximum_depth": RANGE}
    )
    vocabulary = load_vocabulary()
    mapper = new_mapper(options, vocabulary)
    classes = [vocabulary.by_name(name) for name, _, _ in room()]
    listings = []
    for image in frames["ids"]:
        numbers = np.unique(image).tolist()
        listings.append(
            [
                FrameSegment(
                    id=number,
                    category_id=classes[number - 1].id,
                    instance=number,
                    score=1.0,
                    area=1,
                    is_thing=classes[number - 1].kind == "thing",
                )
                for number in numbers
            ]
        )
    ids = frames["ids"].astype(np.int32)
    labels = np.arange(len(classes) + 1, dtype=np.int32)

    def with_everything(k: int) -> None:
        mapper.add_frame(CAMERA, frames["depth"][k], frames["color"][k], frames["poses"][k], ids[k], listings[k])

    def vote_only(k: int) -> None:
        integrate(
            mapper.blocks,
            frames["depth"][k],
            CAMERA,
            frames["poses"][k],
            truncation=mapper.truncation_distance,
            near=options.minimum_depth,
            far=RANGE,
            color=frames["color"][k],
            index_image=frames["ids"][k],
            label_of_index=labels,
            canonical=labels,
            label_band=options.label_band * mapper.truncation_distance,
        )

    def mesh() -> tuple[np.ndarray, np.ndarray]:
        tsdf = smoothed_tsdf(mapper.blocks, options.smoothing)
        surface = extract_surface(mapper.blocks, minimum_weight=options.minimum_weight, tsdf=tsdf)
        return surface.vertices, surface.faces

    return (with_everything if whole else vote_only), mesh


def open3d(frames: dict[str, np.ndarray], voxel_size: float, color: bool) -> tuple[Step, Mesh]:
    """The same for Open3D's VoxelBlockGrid on the processor (8^3 blocks, capacity as large as the room needs)."""
    import open3d as o3d

    core, geometry = o3d.core, o3d.t.geometry
    names = ("tsdf", "weight", "color") if color else ("tsdf", "weight")
    grid = geometry.VoxelBlockGrid(
        names,
        (core.float32,) * len(names),
        ((1), (1), (3))[: len(names)],  # type: ignore[arg-type]
        voxel_size,
        8,
        40_000 if voxel_size < 0.015 else 10_000,
        core.Device("CPU:0"),
    )
    # Its pixels begin at integer coordinates, ours are centred there: without the shift it would be half a pixel off.
    shifted = CAMERA.model_copy(update={"cx": CAMERA.cx + 0.5, "cy": CAMERA.cy + 0.5})
    intrinsic = core.Tensor(intrinsic_matrix(shifted))  # type: ignore[call-overload]
    options = (1.0, RANGE, TRUNCATION_VOXELS)

    def step(k: int) -> None:
        depth = geometry.Image(core.Tensor(frames["depth"][k]))  # type: ignore[call-overload]
        extrinsic = core.Tensor(np.linalg.inv(frames["poses"][k]))  # type: ignore[call-overload]
        blocks = grid.compute_unique_block_coordinates(depth, intrinsic, extrinsic, *options)
        if color:
            image = geometry.Image(core.Tensor(frames["color"][k]).to(core.float32))  # type: ignore[call-overload]
            grid.integrate(blocks, depth, image, intrinsic, extrinsic, *options)
        else:
            grid.integrate(blocks, depth, intrinsic, extrinsic, *options)

    def mesh() -> tuple[np.ndarray, np.ndarray]:
        result = grid.extract_triangle_mesh(1.0)
        return result.vertex.positions.numpy().astype(np.float32), result.triangle.indices.numpy()

    return step, mesh


def build(arm: str, frames: dict[str, np.ndarray], voxel_size: float) -> tuple[Step, Mesh]:
    """Return the steps of an arm."""
    if arm.startswith("ours"):
        return ours(frames, voxel_size, whole=arm == "ours")
    return open3d(frames, voxel_size, color=arm == "open3d-color")


def surface_error(vertices: np.ndarray, faces: np.ndarray) -> dict[str, float]:
    """Distances [mm] from points spread evenly over a mesh to the true surface, and the mesh's area [m^2]."""
    import trimesh

    mesh = trimesh.Trimesh(vertices, faces, process=False)
    points, _ = trimesh.sample.sample_surface(mesh, 100_000, seed=0)
    distance = true_scene().compute_distance(points.astype(np.float32)).numpy()
    return {
        "mean error": 1000 * float(distance.mean()),
        "p95 error": 1000 * float(np.percentile(distance, 95)),
        "area": float(mesh.area),
    }


def work(arm: str, case: str, frames: dict[str, np.ndarray]) -> dict[str, float]:
    """Run one arm once on frames, in a process of its own."""
    step, mesh = build(arm, {name: images[:2] for name, images in frames.items()}, 0.05)
    step(0)
    step(1)
    mesh()  # kernels compiled, libraries loaded, threads started
    step, mesh = build(arm, frames, CASES[case])
    reset_peak()
    before, clock, meshing = memory("VmRSS"), Clock(), Clock()
    for k in range(len(frames["depth"])):
        with clock.lap():
            step(k)
    with meshing.lap():
        vertices, faces = mesh()
    wall, processor = medians(clock)
    measures = {
        "frames per s": 1 / wall,
        "frames per s, all": len(clock.wall) / sum(clock.wall),
        "processor time": 1000 * processor,
        "peak memory": memory("VmHWM") - before,
        "meshing": meshing.wall[0],
    }
    return measures | (surface_error(vertices, faces) if case == ERROR_CASE else {})


def measure(bench: Bench, trials: Sequence[Trial]) -> Iterable[tuple[Trial, dict[str, float]]]:
    """Yield what each run took."""
    frames = render_frames(bench.parameters.frames)
    for trial in trials:
        variables = AS_THE_COMMAND_LINE if trial.arm.startswith("ours") else {}
        yield trial, alone(work, trial.arm, trial.case, frames, **variables)


def shares(results: Results) -> Mapping[str, float | None]:
    """Return the rates of ours over that of Open3D, which integrates depth alone."""
    rates = {(arm, case): results.value(arm, case, "frames per s") for case in results.cases for arm in results.arms()}
    return {
        f"{arm}/{case}/share of Open3D": rate / other
        for (arm, case), rate in rates.items()
        if arm.startswith("ours") and rate is not None and (other := rates.get(("open3d", case)))
    }


EXPERIMENT = Experiment(
    name="speed_fusion",
    title="Labelled fusion beside Open3D",
    simulated="Frames of a room with noise.",
    knows="Exact poses.",
    does_not_show="Speed on other hardware. Where other work ran beside it, less than half as much again is a tie. "
    "Open3D fuses no labels.",
    arms=ARMS,
    cases=tuple(CASES),
    reporting=tuple(f"run {k}" for k in range(1, 6)),
    quick_seeds=1,
    together=lambda trial: "",
    measure=measure,
    record=dict[str, float],
    measures={name: median(name, unit, interval=False) for name, unit in UNITS.items()},
    parameters=FusionParameters,
    quick={"frames": 20},
    more_figures=shares,
)
