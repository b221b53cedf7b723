"""The thesis's tables 2.1 to 2.4 on the data set that they were made on, SceneNN.

For each of the thesis's 20 sequences that is in the folder: ingest, the ground truth out of the annotation, and for
each arm segment, fuse, graph, evaluate. Steps are artifacts below OUT/scenes. docs/DATA.md says what to fetch.
"""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import Field
from scenewright.schemas.contact_graph import ContactGraph, ContactGraphFile
from scenewright.schemas.errors import BadInput, UsageError
from scenewright.schemas.ground_truth import GroundTruth
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.stages.evaluate import EvaluateParameters, PredictedMap, load_map, load_truth
from scenewright.stages.kit.stage import Parameters

from benchmarks.experiment import Bench, Experiment, Results, Trial
from benchmarks.experiments.scenenn.arms import Arm, all_arms
from benchmarks.experiments.scenenn.figures_of_merit import class_figures
from benchmarks.experiments.scenenn.outcomes import Outcome, outcome_of_map
from benchmarks.experiments.scenenn.scenes import Scene, find_scene
from benchmarks.experiments.scenenn.tables import ALL, MEASURES, all_figures, of_ten, printed, read_published
from benchmarks.steps import opened, step

WHAT_TO_FETCH = (
    "make scenenn DATA=folder: SceneNN is not here; fetch <scene>.ply, <scene>.xml, trajectory.log and the frames of "
    "its scenes from https://hkust-vgd.github.io/scenenn/ into folder/<scene>/ (docs/DATA.md, SceneNN)"
)
NAMELESS = ("geometric", "objects")
"""Backends whose masks are class-agnostic."""
SAME_CLASS = {"desk": "table"}
"""Classes of our vocabulary that the thesis's ten know under another name."""


class ScenennParameters(Parameters):
    """Options of the experiment."""

    data: Path | None = Field(None, description="Folder with SceneNN's scenes")
    annotations: Path | None = Field(None, description="Folder with another version of the annotation")
    backend: str = Field("network", description="As in `scenewright segment --backend`")
    weights: Path | None = Field(None, description="Weights of the backend")
    sequences: tuple[str, ...] = Field((), description="Only these (any that the folder has)")
    every: int = Field(3, ge=1, description="Use every n-th frame")
    max_frames: int | None = Field(None, ge=1, description="Frames of a sequence at most")
    voxel_size: float = Field(0.01, gt=0, description="Voxel edge [m]; the thesis's is 0.01")
    matching: Literal["thesis", "words"] = Field("thesis", description="How words of the annotation become classes")


def scenes_of(bench: Bench) -> dict[str, Scene | str]:
    """Return every wanted sequence, or what it lacks. Raises UsageError without a folder, BadInput without a scene."""
    parameters: ScenennParameters = bench.parameters
    if parameters.data is None or not parameters.data.is_dir():
        raise UsageError(WHAT_TO_FETCH)
    names = parameters.sequences or read_published()["sequences"]
    scenes = {name: find_scene(name, parameters.data, parameters.annotations) for name in names}
    if not any(isinstance(scene, Scene) for scene in scenes.values()):
        raise BadInput(f"{parameters.data}: none of the sequences is complete; {WHAT_TO_FETCH}")
    return scenes


def seeds_of(bench: Bench, case: str) -> list[str]:
    """The sequences that are complete; says what the others lack."""
    scenes = scenes_of(bench)
    for name, scene in scenes.items():
        if isinstance(scene, str):
            print(f"{name}: {scene}", file=sys.stderr)
    return [name for name, scene in scenes.items() if isinstance(scene, Scene)]


def inputs(bench: Bench, trial: Trial) -> list[Path]:
    """Annotation and mesh; frames are those of the data set."""
    scene = scenes_of(bench)[trial.seed]
    assert isinstance(scene, Scene)
    weights = bench.parameters.weights
    return [scene.annotation, scene.mesh, *([weights] if weights else [])]


def segments_of(out: Path, sequence: Path, arm: Arm, parameters: ScenennParameters) -> Path:
    """Return the segments of an arm; arms that share the options of `segment` share them."""
    settings = {**arm.segment.model_dump(), "backend": parameters.backend}
    weights: dict[str, Any] = {"weights": parameters.weights} if parameters.weights else {}
    name = hashlib.sha256(repr((sorted(settings.items()), weights)).encode()).hexdigest()[:8]
    return step("segment", out / f"segments-{name}", settings, sequence=sequence, **weights)


