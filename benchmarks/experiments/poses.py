"""How far estimated camera paths are from the given ones, how fast, and what it does to the map.

Arms: `odometry` (no loops), `ours` (loops and pose graph), `ours_bundle` (and bundle adjustment), `ours_depth` (depth
alone), `sfm` (features alone, pycolmap), and `open3d` (Open3D's tensor RGB-D odometry, frame to frame, hybrid, the same
resolution); `given` are the poses to compare with. Logs: the red kitchen of 7-Scenes, Redwood's living room (whose
poses are themselves an estimate), the five frames of the dining room, and generated rooms of the reporting seeds. Cases
`map_<log>` fuse the first room with exact, estimated and drifting poses. Draws a plan of the paths of every log.
"""

from __future__ import annotations

import json
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from pydantic import Field
from scenewright.schemas.ground_truth import GroundTruth
from scenewright.schemas.segments import Segments
from scenewright.schemas.sequence import Sequence as SequenceArtifact
from scenewright.schemas.trajectory import Trajectory
from scenewright.stages.kit.drawing.plots import SERIES_COLORS, STYLE, plt, save
from scenewright.stages.kit.formats.frames import FrameReader
from scenewright.stages.kit.formats.trajectories import read_tum, write_tum
from scenewright.stages.kit.geometry.cameras import intrinsic_matrix
from scenewright.stages.kit.geometry.transforms import apply, inverse
from scenewright.stages.kit.measurement.pose_error import align_rigidly, associate, trajectory_error
from scenewright.stages.kit.measurement.relative_pose_error import trajectory_drift
from scenewright.stages.kit.registration.alignment import judge
from scenewright.stages.kit.registration.pyramid import build_pyramid
from scenewright.stages.kit.stage import Parameters
from scenewright.stages.poses import laid_onto

from benchmarks.drifting import drifting_poses
from benchmarks.experiment import Bench, Experiment, Results, Trial, only
from benchmarks.generated_rooms import STEPS
from benchmarks.steps import made, opened, unrecorded

RECIPES = ("room", "kitchen", "office", "bedroom")
REPORTING_SEEDS = range(1100, 1106)
"""In the reporting range of the recipes; nothing was tuned on them."""
REAL = {
    "7scenes_kitchen": "7scenes_redkitchen",
    "redwood_livingroom": "redwood_livingroom1",
    "diningroom": "slambook2_rgbd/diningroom",
}
INTRINSICS = {"diningroom": ("--fx", "518", "--fy", "519", "--cx", "325.5", "--cy", "253.5")}
GIVEN, OPEN3D = "given", "open3d"
OPTIONS: dict[str, dict[str, object]] = {
    "odometry": {"loop_closure": False},
    "ours": {},
    "ours_bundle": {"bundle_adjustment": True},
    "ours_depth": {"use_color": False},
    "sfm": {"method": "sfm"},
}
"""Arm -> options of the step `poses`."""
ARMS = {
    GIVEN: "the poses to compare with",
    "odometry": "no loops",
    "ours": "loops and pose graph",
    "ours_bundle": "and bundle adjustment",
    "ours_depth": "depth alone",
    "sfm": "features alone (pycolmap)",
    OPEN3D: "Open3D's hybrid odometry",
    "exact": "exact poses (maps)",
    "drifting": "poses that drift (maps)",
}
MAP_ARMS = ("exact", "ours", "odometry", "sfm", "drifting")
ROOMS = tuple(f"{RECIPES[k % len(RECIPES)]}_{seed}" for k, seed in enumerate(REPORTING_SEEDS))
MAPS = "map_"
MAPPED = f"{MAPS}{ROOMS[0]}"
QUICK_ARMS = (GIVEN, "odometry", "ours", "exact", "drifting")
CORRUPTION = "0.2"
MEASURES = (
    "ate_m",
    "rpe_second_m",
    "rpe_second_rad",
    "rpe_metre_m",
    "fit_m",
    "epipolar_rad",
    "posed_share",
    "loops",
    "frames_per_cpu_second",
    "frames_per_second",
)
EPIPOLAR_EVERY, EPIPOLAR_GAP, EPIPOLAR_MATCHES = 12, 25, 40
"""`epipolar_rad`: the turn between frames so far apart, against that which their features say by epipolar geometry,
beginning at every so many-th frame and with at least so many matches that agree; neither depth nor truth is needed."""
FIT_PAIRS, FIT_GAP = 30, 15
"""`fit_m`: depth against depth of so many pairs of frames so far apart, with the poses as they are; no truth needed."""


