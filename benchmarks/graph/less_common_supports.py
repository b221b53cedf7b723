"""`make bench-supports`: the supports of section 2.6.5 (Han 2024) on perfect maps of generated studios.

    python -m benchmarks.graph.less_common_supports --out FOLDER [--seeds N ...] [--quick]

A perfect map is the true surface that the camera saw, with true labels: what is wrong is wrong with the graph. Arms:
`ours` and `thesis` (`graph --method`). Cases: the seeds. Writes metrics.json, table.md and wrong.md (every wrong edge).
"""

from __future__ import annotations

import argparse
import time
from collections import defaultdict
from pathlib import Path
from typing import Literal

from benchmarks.graph.rooms import (
    RELATIONS,
    Figures,
    context_in,
    distance_figures,
    generated_room,
    judge,
    read_room,
    write_figures,
)
from benchmarks.scene.perfect_maps import perfect_map
from schemas.contact_graph import ContactGraphFile
from schemas.ground_truth import GroundTruth
from schemas.scene_parts import Relation
from stages.engine.reading import open_artifact
from stages.evaluate.graph_measures import GraphComparison, optional_nodes
from stages.evaluate.truth import TrueRoom
from stages.graph.parameters import GraphParameters
from stages.graph.stage import run as build_graph

METHODS: tuple[Literal["ours", "thesis"], ...] = ("ours", "thesis")
TUNING, REPORTING = (40, 41, 42, 43), (1000, 1001, 1002, 1003)
FRAMES, SIZE = 60, (320, 240)
SUPPORTING = (*RELATIONS[:-1], "any_support")
"""Relations of support; `proximal` is none."""
SAME_HEIGHT = 0.02
"""A contained thing stands on the right surface when the plane of its relation is within this of the true one [m]."""
Counts = dict[str, list[int]]


def judge_room(path: Path, work: Path, counts: dict[str, Counts]) -> tuple[dict[str, Figures], list[str]]:
    """Return figures by method of one room and the lines of wrong.md; adds true, predicted and agreed edges by method
    and relation to `counts`."""
    truth = open_artifact(path, GroundTruth)
    assert isinstance(truth, GroundTruth)
    room = read_room(path)
    panoptic_map = perfect_map(truth, work / "map")
    same = {(entry.instance, entry.instance): 1.0 for entry in room.objects}
    figures: dict[str, Figures] = {}
    wrong: list[str] = []
    for method in METHODS:
        started = time.process_time()
        graph = build_graph(
            panoptic_map,
            parameters=GraphParameters.model_validate({"method": method}),
            context=context_in(work / method),
        ).info
        seconds = time.process_time() - started
        comparison, edges = judge(room, graph, same)
        own = distance_figures(comparison) | {"cpu_seconds": seconds}
        whole = [0, 0, 0]
        for relation in SUPPORTING:
            agreement = edges[relation]
            row = [agreement.true_count, agreement.predicted_count, agreement.agreed]
            counts[method][relation] = [a + b for a, b in zip(counts[method][relation], row, strict=True)]
            own[f"{relation}_f1"] = agreement.f1
            if relation != "any_support":
                whole = [a + b for a, b in zip(whole, row, strict=True)]
        counts[method]["all"] = [a + b for a, b in zip(counts[method]["all"], whole, strict=True)]
        own["support_f1"] = 2.0 * whole[2] / max(whole[0] + whole[1], 1)
        right, contained = inner_surfaces(comparison)
        counts[method]["inner_surface"] = [
            a + b for a, b in zip(counts[method]["inner_surface"], [contained, contained, right], strict=True)
        ]
        figures[method] = own
        wrong += [f"| {method} | {path.parent.name} | {line} |" for line in differences(room, comparison)]
    return figures, wrong


def inner_surfaces(comparison: GraphComparison) -> tuple[int, int]:
    """Return how many of the right `contains` edges name the right inner surface, by its height, and of how many."""
    right = compared = 0
    partner = dict(comparison.distance.pairs)
    for link in comparison.true.links:
        found = comparison.predicted.parent_link(partner.get(link.target, ""))
        if link.relation != "contains" or found is None or found.relation != "contains":
            continue
        if found.source != partner.get(link.source):
            continue
        heights = [height_of(graph, edge) for graph, edge in ((comparison.true, link), (comparison.predicted, found))]
        compared += 1
        right += None not in heights and abs(float(heights[0] or 0) - float(heights[1] or 0)) <= SAME_HEIGHT
    return right, compared


