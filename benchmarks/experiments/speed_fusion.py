"""Labelled fusion beside Open3D's VoxelBlockGrid without labels: frames/s, peak memory, surface error.

The corridor of boxes (benchmarks/corridor.py), whose surface is known, is seen by a walking depth camera with noise,
millimetre steps and a range of 4 m. Every run of an arm has a process of its own and the same decoded
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
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.kit.geometry.cameras import intrinsic_matrix
from scenewright.stages.kit.stage import Parameters

from benchmarks.corridor import CAMERA, RANGE, CorridorFrame, corridor_scene, make_frames
from benchmarks.experiment import Bench, Experiment, Results, Trial, median
from benchmarks.timing import AS_THE_COMMAND_LINE, Clock, alone, medians, memory, reset_peak

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


Step = Callable[[int], None]
Mesh = Callable[[], tuple[np.ndarray, np.ndarray]]


def ours(frames: list[CorridorFrame], voxel_size: float, whole: bool) -> tuple[Step, Mesh]:
    """Return what integrates frame k, and what gives the mesh. `whole`: with association, counts and merges."""
    from scenewright.stages.fuse.integration import integrate
    from scenewright.stages.fuse.parameters import FuseParameters
    from scenewright.stages.fuse.smoothing import smoothed_tsdf
    from scenewright.stages.fuse.stage import new_mapper
    from scenewright.stages.fuse.surface import extract_surface

    options = FuseParameters.model_validate(
        {"voxel_size": voxel_size, "truncation_voxels": TRUNCATION_VOXELS, "maximum_depth": RANGE}
    )
    mapper = new_mapper(options, load_vocabulary())
    true = [frame.masks.ids.astype(np.uint16) for frame in frames]
    labels = np.arange(1 + max(int(image.max()) for image in true), dtype=np.int32)

    def with_everything(k: int) -> None:
        frame = frames[k]
        mapper.add_frame(CAMERA, frame.depth, frame.color, frame.pose, frame.ids, frame.listing)

    def vote_only(k: int) -> None:
        integrate(
            mapper.blocks,
            frames[k].depth,
            CAMERA,
            frames[k].pose,
            truncation=mapper.truncation_distance,
            near=options.minimum_depth,
            far=RANGE,
            color=frames[k].color,
            index_image=true[k],
            label_of_index=labels,
            canonical=labels,
            label_band=options.label_band * mapper.truncation_distance,
        )

    def mesh() -> tuple[np.ndarray, np.ndarray]:
        tsdf = smoothed_tsdf(mapper.blocks, options.smoothing)
        surface = extract_surface(mapper.blocks, minimum_weight=options.minimum_weight, tsdf=tsdf)
        return surface.vertices, surface.faces

    return (with_everything if whole else vote_only), mesh


def open3d(frames: list[CorridorFrame], voxel_size: float, color: bool) -> tuple[Step, Mesh]:
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
        depth = geometry.Image(core.Tensor(frames[k].depth))  # type: ignore[call-overload]
        extrinsic = core.Tensor(np.linalg.inv(frames[k].pose))  # type: ignore[call-overload]
        blocks = grid.compute_unique_block_coordinates(depth, intrinsic, extrinsic, *options)
        if color:
            image = geometry.Image(core.Tensor(frames[k].color).to(core.float32))  # type: ignore[call-overload]
            grid.integrate(blocks, depth, image, intrinsic, extrinsic, *options)
        else:
            grid.integrate(blocks, depth, intrinsic, extrinsic, *options)

    def mesh() -> tuple[np.ndarray, np.ndarray]:
        result = grid.extract_triangle_mesh(1.0)
        return result.vertex.positions.numpy().astype(np.float32), result.triangle.indices.numpy()

    return step, mesh


def build(arm: str, frames: list[CorridorFrame], voxel_size: float) -> tuple[Step, Mesh]:
    """Return the steps of an arm."""
    if arm.startswith("ours"):
        return ours(frames, voxel_size, whole=arm == "ours")
    return open3d(frames, voxel_size, color=arm == "open3d-color")


def surface_error(vertices: np.ndarray, faces: np.ndarray) -> dict[str, float]:
    """Distances [mm] from points spread evenly over a mesh to the true surface, and the mesh's area [m^2]."""
    import trimesh

    mesh = trimesh.Trimesh(vertices, faces, process=False)
    points, _ = trimesh.sample.sample_surface(mesh, 100_000, seed=0)
    distance = corridor_scene()[0].compute_distance(points.astype(np.float32)).numpy()
    return {
        "mean error": 1000 * float(distance.mean()),
        "p95 error": 1000 * float(np.percentile(distance, 95)),
        "area": float(mesh.area),
    }


def work(arm: str, case: str, frames: list[CorridorFrame]) -> dict[str, float]:
    """Run one arm once on frames, in a process of its own."""
    step, mesh = build(arm, frames[:2], 0.05)
    step(0)
    step(1)
    mesh()  # kernels compiled, libraries loaded, threads started
    step, mesh = build(arm, frames, CASES[case])
    reset_peak()
    before, clock, meshing = memory("VmRSS"), Clock(), Clock()
    for k in range(len(frames)):
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
    frames = make_frames(bench.parameters.frames)
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
    simulated="Frames of a corridor with noise.",
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
