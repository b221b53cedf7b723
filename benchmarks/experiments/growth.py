"""What a frame costs while the map grows, and what holds the memory: `fuse` by part, 100 to 3,000 frames, 5 to 200 m^2.

A camera walks down an endless furnished corridor (benchmarks/corridor.py), 15 frames a square metre of floor. `growing`
walks on; `standing` sees the same cell again and again (a third of the frames), so that the log grows and the map does
not; `hour` walks through the same 200 m^2 36 times, 108,000 frames: an hour at 30 Hz. Cases are the frames up to which
a figure is the mean since the case before; `all`: of all frames. Every arm runs in a process of its own. Times are
processor time, which other work on the machine hardly changes; frames/s on a quiet machine are 1000 / wall_ms. Memory
is the growth of the peak over what the process held before the first frame (libraries loaded, kernels compiled, frames
in memory). Parts of `fuse`: overlap (which voxels of the map lie under a frame's segments), labels (association,
counts, merging of segments), integration, regularisation (merging of instances, every 10 frames), extraction (once, at
the end: surface, entities, files). `segment` without its network: geometric segments, and their fusion with the masks.
"""

from __future__ import annotations

import json
import tempfile
import tracemalloc
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import Field
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.kit.progress import SilentProgress
from scenewright.stages.kit.stage import Context, Parameters

from benchmarks.corridor import AREA, CAMERA, RANGE, CorridorFrame, make_frames, moved
from benchmarks.experiment import Bench, Experiment, Results, Trial, only
from benchmarks.timing import AS_THE_COMMAND_LINE, Clock, alone, memory, reset_peak

DISTINCT = 50
"""Frames that are rendered."""
REPEATS = 3
"""How often each is fused before the camera goes on: a slow walk at 30 Hz."""
HOUR = "2cm hour"
WALKS: dict[str, tuple[float, float, int | None]] = {
    "2cm growing": (0.02, 1, None),
    "2cm standing": (0.02, 1 / 3, 1),
    "1cm growing": (0.01, 1 / 5, None),
    HOUR: (0.02, 36, 20),
}
"""Voxel size [m], frames over those of the first walk, cells that the corridor has (None: no end); 1 cm needs eight
times the memory."""
SEGMENT, LISTING = "segment without its network", "list of segments"
PARTS = {"overlap": "overlap", "labels": "labels time"} | {name: name for name in ("integration", "regularisation")}
UNITS = {
    **dict.fromkeys(("time a frame", "wall time", "slowest frame", *PARTS.values(), "geometric", "fusion"), "ms"),
    **dict.fromkeys(("peak memory", "peak memory with extraction", "size", "memory while read"), "MB"),
    **dict.fromkeys(("labels", "labels counted", "pairs", "blocks", "entities", "segments", "frames per s"), ""),
    "floor": "m²",
    "extraction": "s",
    "size a frame": "kB",
}
WINDOWS = 12
"""Points of the curve."""
WHOLE, QUICK = 3000, 300


class GrowthParameters(Parameters):
    """Options of the experiment."""

    frames: int = Field(WHOLE, ge=QUICK, description=f"Of the longest walk: {WHOLE} or {QUICK}")


def edges_of(count: int) -> list[int]:
    """Return the frames at which the windows of a walk begin and end."""
    return [int(edge) for edge in np.unique(np.linspace(0, count, WINDOWS + 1).astype(int))]


