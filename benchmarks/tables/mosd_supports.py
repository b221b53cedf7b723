"""`make mosd-supports`: which object rests on which, on real Kinect frames, against annotations made by eye.

    python -m benchmarks.tables.mosd_supports --data FOLDER --out FOLDER [--quick]

One frame at a time becomes sequence, segments, map and contact graph. Arms: `ours` and `thesis` (`graph --method`).
Cases: `learn` (15 frames, on which constants of `graph` were set) and `test` (31 frames) from the data set's masks, and
`learn_own_masks`, `test_own_masks` from `segment --backend objects`. Annotations: data/annotations/mosd_supports.
Writes metrics.json, table.md and wrong.md, the list of every wrong edge.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import tempfile
import time
from pathlib import Path

import cv2
import numpy as np

from benchmarks.tables.mosd import CAMERA, DEPTH_UNIT, kind_of
from benchmarks.tables.support_score import SupportScore, f1, score_graph
from benchmarks.tables.tabletop_maps import LabelledView, build_map, context_in, nodes_of_entities, upright_pose
from schemas.contact_graph import ContactGraphFile
from schemas.errors import BadInput
from schemas.panoptic_map import PanopticMap
from stages.graph.parameters import GraphParameters
from stages.graph.stage import run as graph_of
from stages.truth.support_annotation import SupportAnnotation, read_support_annotation

ANNOTATIONS = Path(__file__).resolve().parents[2] / "data" / "annotations" / "mosd_supports"
BASE = "table"
METHODS = ("ours", "thesis")
BACKENDS = {"": "ground-truth", "_own_masks": "objects"}
"""Ending of the case -> where its masks come from."""
QUICK_STEP = 5


def number(path: Path) -> int:
    """The number in the name of a frame."""
    return int("".join(c for c in path.stem if c.isdigit()) or 0)


def read_view(folder: Path, frame: str, told: SupportAnnotation) -> LabelledView:
    """Return a frame with the annotated nodes in place of labels. Raises BadInput when an image is missing."""
    kinds = ("color", "depth", "label")
    images = [cv2.imread(str(folder / f"{frame}.{kind}.png"), cv2.IMREAD_UNCHANGED) for kind in kinds]
    color, depth, label = images
    if color is None or depth is None or label is None:
        raise BadInput(f"{folder / frame}: color, depth or label is missing", hint="copy the data set again")
    metres = depth.astype(np.float32) * np.float32(DEPTH_UNIT)
    nodes = np.zeros(label.shape, dtype=np.int64)
    for k, node in enumerate(told.nodes, 1):
        nodes[np.isin(label, node.find.labels)] = k
    table = nodes == [node.name for node in told.nodes].index(BASE) + 1
    pose = upright_pose(metres, table, CAMERA)
    classes = tuple(node.class_name for node in told.nodes)
    return LabelledView(cv2.cvtColor(color, cv2.COLOR_BGR2RGB), metres, nodes, classes, pose)


def build_graph(made: PanopticMap, method: str, folder: Path) -> ContactGraphFile:
    """The contact graph of a map by one of METHODS."""
    parameters = GraphParameters(method=method)  # type: ignore[arg-type]
    return graph_of(made, parameters=parameters, context=context_in(folder)).info


def judge_frame(folder: Path, annotation: Path, backend: str, work: Path) -> tuple[dict[str, SupportScore], float]:
    """Return method -> score of one frame, and the processor time of the graph by our method [s]."""
    told = read_support_annotation(annotation)
    view = read_view(folder, annotation.stem, told)
    _, made = build_map(view, CAMERA, backend, work)
    node_of = {entity: told.nodes[k - 1].name for entity, k in nodes_of_entities(made, view, CAMERA).items()}
    scores, seconds = {}, 0.0
    for method in METHODS:
        started = time.process_time()
        graph = build_graph(made, method, work / method)
        seconds = time.process_time() - started if method == "ours" else seconds
        scores[method] = score_graph(told, graph, node_of, BASE)
    return scores, seconds


def measures_of(score: SupportScore) -> dict[str, float]:
    """Return what metrics.json holds of one arm and case."""

    def share(part: int, whole: int) -> float:
        return part / whole if whole else 1.0

    found = {
        "support_precision": share(score.agreed, score.predicted),
        "support_recall": share(score.agreed, score.true),
        "support_f1": f1(score.true, score.predicted, score.agreed),
        "on_things_precision": share(score.agreed_to_things, score.predicted_to_things),
        "on_things_recall": share(score.agreed_to_things, score.true_to_things),
        "on_things_f1": f1(score.true_to_things, score.predicted_to_things, score.agreed_to_things),
        "edges": float(score.true),
        "edges_on_things": float(score.true_to_things),
        "doubtful": float(score.doubtful),
        "wrong": float(len(score.wrong)),
    }
    for relation, counts in score.second.items():
        found[f"{relation}_f1"] = f1(*counts)
        found |= {
            f"{relation}_{name}": float(n) for name, n in zip(("true", "predicted", "agreed"), counts, strict=True)
        }
    for level, (children, right) in sorted(score.levels.items()):
        found[f"level_{level}_right"] = share(right, children)
        found[f"level_{level}_objects"] = float(children)
    return found


def table_of(
    results: dict[str, dict[str, SupportScore]], by_kind: dict[str, SupportScore], frames: dict[str, int]
) -> str:
    """Return table.md. results: method -> case -> score; by_kind: kind of test scene -> score of our method."""
    lines = [
        "| case | frames | method | objects | P | R | F1 | on things P | R | F1 | second: true, found, right |",
        "|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    for case in results[METHODS[0]]:
        for method in METHODS:
            score = results[method][case]
            m = measures_of(score)
            second = ", ".join(map(str, score.second["second"]))
            lines.append(
                f"| {case} | {frames[case]} | {method} | {score.true} | {m['support_precision']:.3f} "
                f"| {m['support_recall']:.3f} | {m['support_f1']:.3f} | {m['on_things_precision']:.3f} "
                f"| {m['on_things_recall']:.3f} | {m['on_things_f1']:.3f} | {second} |"
            )
    lines += ["", "Objects whose carrier is right, by level (1 stands on the table):", ""]
    levels = sorted({level for cases in results.values() for score in cases.values() for level in score.levels})
    lines += ["| case | method | " + " | ".join(map(str, levels)) + " |", "|---|---|" + "---|" * len(levels)]
    for case in results[METHODS[0]]:
        for method in METHODS:
            own = results[method][case].levels
            cells = [f"{own[level][1]} of {own[level][0]}" if level in own else "" for level in levels]
            lines.append(f"| {case} | {method} | " + " | ".join(cells) + " |")
    lines += ["", "By kind of scene, `test`, ours, from the data set's masks:", "", "| kind | objects | right | F1 |"]
    lines.append("|---|---|---|---|")
    for kind, score in by_kind.items():
        lines.append(
            f"| {kind} | {score.true} | {score.agreed} | {f1(score.true, score.predicted, score.agreed):.3f} |"
        )
    lines += [
        "",
        "An object that two things carry counts as right with either; `on things` leaves out the edges to the table; "
        "`second` are further carriers and what things lean on. "
        "Objects whose predicted carrier the annotator could not rule out are left out: "
        + ", ".join(f"{results['ours'][case].doubtful} in {case}" for case in results["ours"])
        + ".",
        "",
    ]
    return "\n".join(lines)


def wrong_of(results: dict[str, dict[str, SupportScore]]) -> str:
    """Return wrong.md: every wrong edge."""
    lines = ["| method | case | frame | object | carried by | predicted |", "|---|---|---|---|---|---|"]
    for method, cases in results.items():
        for case, score in cases.items():
            for scene, child, true, predicted in score.wrong:
                lines.append(f"| {method} | {case} | {scene.split('/')[-1]} | {child} | {true} | {predicted} |")
    return "\n".join(lines) + "\n"


def main() -> None:
    """Judge both methods on every annotated frame and write what they reach."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True, help="folder that holds mosd_tabletop")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--quick", action="store_true", help=f"every {QUICK_STEP}th frame")
    parser.add_argument("--case", nargs="*", help="these cases alone")
    arguments = parser.parse_args()
    root = arguments.data / "mosd_tabletop"
    if not root.is_dir():
        print(f"mosd-supports: {root} is not there, nothing is measured (docs/DATA.md says where the data come from)")
        return
    cases = arguments.case or [f"{case}{ending}" for ending in BACKENDS for case in ("learn", "test")]
    results: dict[str, dict[str, SupportScore]] = {method: {} for method in METHODS}
    by_kind: dict[str, SupportScore] = {}
    frames: dict[str, int] = {}
    seconds: list[float] = []
    for case in cases:
        folder, ending = case.split("_")[0], case[len(case.split("_")[0]) :]
        files = sorted((ANNOTATIONS / folder).glob("*.json"), key=number)[:: QUICK_STEP if arguments.quick else 1]
        frames[case] = len(files)
        for method in METHODS:
            results[method][case] = SupportScore()
        for path in files:
            with tempfile.TemporaryDirectory() as work:
                try:
                    scores, spent = judge_frame(root / folder, path, BACKENDS[ending], Path(work))
                except BadInput as error:
                    raise SystemExit(f"mosd-supports: {error}") from None
            seconds.append(spent)
            for method, score in scores.items():
                results[method][case].add(score)
            if case == "test":
                by_kind.setdefault(kind_of("test", path.stem), SupportScore()).add(scores["ours"])
    metrics = {
        f"{method}/{case}/{measure}": value
        for method, of_case in results.items()
        for case, score in of_case.items()
        for measure, value in measures_of(score).items()
    }
    metrics["ours/all/graph_processor_ms"] = float(1000 * np.median(seconds))
    arguments.out.mkdir(parents=True, exist_ok=True)
    (arguments.out / "metrics.json").write_text(json.dumps(metrics, indent=2, sort_keys=True) + "\n")
    table = table_of(results, by_kind, frames)
    table += (
        f"\nProcessor time of one graph by our method: {1000 * np.median(seconds):.0f} ms (median of {len(seconds)}; "
        f"{os.cpu_count()} processors, {platform.machine()}).\n"
    )
    (arguments.out / "table.md").write_text(table)
    (arguments.out / "wrong.md").write_text(wrong_of(results))
    print(table)


if __name__ == "__main__":
    main()