class PosesParameters(Parameters):
    """Options of the experiment."""

    data: Path = Field(Path("../shared/data"), description="Folder with the real logs")
    frames: int = Field(400, ge=2, description="Frames of a generated room")


@dataclass(frozen=True)
class Log:
    """One log, ingested."""

    name: str
    sequence: SequenceArtifact
    ground_truth: GroundTruth | None

    def given(self) -> tuple[np.ndarray, np.ndarray]:
        """Times (N,) and poses (N, 4, 4) to compare with."""
        return read_tum(self.sequence.path("trajectory.tum"))


def log_of(bench: Bench, name: str) -> Log:
    """Ingest a real log, or generate and ingest a room."""
    folder = bench.out / "logs"
    if name in REAL:
        path = made("ingest", folder / name, "--log", bench.parameters.data / REAL[name], *INTRINSICS.get(name, ()))
        return Log(name, opened(SequenceArtifact, path), None)
    library = made("library build", folder / "library", "--seed", 1)
    recipe, seed = name.rsplit("_", 1)
    frames = bench.parameters.frames
    size = ("--frames", frames, "--width", 320, "--height", 240)
    room = ("--library", library, "--recipe", recipe, "--seed", seed)
    truth = made("synthesize", folder / f"{name}-{frames}_truth", *room, *size)
    path = made("ingest", folder / f"{name}-{frames}", "--log", truth / "log.mcap")
    return Log(name, opened(SequenceArtifact, path), opened(GroundTruth, truth))


def seeds_of(bench: Bench, case: str) -> Sequence[str]:
    """The log, where it is there."""
    name = case.removeprefix(MAPS)
    return [name] if name not in REAL or (bench.parameters.data / REAL[name]).is_dir() else []


def runs(arm: str, case: str) -> bool:
    """Maps are made with some of the paths."""
    return arm in MAP_ARMS if case.startswith(MAPS) else arm not in ("exact", "drifting")


def measure(bench: Bench, trials: Sequence[Trial]) -> Iterator[tuple[Trial, Row]]:
    """Yield the figures of one log, path after path; paths are left in the folders of the trials."""
    log = log_of(bench, trials[0].seed)
    turns: list[list[float]] | None = None
    paths: dict[str, Path] = {}
    for trial in trials:
        output = bench.folder(trial)
        output.mkdir(parents=True, exist_ok=True)
        if trial.case.startswith(MAPS):
            yield trial, map_row(bench, log, trial, output, paths.get(trial.arm))
            continue
        if trial.arm == GIVEN:
            row: Row = {"fit_m": depth_fit(log.sequence, *log.given())}
            write_tum(output / "trajectory.tum", *log.given())
        else:
            row = run_arm(log, trial.arm, output)
        paths[trial.arm] = output
        turns = epipolar_turns(log.sequence) if turns is None else turns
        with FrameReader(log.sequence.path("frames.mcap")) as reader:
            own = read_tum(output / "trajectory.tum")
            yield trial, row | {"epipolar_rad": epipolar_disagreement(turns, reader.times, *own)}


def map_row(bench: Bench, log: Log, trial: Trial, output: Path, poses: Path | None) -> Row:
    """Fuse and evaluate a map with the poses of an arm, which are estimated unless a folder holds them."""
    command = ("--backend", "ground-truth", "--corruption", CORRUPTION)
    path = made("segment", bench.out / "segments" / log.sequence.root.name, "--sequence", log.sequence.root, *command)
    if trial.arm == "drifting":
        poses = drifting_path(log, output / "path")
    elif trial.arm != "exact" and poses is None:
        poses = output / "path"
        poses.mkdir()
        run_arm(log, trial.arm, poses)
    return map_figures(log, opened(Segments, path), poses, output)


