"""`make bench-timeline`: the contact graph while the map grows, against the truth, and what each snapshot costs.

    python -m benchmarks.graph.growing_graph --out FOLDER [--rooms FOLDER] [--every N] [--quick]

Rooms of tuning seeds, 60 frames; masks are the true ones with errors of level 0.2 put in (`segment --corruption`). The
truth is that of the whole walk: what was not walked to yet counts as missing. Costs are processor time of one thread:
`fuse` and `graph` with snapshots less without, by snapshot. Writes metrics.json, table.md and timeline.png.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from benchmarks.graph.rooms import (
    OPTIONS,
    Figures,
    context_in,
    distance_figures,
    generated_room,
    judge,
    made,
    read_room,
    write_figures,
)
from schemas.contact_graph import ContactGraphFile
from schemas.panoptic_map import PanopticMap
from schemas.segments import Segments
from schemas.sequence import Sequence
from stages.engine.reading import open_artifact
from stages.evaluate.correspondence import point_overlaps
from stages.evaluate.truth import TrueRoom
from stages.fuse.parameters import FuseParameters
from stages.fuse.stage import run as fuse
from stages.graph.parameters import GraphParameters
from stages.graph.stage import run as build_graph
from stages.kit.drawing.plots import SERIES_COLORS, STYLE, plt, save
from stages.kit.formats.ply_files import read_ply

ROOMS = (("kitchen", 2000), ("office", 2000))
FRAMES, SIZE = 60, (640, 480)
CORRUPTION = "0.2"
EVERY = 6


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


def grow(folder: Path, work: Path, every: int) -> tuple[dict[int, Figures], Figures]:
    """Return the figures after so many frames, and the costs, of the room in `folder` (ground_truth, sequence)."""
    segments_path = made(
        ["segment", "--sequence", str(folder / "sequence"), "--backend", "ground-truth", "--corruption", CORRUPTION],
        work / "segments",
    )
    sequence, segments = open_artifact(folder / "sequence", Sequence), open_artifact(segments_path, Segments)
    assert isinstance(sequence, Sequence) and isinstance(segments, Segments)
    seconds: dict[tuple[str, int], float] = {}
    maps: dict[int, PanopticMap] = {}
    graphs = {}
    for step in (0, every, 0, every):  # The first two warm caches; the last two are timed.
        output = work / f"map_{step}_{sum(key[1] == step for key in seconds)}"
        started = time.process_time()
        options = FuseParameters.model_validate({"snapshot_every": step})
        maps[step] = fuse(sequence, segments, parameters=options, context=context_in(output))
        seconds["fuse", step] = time.process_time() - started
    for step in (0, every):
        started = time.process_time()
        plain = GraphParameters.model_validate({})
        graphs[step] = build_graph(maps[step], parameters=plain, context=context_in(work / f"graph_{step}"))
        seconds["graph", step] = time.process_time() - started
    timeline = graphs[every].timeline
    assert timeline is not None and timeline.snapshots[-1].links == graphs[0].info.links
    room = read_room(folder / "ground_truth", np.array(sequence.info.gravity.world_from_log))
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
    return found, costs | {f"{name}_seconds_without": seconds[name, 0] for name in ("fuse", "graph")}


def table_of(rooms: dict[str, dict[int, Figures]], costs: dict[str, Figures]) -> str:
    """Return table.md."""
    lines = ["| room | frames | nodes | edit distance | wrong supports | missing | wrong | any-parent F1 | changes |"]
    lines.append("|:--|--:|--:|--:|--:|--:|--:|--:|--:|")
    for name, found in rooms.items():
        for frames, f in found.items():
            f1 = "–" if f["support_f1"] is None else f"{f['support_f1']:.3f}"
            lines.append(
                f"| {name} | {frames} | {f['nodes']} | {f['edit_distance']} | {f['wrong_support']} "
                f"| {f['missing_detection']} | {f['wrong_detection']} | {f1} | {f['changes']} |"
            )
    lines += ["", "| room | fuse [s] | graph [s] | snapshot in fuse [s] | its graph [s] |", "|:--|--:|--:|--:|--:|"]
    for name, cost in costs.items():
        columns = (
            "fuse_seconds_without",
            "graph_seconds_without",
            "fuse_seconds_a_snapshot",
            "graph_seconds_a_snapshot",
        )
        lines.append(f"| {name} | " + " | ".join(f"{cost[column]:.2f}" for column in columns) + " |")
    return "\n".join(lines)


def plot(rooms: dict[str, dict[int, Figures]], path: Path) -> None:
    """Draw the edit distance (lines) and the nodes (dashed) over the frames."""
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(figsize=(7.0, 3.6))
        for (name, found), color in zip(rooms.items(), SERIES_COLORS, strict=False):
            frames = list(found)
            axes.plot(
                frames, [found[k]["edit_distance"] or 0 for k in frames], color=color, label=f"{name}: edit distance"
            )
            nodes = [found[k]["nodes"] or 0 for k in frames]
            axes.plot(frames, nodes, color=color, linestyle="--", label=f"{name}: nodes")
        axes.set_xlabel("frames in the map")
        axes.set_ylim(bottom=0)
        axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2)
        save(figure, path)


def main() -> None:
    """Grow the graphs of the rooms and write what they are worth."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--rooms", type=Path, help="folder with <recipe>-<seed>-60/{ground_truth,sequence}")
    parser.add_argument("--every", type=int, default=EVERY, help="frames from one snapshot to the next")
    parser.add_argument("--quick", action="store_true", help="one room")
    arguments = parser.parse_args()
    rooms: dict[str, dict[int, Figures]] = {}
    costs: dict[str, Figures] = {}
    for recipe, seed in ROOMS[: 1 if arguments.quick else None]:
        name = f"{recipe}-{seed}-{FRAMES}"
        folder = (arguments.rooms or arguments.out / "rooms") / name
        if arguments.rooms is None:
            generated_room(arguments.out / "rooms", recipe, seed, FRAMES, SIZE)
            made(["ingest", "--log", str(folder / "ground_truth" / "log.mcap")], folder / "sequence")
        rooms[name], costs[name] = grow(folder, arguments.out / "work" / name, arguments.every)
        print(f"{name}: {[f['edit_distance'] for f in rooms[name].values()]}", flush=True)
    flat = {
        f"ours/{name}/{k}_at_{frames}": v for name, r in rooms.items() for frames, f in r.items() for k, v in f.items()
    }
    flat |= {f"ours/{name}/{k}": v for name, cost in costs.items() for k, v in cost.items()}
    write_figures(arguments.out, flat, table_of(rooms, costs))
    plot(rooms, arguments.out / "timeline.png")


if __name__ == "__main__":
    main()
