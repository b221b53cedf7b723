"""Which object rests on which, on real Kinect frames of tabletops, against annotations made by eye.

One frame at a time becomes sequence, segments, map and contact graph. Arms: `ours` and `thesis` (`graph --method`).
Cases: `learn` (15 frames, on which constants of `graph` were set) and `test` (31 frames) from the data set's masks, and
`learn_own_masks`, `test_own_masks` from `segment --backend objects`. Annotations: data/annotations/mosd_supports.
Writes wrong.md too, the list of every wrong edge.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from pydantic import Field
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.formats.mosd_frames import CAMERA, DEPTH_UNIT, FOLDER, frame_files, kind_of
from scenewright.stages.kit.stage import Parameters
from scenewright.stages.truth import SupportAnnotation, read_support_annotation

from benchmarks.experiment import Bench, Experiment, Measure, Results, Trial, median
from benchmarks.experiments.mosd_supports.support_score import SupportScore, f1, score_graph
from benchmarks.experiments.mosd_supports.tabletop_maps import LabelledView, build_map, nodes_of_entities, upright_pose
from benchmarks.steps import unrecorded
from benchmarks.tabulation import markdown

ANNOTATIONS = Path(__file__).resolve().parents[3] / "data" / "annotations" / "mosd_supports"
BASE = "table"
BACKENDS = {"": "ground-truth", "_own_masks": "objects"}
"""Ending of the case -> where its masks come from."""
QUICK_STEP = 5


class MosdSupportsParameters(Parameters):
    """Options of the experiment."""

    data: Path = Field(Path("../shared/data"), description=f"Folder that holds {FOLDER}")


@dataclass(frozen=True)
class FrameSupports:
    """What a method makes of a frame."""

    score: SupportScore
    processor_ms: float
    """Of the graph."""


def number(path: Path) -> int:
    """The number in the name of a frame."""
    return int("".join(c for c in path.stem if c.isdigit()) or 0)


def read_view(folder: Path, frame: str, told: SupportAnnotation) -> LabelledView:
    """Return a frame with the annotated nodes in place of labels. Raises BadInput when an image is missing."""
    color, depth, label = (cv2.imread(str(path), cv2.IMREAD_UNCHANGED) for path in frame_files(folder, frame))
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


def parts_of(bench: Bench, case: str) -> tuple[Path, Path, str]:
    """Return (folder of the frames, folder of the annotations, where the masks come from) of a case."""
    name, *ending = case.split("_", 1)
    return bench.parameters.data / FOLDER / name, ANNOTATIONS / name, BACKENDS["_" + ending[0] if ending else ""]


def seeds_of(bench: Bench, case: str) -> Sequence[str]:
    """The annotated frames that are there."""
    frames, annotations, _ = parts_of(bench, case)
    files = sorted(annotations.glob("*.json"), key=number)[:: QUICK_STEP if bench.quick else 1]
    return [path.stem for path in files if frames.is_dir()]


def inputs(bench: Bench, trial: Trial) -> list[Path]:
    """The frame and its annotation."""
    frames, annotations, _ = parts_of(bench, trial.case)
    return [*frame_files(frames, trial.seed), annotations / f"{trial.seed}.json"]


def measure(bench: Bench, trials: Sequence[Trial]) -> Iterator[tuple[Trial, FrameSupports]]:
    """Yield what the methods make of the map of one frame."""
    frames, annotations, backend = parts_of(bench, trials[0].case)
    told = read_support_annotation(annotations / f"{trials[0].seed}.json")
    view = read_view(frames, trials[0].seed, told)
    with tempfile.TemporaryDirectory() as folder:
        panoptic_map = build_map(view, CAMERA, backend, Path(folder))
        entities = nodes_of_entities(panoptic_map, view, CAMERA)
        node_of = {entity: told.nodes[k - 1].name for entity, k in entities.items()}
        for trial in trials:
            started = time.process_time()
            parameters = {"method": trial.arm}
            graph = unrecorded("graph", Path(folder) / trial.arm, parameters, panoptic_map=panoptic_map).info
            spent = 1000 * (time.process_time() - started)
            yield trial, FrameSupports(score_graph(told, graph, node_of, BASE), spent)


def pooled(records: Sequence[FrameSupports]) -> SupportScore:
    """Add the counts of frames."""
    total = SupportScore()
    for record in records:
        total.add(record.score)
    return total


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


def of_counts(name: str) -> Callable[[Sequence[FrameSupports]], float | None]:
    """A measure of the pooled counts."""
    return lambda records: measures_of(pooled(records)).get(name)


SHARES = (
    "support_precision",
    "support_recall",
    "support_f1",
    "on_things_precision",
    "on_things_recall",
    "on_things_f1",
)
COUNTS = [name for name in measures_of(SupportScore()) if name not in SHARES]
MEASURES = {name: Measure(of_counts(name)) for name in SHARES}
MEASURES |= {name: Measure(of_counts(name), interval=False) for name in COUNTS}
MEASURES["graph_processor_ms"] = median("processor_ms", "ms", interval=False)


def kinds_of(results: Results) -> dict[str, list[FrameSupports]]:
    """Return the frames of `test` by the kind of scene, ours from the data set's masks."""
    kinds: dict[str, list[FrameSupports]] = {}
    for trial, record in results.records.items():
        if (trial.arm, trial.case) == ("ours", "test"):
            kinds.setdefault(kind_of("test", trial.seed), []).append(record)
    return kinds


