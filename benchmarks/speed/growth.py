"""What a frame costs while the map grows, and what holds the memory: `fuse` by part, 100 to 3,000 frames, 5 to 200 m^2.

    python -m benchmarks.speed.growth [--out FOLDER] [--quick]

A camera walks down an endless furnished corridor (benchmarks/speed/corridor.py), 15 frames a square metre of floor.
Arms: `growing` walks on; `standing` sees the same cell again and again (a third of the frames), so that the log grows
and the map does not.
Every case runs in a process of its own. Times are processor time, which other work on the machine hardly changes;
frames/s on a quiet machine are 1000 / wall_ms. Memory is the growth of the peak over what the process held before the
first frame (libraries loaded, kernels compiled, frames in memory). Parts of `fuse`: overlap (which voxels of the map
lie under a frame's segments), labels (association, counts, merging of segments), integration, regularisation (merging
of instances, every 10 frames), extraction (once, at the end: surface, entities, files). `segment` without its network:
geometric segments, and their fusion with the masks.
"""

from __future__ import annotations

import json
import os
import platform
import subprocess
import sys
import tempfile
import time
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import Field
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.kit.measurement.tables import Table, as_markdown
from scenewright.stages.kit.progress import SilentProgress
from scenewright.stages.kit.stage import Context

from benchmarks.options import Measurement, asked
from benchmarks.results import write_measured
from benchmarks.speed.corridor import (
    AREA,
    CAMERA,
    PER_CELL,
    RANGE,
    CorridorFrame,
    load_frames,
    make_frames,
    moved,
    save_frames,
)
from benchmarks.speed.fusion import memory, reset_peak

REPOSITORY = Path(__file__).resolve().parents[2]
DISTINCT = 50
"""Frames that are rendered."""
REPEATS = 3
"""How often each is fused before the camera goes on: a slow walk at 30 Hz."""
CURVES = ("growing", "standing")
PARTS = ("overlap", "labels", "integration", "regularisation")
CASES = {"2cm": (0.02, 3000), "1cm": (0.01, 600)}
"""Voxel size [m] and frames; 1 cm needs eight times the memory and goes to 40 m^2."""
QUICK = {"2cm": (0.02, 300)}
WINDOWS = 12
"""Points of the curve."""
FLAT = 1.5
"""A frame at the end may cost this times one at the beginning."""