Row = dict[str, float | None]


def run_arm(log: Log, arm: str, output: Path) -> Row:
    """Estimate the poses of a log into `output` and measure them."""
    cpu, wall = time.process_time(), time.perf_counter()
    loops = 0
    if arm == OPEN3D:
        frames = open3d_odometry(log.sequence, output)
    else:
        info = unrecorded("poses", output, OPTIONS[arm], sequence=log.sequence).info
        frames, loops = len(info.frames), sum(loop.weight >= 0.5 for loop in info.loops)
    cpu, wall = time.process_time() - cpu, time.perf_counter() - wall
    times, poses = read_tum(output / "trajectory.tum")
    error = trajectory_error(*log.given(), times, poses)
    drift = trajectory_drift(*log.given(), times, poses)
    second, metre = drift.per_second, drift.per_metre
    return {
        "ate_m": error.rmse_aligned if error else None,
        "rpe_second_m": second.translation_rmse if second else None,
        "rpe_second_rad": second.rotation_mean if second else None,
        "rpe_metre_m": metre.translation_rmse if metre else None,
        "fit_m": depth_fit(log.sequence, times, poses),
        "posed_share": len(times) / frames,
        "loops": float(loops),
        "frames_per_cpu_second": frames / cpu,
        "frames_per_second": frames / wall,
    }


def depth_fit(sequence: SequenceArtifact, times: np.ndarray, poses: np.ndarray) -> float | None:
    """Return the median over pairs of frames of the distance between their surfaces under these poses [m].

    The distance of a pair is the root mean square to the planes of the earlier frame, of points within 5 cm of them.
    """
    found = []
    with FrameReader(sequence.path("frames.mcap")) as reader:
        rows, frames = associate(times, reader.times)
        last = len(frames) - FIT_GAP
        for k in np.unique(np.linspace(0, last - 1, min(FIT_PAIRS, max(last, 0))).astype(int)).tolist():
            first, second = (
                build_pyramid(depth, None, reader.camera, width=320, levels=1, maximum_depth=4.5)
                for depth in (reader.read(int(frames[n]), ("depth",)).depth for n in (k, k + FIT_GAP))
                if depth is not None
            )
            found.append(judge(first, second, inverse(poses[rows[k]]) @ poses[rows[k + FIT_GAP]]).residual)
    return float(np.median(found)) if found else None


def epipolar_turns(sequence: SequenceArtifact) -> list[list[float]]:
    """Return first frame, second frame and the rotation vector [rad] of first_from_second, of pairs whose SIFT matches
    have an essential matrix."""
    finder, matcher, turns = cv2.SIFT_create(1500), cv2.BFMatcher(), []  # type: ignore[attr-defined]
    with FrameReader(sequence.path("frames.mcap")) as reader:
        matrix = intrinsic_matrix(reader.camera)
        for first in range(0, len(reader) - EPIPOLAR_GAP, EPIPOLAR_EVERY):
            colors = [reader.read(k, ("color",)).color for k in (first, first + EPIPOLAR_GAP)]
            if any(color is None for color in colors):
                continue
            found = [finder.detectAndCompute(cv2.cvtColor(c, cv2.COLOR_RGB2GRAY), None) for c in colors]  # type: ignore
            if any(descriptors is None or len(descriptors) < 2 for _, descriptors in found):
                continue
            pairs = matcher.knnMatch(found[0][1], found[1][1], k=2)
            good = [near for near, next_best in pairs if near.distance < 0.75 * next_best.distance]
            if len(good) < EPIPOLAR_MATCHES:
                continue
            here = np.array([found[0][0][match.queryIdx].pt for match in good])
            there = np.array([found[1][0][match.trainIdx].pt for match in good])
            cv2.setRNGSeed(0)
            essential, mask = cv2.findEssentialMat(here, there, matrix, method=cv2.RANSAC, prob=0.9999, threshold=0.7)
            if essential is None or essential.shape != (3, 3):
                continue
            agreeing, rotation, _, _ = cv2.recoverPose(essential, here, there, matrix, mask=mask)
            if agreeing >= EPIPOLAR_MATCHES:
                turns.append([first, first + EPIPOLAR_GAP, *cv2.Rodrigues(rotation.T)[0][:, 0].tolist()])
    return turns


