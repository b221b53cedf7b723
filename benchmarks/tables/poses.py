"""`make bench-poses`: how far estimated camera paths are from the given ones, how fast, and what it does to the map.

Arms: `odometry` (no loops), `ours` (loops and pose graph), `ours_bundle` (and bundle adjustment), `ours_depth` (depth
alone), `sfm` (features alone, pycolmap), and `open3d` (Open3D's tensor RGB-D odometry, frame to frame, hybrid, the same
resolution). Logs: the red kitchen of 7-Scenes, Redwood's living room (whose poses are themselves an estimate), the five
frames of the dining room, and generated rooms of the reporting seeds. Writes metrics.json, table.md and a plan of the
paths of every log; what is there already is kept unless the code of the steps has changed or --fresh is given, and
--kept-only tabulates that alone.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import resource
import shutil
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from benchmarks.mapping.drift import drifting_poses
from schemas.ground_truth import GroundTruth
from schemas.segments import Segments
from schemas.sequence import Sequence
from schemas.trajectory import Trajectory
from stages.engine.chain import run_command
from stages.engine.reading import open_artifact
from stages.evaluate.parameters import EvaluateParameters
from stages.evaluate.stage import run as evaluate
from stages.fuse.parameters import FuseParameters
from stages.fuse.stage import run as fuse
from stages.kit.drawing.plots import SERIES_COLORS, STYLE, plt, save
from stages.kit.formats.frames import FrameReader
from stages.kit.formats.trajectories import read_tum, write_tum
from stages.kit.geometry.cameras import intrinsic_matrix
from stages.kit.geometry.transforms import apply, inverse
from stages.kit.measurement.pose_error import align_rigidly, associate, trajectory_error
from stages.kit.measurement.relative_pose_error import trajectory_drift
from stages.kit.progress import SilentProgress
from stages.kit.stage import Context
from stages.poses.alignment import judge
from stages.poses.parameters import PosesParameters
from stages.poses.pyramid import build_pyramid
from stages.poses.stage import run as estimate_poses
from stages.poses.world import laid_onto

RECIPES = ("room", "kitchen", "office", "bedroom")
REPORTING_SEEDS = range(1100, 1106)
"""In the reporting range of the recipes; nothing was tuned on them."""
REAL = {
    "7scenes_kitchen": "7scenes_redkitchen",
    "redwood_livingroom": "redwood_livingroom1",
    "diningroom": "slambook2_rgbd/diningroom",
}
INTRINSICS = {"diningroom": ("--fx", "518", "--fy", "519", "--cx", "325.5", "--cy", "253.5")}
ARMS: dict[str, PosesParameters | None] = {
    "odometry": PosesParameters(loop_closure=False),  # type: ignore[call-arg]
    "ours": PosesParameters(),  # type: ignore[call-arg]
    "ours_bundle": PosesParameters(bundle_adjustment=True),  # type: ignore[call-arg]
    "ours_depth": PosesParameters(use_color=False),  # type: ignore[call-arg]
    "sfm": PosesParameters(method="sfm"),  # type: ignore[call-arg]
    "open3d": None,
}
QUICK_ARMS = ("odometry", "ours")
CORRUPTION = "0.2"
MEASURES = (
    "ate_m", "rpe_second_m", "rpe_second_rad", "rpe_metre_m", "fit_m", "epipolar_rad", "posed_share", "loops",
    "frames_per_cpu_second", "frames_per_second",
)  # fmt: skip
EPIPOLAR_EVERY, EPIPOLAR_GAP, EPIPOLAR_MATCHES = 12, 25, 40
"""`epipolar_rad`: the turn between frames so far apart, against that which their features say by epipolar geometry,
beginning at every so many-th frame and with at least so many matches that agree; neither depth nor truth is needed."""
FIT_PAIRS, FIT_GAP = 30, 15
"""`fit_m`: depth against depth of so many pairs of frames so far apart, with the poses as they are; no truth needed."""


@dataclass(frozen=True)
class Log:
    """One log, ingested."""

    name: str
    sequence: Sequence
    ground_truth: GroundTruth | None

    def given(self) -> tuple[np.ndarray, np.ndarray]:
        """Times (N,) and poses (N, 4, 4) to compare with."""
        return read_tum(self.sequence.path("trajectory.tum"))


def made(arguments: list[str], out: Path) -> Path:
    """Run a scenewright command that writes `out` (nothing happens when it is up to date)."""
    code, _ = run_command([*arguments, "--out", str(out), "--quiet"])
    if code != 0:
        sys.exit(f"{' '.join(arguments)} exited with {code}")
    return out


def logs_of(arguments: argparse.Namespace) -> list[Log]:
    """Ingest the real logs, generate and ingest the rooms."""
    wanted: Callable[[str], bool] = lambda name: not arguments.only or name in arguments.only  # noqa: E731
    folder, logs = arguments.out / "logs", []
    for name, where in REAL.items():
        log = arguments.data / where
        if log.is_dir() and wanted(name) and ((folder / name).is_dir() or not arguments.kept_only):
            made(["ingest", "--log", str(log), *INTRINSICS.get(name, ())], folder / name)
            logs.append(Log(name, open_artifact(folder / name, Sequence), None))  # type: ignore[arg-type]
    rooms = [(RECIPES[k % len(RECIPES)], seed) for k, seed in enumerate(REPORTING_SEEDS)]
    number = arguments.frames or (240 if arguments.quick else 400)
    frames = ["--frames", str(number), "--width", "320", "--height", "240"]
    for recipe, seed in rooms[: arguments.rooms or (1 if arguments.quick else len(rooms))]:
        name = f"{recipe}_{seed}"
        if not wanted(name) or (arguments.kept_only and not (folder / name).is_dir()):
            continue
        library = made(["library", "build", "--seed", "1"], folder / "library")
        synthesize = ["synthesize", "--library", str(library), "--recipe", recipe, "--seed", str(seed), *frames]
        truth = made(synthesize, folder / f"{name}_truth")
        made(["ingest", "--log", f"{truth}/log.mcap"], folder / name)
        logs.append(Log(name, open_artifact(folder / name, Sequence), open_artifact(truth, GroundTruth)))  # type: ignore[arg-type]
    return logs


def code_of(*steps: str) -> str:
    """Return a digest of the source of these steps, which says whether a kept result is still theirs."""
    stages, digest = Path(__file__).resolve().parents[2] / "stages", hashlib.sha256()
    for step in steps:
        for file in sorted((stages / step).rglob("*.py")):
            digest.update(file.read_bytes())
    return digest.hexdigest()[:16]


Row = dict[str, float | None]


class Kept:
    """Figures in files, each with the digest of the code that they were measured with."""

    def __init__(self, fresh: bool, only: bool) -> None:
        self._fresh, self._only = fresh, only

    def get(self, file: Path, code: str, measure: Callable[[], Row]) -> Row | None:
        """Return the figures that `file` keeps of this code, else measure and keep them; None with --kept-only."""
        if file.is_file() and not self._fresh:
            kept = json.loads(file.read_text())
            if kept.get("code") == code:
                return dict(kept["figures"])
        if self._only:
            return None
        figures = measure()
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(json.dumps({"code": code, "figures": figures}))
        return figures


def run_arm(log: Log, arm: str, output: Path) -> Row:
    """Estimate the poses of a log into `output` and measure them."""
    if output.exists():
        shutil.rmtree(output)
    output.mkdir(parents=True)
    parameters = ARMS[arm]
    cpu, wall = time.process_time(), time.perf_counter()
    loops = 0
    if parameters is None:
        frames = open3d_odometry(log.sequence, output)
    else:
        context = Context(output, seed=0, device="cpu", progress=SilentProgress())
        info = estimate_poses(log.sequence, parameters=parameters, context=context).info
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


def depth_fit(sequence: Sequence, times: np.ndarray, poses: np.ndarray) -> float | None:
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


def epipolar_turns(sequence: Sequence) -> list[list[float]]:
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


def open3d_odometry(sequence: Sequence, output: Path) -> int:
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
            image = RGBDImage(Image(o3c.Tensor(color)), Image(o3c.Tensor(depth)))
            if previous is not None:
                found = odometry.rgbd_odometry_multi_scale(
                    image, previous, o3c.Tensor(matrix), o3c.Tensor(np.eye(4)), 1.0, 4.5, criteria,
                    odometry.Method.Hybrid, losses,
                )  # fmt: skip
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


def draw_paths(log: Log, paths: dict[str, Path], file: Path) -> None:
    """Draw the paths from above, each aligned with the given one."""
    times, given = log.given()
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(figsize=(6.0, 5.2))
        axes.plot(given[:, 0, 3], given[:, 1, 3], color="#222222", linewidth=2.2, label="given")
        for (name, path), color in zip(paths.items(), SERIES_COLORS, strict=False):
            own, poses = read_tum(path / "trajectory.tum")
            true_rows, rows = associate(times, own)
            if len(rows) < 3:
                continue
            centres = apply(align_rigidly(poses[rows, :3, 3], given[true_rows, :3, 3]), poses[:, :3, 3])
            axes.plot(centres[:, 0], centres[:, 1], color=color, linewidth=1.1, label=name)
        axes.set_aspect("equal")
        axes.set_xlabel("x [m]")
        axes.set_ylabel("y [m]")
        axes.set_title(f"{log.name}: camera path from above")
        axes.legend()
        file.parent.mkdir(parents=True, exist_ok=True)
        save(figure, file)


def map_quality(log: Log, paths: dict[str, Path], out: Path, keeper: Kept) -> dict[str, Row]:
    """Return panoptic quality of maps fused with exact, estimated and drifting poses (true masks, corruption 0.2)."""
    folder = out / "maps" / log.name
    command = ["segment", "--sequence", str(log.sequence.root), "--backend", "ground-truth", "--corruption", CORRUPTION]
    segments = open_artifact(made(command, folder / "segments"), Segments)
    trajectories: dict[str, Path | None] = {"exact": None, **paths, "drifting": drifting_path(log, folder)}
    code, results = code_of("poses", "fuse", "evaluate"), {}
    for name, path in trajectories.items():

        def measure(output: Path = folder / name, path: Path | None = path) -> Row:
            return map_figures(log, segments, path, output)  # type: ignore[arg-type]

        found = keeper.get(folder / f"{name}.json", code, measure)
        if found is None:
            continue
        results[name] = found
        print(f"{log.name:20} map {name:12} {results[name]}", file=sys.stderr, flush=True)
    return results


def drifting_path(log: Log, folder: Path) -> Path:
    """Write the given poses with the mapping benchmark's drift, laid onto the given ones; return their folder."""
    times, given = log.given()
    output = folder / "drifting_path"
    output.mkdir(parents=True, exist_ok=True)
    drifted = drifting_poses(given, np.random.default_rng(0))
    drifted = laid_onto(drifted, given) @ drifted
    write_tum(output / "trajectory.tum", times, np.array([orthonormal(pose) for pose in drifted]))
    return output