def more_figures(results: Results) -> dict[str, float | None]:
    """The levels, and the time of our graphs over all cases."""
    flat: dict[str, float | None] = {}
    for case in results.cases:
        for arm in results.arms(case):
            found = measures_of(pooled(results.of(arm, case)))
            flat |= {f"{arm}/{case}/{name}": value for name, value in found.items() if name.startswith("level_")}
    for kind, records in kinds_of(results).items():
        score = pooled(records)
        flat[f"ours/test_{kind.replace(' ', '_')}/edges"] = float(score.true)
        flat[f"ours/test_{kind.replace(' ', '_')}/support_f1"] = f1(score.true, score.predicted, score.agreed)
    ours = [record.processor_ms for trial, record in results.records.items() if trial.arm == "ours"]
    flat["ours/all/graph_processor_ms"] = float(np.median(ours)) if ours else None
    return flat


def notes(results: Results) -> str:
    """Return what the figures mean."""
    return (
        "An object that two things carry counts as right with either; `on things` leaves out the edges to the table; "
        "`second` are further carriers and what things lean on. Objects whose predicted carrier the annotator could "
        "not rule out are left out (`doubtful`).\n"
    )


def write_wrong(results: Results) -> None:
    """Write wrong.md: every wrong edge."""
    rows = [
        (trial.arm, trial.case, scene.split("/")[-1], child, true, predicted)
        for trial, record in results.records.items()
        for scene, child, true, predicted in record.score.wrong
    ]
    text = markdown("", ("method", "case", "frame", "object", "carried by", "predicted"), rows)
    (results.bench.out / "wrong.md").write_text(text, encoding="utf-8")


EXPERIMENT = Experiment(
    name="mosd_supports",
    title="Who rests on whom on real tabletops",
    simulated="Nothing: frames of a Kinect; what rests on what was annotated by eye. A frame is shown twelve times.",
    knows="Colour, depth, camera, which way is up (the normal of the table); the data set's masks, but for the cases "
    "own_masks.",
    does_not_show="Rooms, or maps of many views; `learn` was looked at while constants were set.",
    arms={"ours": "ours", "thesis": "thesis"},
    cases=tuple(f"{case}{ending}" for ending in BACKENDS for case in ("learn", "test")),
    seeds_of=seeds_of,
    together=lambda trial: (trial.case, trial.seed),
    measure=measure,
    record=FrameSupports,
    measures=MEASURES,
    more_figures=more_figures,
    parameters=MosdSupportsParameters,
    places=frozenset({"data"}),
    inputs=inputs,
    steps=("ingest", "segment", "fuse", "graph"),
    pairs=(("ours", "thesis"),),
    compared=("support_f1", "on_things_f1"),
    notes=notes,
    pictures=write_wrong,
)