class Timers:
    """Processor seconds by part; wraps functions of a module so that their time is counted."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = dict.fromkeys((*PARTS, "whole", "wall"), 0.0)

    def wrap(self, owner: Any, name: str, part: str) -> None:
        """Replace `owner.name` by the same function, timed."""
        inner: Callable[..., Any] = getattr(owner, name)

        def timed(*arguments: Any, **named: Any) -> Any:
            start = time.process_time()
            try:
                return inner(*arguments, **named)
            finally:
                self.seconds[part] += time.process_time() - start

        setattr(owner, name, timed)

    def taken(self) -> dict[str, float]:
        """Return what was counted, and begin again."""
        result, self.seconds = self.seconds, dict.fromkeys(self.seconds, 0.0)
        return result


def frame_at(frames: list[CorridorFrame], number: int, standing: bool) -> tuple[CorridorFrame, np.ndarray]:
    """Return frame `number` of the walk and its pose."""
    place, cell = (number // REPEATS) % len(frames), number // (REPEATS * len(frames))
    frame = frames[place]
    return frame, moved(frame.pose, 0 if standing else cell)


def fuse_walk(frames: list[CorridorFrame], voxel_size: float, count: int, standing: bool) -> list[dict[str, float]]:
    """Fuse `count` frames; return one row of figures for each window of the walk, the last with the extraction."""
    from scenewright.stages.fuse import mapping
    from scenewright.stages.fuse.closing import MaskSource
    from scenewright.stages.fuse.ours import Ours
    from scenewright.stages.fuse.parameters import FuseParameters
    from scenewright.stages.fuse.stage import new_mapper, write_map

    timers = Timers()
    for name in ("index_segments", "measure_overlap"):
        timers.wrap(mapping, name, "overlap")
    timers.wrap(mapping, "integrate", "integration")
    timers.wrap(mapping.PanopticMapper, "regularize", "regularisation")
    timers.wrap(mapping.PanopticMapper, "_associate", "labels")
    options = FuseParameters.model_validate({"voxel_size": voxel_size, "maximum_depth": RANGE})

    def extract(mapper: mapping.PanopticMapper) -> int:
        with tempfile.TemporaryDirectory() as folder:
            context = Context(Path(folder), seed=0, device="cpu", progress=SilentProgress())
            return int(write_map(mapper, load_vocabulary(), MaskSource("benchmark"), {}, context).summary["entities"])

    def add(mapper: mapping.PanopticMapper, number: int) -> None:
        frame, pose = frame_at(frames, number, standing)
        mapper.add_frame(CAMERA, frame.depth, frame.color, pose, frame.ids, frame.listing)

    warm = new_mapper(options.model_copy(update={"voxel_size": 0.08}), load_vocabulary())
    for number in range(12):
        add(warm, number)
    extract(warm)
    del warm
    timers.taken()
    reset_peak()
    before = memory("VmRSS")
    merging = Ours(options, frozenset(entry.id for entry in load_vocabulary().classes if entry.kind == "thing"))
    mapper = mapping.PanopticMapper(options, merging)
    rows = []
    edges = np.unique(np.linspace(0, count, WINDOWS + 1).astype(int))
    for start, end in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
        slowest = 0.0
        for number in range(start, end):
            wall, processor = time.perf_counter(), time.process_time()
            add(mapper, number)
            spent = time.process_time() - processor
            slowest = max(slowest, spent)
            timers.seconds["whole"] += spent
            timers.seconds["wall"] += time.perf_counter() - wall
        taken = timers.taken()
        taken["labels"] -= taken["overlap"]  # it is called in there
        cells = 1.0 if standing else end / (REPEATS * len(frames))
        rows.append(
            {
                "frames": float(end),
                "area_m2": cells * AREA,
                "frame_ms": 1000 * taken["whole"] / (end - start),
                "wall_ms": 1000 * taken["wall"] / (end - start),
                "slowest_ms": 1000 * slowest,
                **{f"{part}_ms": 1000 * taken[part] / (end - start) for part in PARTS},
                "memory_mb": memory("VmHWM") - before,
                "blocks": float(mapper.blocks.count),
                "segment_labels": float(len(mapper.labels.table()) - 1),
                "segments_counted": float(len(merging.counts.by_segment)),
                "pairs": float(len(merging.shared.together) + sum(map(len, merging.shared.apart.values())) // 2),
            }
        )
    start_extraction = time.process_time()
    rows[-1]["entities"] = float(extract(mapper))
    rows[-1]["extraction_s"] = time.process_time() - start_extraction
    rows[-1]["memory_with_extraction_mb"] = memory("VmHWM") - before
    return rows


def segment_parts(frames: list[CorridorFrame]) -> dict[str, float]:
    """Return processor ms a frame of `segment` without its network, by part, and the peak memory [MB]."""
    from scenewright.stages.segment.fusion_ours import fuse
    from scenewright.stages.segment.geometric import segment_depth
    from scenewright.stages.segment.parameters import SegmentParameters
    from scenewright.stages.segment.settings import fusion_settings, geometric_settings

    options = SegmentParameters.model_validate({})
    reset_peak()
    before = memory("VmRSS")
    taken = {"geometric": 0.0, "fusion": 0.0, "wall": 0.0}
    for frame in frames:
        wall, start = time.perf_counter(), time.process_time()
        geometric = segment_depth(frame.depth, CAMERA, geometric_settings(options))
        middle = time.process_time()
        fuse(geometric.labels, frame.masks, geometric.points, fusion_settings(options))
        taken["geometric"] += middle - start
        taken["fusion"] += time.process_time() - middle
        taken["wall"] += time.perf_counter() - wall
    milliseconds = {f"{part}_ms": 1000 * seconds / len(frames) for part, seconds in taken.items()}
    return {
        **milliseconds,
        "frame_ms": milliseconds["geometric_ms"] + milliseconds["fusion_ms"],
        "memory_mb": memory("VmHWM") - before,
    }


def listing_memory(frames: list[CorridorFrame], count: int) -> dict[str, float]:
    """Return what the list of segments of a log of `count` frames takes once `fuse` has read it, and while it reads,
    before there is a map [MB]: the one thing that it holds of every frame."""
    from scenewright.schemas.segments import FrameSegments, SegmentsFile
    from scenewright.stages.fuse.listings import Listings

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "segments.json"
        entries = (FrameSegments(frame=k, segments=frames[k % len(frames)].listing) for k in range(count))
        with path.open("w") as file:
            head = {"backend": "ground-truth", "label": "", "width": CAMERA.width, "height": CAMERA.height}
            file.write(json.dumps(head)[:-1] + ', "frames": [')
            for k, entry in enumerate(entries):
                file.write(("," if k else "") + entry.model_dump_json())
            file.write("]}")
        tracemalloc.start()
        listed = Listings(SegmentsFile.read(path))
        kept, peak = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        segments = sum(len(listed.get(k) or ()) for k in range(count))
        megabyte = 2.0**20
        return {
            "frames": float(count),
            "segments": float(segments),
            "memory_mb": kept / megabyte,
            "peak_mb": peak / megabyte,
        }


def worker(arm: str, case: str, folder: Path, quick: bool) -> list[dict[str, float]]:
    """Run one arm in one case on the frames of a folder; this is what a subprocess does."""
    frames = load_frames(folder)
    if arm == "segment":
        segment_parts(frames[:2])
        return [segment_parts(frames)]
    if arm == "listing":
        return [listing_memory(frames, (QUICK if quick else CASES)["2cm"][1])]
    voxel_size, count = (QUICK if quick else CASES)[case]
    standing = arm == "standing"
    return fuse_walk(frames, voxel_size, count // 3 if standing else count, standing)


def flat_metrics(results: dict[tuple[str, str], list[dict[str, float]]]) -> dict[str, float]:
    """Return `<arm>/<voxel>_at_<frames>/<measure>` -> number, and how flat each arm is."""
    metrics: dict[str, float] = {}
    for (arm, case), rows in results.items():
        for row in rows:
            place = f"{case}_at_{int(row['frames']):04d}" if "frames" in row else case
            metrics |= {f"{arm}/{place}/{name}": value for name, value in row.items() if name != "frames"}
        if len(rows) > 3:
            metrics[f"{arm}/{case}/growth"] = growth(rows)
            metrics[f"{arm}/{case}/memory_kb_a_frame_at_the_end"] = (
                1024
                * (rows[-1]["memory_mb"] - rows[len(rows) // 2]["memory_mb"])
                / (rows[-1]["frames"] - rows[len(rows) // 2]["frames"])
            )
    return metrics


def growth(rows: list[dict[str, float]]) -> float:
    """Return what a frame of the last two windows costs, in units of one of the second and third (the first window
    begins in an empty map)."""
    return float(np.mean([row["frame_ms"] for row in rows[-2:]]) / np.mean([row["frame_ms"] for row in rows[1:3]]))


def as_tables(results: dict[tuple[str, str], list[dict[str, float]]]) -> list[Table]:
    """Return the tables: the curve, and `segment`."""
    lines = []
    for (arm, case), rows in results.items():
        if arm not in CURVES:
            continue
        for row in rows:
            lines.append(
                (
                    case,
                    arm,
                    int(row["frames"]),
                    round(row["area_m2"]),
                    row["frame_ms"],
                    *(row[f"{part}_ms"] for part in PARTS),
                    row["slowest_ms"],
                    round(row["memory_mb"]),
                    int(row["segment_labels"]),
                    int(row["pairs"]),
                    row.get("extraction_s"),
                )
            )
    columns = (
        "voxel",
        "arm",
        "frames",
        "floor m2",
        "ms a frame",
        *(f"{part} ms" for part in PARTS),
        "slowest ms",
        "peak MB",
        "labels",
        "pairs",
        "extraction s",
    )
    verdicts = [
        f"{case}, {arm}: {growth(rows):.2f}x ({'flat' if growth(rows) <= FLAT else 'not flat'})"
        for (arm, case), rows in results.items()
        if len(rows) > 3
    ]
    note = (
        f"Processor time, 640x480, {DISTINCT} frames a cell of {AREA:g} m2 with {PER_CELL} places for entities, each "
        f"fused {REPEATS} times; {os.cpu_count()} processors, {platform.machine()}, load average "
        f"{os.getloadavg()[0]:.1f} at the end. A row is the mean of its window. End beside beginning: "
        f"{'; '.join(verdicts)}."
    )
    tables = [Table("growth", "What a frame costs as the map grows", columns, tuple(lines), note)]
    segment = results.get(("segment", "640x480"))
    if segment:
        row = segment[0]
        cells = (
            row["frame_ms"],
            row["geometric_ms"],
            row["fusion_ms"],
            row["wall_ms"],
            1000 / row["wall_ms"],
            row["memory_mb"],
        )
        names = ("ms a frame", "geometric ms", "fusion ms", "wall ms", "frames/s", "peak MB")
        tables.append(Table("segment", "segment without its network", names, (cells,)))
    listing = results.get(("listing", "640x480"))
    if listing:
        row = listing[0]
        held = (
            int(row["frames"]),
            int(row["segments"]),
            row["memory_mb"],
            1024 * row["memory_mb"] / row["frames"],
            row["peak_mb"],
        )
        columns = ("frames", "segments", "MB", "kB a frame", "MB while it is read")
        tables.append(Table("listing", "What fuse holds of every frame: the list of its segments", columns, (held,)))
    return tables


def draw(results: dict[tuple[str, str], list[dict[str, float]]], path: Path) -> None:
    """Draw the curves: time a frame by part over the area, memory over the frames."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    curves = {key: rows for key, rows in results.items() if key[0] in CURVES}
    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 3.6), constrained_layout=True)
    growing = {case: rows for (arm, case), rows in curves.items() if arm == "growing"}
    case = "2cm" if "2cm" in growing else next(iter(growing))
    rows = growing[case]
    area = [row["area_m2"] for row in rows]
    names = ("integration", "overlap", "labels", "regularisation")
    left.stackplot(area, [[row[f"{name}_ms"] for row in rows] for name in names], labels=names, alpha=0.8)
    left.set(xlabel="floor in the map [m²]", ylabel="ms a frame (processor)", title=f"fuse, {case}, 640x480")
    left.legend(loc="upper left", fontsize=8)
    left.set_ylim(0, 1.6 * max(row["frame_ms"] for row in rows))
    for (arm, name), rows in curves.items():
        frames = [row["frames"] for row in rows]
        style = "-" if arm == "growing" else "--"
        right.plot(frames, [row["memory_mb"] for row in rows], style, label=f"{name}, {arm}")
    right.set(xlabel="frames", ylabel="peak memory [MB]", title="memory follows the map")
    right.legend(fontsize=8)
    figure.savefig(path, dpi=110)
    plt.close(figure)


