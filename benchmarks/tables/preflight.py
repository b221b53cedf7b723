"""`scenewright inspect` against faults that were planted: what is detected, what is named, what is a false alarm.

Every log is opened once a fault, the fault is put into its frames in memory, and the pre-flight judges it. Logs: MCAP
files of generated rooms (made below `--out` unless `--rooms` has some), and the real logs of
benchmarks/expectations/real.toml (`--data`). Writes metrics.json and table.md.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
import tomllib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from schemas.scene_parts import Camera
from stages.engine.chain import run_command
from stages.ingest.detection import open_log
from stages.ingest.parameters import IngestParameters
from stages.ingest.pose_conventions import BODY_FROM_OPTICAL, MIRROR_Y, OPENGL_AXES
from stages.ingest.preflight.inspection import inspect_source
from stages.ingest.preflight.report import CameraReport, InspectionReport
from stages.ingest.source import Entry, LoadedFrame, LogSource
from stages.kit.geometry.transforms import inverse, quaternion_of, transform_from_quaternion
from stages.kit.progress import SilentProgress

EXPECTATIONS = Path(__file__).resolve().parent.parent / "expectations" / "real.toml"
REPORTED_SEEDS = range(200, 212)
"""Rooms that no threshold was set on."""
RECIPES = ("room", "kitchen", "office", "bedroom")
Fault = Callable[[LogSource], LogSource]
Named = Callable[[CameraReport], bool]


def on_poses(change: Callable[[np.ndarray], np.ndarray]) -> Fault:
    """A fault of every pose for itself."""

    def planted(source: LogSource) -> LogSource:
        return replace(source, entries=tuple(_posed(entry, change) for entry in source.entries))

    return planted


def _posed(entry: Entry, change: Callable[[np.ndarray], np.ndarray]) -> Entry:
    return (
        entry if entry.world_from_camera is None else replace(entry, world_from_camera=change(entry.world_from_camera))
    )


def reordered(order: tuple[int, int, int, int]) -> Callable[[np.ndarray], np.ndarray]:
    """Poses whose quaternion was written with one order and read with another."""
    return lambda pose: transform_from_quaternion(quaternion_of(pose)[list(order)], pose[:3, 3])


def stretched(factor: float) -> Callable[[np.ndarray], np.ndarray]:
    """Poses with longer translations."""

    def change(pose: np.ndarray) -> np.ndarray:
        result = pose.copy()
        result[:3, 3] *= factor
        return result

    return change


def shifted_poses(frames: int) -> Fault:
    """Every frame has the pose of an earlier one."""

    def planted(source: LogSource) -> LogSource:
        poses = [entry.world_from_camera for entry in source.entries]
        entries = [replace(e, world_from_camera=poses[max(k - frames, 0)]) for k, e in enumerate(source.entries)]
        return replace(source, entries=tuple(entries))

    return planted


def frozen(source: LogSource) -> LogSource:
    """Every frame has the first pose."""
    first = source.entries[0].world_from_camera
    return replace(source, entries=tuple(replace(entry, world_from_camera=first) for entry in source.entries))


def shaken(source: LogSource) -> LogSource:
    """Poses with 10 cm of noise."""
    random = np.random.default_rng(0)

    def change(pose: np.ndarray) -> np.ndarray:
        result = pose.copy()
        result[:3, 3] += random.normal(0, 0.1, 3)
        return result

    return on_poses(change)(source)


def scaled_depth(factor: float) -> Fault:
    """Depth in another unit, as the 16-bit millimetres of ingest hold it."""

    def change(frame: LoadedFrame) -> LoadedFrame:
        assert frame.depth is not None
        values = np.rint(frame.depth * factor)
        return replace(frame, depth=np.where(values < 65535, values, 0).astype(np.uint16))

    def planted(source: LogSource) -> LogSource:
        entries = [replace(e, load=lambda e=e: change(e.load())) for e in source.entries]  # type: ignore[misc]
        return replace(source, entries=tuple(entries))

    return planted


def shifted_color(frames: int) -> Fault:
    """Every frame has the colour of an earlier one."""

    def planted(source: LogSource) -> LogSource:
        entries = list(source.entries)

        def load(index: int) -> LoadedFrame:
            other = entries[int(np.clip(index - frames, 0, len(entries) - 1))]
            return replace(entries[index].load(), color=other.load().color)

        shifted = [replace(entry, load=lambda k=k: load(k)) for k, entry in enumerate(entries)]  # type: ignore[misc]
        return replace(source, entries=tuple(shifted))

    return planted


def other_camera(change: Callable[[Camera], dict[str, float]]) -> Fault:
    """Intrinsics that are not those of the images."""

    def planted(source: LogSource) -> LogSource:
        cameras = [replace(c, camera=c.camera.model_copy(update=change(c.camera))) for c in source.cameras]
        return replace(source, cameras=tuple(cameras))

    return planted


def best_is(convention: str, scale: float = 1.0) -> Named:
    """Whether the pre-flight is decided about a reading of the poses."""

    def named(report: CameraReport) -> bool:
        best = report.poses.best
        return bool(
            best is not None
            and report.poses.decisive
            and best.convention == convention
            and abs(best.translation_scale / scale - 1) < 0.15
        )

    return named


def depth_times(factor: float) -> Named:
    """Whether the pre-flight says that depth must be multiplied by a factor."""
    return lambda report: (
        report.depth is not None and report.depth.factor is not None and abs(report.depth.factor / factor - 1) < 0.15
    )


def doubled(camera: Camera) -> dict[str, float]:
    """Intrinsics of the camera at twice its resolution."""
    return {"fx": 2 * camera.fx, "fy": 2 * camera.fy, "cx": 2 * camera.cx + 0.5, "cy": 2 * camera.cy + 0.5}


FAULTS: dict[str, tuple[Fault, Named]] = {
    "inverse poses": (on_poses(inverse), best_is("inverse")),
    "OpenGL axes": (on_poses(lambda pose: pose @ OPENGL_AXES), best_is("opengl")),
    "OpenGL view matrices": (on_poses(lambda pose: OPENGL_AXES @ inverse(pose)), best_is("inverse-opengl")),
    "ROS body axes": (on_poses(lambda pose: pose @ inverse(BODY_FROM_OPTICAL)), best_is("ros-body")),
    "left-handed": (on_poses(lambda pose: MIRROR_Y @ pose @ MIRROR_Y), best_is("left-handed")),
    "quaternion w first": (on_poses(reordered((3, 0, 1, 2))), best_is("quaternion-wxyz")),
    "translations x10": (on_poses(stretched(10)), best_is("as-is", 0.1)),
    "translations /10": (on_poses(stretched(0.1)), best_is("as-is", 10)),
    "translations x1000": (on_poses(stretched(1000)), best_is("as-is", 0.001)),
    "translations x0.37": (on_poses(stretched(0.37)), best_is("as-is", 1 / 0.37)),
    "OpenGL and mm": (on_poses(lambda pose: stretched(1000)(pose @ OPENGL_AXES)), best_is("opengl", 0.001)),
    "depth x5 (5000 as mm)": (scaled_depth(5.0), depth_times(0.2)),
    "depth /5 (mm as 5000)": (scaled_depth(0.2), depth_times(5.0)),
    "depth x10 (0.1 mm as mm)": (scaled_depth(10.0), depth_times(0.1)),
    "colour 3 frames late": (
        shifted_color(3),
        lambda r: r.registration.lag_decisive and abs((r.registration.lag_frames or 0) - 3) < 0.75,
    ),
    "poses 3 frames late": (
        shifted_poses(3),
        lambda r: r.poses.lag_frames is not None and r.poses.lag_frames in (2, 3, 4),
    ),
    "intrinsics of twice the size": (other_camera(doubled), lambda r: not r.calibration.plausible),
    "focal length x1.3": (
        other_camera(lambda c: {"fx": 1.3 * c.fx, "fy": 1.3 * c.fy}),
        lambda r: r.calibration.focal_fit is not None and 0.7 < r.calibration.focal_fit < 0.85,
    ),
    "poses frozen": (frozen, lambda r: r.poses.verdict == "contradict" and "camera moves" in r.poses.detail),
    "poses with 10 cm noise": (shaken, lambda r: r.poses.verdict in ("contradict", "doubtful")),
}
"""Name -> (what is planted, whether a report names it)."""
NOTHING = "nothing"


def judge(log: Path, parameters: IngestParameters, fault: Fault | None, frames: int) -> tuple[InspectionReport, float]:
    """Inspect a log with a fault; return the report and the CPU seconds it took."""
    source = open_log(log, parameters)
    try:
        started = time.process_time()
        planted = fault(source) if fault else source
        found = inspect_source(planted, log, parameters, frames, SilentProgress())
        return found.report, time.process_time() - started
    finally:
        source.close()


def row_of(report: InspectionReport, seconds: float, named: Named | None) -> dict[str, Any]:
    """What is kept of one inspection."""
    return {
        "verdict": report.verdict,
        "detected": report.verdict != "ready",
        "named": bool(named and named(report.cameras[0])),
        "reason": report.reason,
        "seconds": round(seconds, 2),
    }


def make_rooms(folder: Path, seeds: range) -> None:
    """Generate the rooms that are missing in `folder`, one of the four recipes after the other."""
    commands = [["library", "build", "--seed", "1", "--out", f"{folder}/library"]]
    for seed in seeds:
        size = ["--frames", "240", "--width", "320", "--height", "240"]
        recipe = ["--recipe", RECIPES[seed % len(RECIPES)], "--library", f"{folder}/library"]
        commands.append(["synthesize", *recipe, *size, "--seed", str(seed), "--out", f"{folder}/{seed}"])
    for command in commands:
        code, _ = run_command([*command, "--quiet"])
        if code != 0:
            sys.exit(f"{' '.join(command)} exited with {code}")


def logs_of(arguments: argparse.Namespace) -> dict[str, tuple[Path, IngestParameters]]:
    """Name -> (path, options) of every log that is there."""
    logs = {}
    if arguments.rooms.is_dir():
        for folder in sorted(arguments.rooms.iterdir()):
            if (folder / "log.mcap").exists() and (not arguments.only or folder.name in arguments.only):
                logs[f"room {folder.name}"] = (folder / "log.mcap", IngestParameters())  # type: ignore[call-arg]
    if arguments.data:
        for name, expected in tomllib.loads(EXPECTATIONS.read_text()).items():
            if not expected["log"].startswith("@") and (not arguments.only or name in arguments.only):
                settings = {key: float(value) for key, value in expected.get("settings", {}).items()}
                logs[name] = (arguments.data / expected["log"], IngestParameters(**settings))  # type: ignore[arg-type]
    return logs


def table(rows: dict[str, dict[str, dict[str, Any]]]) -> str:
    """Return the Markdown table: a line per fault, generated rooms together, real logs one by one."""
    real = [name for name in rows if not name.startswith("room ")]
    rooms = [name for name in rows if name.startswith("room ")]
    lines = ["| planted | " + " | ".join([f"{len(rooms)} generated rooms", *real]) + " |"]
    lines.append("|" + "---|" * (len(real) + 2))
    for fault in [NOTHING, *FAULTS]:
        cells = []
        found = [rows[name][fault] for name in rooms if fault in rows[name]]
        if fault == NOTHING:
            cells.append(f"{sum(r['detected'] for r in found)} false alarms")
            cells += [rows[name][fault]["verdict"] for name in real]
        else:
            detected, named = (sum(r[key] for r in found) for key in ("detected", "named"))
            cells.append(f"{detected} detected, {named} named")
            cells += [_cell(rows[name].get(fault)) for name in real]
        lines.append(f"| {fault} | " + " | ".join(cells) + " |")
    seconds = [row["seconds"] for faults in rows.values() for row in faults.values()]
    lines += [
        "",
        f"{len(seconds)} inspections, {np.median(seconds):.1f} s of CPU median, {max(seconds):.1f} s at most.",
    ]
    return "\n".join(lines) + "\n"


def _cell(row: dict[str, Any] | None) -> str:
    if row is None:
        return ""
    return "named" if row["named"] else "detected" if row["detected"] else "**missed**"


def main() -> int:
    """Plant, inspect, print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rooms", type=Path, help="folder with ground_truth artifacts; default: made in OUT/rooms")
    parser.add_argument("--quick", action="store_true", help="three rooms instead of twelve")
    parser.add_argument("--data", type=Path, help="folder with the real logs")
    parser.add_argument("--out", type=Path, default=Path("outputs/experiments/bench-preflight"))
    parser.add_argument("--frames", type=int, default=60)
    parser.add_argument("--only", nargs="*", help="only these rooms or logs")
    parser.add_argument("--faults", nargs="*", help="only these faults")
    arguments = parser.parse_args()
    if arguments.rooms is None:
        arguments.rooms = arguments.out / "rooms"
        make_rooms(arguments.rooms, REPORTED_SEEDS[:3] if arguments.quick else REPORTED_SEEDS)
    rows: dict[str, dict[str, dict[str, Any]]] = {}
    for name, (log, parameters) in logs_of(arguments).items():
        rows[name] = {}
        for fault, (plant, named) in {NOTHING: (None, None), **FAULTS}.items():
            if arguments.faults and fault not in arguments.faults:
                continue
            report, seconds = judge(log, parameters, plant, arguments.frames)
            row = rows[name][fault] = row_of(report, seconds, named)
            mark = "named" if row["named"] else "found" if row["detected"] else "-"
            print(f"{name:14} {fault:28} {mark:6} {seconds:5.1f} s  {row['reason'][:150]}", file=sys.stderr, flush=True)
    arguments.out.mkdir(parents=True, exist_ok=True)
    metrics = {
        f"{name}/{fault}/{key}": float(row[key])
        for name, faults in rows.items()
        for fault, row in faults.items()
        for key in ("detected", "named", "seconds")
    }
    (arguments.out / "metrics.json").write_text(json.dumps(metrics, indent=1, sort_keys=True) + "\n")
    (arguments.out / "reasons.json").write_text(json.dumps(rows, indent=1, sort_keys=True) + "\n")
    (arguments.out / "table.md").write_text(table(rows))
    print(table(rows))
    return 0


if __name__ == "__main__":
    sys.exit(main())
