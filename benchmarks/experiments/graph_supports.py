"""The supports of section 2.6.5 (Han 2024) on perfect maps of generated studios: hanging, leaning, contained, shared.

A perfect map is the true surface that the camera saw, with true labels: what is wrong is wrong with the graph. Arms:
`ours` and `thesis` (`graph --method`). Writes wrong.md too, every wrong edge.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from scenewright.schemas.contact_graph import ContactGraphFile
from scenewright.schemas.ground_truth import GroundTruth
from scenewright.schemas.scene_parts import Relation
from scenewright.stages.evaluate import GraphComparison, TrueRoom, optional_nodes

from benchmarks.experiment import Bench, Experiment, Measure, Results, Trial, statistic
from benchmarks.generated_rooms import STEPS, make_room
from benchmarks.graph_scores import RELATIONS, distance_figures, judge, read_room
from benchmarks.perfect_maps import perfect_map
from benchmarks.steps import opened, unrecorded

TUNING, REPORTING = tuple(f"studio-{k}" for k in range(40, 44)), tuple(f"studio-{k}" for k in range(1000, 1004))
CASES = {"reporting": REPORTING, "tuning": TUNING}
FRAMES, SIZE = 60, (320, 240)
SUPPORTING = (*RELATIONS[:-1], "any_support")
"""Relations of support; `proximal` is none."""
SAME_HEIGHT = 0.02
"""A contained thing stands on the right surface when the plane of its relation is within this of the true one [m]."""
WHOLE = "all"
"""Over all relations that stand in the tree."""
INNER = "inner_surface"


@dataclass(frozen=True)
class Studio:
    """What a method made of one studio."""

    figures: dict[str, float | None]
    counts: dict[str, tuple[int, int, int]]
    """Relation -> true, predicted, agreed edges."""
    wrong: tuple[str, ...]
    """Lines of wrong.md."""


def measure(bench: Bench, trials: Sequence[Trial]) -> Iterator[tuple[Trial, Studio]]:
    """Yield what the methods make of one studio."""
    name = trials[0].seed
    path = make_room(bench.out / "rooms", name, FRAMES, size=SIZE, clutter="medium").ground_truth
    room = read_room(path)
    panoptic_map = perfect_map(opened(GroundTruth, path), bench.out / "work" / name)
    same = {(entry.instance, entry.instance): 1.0 for entry in room.objects}
    for trial in trials:
        folder = bench.folder(trial) / "contact_graph"
        started = time.process_time()
        graph = unrecorded("graph", folder, {"method": trial.arm}, panoptic_map=panoptic_map).info
        seconds = time.process_time() - started
        yield trial, judged(room, graph, same, seconds)


def judged(
    room: TrueRoom, graph: ContactGraphFile, overlaps: Mapping[tuple[int, int], float], seconds: float
) -> Studio:
    """Return the figures, the edges by relation and the wrong edges of a graph."""
    comparison, edges = judge(room, graph, overlaps)
    counts = {name: (edges[name].true_count, edges[name].predicted_count, edges[name].agreed) for name in SUPPORTING}
    in_tree = [counts[name] for name in SUPPORTING if name != "any_support"]
    counts[WHOLE] = (sum(c[0] for c in in_tree), sum(c[1] for c in in_tree), sum(c[2] for c in in_tree))
    right, contained = inner_surfaces(comparison)
    counts[INNER] = (contained, contained, right)
    figures = distance_figures(comparison) | {"cpu_seconds": seconds}
    figures |= {f"{name}_f1": edges[name].f1 for name in SUPPORTING}
    true, predicted, agreed = counts[WHOLE]
    figures["support_f1"] = 2.0 * agreed / max(true + predicted, 1)
    return Studio(figures, counts, tuple(differences(room, comparison)))


def pooled(records: Sequence[Studio], relation: str) -> tuple[int, int, int]:
    """Add the edges of a relation over studios."""
    counts = [record.counts[relation] for record in records]
    return sum(c[0] for c in counts), sum(c[1] for c in counts), sum(c[2] for c in counts)


def pooled_f1(relation: str) -> Callable[[Sequence[Studio]], float | None]:
    """F1 of a relation's edges over all studios; None where there are none."""

    def figure(records: Sequence[Studio]) -> float | None:
        true, predicted, agreed = pooled(records, relation)
        return 2 * agreed / (true + predicted) if true + predicted else None

    return figure


def pooled_edges(relation: str) -> Callable[[Sequence[Studio]], float]:
    """True edges of a relation over all studios."""
    return lambda records: float(pooled(records, relation)[0])


def of_figures(name: str) -> Callable[[Sequence[Studio]], float | None]:
    """Mean over studios of one of `figures`."""
    figure = statistic(name, lambda values: sum(values) / len(values))
    return lambda records: figure([record.figures for record in records])


COUNTED = (*SUPPORTING, WHOLE, INNER)
MEASURES = {f"{name}_f1": Measure(pooled_f1(name)) for name in COUNTED}
MEASURES |= {f"{name}_edges": Measure(pooled_edges(name), interval=False) for name in COUNTED}
MEASURES |= {name: Measure(of_figures(name)) for name in ("edit_distance", "wrong_support")}
MEASURES["cpu_seconds"] = Measure(of_figures("cpu_seconds"), "s")


def more_figures(results: Results) -> dict[str, float | None]:
    """Every studio by itself, and all of them together."""
    flat: dict[str, float | None] = {}
    for arm in results.arms():
        for trial, record in results.records.items():
            if trial.arm == arm:
                flat |= {f"{arm}/{trial.seed.split('-')[1]}/{name}": v for name, v in record.figures.items()}
        every = [record for trial, record in results.records.items() if trial.arm == arm]
        for name in COUNTED:
            flat[f"{arm}/all/{name}_f1"] = pooled_f1(name)(every)
            flat[f"{arm}/all/{name}_edges"] = pooled_edges(name)(every)
    return flat


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


def write_wrong(results: Results) -> None:
    """Write wrong.md."""
    lines = ["| method | room | relation | source | target | |", "|:--|:--|:--|:--|:--|:--|"]
    lines += [f"| {trial.arm} | {trial.seed} | {line} |" for trial, r in results.records.items() for line in r.wrong]
    (results.bench.out / "wrong.md").write_text("\n".join(lines) + "\n", encoding="utf-8")


EXPERIMENT = Experiment(
    name="graph_supports",
    title="Less common supports in contact graphs",
    simulated="Studios and walks; the map is the true surface that the camera saw, with true labels.",
    knows="That map, and nothing of how it was furnished.",
    does_not_show="What mistakes of a map do to these relations.",
    arms={"ours": "ours", "thesis": "thesis"},
    cases=tuple(CASES),
    tuning=TUNING,
    reporting=REPORTING,
    seeds_of=lambda bench, case: CASES[case],
    together=lambda trial: trial.seed,
    measure=measure,
    record=Studio,
    measures=MEASURES,
    more_figures=more_figures,
    quick_seeds=1,
    default_cases=lambda bench: ["tuning"] if bench.quick or bench.tuning else list(CASES),
    steps=("graph", *STEPS),
    pairs=(("ours", "thesis"),),
    compared=("all_f1", "edit_distance"),
    pictures=write_wrong,
)