def map_figures(log: Log, segments: Segments, path: Path | None, output: Path) -> Row:
    """Fuse with the poses in the folder `path` (None: the sequence's own), evaluate, return the figures."""
    assert log.ground_truth is not None
    for part in ("map", "evaluation"):
        shutil.rmtree(output / part, ignore_errors=True)
        (output / part).mkdir(parents=True)
    trajectory = None if path is None else Trajectory(path)
    progress = SilentProgress()
    fused = fuse(
        log.sequence, segments, trajectory,
        parameters=FuseParameters(), context=Context(output / "map", 0, "cpu", progress),  # type: ignore[call-arg]
    )  # fmt: skip
    evaluate(
        log.ground_truth, log.sequence, trajectory, None, fused,
        parameters=EvaluateParameters(plots=False),  # type: ignore[call-arg]
        context=Context(output / "evaluation", 0, "cpu", progress),
    )  # fmt: skip
    metrics = json.loads((output / "evaluation" / "metrics.json").read_text())["metrics"]
    return {
        "pq": metrics["map/pq"],
        "accuracy_mm": metrics["map/accuracy_mean_mm"],
        "ate_m": metrics.get("trajectory/ate_rmse_aligned_m") if path is not None else 0.0,
    }


def table(rows: dict[str, dict[str, Row]], maps: dict[str, dict[str, Row]]) -> str:
    """Return the Markdown tables."""
    header = [
        "log",
        "arm",
        "ATE [cm]",
        "RPE [cm/s]",
        "RPE [deg/s]",
        "RPE [cm/m]",
        "fit [mm]",
        "epipolar [deg]",
        "posed",
        "loops",
        "frames/CPU s",
        "frames/s",
    ]
    lines = ["| " + " | ".join(header) + " |", "|" + "---|" * len(header)]
    degrees = float(np.degrees(1.0))
    scales = (100.0, 100.0, degrees, 100.0, 1000.0, degrees, 100.0, 1.0, 1.0, 1.0)
    digits = (2, 2, 2, 2, 2, 2, 0, 0, 1, 1)
    for log, arms in rows.items():
        for arm, row in arms.items():
            cells = [_cell(row.get(name), scale, k) for name, scale, k in zip(MEASURES, scales, digits, strict=True)]
            cells[6] += " %" if cells[6] else ""
            lines.append("| " + " | ".join([log, arm, *cells]) + " |")
    generated = {log: arms for log, arms in rows.items() if log not in REAL}
    for arm in next(iter(generated.values()), {}):
        found = [arms[arm].get("ate_m") for arms in generated.values() if arm in arms]
        values = [value for value in found if value is not None]
        if len(values) > 1:
            text = f"{100 * float(np.median(values)):.2f}, worst {100 * max(values):.2f}"
            lines.append(f"| {len(values)} generated rooms | {arm} | median {text} |" + " |" * 9)
    for log, arms in maps.items():
        lines += ["", f"Map of {log}, true masks with corruption {CORRUPTION}, 2 cm voxels:", ""]
        lines += ["| poses | ATE [cm] | PQ | surface error [mm] |", "|---|---|---|---|"]
        for arm, row in arms.items():
            cells = [_cell(row["ate_m"], 100, 2), _cell(row["pq"], 100, 1), _cell(row["accuracy_mm"], 1, 1)]
            lines.append("| " + " | ".join([arm, *cells]) + " |")
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    return "\n".join([*lines, "", f"Peak memory of the benchmark's process: {memory:.0f} MiB."]) + "\n"


