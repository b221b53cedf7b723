"""`make real-supports`: contact graphs of the real logs against what stands on what in the pictures.

    python -m benchmarks.tables.real_supports --runs FOLDER --out FOLDER

Reads what `make real` left below FOLDER (<log>/sequence and <log>/panoptic_map). Arms: `ours` and `thesis`
(`graph --method`). Cases: <log>, the map of the run, and <log>_annotated_masks, the same surface with the annotated
things for entities, which leaves the graph's own mistakes. Annotations: data/annotations/real.
Writes metrics.json, table.md and errors.md, every error of the edit distance.
"""

from __future__ import annotations

import argparse
import csv
import json
import tempfile
from pathlib import Path

import numpy as np
import trimesh

from benchmarks.scene.perfect_maps import write_map
from benchmarks.tables.tabletop_maps import context_in
from schemas.errors import BadInput
from schemas.ground_truth import GroundTruth
from schemas.panoptic_map import PanopticMap
from schemas.sequence import Sequence
from stages.engine.reading import open_artifact
from stages.evaluate.parameters import EvaluateParameters
from stages.evaluate.stage import run as evaluate
from stages.graph.parameters import GraphParameters
from stages.graph.stage import run as graph_of
from stages.kit.formats.mesh_files import read_mesh
from stages.truth.annotated_points import instances_of
from stages.truth.parameters import SupportsParameters
from stages.truth.support_annotation import SupportAnnotation, read_support_annotation
from stages.truth.supports import run as truth_of

ANNOTATIONS = Path(__file__).resolve().parents[2] / "data" / "annotations" / "real"
METHODS = ("ours", "thesis")
EVERY = 3
"""Every how many-th frame of the sequence shows the annotated things their surface."""
LEAST_FACES = 10
MEASURES = {
    "edit_distance": "edit_distance", "wrong_support": "wrong_supports", "missing_detection": "missing_detections",
    "wrong_detection": "wrong_detections", "support_f1": "any_support_f1", "support_precision": "any_support_precision",
    "support_recall": "any_support_recall", "supports_f1": "supports_f1", "carries_on_wall_f1": "carries_on_wall_f1",
    "true_nodes": "true_nodes", "predicted_nodes": "predicted_nodes", "exact": "edit_distance_exact",
}  # fmt: skip
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


def score(
    truth: GroundTruth, made: PanopticMap, method: str, work: Path
) -> tuple[dict[str, float], list[dict[str, str]]]:
    """Return the measures of one graph and the rows of its errors."""
    parameters = GraphParameters(method=method)  # type: ignore[arg-type]
    graph = graph_of(made, parameters=parameters, context=context_in(work / "graph"))
    done = evaluate(
        ground_truth=truth, panoptic_map=made, contact_graph=graph, parameters=EvaluateParameters(plots=False),
        context=context_in(work / "evaluation"),
    )  # fmt: skip
    found = json.loads((done.root / "metrics.json").read_text())["metrics"]
    values = {name: found.get(f"graph/{measure}") for name, measure in MEASURES.items()}
    with (done.root / "tables" / "graph_edit_distance.csv").open() as file:
        errors = list(csv.DictReader(file))
    return {name: value for name, value in values.items() if value is not None}, errors


def table_of(results: dict[str, dict[str, dict[str, float]]]) -> str:
    """Return table.md. results: case -> method -> measures."""
    lines = [
        "| case | method | edit distance | wrong supports | missing | wrong detections | support P | R | F1 |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for case, methods in results.items():
        for method, m in methods.items():
            bound = "" if m.get("exact") else " (at most)"
            shares = " | ".join(
                f"{m.get(f'support_{name}', float('nan')):.3f}" for name in ("precision", "recall", "f1")
            )
            lines.append(
                f"| {case} | {method} | {m['edit_distance']:.0f}{bound} | {m['wrong_support']:.0f} "
                f"| {m['missing_detection']:.0f} | {m['wrong_detection']:.0f} | {shares} |"
            )
    counts = ", ".join(f"{case}: {methods['ours']['true_nodes']:.0f}" for case, methods in results.items())
    return "\n".join([*lines, "", f"True nodes, walls as one: {counts}.", ""])


def main() -> None:
    """Score both methods on every annotated log that has been run."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=Path, required=True, help="folder that `make real` wrote")
    parser.add_argument("--out", type=Path, required=True)
    arguments = parser.parse_args()
    results: dict[str, dict[str, dict[str, float]]] = {}
    errors = [
        "| case | method | error | true | predicted | true parent | predicted parent |",
        "|---|---|---|---|---|---|---|",
    ]
    for path in sorted(ANNOTATIONS.glob("*.json")):
        run = arguments.runs / path.stem
        if not (run / "panoptic_map" / "manifest.json").is_file():
            print(f"real-supports: {run} has no map, {path.stem} is left out (`make real` makes it)")
            continue
        with tempfile.TemporaryDirectory() as folder:
            work = Path(folder)
            try:
                sequence = open_artifact(run / "sequence", Sequence)
                made = open_artifact(run / "panoptic_map", PanopticMap)
                assert isinstance(sequence, Sequence) and isinstance(made, PanopticMap)
                parameters = SupportsParameters(every=EVERY)
                truth = truth_of(path, sequence, parameters=parameters, context=context_in(work / "truth"))
            except BadInput as error:
                raise SystemExit(f"real-supports: {error}") from None
            told = read_support_annotation(path)
            maps = {path.stem: made, f"{path.stem}_annotated_masks": annotated_map(told, made, work / "annotated")}
            for case, one in maps.items():
                for method in METHODS:
                    values, rows = score(truth, one, method, work / case / method)
                    results.setdefault(case, {})[method] = values
                    keys = ("error", "true", "predicted", "true parent", "predicted parent")
                    errors += [f"| {case} | {method} | " + " | ".join(row[key] for key in keys) + " |" for row in rows]
    if not results:
        return
    arguments.out.mkdir(parents=True, exist_ok=True)
    metrics = {f"{m}/{case}/{k}": v for case, ms in results.items() for m, vs in ms.items() for k, v in vs.items()}
    (arguments.out / "metrics.json").write_text(json.dumps(metrics, indent=2, sort_keys=True) + "\n")
    (arguments.out / "table.md").write_text(table_of(results))
    (arguments.out / "errors.md").write_text("\n".join(errors) + "\n")
    print(table_of(results))


if __name__ == "__main__":
    main()