def frame_at(frames: list[CorridorFrame], number: int, cells: int | None) -> tuple[CorridorFrame, np.ndarray]:
    """Return frame `number` of the walk, which begins again behind the last of `cells`, and its pose."""
    place, cell = (number // REPEATS) % len(frames), number // (REPEATS * len(frames))
    frame = frames[place]
    return frame, moved(frame.pose, cell if cells is None else cell % cells)


def fuse_walk(frames: list[CorridorFrame], voxel_size: float, count: int, ends: int | None) -> list[dict[str, float]]:
    """Fuse `count` frames, in a process of its own; return a row of figures for each window of the walk, the last with
    the extraction."""
    from scenewright.stages.fuse import mapping
    from scenewright.stages.fuse.ours import Ours
    from scenewright.stages.fuse.parameters import FuseParameters
    from scenewright.stages.fuse.stage import new_mapper, write_map

    clocks = {part: Clock() for part in PARTS}
    for name in ("index_segments", "measure_overlap"):
        clocks["overlap"].wrap(mapping, name)
    clocks["integration"].wrap(mapping, "integrate")
    clocks["regularisation"].wrap(mapping.PanopticMapper, "regularize")
    clocks["labels"].wrap(mapping.PanopticMapper, "_associate")
    options = FuseParameters.model_validate({"voxel_size": voxel_size, "maximum_depth": RANGE})

    def extract(mapper: mapping.PanopticMapper) -> int:
        with tempfile.TemporaryDirectory() as folder:
            context = Context(Path(folder), seed=0, device="cpu", progress=SilentProgress())
            return int(write_map(mapper, load_vocabulary(), "benchmark", {}, context).summary["entities"])

    def add(mapper: mapping.PanopticMapper, number: int) -> None:
        frame, pose = frame_at(frames, number, ends)
        mapper.add_frame(CAMERA, frame.depth, frame.color, pose, frame.ids, frame.listing)

    warm = new_mapper(options.model_copy(update={"voxel_size": 0.08}), load_vocabulary())
    for number in range(12):
        add(warm, number)
    extract(warm)
    del warm
    for clock in clocks.values():
        clock.taken()
    reset_peak()
    before = memory("VmRSS")
    mapper = new_mapper(options, load_vocabulary())
    merging = mapper.merging
    assert isinstance(merging, Ours)
    rows = []
    edges = edges_of(count)
    for start, end in zip(edges[:-1], edges[1:], strict=True):
        whole = Clock()
        for number in range(start, end):
            with whole.lap():
                add(mapper, number)
        taken = {part: clock.taken() for part, clock in clocks.items()}
        taken["labels"] -= taken["overlap"]  # it is called in there
        cells = min(end / (REPEATS * len(frames)), np.inf if ends is None else ends)
        rows.append(
            {
                "frames": float(end),
                "floor": cells * AREA,
                "slowest frame": 1000 * max(whole.processor),
                "wall time": 1000 * sum(whole.wall) / (end - start),
                "time a frame": 1000 * whole.taken() / (end - start),
                **{PARTS[part]: 1000 * seconds / (end - start) for part, seconds in taken.items()},
                "peak memory": memory("VmHWM") - before,
                "blocks": float(mapper.blocks.count),
                "labels": float(len(mapper.labels.table()) - 1),
                "labels counted": float(len(merging.counts.by_segment)),
                "pairs": float(len(merging.shared.together) + sum(map(len, merging.shared.apart.values())) // 2),
            }
        )
    extraction = Clock()
    with extraction.lap():
        rows[-1]["entities"] = float(extract(mapper))
    rows[-1] |= {"extraction": extraction.taken(), "peak memory with extraction": memory("VmHWM") - before}
    return rows


def segment_parts(frames: list[CorridorFrame]) -> list[dict[str, float]]:
    """Return what `segment` without its network takes of a frame, by part, in a process of its own."""
    from scenewright.stages.segment.fusion_ours import fuse
    from scenewright.stages.segment.geometric import segment_depth
    from scenewright.stages.segment.parameters import SegmentParameters
    from scenewright.stages.segment.settings import fusion_settings, geometric_settings

    options = SegmentParameters.model_validate({})

    def segment(frame: CorridorFrame, cutting: Clock, fusing: Clock) -> None:
        with cutting.lap():
            geometric = segment_depth(frame.depth, CAMERA, geometric_settings(options))
        with fusing.lap():
            fuse(geometric.labels, frame.masks, geometric.points, fusion_settings(options))

    for frame in frames[:2]:
        segment(frame, Clock(), Clock())
    reset_peak()
    before, cutting, fusing = memory("VmRSS"), Clock(), Clock()
    for frame in frames:
        segment(frame, cutting, fusing)
    wall = 1000 * sum(cutting.wall + fusing.wall) / len(frames)
    parts = [1000 * clock.taken() / len(frames) for clock in (cutting, fusing)]
    row = {"geometric": parts[0], "fusion": parts[1], "time a frame": sum(parts), "wall time": wall}
    return [row | {"frames per s": 1000 / wall, "peak memory": memory("VmHWM") - before}]


def listing_memory(frames: list[CorridorFrame], count: int) -> list[dict[str, float]]:
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
        held = {"size": kept / megabyte, "size a frame": kept / 1024 / count, "memory while read": peak / megabyte}
        return [{"frames": float(count), "segments": float(segments), **held}]


def measure(bench: Bench, trials: Sequence[Trial]) -> Iterable[tuple[Trial, list[dict[str, float]]]]:
    """Yield the rows of every arm."""
    frames, count = make_frames(DISTINCT), bench.parameters.frames
    for trial in trials:
        if trial.arm in WALKS:
            voxel_size, length, cells = WALKS[trial.arm]
            work: tuple[Any, ...] = (fuse_walk, frames, voxel_size, round(count * length), cells)
        else:
            work = (segment_parts, frames) if trial.arm == SEGMENT else (listing_memory, frames, count)
        yield trial, alone(*work, **AS_THE_COMMAND_LINE)  # type: ignore[arg-type]


def row_at(frames: int | None) -> Callable[[list[dict[str, float]]], dict[str, float] | None]:
    """Return what picks the row up to so many frames (None: of all frames) out of an arm's rows."""
    return lambda rows: next((row for row in rows if row.get("frames") == frames), None)


def growth(rows: list[dict[str, float]]) -> float:
    """Return what a frame of the last two windows costs, in units of one of the second and third (the first window
    begins in an empty map)."""
    times = [row["time a frame"] for row in rows]
    return float(np.mean(times[-2:]) / np.mean(times[1:3]))


def curves(results: Results) -> dict[str, list[dict[str, float]]]:
    """Return the rows of every walk."""
    arms = [arm for arm in WALKS if arm in results.arms()]
    return {arm: [row for case in results.cases for row in results.of(arm, case)] for arm in arms}


def draw(results: Results) -> None:
    """Draw growth.png: time a frame by part over the area, memory over the frames."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    walks = curves(results)
    growing = next((arm for arm in walks if WALKS[arm][2] is None), None)
    if growing is None:
        return
    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 3.6), constrained_layout=True)
    rows = walks[growing]
    names = ("integration", "overlap", "labels", "regularisation")
    left.stackplot(
        [row["floor"] for row in rows], [[row[PARTS[name]] for row in rows] for name in names], labels=names, alpha=0.8
    )
    left.set(xlabel="floor in the map [m²]", ylabel="ms a frame (processor)", title=f"fuse, {growing}, 640x480")
    left.legend(loc="upper left", fontsize=8)
    left.set_ylim(0, 1.6 * max(row["time a frame"] for row in rows))
    for arm, rows in walks.items():
        if arm == HOUR:  # it would press the others to the edge
            continue
        style = "--" if WALKS[arm][2] else "-"
        right.plot([row["frames"] for row in rows], [row["peak memory"] for row in rows], style, label=arm)
    right.set(xlabel="frames", ylabel="peak memory [MB]", title="memory follows the map")
    right.legend(fontsize=8)
    figure.savefig(results.bench.out / "growth.png", dpi=110)
    plt.close(figure)


def ends_beside_beginnings(results: Results) -> Mapping[str, float | None]:
    """Return how flat each walk is."""
    walks = {arm: rows for arm, rows in curves(results).items() if len(rows) > 3}
    return {f"{arm}/end/time over the beginning": growth(rows) for arm, rows in walks.items()}


COUNTS = [round(count * length) for count in (WHOLE, QUICK) for _, length, _ in WALKS.values()]
SHOWN = sorted({edge for count in COUNTS for edge in edges_of(count)[1:]})
EXPERIMENT = Experiment(
    name="growth",
    title="What a frame costs as the map grows",
    simulated=f"An endless corridor of {DISTINCT} rendered frames, each fused again and again, true masks.",
    knows="Exact poses.",
    does_not_show="A long real walk: the corridor repeats itself. One seed, one run. Extraction is no part of a frame.",
    arms={arm: arm for arm in (SEGMENT, LISTING, *WALKS)},
    cases=("walk",),
    default_arms=lambda bench: [SEGMENT, LISTING, *list(WALKS)[: 2 if bench.quick else None]],
    reporting=("0",),
    together=lambda trial: "",
    measure=measure,
    record=list[dict[str, float]],
    measures={name: only(name, unit) for name, unit in UNITS.items()},
    parameters=GrowthParameters,
    quick={"frames": QUICK},
    subcases={str(frames): ("walk", row_at(frames)) for frames in SHOWN} | {"all": ("walk", row_at(None))},
    more_figures=ends_beside_beginnings,
    pictures=draw,
)
