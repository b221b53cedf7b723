"""Contact graphs of the real logs against what stands on what in the pictures, after `make real`.

Arms: `ours` and `thesis` (`graph --method`). Cases: <log>, the map of the run, and <log>_annotated_masks, the same
surface with the annotated things for entities, which leaves the graph's own mistakes. Annotations:
data/annotations/real. Writes errors.md too, every error of the edit distance.
"""

from __future__ import annotations

import csv
import json
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh
from pydantic import Field
from scenewright.schemas.ground_truth import GroundTruth
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.stages.kit.formats.mesh_files import read_mesh
from scenewright.stages.kit.stage import Parameters
from scenewright.stages.truth import SupportAnnotation, instances_of, read_support_annotation

from benchmarks.experiment import Bench, Experiment, Measure, Results, Trial, statistic
from benchmarks.perfect_maps import write_map
from benchmarks.steps import opened, step, unrecorded
from benchmarks.tabulation import markdown

ANNOTATIONS = Path(__file__).resolve().parents[2] / "data" / "annotations" / "real"
LOGS = tuple(sorted(path.stem for path in ANNOTATIONS.glob("*.json")))
ANNOTATED = "_annotated_masks"
ERROR = ("error", "true", "predicted", "true parent", "predicted parent")
EVERY = 3
"""Every how many-th frame of the sequence shows the annotated things their surface."""
LEAST_FACES = 10
MEASURES = {
    "edit_distance": "edit_distance",
    "wrong_support": "wrong_supports",
    "missing_detection": "missing_detections",
    "wrong_detection": "wrong_detections",
    "support_f1": "any_support_f1",
    "support_precision": "any_support_precision",
    "support_recall": "any_support_recall",
    "supports_f1": "supports_f1",
    "carries_on_wall_f1": "carries_on_wall_f1",
    "true_nodes": "true_nodes",
    "predicted_nodes": "predicted_nodes",
    "exact": "edit_distance_exact",
}
"""Name in metrics.json -> measure of `evaluate`. `support_f1` is that of all edges to a parent, whatever their kind."""


def annotated_map(told: SupportAnnotation, made: PanopticMap, folder: Path) -> PanopticMap:
    """Return the map's surface with the annotated things, which are given by boxes, as its entities."""
    mesh = read_mesh(made.path("mesh.ply"))
    vertices, faces = np.asarray(mesh.vertices, float), np.asarray(mesh.faces)
    _, owner = instances_of(told, vertices, np.zeros(len(vertices), np.int64), None, 0.0)
    meshes, classes = {}, {}
    for k, node in enumerate(told.nodes, 1):
        own = faces[(owner[faces] == k).all(axis=1)]
        if len(own) >= LEAST_FACES:
            used, corners = np.unique(own, return_inverse=True)
            meshes[k] = trimesh.Trimesh(vertices[used], corners.reshape(-1, 3), process=False)
            classes[k] = node.class_name
    return write_map(folder, meshes, classes)


class RealSupportsParameters(Parameters):
    """Options of the experiment."""

    runs: Path = Field(Path("outputs/experiments/real"), description="Folder that `make real` wrote")


@dataclass(frozen=True)
class Scored:
    """What one graph is worth."""

    measures: dict[str, float]
    errors: tuple[tuple[str, ...], ...]
    """Rows of the edit distance's errors, as ERROR names them."""


def log_of(case: str) -> str:
    """The log that a case is made of."""
    return case.removesuffix(ANNOTATED)


def seeds_of(bench: Bench, case: str) -> list[str]:
    """The log, where `make real` has made its map."""
    name = log_of(case)
    return [name] if (bench.parameters.runs / name / "panoptic_map" / "manifest.json").is_file() else []


def inputs(bench: Bench, trial: Trial) -> list[Path]:
    """Annotation, sequence and map."""
    run = bench.parameters.runs / trial.seed
    return [ANNOTATIONS / f"{trial.seed}.json", run / "sequence", run / "panoptic_map"]


def measure(bench: Bench, trials: Sequence[Trial]) -> Iterator[tuple[Trial, Scored]]:
    """Yield the scores of one log's graphs."""
    annotation, sequence, map_folder = inputs(bench, trials[0])
    told, panoptic_map = read_support_annotation(annotation), opened(PanopticMap, map_folder)
    with tempfile.TemporaryDirectory() as folder:
        work = Path(folder)
        path = step("truth supports", work / "truth", {"every": EVERY}, annotation=annotation, sequence=sequence)
        truth = opened(GroundTruth, path)
        maps = {False: panoptic_map, True: annotated_map(told, panoptic_map, work / "annotated")}
        for trial in trials:
            yield trial, score(truth, maps[trial.case.endswith(ANNOTATED)], trial.arm, work / trial.case / trial.arm)


def score(truth: GroundTruth, panoptic_map: PanopticMap, method: str, work: Path) -> Scored:
    """Return the measures of one graph and the rows of its errors."""
    graph = unrecorded("graph", work / "graph", {"method": method}, panoptic_map=panoptic_map)
    evaluation = unrecorded(
        "evaluate",
        work / "evaluation",
        {"plots": False},
        ground_truth=truth,
        panoptic_map=panoptic_map,
        contact_graph=graph,
    )
    metrics = json.loads((evaluation.root / "metrics.json").read_text())["metrics"]
    values = {name: metrics.get(f"graph/{measure}") for name, measure in MEASURES.items()}
    with (evaluation.root / "tables" / "graph_edit_distance.csv").open() as file:
        errors = tuple(tuple(row[key] for key in ERROR) for row in csv.DictReader(file))
    return Scored({name: value for name, value in values.items() if value is not None}, errors)


def of_measures(name: str) -> Measure:
    """One of the measures; a case is one log, so that there is no interval."""
    figure = statistic(name, np.mean)
    return Measure(lambda records: figure([record.measures for record in records]), interval=False)


def write_errors(results: Results) -> None:
    """Write errors.md."""
    rows = [(trial.case, trial.arm, *error) for trial, record in results.records.items() for error in record.errors]
    (results.bench.out / "errors.md").write_text(markdown("", ("case", "method", *ERROR), rows), encoding="utf-8")


EXPERIMENT = Experiment(
    name="real_supports",
    title="Who rests on whom in the real logs",
    simulated="nothing, but the living room's images are rendered; supports annotated by eye",
    knows="the map of `make real`; with annotated masks, which thing is which",
    does_not_show="How graphs are in rooms in general: one kitchen, one office and one rendered living room, annotated "
    "by one person with rough boxes, and no interval can be given. In our own maps things are missing or have no name, "
    "since the detector has no word for counters, cabinets and curtains, and what it has no word for counts as a wrong "
    "detection. Relations of nearness were not annotated.",
    arms={"ours": "ours", "thesis": "thesis"},
    cases=tuple(f"{log}{ending}" for log in LOGS for ending in ("", ANNOTATED)),
    seeds_of=seeds_of,
    together=lambda trial: trial.seed,
    measure=measure,
    record=Scored,
    measures={name: of_measures(name) for name in MEASURES},
    parameters=RealSupportsParameters,
    places=frozenset({"runs"}),
    inputs=inputs,
    steps=("graph", "evaluate", "truth supports"),
    pictures=write_errors,
)