def measure(bench: Bench, trials: Sequence[Trial]) -> Iterator[tuple[Trial, Outcome]]:
    """Run the chain of one scene through every arm and yield what each made of it."""
    parameters: ScenennParameters = bench.parameters
    scene, out = scenes_of(bench)[trials[0].seed], bench.out / "scenes" / trials[0].seed
    assert isinstance(scene, Scene)
    frames = {"format": "scenenn", "every": parameters.every, "max_frames": parameters.max_frames}
    sequence = step("ingest", out / "sequence", frames, log=scene.log)
    truth = step(
        "truth scenenn",
        out / "ground_truth",
        {"matching": parameters.matching},
        annotation=scene.annotation,
        mesh=scene.mesh,
        sequence=sequence,
    )
    arms = {arm.name: arm for arm in all_arms(parameters.voxel_size)}
    for trial in trials:
        arm, folder = arms[trial.arm], out / trial.arm
        segments = segments_of(out, sequence, arm, parameters)
        panoptic_map = step("fuse", folder / "panoptic_map", arm.fuse, sequence=sequence, segments=segments)
        graph = step("graph", folder / "contact_graph", arm.graph, panoptic_map=panoptic_map)
        # Without the sequence: the truth of a scan is in its world already.
        step(
            "evaluate",
            folder / "evaluation",
            ground_truth=truth,
            segments=segments,
            panoptic_map=panoptic_map,
            contact_graph=graph,
        )
        yield trial, outcome_of(truth, panoptic_map, graph)


def outcome_of(truth_folder: Path, map_folder: Path, graph_folder: Path) -> Outcome:
    """Measure a map and its boxes against the annotation, by class."""
    options = EvaluateParameters.model_validate({})
    truth = load_truth(opened(GroundTruth, truth_folder), np.eye(4), options.minimum_visible_points)
    predicted = renamed_map(load_map(opened(PanopticMap, map_folder)))
    return outcome_of_map(truth, predicted, renamed_graph(opened(ContactGraph, graph_folder).info), options)


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


def more_figures(results: Results) -> dict[str, float | None]:
    """Every class, every sequence by itself, and how many sequences there were."""
    flat: dict[str, float | None] = {}
    for arm in results.arms():
        flat[f"{arm}/{ALL}/sequences"] = float(len(results.of(arm, ALL)))
        flat |= {f"{arm}/{ALL}/{name}": value for name, value in class_figures(results.of(arm, ALL)).items()}
        for seed in results.seeds(ALL):
            if (outcome := results.get(arm, ALL, seed)) is not None:
                flat |= {f"{arm}/{seed}/{name}": value for name, value in all_figures([outcome]).items()}
    return flat


def notes(results: Results) -> str:
    """Return the thesis's tables with its printed rows, and what was not there."""
    backend = results.bench.parameters.backend
    seeds = results.seeds(ALL)
    parts = [printed(seeds)]
    parts.append(
        f"Masks: {backend}. {len(seeds)} of the thesis's {len(read_published()['sequences'])} sequences: "
        f"{', '.join(seeds)}."
    )
    if backend in NAMELESS:
        parts.append("These masks name no classes: the figures by class are not about them.")
    absent = {name: why for name, why in scenes_of(results.bench).items() if isinstance(why, str)}
    if absent:
        parts.append("Absent: " + "; ".join(f"{name} ({why})" for name, why in absent.items()) + ".")
    return "\n".join(parts) + "\n"


EXPERIMENT = Experiment(
    name="scenenn",
    title="The thesis's tables on SceneNN",
    simulated="Nothing: recordings of the data set, with its annotation.",
    knows="Colour, depth, camera, and the data set's own poses.",
    does_not_show="The thesis's exact set-up: its masks came from another network.",
    arms={arm.name: arm.title for arm in all_arms(0.01)},
    cases=(ALL,),
    seeds_of=seeds_of,
    together=lambda trial: trial.seed,
    measure=measure,
    record=Outcome,
    subcases={ALL: (ALL, of_ten)},
    measures=MEASURES,
    more_figures=more_figures,
    parameters=ScenennParameters,
    places=frozenset({"data", "annotations", "weights", "sequences"}),
    inputs=inputs,
    steps=("ingest", "truth scenenn", "segment", "fuse", "graph", "evaluate"),
    pairs=(("thesis", "thesis_separate"), ("thesis", "voxblox++"), ("ours", "thesis")),
    compared=("pq", "instance_ap", "box_ap"),
    notes=notes,
)