class Options(Measurement):
    """Options."""

    only: tuple[str, ...] = Field((), description="These arms alone: segment, listing, growing, standing")
    worker: tuple[str, ...] = Field((), description="Arm, case and folder of frames: one measurement in this process")


def main() -> int:
    """Measure, print the tables, write metrics.json, table.md and growth.png."""
    arguments = asked(Options)
    if arguments.worker:
        arm, case, folder = arguments.worker
        print(json.dumps(worker(arm, case, Path(folder), arguments.quick)))
        return 0
    cases = QUICK if arguments.quick else CASES
    jobs = [("segment", "640x480"), ("listing", "640x480"), *(("growing", case) for case in cases), ("standing", "2cm")]
    results = {}
    settings = {"NUMBA_THREADING_LAYER": "omp", "OMP_WAIT_POLICY": "passive"}
    with tempfile.TemporaryDirectory() as folder:
        save_frames(make_frames(DISTINCT), Path(folder))
        for arm, case in jobs:
            if arguments.only and arm not in arguments.only:
                continue
            print(f"{arm}, {case}", file=sys.stderr, flush=True)
            command = [sys.executable, "-m", "benchmarks.speed.growth", "--worker", arm, case, folder]
            command += ["--quick"] if arguments.quick else []
            done = subprocess.run(
                command, check=True, stdout=subprocess.PIPE, text=True, cwd=REPOSITORY, env={**os.environ, **settings}
            )
            results[arm, case] = json.loads(done.stdout.splitlines()[-1])
    text = "\n".join(as_markdown(table) for table in as_tables(results))
    write_measured(arguments.out, flat_metrics(results), text)
    if arguments.out and any(arm == "growing" for arm, _ in results):
        draw(results, arguments.out / "growth.png")
    return 0


if __name__ == "__main__":
    sys.exit(main())