def _cell(value: float | None, scale: float, digits: int) -> str:
    return "" if value is None else f"{value * scale:.{digits}f}"


def main() -> int:
    """Estimate, measure, draw, print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", type=Path, default=Path("../shared/data"), help="folder with the real logs")
    parser.add_argument("--out", type=Path, default=Path("outputs/experiments/bench-poses"))
    parser.add_argument("--quick", action="store_true", help="one generated room, the arms odometry and ours")
    parser.add_argument("--only", nargs="*", help="only these logs")
    parser.add_argument("--arms", nargs="*", choices=list(ARMS), help="only these arms")
    parser.add_argument("--rooms", type=int, choices=range(1, len(REPORTING_SEEDS) + 1), help="so many generated rooms")
    parser.add_argument("--frames", type=int, help="frames of a generated room (400; 240 with --quick)")
    parser.add_argument("--fresh", action="store_true", help="measure again what is there already")
    parser.add_argument("--kept-only", action="store_true", help="measure nothing: tabulate what is there")
    parser.add_argument("--no-map", action="store_true", help="leave out the maps")
    arguments = parser.parse_args()
    arms = arguments.arms or (QUICK_ARMS if arguments.quick else tuple(ARMS))
    keeper = Kept(arguments.fresh, arguments.kept_only)
    rows: dict[str, dict[str, Row]] = {}
    maps: dict[str, dict[str, Row]] = {}
    for log in logs_of(arguments):
        rows[log.name], paths, folder = {}, {}, arguments.out / "paths" / log.name

        def given_fit(log: Log = log) -> Row:
            return {"fit_m": depth_fit(log.sequence, *log.given())}

        fit = keeper.get(folder / "given.json", code_of("poses"), given_fit)
        rows[log.name]["given"] = fit or {}
        for arm in arms:

            def measure(log: Log = log, arm: str = arm, output: Path = folder / arm) -> Row:
                return run_arm(log, arm, output)

            code = code_of("poses") if ARMS[arm] is not None else "open3d"
            found = keeper.get(folder / f"{arm}.json", code, measure)
            if found is None:
                continue
            rows[log.name][arm], paths[arm] = found, folder / arm
            print(f"{log.name:20} {arm:12} {rows[log.name][arm]}", file=sys.stderr, flush=True)
        folder.mkdir(parents=True, exist_ok=True)
        kept = folder / "epipolar.json"
        if arguments.fresh or not kept.is_file():
            kept.write_text(json.dumps(epipolar_turns(log.sequence)))
        with FrameReader(log.sequence.path("frames.mcap")) as reader:
            frame_times = reader.times
        for arm, row in rows[log.name].items():
            path = log.given() if arm == "given" else read_tum(paths[arm] / "trajectory.tum")
            row["epipolar_rad"] = epipolar_disagreement(json.loads(kept.read_text()), frame_times, *path)
        draw_paths(log, paths, arguments.out / "plots" / f"{log.name}.png")
        if log.ground_truth is not None and not maps and not arguments.no_map:
            chosen = {arm: path for arm, path in paths.items() if arm in ("ours", "odometry", "sfm")}
            maps[log.name] = map_quality(log, chosen, arguments.out, keeper)
    metrics = {
        f"{arm}/{log}/{measure}": value
        for log, found in rows.items()
        for arm, figures in found.items()
        for measure, value in figures.items()
        if value is not None
    }
    metrics |= {
        f"{arm}/map_{log}/{measure}": value
        for log, found in maps.items()
        for arm, figures in found.items()
        for measure, value in figures.items()
        if value is not None
    }
    arguments.out.mkdir(parents=True, exist_ok=True)
    (arguments.out / "metrics.json").write_text(json.dumps(metrics, indent=1, sort_keys=True) + "\n")
    (arguments.out / "table.md").write_text(table(rows, maps))
    print(table(rows, maps))
    return 0


if __name__ == "__main__":
    sys.exit(main())
