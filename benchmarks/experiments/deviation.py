"""Whether the standard deviation that `disparity` writes beside depth is true, and whether it betters a map.

Rooms of two eyes, matched and fused as `reconstruct-stereo` does: `weighed` by the deviations, `even` without them, and
`strict`, without them too but of pixels alone whose confidence is STRICT or more. Surface is compared with the true
mesh, both ways. Whether deviations are true is counted in pixels: how often the error is within one of them, and two.
The real pair has no room around it, so that only this is asked of it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numba
import numpy as np
from pydantic import Field
from scenewright.stages.disparity import deviation_of, match
from scenewright.stages.fuse import FuseParameters, Surface, VoxelBlocks, extract_surface, integrate, smoothed_tsdf
from scenewright.stages.kit.formats.frames import FrameReader
from scenewright.stages.kit.formats.mesh_files import read_mesh
from scenewright.stages.kit.stage import Parameters

from benchmarks.disparity.rendered_pairs import BASELINE, PICTURE_NOISE
from benchmarks.experiment import Bench, Experiment, Results, Trial, mean, ratio
from benchmarks.experiments.disparity.arms import TRUSTED
from benchmarks.experiments.disparity.cases import CASES
from benchmarks.experiments.surface.measuring import distances
from benchmarks.generated_rooms import RECIPES, recipe_of
from benchmarks.steps import made
from benchmarks.tabulation import Figure

FUSE = FuseParameters()  # type: ignore[call-arg]
STRICT = 0.5
"""Least confidence of the arm that has no deviations and is choosy instead."""
NEAR = 0.05
"""True surface with the map's this close to it is found [m]."""
ROOMS, REAL = "rooms", "motorcycle"
TUNING = ("room-100", "kitchen-40", "office-41", "bedroom-40")
"""Rooms that the table of deviations and the weights were made with."""
REPORTING = tuple(f"{RECIPES[k % 4]}-{1420 + k}" for k in range(8))


class DeviationParameters(Parameters):
    """Options of the experiment."""

    data: Path = Field(Path("../shared/data"), description="Folder with the real logs")
    frames: int = Field(40, ge=2, description="Frames of a room")


@dataclass(frozen=True)
class Judged:
    """A map against the true surface, and the deviations against the true errors."""

    error_median: float | None = None
    """Distance of the map's vertices from the true surface: its median ..."""
    error_90: float | None = None
    """... and 90th percentile [mm]."""
    missing: float | None = None
    """Mean distance of the seen true surface from the map, NEAR at most [mm]."""
    found: float | None = None
    """Share of the seen true surface that is within NEAR of the map [%]."""
    within_1: float | None = None
    """Share of the pixels whose error is at most one standard deviation [%] (of a normal distribution: 68)."""
    within_2: float | None = None
    """At most two (95)."""


def seeds_of(bench: Bench, case: str) -> Sequence[str]:
    """The rooms, or the pair where it is there."""
    if case == REAL:
        return CASES[REAL].names(bench.parameters.data, bench.out, bench.quick, bench.tuning)
    return TUNING if bench.tuning else REPORTING


def measure(bench: Bench, trials: Sequence[Trial]) -> Iterator[tuple[Trial, Judged]]:
    """Yield what every arm makes of one room, or of the pair."""
    cv2.setNumThreads(1)
    numba.set_num_threads(1)
    case, name = trials[0].case, trials[0].seed
    if case == REAL:
        yield trials[0], of_pair(bench.parameters.data, name)
        return
    work = bench.out / "rooms" / f"{name}-{bench.parameters.frames}"
    truth, pairs = recorded(bench.out, work, name, bench.parameters.frames)
    for trial in trials:
        least = STRICT if trial.arm == "strict" else TRUSTED
        sequence = made(
            "disparity",
            work / f"sequence-{least}",
            *("--sequence", pairs, "--minimum-confidence", least, "--maximum-depth", FUSE.maximum_depth),
        )
        surface = mapped(sequence / "frames.mcap", weighed=trial.arm == "weighed")
        within = shares_within(sequence / "frames.mcap", pairs / "frames.mcap") if trial.arm == "weighed" else {}
        yield trial, Judged(**against_truth(surface, truth), **within)


def recorded(root: Path, work: Path, name: str, frames: int) -> tuple[Path, Path]:
    """Return a room's truth and its sequence, which has two eyes and the exact depth. Raises StepFailed."""
    shapes = ("--shapes-per-class", 4, "--small-shapes-per-class", 4)
    library = made("library build", root / "cad_library", *shapes, "--seed", 1)
    truth = made(
        "synthesize",
        work / "truth",
        *("--library", library, "--recipe", recipe_of(name), "--seed", name.rsplit("-", 1)[1], "--frames", frames),
        *("--stereo-baseline", BASELINE, "--picture-noise", PICTURE_NOISE, "--no-depth-noise"),
    )
    return truth, made("ingest", work / "pairs", "--log", truth / "log.mcap")


