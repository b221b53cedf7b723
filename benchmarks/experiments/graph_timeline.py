"""The contact graph while the map grows, against the truth, and what each snapshot costs.

Rooms of tuning seeds; masks are the true ones with errors of level 0.2 put in (`segment --corruption`). The truth is
that of the whole walk: what was not walked to yet counts as missing. Costs are processor time of one thread: `fuse` and
`graph` with snapshots less without, by snapshot. Draws timeline.png.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pydantic import Field
from scenewright.schemas.contact_graph import ContactGraphFile
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.schemas.segments import Segments
from scenewright.schemas.sequence import Sequence as SequenceArtifact
from scenewright.stages.evaluate import TrueRoom, point_overlaps
from scenewright.stages.kit.drawing.plots import SERIES_COLORS, STYLE, plt, save
from scenewright.stages.kit.formats.ply_files import read_ply
from scenewright.stages.kit.stage import Parameters
from scipy.spatial import cKDTree

from benchmarks.experiment import Bench, Experiment, Results, Trial
from benchmarks.generated_rooms import STEPS, RoomFolder, make_room
from benchmarks.graph_scores import OPTIONS, Figures, distance_figures, judge, read_room
from benchmarks.steps import made, opened, unrecorded

ROOMS = ("kitchen-2000", "office-2000")
FRAMES = 60
CORRUPTION = "0.2"


class TimelineParameters(Parameters):
    """Options of the experiment."""

    rooms: Path | None = Field(None, description="Folder with <recipe>-<seed>-60/{ground_truth,sequence}")
    every: int = Field(6, ge=1, description="Frames from one snapshot to the next")


@dataclass(frozen=True)
class Growth:
    """What came of one room."""

    figures: dict[int, Figures]
    """After so many frames."""
    costs: Figures


def overlaps_with(room: TrueRoom, panoptic_map: PanopticMap) -> dict[tuple[int, int], float]:
    """Return the IoU of the visible points by (true, predicted) instance: a true point takes the label of the nearest
    vertex of an entity within the evaluation's distance."""
    vertices, instances = [np.zeros((0, 3))], [np.zeros(0, dtype=np.int64)]
    for entity in panoptic_map.info.entities:
        points = read_ply(panoptic_map.path(entity.mesh)).vertices
        vertices.append(points)
        instances.append(np.full(len(points), entity.instance, dtype=np.int64))
    labels = np.concatenate([*instances, np.zeros(1, dtype=np.int64)])
    reach = OPTIONS.label_distance
    _, nearest = cKDTree(np.concatenate(vertices)).query(room.points, distance_upper_bound=reach)
    classes = {entity.instance: entity.class_name for entity in panoptic_map.info.entities}
    return point_overlaps(room, labels[nearest], classes)


def measure(bench: Bench, trials: Sequence[Trial]) -> Iterator[tuple[Trial, Growth]]:
    """Yield the growth of each room."""
    for trial in trials:
        name = trial.case.rsplit("-", 1)[0]
        given = bench.parameters.rooms
        room = (
            RoomFolder(name, given / trial.case)
            if given
            else make_room(bench.out / "rooms", name, FRAMES, clutter="medium")
        )
        yield trial, grow(room, bench.folder(trial), bench.parameters.every)


def grow(folder: RoomFolder, work: Path, every: int) -> Growth:
    """Return the figures after so many frames, and the costs, of a room."""
    path = made(
        "segment",
        work / "segments",
        "--sequence",
        folder.sequence,
        "--backend",
        "ground-truth",
        "--corruption",
        CORRUPTION,
    )
    sequence, segments = opened(SequenceArtifact, folder.sequence), opened(Segments, path)
    seconds: dict[tuple[str, int], float] = {}
    maps: dict[int, PanopticMap] = {}
    graphs = {}
    for step in (0, every, 0, every):  # The first two warm caches; the last two are timed.
        output = work / f"map_{step}_{sum(key[1] == step for key in seconds)}"
        started = time.process_time()
        maps[step] = unrecorded("fuse", output, {"snapshot_every": step}, sequence=sequence, segments=segments)
        seconds["fuse", step] = time.process_time() - started
    for step in (0, every):
        started = time.process_time()
        graphs[step] = unrecorded("graph", work / f"graph_{step}", panoptic_map=maps[step])
        seconds["graph", step] = time.process_time() - started
    timeline = graphs[every].timeline
    assert timeline is not None and timeline.snapshots[-1].links == graphs[0].info.links
    room = read_room(folder.ground_truth, np.array(sequence.info.gravity.world_from_log))
    partial = {snapshot.info.frames_integrated: snapshot for snapshot in (*maps[every].snapshots(), maps[every])}
    found: dict[int, Figures] = {}
    for snapshot in timeline.snapshots:
        graph = ContactGraphFile(nodes=snapshot.nodes, links=snapshot.links)
        comparison, edges = judge(room, graph, overlaps_with(room, partial[snapshot.frames]))
        found[snapshot.frames] = distance_figures(comparison) | {
            "nodes": len(snapshot.nodes) - 1,
            "support_f1": edges["any_support"].f1,
            "changes": snapshot.changes.count,
        }
    snapshots = len(timeline.snapshots) - 1
    costs: Figures = {
        f"{name}_seconds_a_snapshot": (seconds[name, every] - seconds[name, 0]) / max(snapshots, 1)
        for name in ("fuse", "graph")
    }
    return Growth(found, costs | {f"{name}_seconds_without": seconds[name, 0] for name in ("fuse", "graph")})


def more_figures(results: Results) -> Figures:
    """Every measure after so many frames, and the costs."""
    flat: Figures = {}
    for trial, growth in results.records.items():
        for frames, figures in growth.figures.items():
            flat |= {f"{trial.arm}/{trial.case}/{name}_at_{frames}": value for name, value in figures.items()}
        flat |= {f"{trial.arm}/{trial.case}/{name}": value for name, value in growth.costs.items()}
    return flat


def plot(results: Results) -> None:
    """Draw the edit distance (lines) and the nodes (dashed) over the frames."""
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(figsize=(7.0, 3.6))
        for (trial, growth), color in zip(results.records.items(), SERIES_COLORS, strict=False):
            frames = list(growth.figures)
            for name, style, label in (("edit_distance", "-", "edit distance"), ("nodes", "--", "nodes")):
                values = [growth.figures[k][name] or 0 for k in frames]
                axes.plot(frames, values, color=color, linestyle=style, label=f"{trial.case}: {label}")
        axes.set_xlabel("frames in the map")
        axes.set_ylim(bottom=0)
        axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2)
        save(figure, results.bench.out / "timeline.png")


EXPERIMENT = Experiment(
    name="graph_timeline",
    title="The contact graph while the map grows",
    simulated="Rooms, walks, pictures and noisy depth; masks are the true ones with errors of level 0.2.",
    knows="Colour, depth, true poses, those masks.",
    does_not_show="How the graph grows with drifting poses or masks of a network; both rooms are of tuning seeds.",
    arms={"ours": "ours"},
    cases=tuple(f"{room}-{FRAMES}" for room in ROOMS),
    tuning=ROOMS,
    seeds_of=lambda bench, case: [case.rsplit("-", 1)[0]],
    default_cases=lambda bench: [f"{room}-{FRAMES}" for room in ROOMS[: 1 if bench.quick else None]],
    measure=measure,
    record=Growth,
    measures={},
    more_figures=more_figures,
    parameters=TimelineParameters,
    places=frozenset({"rooms"}),
    steps=("segment", "fuse", "graph", *STEPS),
    pictures=plot,
)