def epipolar_disagreement(
    turns: list[list[float]], frame_times: np.ndarray, times: np.ndarray, poses: np.ndarray
) -> float | None:
    """Return the median angle between the turns of these poses and those of `epipolar_turns` [rad]."""
    rows = dict(zip(*(found.tolist() for found in associate(frame_times, times)), strict=True))
    angles = []
    for first, second, *vector in turns:
        if first in rows and second in rows:
            own = poses[rows[first], :3, :3].T @ poses[rows[second], :3, :3]
            other = cv2.Rodrigues(np.array(vector))[0]
            angles.append(float(np.linalg.norm(cv2.Rodrigues(own.T @ other)[0])))
    return float(np.median(angles)) if len(angles) >= 5 else None


def open3d_odometry(sequence: SequenceArtifact, output: Path) -> int:
    """Write the path that Open3D's hybrid odometry finds frame to frame at half the width; return how many frames."""
    import open3d.core as o3c
    from open3d.t.geometry import Image, RGBDImage
    from open3d.t.pipelines import odometry

    criteria = [odometry.OdometryConvergenceCriteria(n) for n in (10, 5, 3)]
    losses = odometry.OdometryLossParams(0.07, 0.05, 0.1)
    poses, previous = [np.eye(4)], None
    with FrameReader(sequence.path("frames.mcap")) as reader:
        stride = max(1, reader.camera.width // 320)
        matrix = intrinsic_matrix(reader.camera)
        matrix[:2] /= stride
        for frame in reader.frames(("color", "depth")):
            assert frame.color is not None and frame.depth is not None
            color, depth = (np.ascontiguousarray(x[::stride, ::stride]) for x in (frame.color, frame.depth))
            pictures = [Image(o3c.Tensor(x)) for x in (color, depth)]  # type: ignore[call-overload]
            image = RGBDImage(*pictures)
            if previous is not None:
                start = [o3c.Tensor(x) for x in (matrix, np.eye(4))]  # type: ignore[call-overload]
                found = odometry.rgbd_odometry_multi_scale(
                    image, previous, *start, 1.0, 4.5, criteria, odometry.Method.Hybrid, losses
                )
                poses.append(poses[-1] @ found.transformation.numpy())
            previous = image
        write_tum(output / "trajectory.tum", reader.times, np.array([orthonormal(pose) for pose in poses]))
        return len(reader)


def orthonormal(pose: np.ndarray) -> np.ndarray:
    """Return the pose with its rotation made orthonormal."""
    u, _, vt = np.linalg.svd(pose[:3, :3])
    result = pose.copy()
    result[:3, :3] = u @ vt
    return result


def draw_paths(results: Results) -> None:
    """Draw the paths of every log from above, each aligned with the given one."""
    for case in results.cases:
        if not case.startswith(MAPS):
            paths = {arm: results.bench.folder(Trial(arm, case, case)) for arm in results.arms(case)}
            if GIVEN in paths:
                draw_log(case, paths, results.bench.out / "plots" / f"{case}.png")


def draw_log(name: str, paths: dict[str, Path], file: Path) -> None:
    """Draw the paths of one log."""
    times, given = read_tum(paths[GIVEN] / "trajectory.tum")
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(figsize=(6.0, 5.2))
        axes.plot(given[:, 0, 3], given[:, 1, 3], color="#222222", linewidth=2.2, label=GIVEN)
        estimated = [(arm, path) for arm, path in paths.items() if arm != GIVEN]
        for (arm, path), color in zip(estimated, SERIES_COLORS, strict=False):
            own, poses = read_tum(path / "trajectory.tum")
            true_rows, rows = associate(times, own)
            if len(rows) < 3:
                continue
            centres = apply(align_rigidly(poses[rows, :3, 3], given[true_rows, :3, 3]), poses[:, :3, 3])
            axes.plot(centres[:, 0], centres[:, 1], color=color, linewidth=1.1, label=arm)
        axes.set_aspect("equal")
        axes.set_xlabel("x [m]")
        axes.set_ylabel("y [m]")
        axes.set_title(f"{name}: camera path from above")
        axes.legend()
        file.parent.mkdir(parents=True, exist_ok=True)
        save(figure, file)


def drifting_path(log: Log, output: Path) -> Path:
    """Write the given poses with the drift of the experiment `mapping`, laid onto the given ones; return the folder."""
    times, given = log.given()
    output.mkdir(parents=True, exist_ok=True)
    drifted = drifting_poses(given, np.random.default_rng(0))
    drifted = laid_onto(drifted, given) @ drifted
    write_tum(output / "trajectory.tum", times, np.array([orthonormal(pose) for pose in drifted]))
    return output


def map_figures(log: Log, segments: Segments, path: Path | None, output: Path) -> Row:
    """Fuse with the poses in the folder `path` (None: the sequence's own), evaluate, return the figures."""
    assert log.ground_truth is not None
    given: dict[str, Any] = {"sequence": log.sequence} | ({} if path is None else {"trajectory": Trajectory(path)})
    fused = unrecorded("fuse", output / "map", segments=segments, **given)
    unrecorded(
        "evaluate", output / "evaluation", {"plots": False}, ground_truth=log.ground_truth, panoptic_map=fused, **given
    )
    metrics = json.loads((output / "evaluation" / "metrics.json").read_text())["metrics"]
    return {
        "pq": metrics["map/pq"],
        "accuracy_mm": metrics["map/accuracy_mean_mm"],
        "ate_m": metrics.get("trajectory/ate_rmse_aligned_m") if path is not None else 0.0,
    }


def more_figures(results: Results) -> dict[str, float | None]:
    """Median and worst error over the generated rooms."""
    flat: dict[str, float | None] = {}
    for arm in results.arms():
        rows = [row for trial, row in results.records.items() if trial.arm == arm and trial.case in ROOMS]
        values = [value for row in rows if (value := row.get("ate_m")) is not None]
        if len(values) > 1:
            flat[f"{arm}/generated_rooms/ate_m_median"] = float(np.median(values))
            flat[f"{arm}/generated_rooms/ate_m_worst"] = max(values)
    return flat


UNITS = {"_m": "m", "_rad": "rad", "_mm": "mm", "_second": "frames/s"}
EXPERIMENT = Experiment(
    name="poses",
    title="Estimated camera paths",
    simulated="The rooms, walks, pictures and noisy depth; the real logs are recordings with the poses they bring.",
    knows="Colour, depth and camera of every frame, in their order.",
    does_not_show="Outdoor scenes, rolling shutters, logs with long gaps. A case is one log: no interval can be given.",
    arms=ARMS,
    cases=(*REAL, *ROOMS, MAPPED),
    default_arms=lambda bench: QUICK_ARMS if bench.quick else list(ARMS),
    default_cases=lambda bench: [*REAL, *ROOMS[: 1 if bench.quick else None], MAPPED],
    runs=runs,
    reporting=ROOMS,
    seeds_of=seeds_of,
    together=lambda trial: trial.seed,
    measure=measure,
    record=Row,
    measures={
        name: only(name, next((unit for end, unit in UNITS.items() if name.endswith(end)), ""))
        for name in (*MEASURES, "pq", "accuracy_mm")
    },
    parameters=PosesParameters,
    places=frozenset({"data"}),
    quick={"frames": 240},
    steps=("poses", "segment", "fuse", "evaluate", *STEPS),
    code={OPEN3D: ("scenewright.stages.kit.measurement.pose_error", "scenewright.stages.kit.formats.trajectories")},
    more_figures=more_figures,
    pictures=draw_paths,
)