def mapped(frames: Path, *, weighed: bool) -> Surface:
    """Return the surface that `fuse` draws of a sequence."""
    blocks = VoxelBlocks(FUSE.voxel_size)
    with FrameReader(frames) as reader:
        for frame in reader.frames(("depth", "deviation")):
            assert frame.depth is not None and frame.world_from_camera is not None
            integrate(
                blocks,
                frame.depth,
                reader.camera,
                frame.world_from_camera,
                truncation=FUSE.truncation_voxels * FUSE.voxel_size,
                near=FUSE.minimum_depth,
                far=FUSE.maximum_depth,
                deviation=frame.deviation if weighed else None,
                maximum_weight=FUSE.maximum_weight,
                stride=FUSE.block_stride,
            )
    tsdf = smoothed_tsdf(blocks, FUSE.smoothing)
    return extract_surface(blocks, minimum_weight=FUSE.minimum_weight, tsdf=tsdf)


def against_truth(surface: Surface, truth: Path) -> dict[str, float]:
    """Compare a surface with the true mesh and with what of it was seen."""
    mesh = read_mesh(truth / "mesh.ply")
    with np.load(truth / "visible.npz", allow_pickle=False) as visible:
        seen = visible["points"][::10]
    error = distances(np.asarray(mesh.vertices), np.asarray(mesh.faces), surface.vertices)
    missing = distances(surface.vertices, surface.faces, seen)
    return {
        "error_median": 1000 * float(np.median(error)),
        "error_90": 1000 * float(np.percentile(error, 90)),
        "missing": 1000 * float(np.minimum(missing, NEAR).mean()),
        "found": 100 * float(np.mean(missing <= NEAR)),
    }


def shares_within(frames: Path, exact: Path, every: int = 5) -> dict[str, float]:
    """Return how often depth errs by at most one and two of its deviations, over every n-th frame."""
    shares = []
    with FrameReader(frames) as reader, FrameReader(exact) as truth:
        true_depths = {frame.time: frame.depth for frame in truth.frames(("depth",), every=every)}
        for frame in reader.frames(("depth", "deviation")):
            true = true_depths.get(frame.time)
            if true is None or frame.depth is None or frame.deviation is None:
                continue
            both = (frame.depth > 0) & (true > 0)
            shares.append(_within(np.abs(frame.depth - true)[both] / frame.deviation[both]))
    return dict(zip(("within_1", "within_2"), np.mean(shares, axis=0).tolist(), strict=True))


def of_pair(data: Path, name: str) -> Judged:
    """Count the same in a pair with measured disparities, in pixels: depth errs by as many deviations."""
    pair = CASES[REAL].pair(data, data, name)
    found = match(pair.left, pair.right)
    both = found.known & np.isfinite(pair.truth) & (found.confidence >= TRUSTED)
    error = np.abs(found.disparity - pair.truth)[both] / deviation_of(found.confidence)[both]
    return Judged(**dict(zip(("within_1", "within_2"), _within(error), strict=True)))


def _within(errors: np.ndarray) -> tuple[float, float]:
    return 100 * float(np.mean(errors <= 1)), 100 * float(np.mean(errors <= 2))


def beside_even(results: Results) -> dict[str, Figure | None]:
    """The errors of the other arms as a share of what they are without deviations."""
    return {
        f"{arm}/{ROOMS}/{name}_of_even": ratio(
            [(getattr(own, name), getattr(even, name)) for own, even in results.pairs(arm, "even", ROOMS)]
        )
        for arm in ("weighed", "strict")
        for name in ("error_median", "error_90")
    }


EXPERIMENT = Experiment(
    name="deviation",
    title="Depth from two eyes, weighed by its own deviation",
    simulated="Generated rooms, two rendered eyes with noisy pictures. The motorcycle is a real pair.",
    knows="Exact poses and calibration.",
    does_not_show=(
        "Real rooms, or phones: no log with deviations and a true surface was at hand. The pair has no other "
        "views, so nothing is fused of it."
    ),
    arms={"weighed": "weighed by deviation", "even": "without deviations", "strict": "without, confidence from 0.5"},
    cases=(ROOMS, REAL),
    runs=lambda arm, case: arm == "weighed" or case == ROOMS,
    seeds_of=seeds_of,
    tuning=TUNING,
    reporting=REPORTING,
    quick_seeds=1,
    quick={"frames": 12},
    together=lambda trial: (trial.case, trial.seed),
    measure=measure,
    record=Judged,
    measures={
        "error_median": mean("error_median", "mm"),
        "error_90": mean("error_90", "mm"),
        "missing": mean("missing", "mm"),
        "found": mean("found", "%"),
        "within_1": mean("within_1", "%"),
        "within_2": mean("within_2", "%"),
    },
    pairs=(("weighed", "even"), ("weighed", "strict")),
    compared=("error_median", "error_90", "missing", "found"),
    more_figures=beside_even,
    parameters=DeviationParameters,
    places=frozenset({"data"}),
    steps=("synthesize", "library build", "ingest", "disparity"),
)