def height_of(graph: ContactGraphFile, edge: Relation) -> float | None:
    """Height of the plane that an edge names [m]."""
    return None if edge.plane is None else graph.node(edge.source).planes[edge.plane].center[2]


def differences(room: TrueRoom, comparison: GraphComparison) -> list[str]:
    """Return `relation | source | target | missed or false` of every wrong edge of support."""
    ignored = optional_nodes(room, comparison.true)
    partner = dict(comparison.distance.pairs)
    back = {b: a for a, b in partner.items()}
    true = {
        (link.relation, link.source, link.target)
        for link in comparison.true.links
        if link.relation != "proximal" and not {link.source, link.target} & ignored
    }
    predicted = {
        (link.relation, back.get(link.source, link.source), back.get(link.target, link.target))
        for link in comparison.predicted.links
        if link.relation != "proximal"
    }
    predicted = {edge for edge in predicted if not set(edge[1:]) & ignored}
    return [" | ".join((*edge, "missed")) for edge in sorted(true - predicted)] + [
        " | ".join((*edge, "false")) for edge in sorted(predicted - true)
    ]


def table_of(counts: dict[str, Counts], rooms: dict[str, dict[str, Figures]]) -> str:
    """Return table.md: edges by relation over all rooms, then the edit distance room by room."""
    lines = ["| relation | true edges | ours P | R | F1 | thesis P | R | F1 |", "|:--|--:|--:|--:|--:|--:|--:|--:|"]
    for relation in (*SUPPORTING, "all"):
        cells = []
        for method in METHODS:
            true, predicted, agreed = counts[method][relation]
            share = [agreed / predicted if predicted else None, agreed / true if true else None]
            cells += [*share, 2 * agreed / (true + predicted) if true + predicted else None]
        shown = ["–" if value is None else f"{value:.3f}" for value in cells]
        name = "any parent" if relation == "any_support" else relation
        lines.append(f"| {name} | {counts['ours'][relation][0]} | " + " | ".join(shown) + " |")
    lines += ["", "| room | search | edit distance ours | thesis | support F1 ours | thesis |"]
    lines.append("|:--|--:|--:|--:|--:|--:|")
    for name, figures in rooms.items():
        ours, thesis = figures["ours"], figures["thesis"]
        lines.append(
            f"| {name} | {'exact' if ours['edit_distance_exact'] and thesis['edit_distance_exact'] else 'bound'} "
            f"| {ours['edit_distance']} | {thesis['edit_distance']} "
            f"| {ours['support_f1']:.3f} | {thesis['support_f1']:.3f} |"
        )
    rows = {method: counts[method]["inner_surface"] for method in METHODS}
    shares = ", ".join(f"{method} {row[2]} of {row[0]}" for method, row in rows.items())
    lines += ["", f"Right inner surface under what is rightly contained: {shares}."]
    return "\n".join(lines)


def main() -> None:
    """Make the studios, judge both methods, write what they reach."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--seeds", type=int, nargs="*", default=list(TUNING + REPORTING))
    parser.add_argument("--quick", action="store_true", help="one tuning room")
    arguments = parser.parse_args()
    seeds = [TUNING[0]] if arguments.quick else arguments.seeds
    counts: dict[str, Counts] = {method: defaultdict(lambda: [0, 0, 0]) for method in METHODS}
    rooms: dict[str, dict[str, Figures]] = {}
    wrong = ["| method | room | relation | source | target | |", "|:--|:--|:--|:--|:--|:--|"]
    for seed in seeds:
        path = generated_room(arguments.out / "rooms", "studio", seed, FRAMES, SIZE)
        rooms[str(seed)], lines = judge_room(path, arguments.out / "work" / str(seed), counts)
        wrong += lines
        write(arguments.out, counts, rooms, wrong)
        print(f"studio {seed}: edit distance {[rooms[str(seed)][m]['edit_distance'] for m in METHODS]}", flush=True)


def write(out: Path, counts: dict[str, Counts], rooms: dict[str, dict[str, Figures]], wrong: list[str]) -> None:
    """Write what the rooms so far come to."""
    flat = {f"{m}/{seed}/{k}": v for seed, own in rooms.items() for m, f in own.items() for k, v in f.items()}
    for method in METHODS:
        for relation, (true, predicted, agreed) in counts[method].items():
            flat[f"{method}/all/{relation}_f1"] = 2 * agreed / (true + predicted) if true + predicted else None
            flat[f"{method}/all/{relation}_edges"] = true
    write_figures(out, flat, table_of(counts, rooms))
    (out / "wrong.md").write_text("\n".join(wrong) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
