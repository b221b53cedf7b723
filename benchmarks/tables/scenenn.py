"""`make scenenn DATA=folder`: the thesis's tables 2.1 to 2.4 on the data set they were made on.

For each of the thesis's 20 sequences that is in the folder: ingest, the ground truth out of the annotation, and for
each arm segment, fuse, graph, evaluate. Steps are artifacts below --out/scenes, so that a second call goes on where the
first ended. Writes metrics.json (`<arm>/<sequence or all>/<measure>`, shares) and table.md. docs/DATA.md says what to
fetch.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import sys
from pathlib import Path

import numpy as np

from benchmarks.mapping.arms import Arm, all_arms
from benchmarks.tables.scenenn_scenes import Scene, find_scene
from benchmarks.tables.scenenn_tables import ALL, Outcome, all_figures, make_tables, read_published
from schemas.contact_graph import ContactGraph, ContactGraphFile
from schemas.ground_truth import GroundTruth
from schemas.panoptic_map import PanopticMap
from stages.engine.chain import run_command
from stages.engine.reading import open_artifact
from stages.evaluate.graph_measures import box_candidates
from stages.evaluate.map_measures import (
    PredictedMap,
    instance_candidates,
    label_true_points,
    load_map,
    measure_quality,
    quality_thesis_code,
)
from stages.evaluate.parameters import EvaluateParameters
from stages.evaluate.results import Part
from stages.evaluate.truth import load_truth
from stages.kit.measurement.tables import as_markdown
from stages.kit.stage import Parameters

WHAT_TO_FETCH = (
    "make scenenn DATA=folder: SceneNN is not here; fetch <scene>.ply, <scene>.xml, trajectory.log and the frames of "
    "its scenes from https://hkust-vgd.github.io/scenenn/ into folder/<scene>/ (docs/DATA.md, SceneNN)"
)
NAMELESS = ("geometric", "objects")
"""Backends whose masks are class-agnostic."""
SAME_CLASS = {"desk": "table"}
"""Classes of our vocabulary that the thesis's ten know under another name."""


class StepFailed(Exception):
    """A step of the chain ended with this exit code."""

    def __init__(self, step: str, code: int) -> None:
        super().__init__(f"step {step} ended with {code}")
        self.code = code


def step(name: str, out: Path, *arguments: object) -> Path:
    """Run one scenewright step into `out` unless it is up to date; return `out`. Raises StepFailed.

    Exit code 4 is none: an empty map is a result too.
    """
    code, _ = run_command([*name.split(), *(str(argument) for argument in arguments), "--out", str(out), "--quiet"])
    if code not in (0, 4):
        raise StepFailed(f"{name} ({out})", code)
    return out


def config_file(folder: Path, name: str, parameters: Parameters) -> Path:
    """Write what differs from a step's defaults as a config file, and return its path."""
    folder.mkdir(parents=True, exist_ok=True)
    lines = [f"{key} = {json.dumps(value)}" for key, value in parameters.model_dump(exclude_defaults=True).items()]
    path = folder / f"{name}.toml"
    path.write_text("\n".join(lines) + "\n")
    return path


def segments_of(scene: Path, sequence: Path, arm: Arm, backend: list[str]) -> Path:
    """Return the segments of an arm; arms that share the options of `segment` share them."""
    settings = arm.segment.model_copy(update={"backend": type(arm.segment)().backend})
    text = settings.model_dump_json() + " ".join(backend)
    name = "segments-" + hashlib.sha256(text.encode()).hexdigest()[:8]
    config = config_file(scene / "configs", name, settings)
    return step("segment", scene / name, "--sequence", sequence, "--config", config, *backend)


def run_scene(scene: Scene, arms: list[Arm], out: Path, arguments: argparse.Namespace) -> list[Outcome]:
    """Run the chain of one scene through every arm and measure it. Raises StepFailed."""
    ingest = ["--format", "scenenn", "--every", arguments.every]
    if arguments.max_frames:
        ingest += ["--max-frames", arguments.max_frames]
    sequence = step("ingest", out / "sequence", "--log", scene.log, *ingest)
    truth = step(
        "truth scenenn", out / "ground_truth", "--annotation", scene.annotation, "--mesh", scene.mesh,
        "--sequence", sequence, "--matching", arguments.matching,
    )  # fmt: skip
    backend = ["--backend", arguments.backend]
    if arguments.weights:
        backend += ["--weights", str(arguments.weights)]
    outcomes = []
    for arm in arms:
        print(f"   {scene.name}: {arm.title}", file=sys.stderr, flush=True)
        folder = out / arm.name
        segments = segments_of(out, sequence, arm, backend)
        panoptic_map = step(
            "fuse", folder / "panoptic_map", "--sequence", sequence, "--segments", segments,
            "--config", config_file(folder, "fuse", arm.fuse),
        )  # fmt: skip
        graph = step(
            "graph", folder / "contact_graph", "--panoptic-map", panoptic_map,
            "--config", config_file(folder, "graph", arm.graph),
        )  # fmt: skip
        # Without the sequence: the truth of a scan is in its world already.
        step(
            "evaluate", folder / "evaluation", "--ground-truth", truth, "--segments", segments,
            "--panoptic-map", panoptic_map, "--contact-graph", graph,
        )  # fmt: skip
        outcomes.append(measure(scene.name, arm.name, truth, panoptic_map, graph))
    return outcomes


def measure(scene: str, arm: str, truth_folder: Path, map_folder: Path, graph_folder: Path) -> Outcome:
    """Measure a map and its boxes against the annotation, by class."""
    truth_artifact = open_artifact(truth_folder, GroundTruth)
    map_artifact, graph_artifact = open_artifact(map_folder, PanopticMap), open_artifact(graph_folder, ContactGraph)
    assert isinstance(truth_artifact, GroundTruth) and isinstance(map_artifact, PanopticMap)
    assert isinstance(graph_artifact, ContactGraph)
    options = EvaluateParameters()
    truth = load_truth(truth_artifact, np.eye(4), options.minimum_visible_points)
    predicted = renamed_map(load_map(map_artifact))
    graph = renamed_graph(graph_artifact.info)
    labels = label_true_points(truth, predicted, options.label_distance)
    vertices = {entity.instance: entity.vertices for entity in predicted.info.entities}
    return Outcome(
        scene,
        arm,
        measure_quality(Part("map"), truth, predicted, labels, options),
        quality_thesis_code(truth, predicted, options),
        instance_candidates(truth, predicted, labels),
        box_candidates(truth, graph, vertices, "box_observed", options.match_iou),
        box_candidates(truth, graph, vertices, "box", options.match_iou),
    )


def renamed_map(predicted: PredictedMap) -> PredictedMap:
    """Return the map with the classes that the thesis's ten know under another name renamed."""
    entities = tuple(
        entity.model_copy(update={"class_name": SAME_CLASS.get(entity.class_name, entity.class_name)})
        for entity in predicted.info.entities
    )
    info = predicted.info.model_copy(update={"entities": entities})
    return PredictedMap(info, predicted.surface, predicted.vertex_instances)


def renamed_graph(graph: ContactGraphFile) -> ContactGraphFile:
    """Return the graph with the same classes renamed."""
    nodes = tuple(
        node.model_copy(update={"class_name": SAME_CLASS.get(node.class_name, node.class_name)}) for node in graph.nodes
    )
    return graph.model_copy(update={"nodes": nodes})


def report(outcomes: list[Outcome], absent: dict[str, str], arguments: argparse.Namespace) -> str:
    """Write metrics.json and table.md; return the text."""
    published = read_published()
    metrics = all_figures(outcomes, published)
    arms = list(dict.fromkeys(outcome.arm for outcome in outcomes))
    scenes = sorted({outcome.scene for outcome in outcomes})
    metrics |= {f"{arm}/{ALL}/sequences": float(len(scenes)) for arm in arms}
    parts = [as_markdown(table) for table in make_tables(metrics, arms, published)]
    total = len(published["sequences"])
    parts.append(f"Masks: {arguments.backend}. {len(scenes)} of the thesis's {total} sequences: {', '.join(scenes)}.")
    if arguments.backend in NAMELESS:
        parts.append("These masks name no classes: the figures by class are not about them.")
    if absent:
        parts.append("Absent: " + "; ".join(f"{name} ({why})" for name, why in absent.items()) + ".")
    text = "\n".join(parts) + "\n"
    (arguments.out / "metrics.json").write_text(json.dumps(metrics, indent=1, sort_keys=True) + "\n")
    (arguments.out / "table.md").write_text(text)
    return text


def main(words: list[str] | None = None) -> int:
    """Run what is there, list what is not, print the tables."""
    names = [arm.name for arm in all_arms(0.01)]
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, help="folder with SceneNN's scenes")
    parser.add_argument("--annotations", type=Path, help="folder with another version of the annotation")
    parser.add_argument("--backend", default="network", help="as in `scenewright segment --backend`")
    parser.add_argument("--weights", type=Path, help="weights of the backend")
    parser.add_argument("--arms", nargs="*", default=names, choices=names, metavar="ARM", help=" ".join(names))
    parser.add_argument("--sequences", nargs="*", metavar="ID", help="only these (any that the folder has)")
    parser.add_argument("--every", type=int, default=3, help="use every n-th frame")
    parser.add_argument("--max-frames", type=int)
    parser.add_argument("--voxel-size", type=float, default=0.01, help="[m]; the thesis's is 0.01")
    parser.add_argument("--matching", choices=("thesis", "words"), default="thesis")
    parser.add_argument("--out", type=Path, default=Path("outputs/experiments/scenenn"))
    arguments = parser.parse_args(words)
    if arguments.data is None or not arguments.data.is_dir():
        print(WHAT_TO_FETCH, file=sys.stderr)
        return 2
    found = {
        name: find_scene(name, arguments.data, arguments.annotations)
        for name in arguments.sequences or read_published()["sequences"]
    }
    absent = {name: scene for name, scene in found.items() if isinstance(scene, str)}
    for name, why in absent.items():
        print(f"{name}: {why}", file=sys.stderr)
    scenes = [scene for scene in found.values() if isinstance(scene, Scene)]
    if not scenes:
        print(f"{arguments.data}: none of the sequences is complete; {WHAT_TO_FETCH}", file=sys.stderr)
        return 3
    arms = [arm for arm in all_arms(arguments.voxel_size) if arm.name in arguments.arms]
    outcomes: list[Outcome] = []
    worst = 0
    for scene in scenes:
        print(f"== {scene.name}", file=sys.stderr, flush=True)
        try:
            outcomes += run_scene(scene, arms, arguments.out / "scenes" / scene.name, arguments)
        except StepFailed as error:
            print(f"{scene.name}: {error}", file=sys.stderr)
            absent[scene.name] = str(error)
            worst = error.code
    if outcomes:
        print(report(outcomes, absent, arguments))
    return worst


if __name__ == "__main__":
    sys.exit(main())
