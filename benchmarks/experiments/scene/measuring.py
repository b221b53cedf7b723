"""One generated room through all arms of a case: map, contact graph, CAD scene, URDF scene, each measured."""

from __future__ import annotations

import shutil
import time
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import Field
from scenewright.schemas.cad_library import CadLibrary, CadModel, LibraryFile
from scenewright.schemas.cad_scene import CadScene
from scenewright.schemas.contact_graph import SCENE_NODE, ContactGraphFile, GraphNode
from scenewright.schemas.ground_truth import GroundTruth
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.schemas.sequence import Sequence as SequenceArtifact
from scenewright.stages.cad import ModelSurface, Shortlist, choose_and_write, find_candidates
from scenewright.stages.cad.stage import METHODS
from scenewright.stages.evaluate import (
    ObjectResult,
    TrueRoom,
    label_true_points,
    load_map,
    load_truth,
    point_overlaps,
    replacements_of,
    true_shapes,
)
from scenewright.stages.kit.formats.mobility import BUILT_IN, STANDS
from scenewright.stages.kit.stage import Parameters
from scenewright.stages.urdf import mujoco_motions
from scenewright.stages.urdf.settle_report import BodyMotion, SettleReport, settle_report

from benchmarks.experiment import Bench, Trial
from benchmarks.experiments.mapping.experiment import EXPERIMENT as MAPPING
from benchmarks.experiments.mapping.measuring import MappingParameters, room_for
from benchmarks.experiments.scene.arms import ARMS, MAPS, OF_HELD_OUT, OF_PERFECT, REAL, Arm
from benchmarks.experiments.scene.shown import shown_by_masks
from benchmarks.experiments.scene.stand_ins import lacking, nearest_stand_in, without_styles
from benchmarks.generated_rooms import INDEPENDENT_RECIPES, make_library, recipe_of, room_at, room_of
from benchmarks.graph_scores import OPTIONS, distance_figures, judge
from benchmarks.keeping import measure_missing
from benchmarks.perfect_maps import perfect_map
from benchmarks.steps import StepFailed, context_in, made, opened, unrecorded

ARM = {arm.name: arm for arm in ARMS}
SEED = 0
HELD_OUT_SEED = 501
"""Of the library whose shapes no room has."""
RESCALED = 0.2
"""Largest share by which things of the independent rooms are larger or smaller than their models."""
BY_TRUTH = "_by_truth"
"""Ending of figures of the things that have to be free by what they truly are, not by what the map calls them."""
ANNOTATIONS = Path(__file__).resolve().parents[3] / "data" / "annotations" / "real"


class SceneParameters(Parameters):
    """Options of the experiment."""

    maps: Path = Field(Path("outputs/experiments/bench-mapping"), description="What `mapping` writes: its rooms, maps")
    real: Path | None = Field(None, description="What `make real` wrote; the case `real` needs its maps")
    frames: int = Field(60, ge=1, description="Frames of every room")
    width: int = Field(640, ge=64, description="Width of the pictures [pixels]; their height is three quarters of it")
    as_is: bool = Field(False, description="Take rooms and maps as they stand, even of older code")
    keep: bool = Field(False, description="Keep the artifacts (100 MB an arm and case)")


@dataclass(frozen=True)
class Outcome:
    """What one arm made of one room in one case: plain numbers, so that rooms run in processes of their own."""

    graph: dict[str, float]
    """Edit distance and its parts."""
    edges: dict[str, tuple[int, int, int]]
    """Relation -> (true, predicted, agreed)."""
    cad: dict[str, float | None] = field(default_factory=dict)
    """`room_summary`; empty where no models are true."""
    failures: tuple[tuple[str, str, str], ...] = ()
    """(object, class, why): objects that are no success."""
    physics: dict[str, float] = field(default_factory=dict)
    unsettled: tuple[str, ...] = ()
    """What did not stay, in words."""


@dataclass(frozen=True)
class Room:
    """Truth and maps of one room."""

    name: str
    truth_artifact: GroundTruth
    truth: TrueRoom
    world_from_log: np.ndarray
    maps: Mapping[tuple[str, str], Path]
    """(case, arm of `mapping`) -> its map of this room."""
    library: CadLibrary
    """That it was furnished from."""
    held_out: CadLibrary
    """Of other shapes, without its styles."""
    shown: Mapping[str, Mapping[str, float]]
    """Case of `mapping` -> what its masks alone show."""


def measure(bench: Bench, trials: Sequence[Trial]) -> Iterator[tuple[Trial, Outcome]]:
    """Yield the outcomes of the trials of one room, or of one real log."""
    wanted = {(trial.case, trial.arm): trial for trial in trials}
    shared = Shared()
    if trials[0].case == REAL:
        folder, scratch = bench.parameters.real / trials[0].seed, bench.out / "scenes" / trials[0].seed
        for name, outcome in run_real(folder, scratch, [arm for arm in ARMS if (REAL, arm.name) in wanted]):
            yield wanted[REAL, name], outcome
        return
    room = load_room(bench, trials[0].seed, {(MAPS[t.case], ARM[t.arm].map_arm) for t in trials if t.case in MAPS})
    for case in dict.fromkeys(trial.case for trial in trials):
        arms = [arm for arm in ARMS if (case, arm.name) in wanted]
        outcomes = run_case(room, arms, case, bench.out / "scenes", shared, keep=bench.parameters.keep)
        for arm, made_of_it in zip(arms, outcomes, strict=True):
            yield wanted[case, arm.name], made_of_it


def held_out_library(bench: Bench) -> Path:
    """Where the library stands that shares no shape with the rooms, whole."""
    return bench.out / "held_out_library"


def library_lacking(library: CadLibrary, room: Sequence[CadModel], folder: Path) -> CadLibrary:
    """Write a library without the styles of a room's models (`without_styles`), which has the folders of `library`."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    (folder / "models").symlink_to(library.path("models").resolve(), target_is_directory=True)
    models = tuple(without_styles(library.info.models, room))
    LibraryFile(seed=library.info.seed, models=models).write(folder / "library.json")
    return CadLibrary(folder)


def prepare(bench: Bench, trials: Sequence[Trial]) -> None:
    """Make both libraries before rooms run beside each other."""
    if not bench.parameters.as_is:
        make_library(bench.parameters.maps / "rooms")
    made("library build", held_out_library(bench), "--seed", HELD_OUT_SEED)


def load_room(bench: Bench, name: str, wanted: Collection[tuple[str, str]]) -> Room:
    """Read a room, and make what is missing of it and of the `wanted` maps, (case, arm) of `mapping`.

    Raises BadInput or StepFailed.
    """
    parameters: SceneParameters = bench.parameters
    rooms = parameters.maps / "rooms"
    rescaled = RESCALED if recipe_of(room_of(name)) in INDEPENDENT_RECIPES else 0.0
    told = {"frames": parameters.frames, "width": parameters.width, "rescaled": rescaled}
    of_maps = MappingParameters.model_validate(told)
    folder = room_at(rooms, room_of(name), parameters.frames)
    if not (parameters.as_is and folder.ground_truth.is_dir() and folder.sequence.is_dir()):
        folder = room_for(rooms, name, of_maps)
    mapping = Bench(parameters.maps, of_maps, bench.quick)
    trials = [Trial(arm, case, name) for case, arm in sorted(wanted)]
    if trials and (code := measure_missing(MAPPING, mapping, trials, any_code=parameters.as_is)):
        raise StepFailed(f"mapping of {name}", code)
    sequence, artifact = opened(SequenceArtifact, folder.sequence), opened(GroundTruth, folder.ground_truth)
    world_from_log = np.array(sequence.info.gravity.world_from_log)
    truth = load_truth(artifact, world_from_log, OPTIONS.minimum_visible_points)
    library, used = CadLibrary(rooms / "cad_library"), {thing.model_id for thing in artifact.info.objects}
    own = [model for model in library.info.models if model.id in used]
    held_out = library_lacking(CadLibrary(held_out_library(bench)), own, bench.out / "libraries" / name)
    maps = {(trial.case, trial.arm): mapping.folder(trial) / "panoptic_map" for trial in trials}
    shown = {case: shown_by_masks(name, sequence, case) for case in sorted({case for case, _ in wanted})}
    return Room(name, artifact, truth, world_from_log, maps, library, held_out, shown)


@dataclass(frozen=True)
class Found:
    """What arms that differ in the global check alone share of one map and library."""

    shortlists: dict[str, Shortlist]
    surfaces: dict[str, ModelSurface]
    seconds: float
    scene: Path
    """Where the built-ins were written that it names (`models/`)."""


class Shared:
    """Contact graphs by map and method, candidates by case and method: made once, whichever arm asks first."""

    def __init__(self) -> None:
        self.graphs: dict[tuple[Path, str], ContactGraphFile] = {}
        self.overlaps: dict[Path, dict[tuple[int, int], float]] = {}
        self.found: dict[tuple[str, Path, str], Found] = {}
        """By case, map, and what decides the candidates."""


def run_case(
    room: Room, arms: Sequence[Arm], case: str, scratch: Path, shared: Shared, *, keep: bool
) -> Iterator[Outcome]:
    """Yield the outcome of every arm. Artifacts are written under `scratch` and deleted again unless `keep`."""
    folder = scratch / room.name / case
    shutil.rmtree(folder, ignore_errors=True)
    if case in OF_PERFECT:
        perfect_map(room.truth_artifact, folder / "map")
    for arm in arms:
        map_folder = folder / "map" if case in OF_PERFECT else room.maps[MAPS[case], arm.map_arm]
        yield _run_arm(room, arm, case, PanopticMap(map_folder), folder / arm.name, shared)
    if not keep:
        shutil.rmtree(folder)


def _run_arm(room: Room, arm: Arm, case: str, panoptic_map: PanopticMap, folder: Path, shared: Shared) -> Outcome:
    library, method = room.held_out if case in OF_HELD_OUT else room.library, arm.graph.method
    of_graph = (panoptic_map.root, method)
    if of_graph not in shared.graphs:
        built = unrecorded("graph", folder / "contact_graph", arm.graph, seed=SEED, panoptic_map=panoptic_map)
        shared.graphs[of_graph] = built.info
    graph = shared.graphs[of_graph]
    key = (case, panoptic_map.root, arm.cad.model_dump_json(exclude={"conflict_iterations", "maximum_shift"}))
    context = context_in(folder / "cad_scene", SEED)
    replacing = METHODS[arm.cad.method](arm.cad)
    if key not in shared.found:
        surfaces: dict[str, ModelSurface] = {}
        start = time.process_time()
        shortlists = find_candidates(graph, panoptic_map, library, surfaces, replacing, context)
        shared.found[key] = Found(shortlists, surfaces, time.process_time() - start, context.output)
    found = shared.found[key]
    if found.scene != context.output:
        for built_in in sorted((found.scene / "models").glob("*_built_in")):
            shutil.copytree(built_in, context.output / "models" / built_in.name)
    start = time.process_time()
    scene = choose_and_write(graph, panoptic_map, library, found.shortlists, found.surfaces, replacing, context)
    seconds = found.seconds + time.process_time() - start
    if panoptic_map.root not in shared.overlaps:
        shared.overlaps[panoptic_map.root] = overlaps_of(room.truth, panoptic_map)
    overlaps = shared.overlaps[panoptic_map.root]
    loose = to_be_free(graph, room.truth.graph, overlaps)
    physics, moved = settle(scene, loose, folder / "interactive_scene")
    measured = replacements_of(
        true_shapes(room.truth_artifact, room.world_from_log),
        room.truth,
        scene,
        overlaps=overlaps,
        minimum_iou=OPTIONS.node_match_iou,
        library_models=library.path("models"),
    )
    objects = sum(node.node_type in ("rigid", "articulated") for node in graph.nodes)
    distance, edges = measure_graph(room.truth, graph, overlaps)
    summary = scene.info
    own = {model.id: model for model in room.library.info.models}
    models = library.info.models
    known = [off for r in measured.objects if (off := nearest_stand_in(own[r.true_model], models)) is not None]
    without = [r.functional for r in measured.objects if lacking(own[r.true_model], models)]
    # The ids of the two libraries are the same words for other models.
    undefined = ("true_model_first", "true_model_among_candidates") if case in OF_HELD_OUT else ()
    extra: dict[str, float | None] = {
        **dict.fromkeys(undefined),
        **room.shown.get(MAPS.get(case, ""), {}),
        "without_style": float(len(without)),
        "functional_without_style": float(np.mean(without)) if without else None,
        "nearest_stand_in": float(np.median(known)) if known else None,
        "seconds_per_object": seconds / max(1, objects),
        "conflicts_before": float(summary.conflicts_before),
        "conflicts_after": float(summary.conflicts_after),
    }
    return Outcome(
        graph=distance,
        edges=edges,
        cad={**measured.summary, **extra},
        failures=tuple((r.name, r.class_name, why_no_success(r)) for r in measured.objects if not r.success),
        physics=physics,
        unsettled=moved,
    )


def settle(
    scene: CadScene, loose: Mapping[str, frozenset[str]], folder: Path
) -> tuple[dict[str, float], tuple[str, ...]]:
    """Write the URDF scene as it was reconstructed, without a rest in the engine before, and let it go in Bullet and in
    MuJoCo; return figures, and what did not stay in words. `loose`: as in `physics_of`."""
    unrecorded("urdf", folder, {"rest": False, "settle_seconds": 0.0}, seed=SEED, cad_scene=scene)
    report = settle_report(folder)
    other = {body.name: body for body in mujoco_motions(folder, report.seconds)}
    return physics_of(report, other, loose), what_moved(report)


def loose_things(graph: ContactGraphFile) -> frozenset[str]:
    """Return the things that stand on the floor or on something and are not built in: those that have to be free."""
    names = set()
    for node in things_of(graph):
        link = graph.parent_link(node.id)
        if (link is None or link.relation in STANDS) and node.class_name not in BUILT_IN:
            names.add(node.id)
    return frozenset(names)


def to_be_free(
    graph: ContactGraphFile, true_graph: ContactGraphFile, overlaps: Mapping[tuple[int, int], float]
) -> dict[str, frozenset[str]]:
    """Return the things that have to be free, by what the graph calls them and by what they truly are: ending of the
    figures' names -> nodes. `overlaps` as in `loose_by_truth`."""
    return {"": loose_things(graph), BY_TRUTH: loose_by_truth(graph, true_graph, overlaps)}


def loose_by_truth(
    graph: ContactGraphFile, true_graph: ContactGraphFile, overlaps: Mapping[tuple[int, int], float]
) -> frozenset[str]:
    """Return the things that have to be free by what they truly are, whatever the graph calls them and hangs them on:
    those that show a true thing which has to be. What shows nothing true is judged as in `loose_things`.

    `overlaps`: (true instance, predicted instance) -> IoU."""
    loose = loose_things(true_graph)
    of_true = {node.instance: node.id in loose for node in things_of(true_graph)}
    shown = [(iou, true, found) for (true, found), iou in overlaps.items() if iou >= OPTIONS.node_match_iou]
    is_loose = {found: of_true[true] for _, true, found in sorted(shown) if true in of_true}
    own = loose_things(graph)
    return frozenset(node.id for node in things_of(graph) if is_loose.get(node.instance, node.id in own))


def things_of(graph: ContactGraphFile) -> list[GraphNode]:
    """Return the nodes of a graph that are neither the scene nor of the building."""
    return [node for node in graph.nodes if node.id != SCENE_NODE and node.node_type != "layout"]


def annotated_runs(real: Path | None) -> list[str]:
    """Return the annotated logs whose map stands under `real` (`make real`), by name."""
    names = sorted(file.stem for file in ANNOTATIONS.glob("*.json"))
    return [name for name in names if real and (real / name / "panoptic_map" / "manifest.json").is_file()]


def run_real(folder: Path, scratch: Path, arms: Sequence[Arm]) -> Iterator[tuple[str, Outcome]]:
    """Yield arm and outcome for a log of `annotated_runs`.

    All arms start from the one map that is there. No CAD model is true, so that only graph and physics are measured.
    Raises BadInput when sequence, map or library of a run are broken.
    """
    annotation, map_folder = ANNOTATIONS / f"{folder.name}.json", folder / "panoptic_map"
    told = ("--annotation", annotation, "--sequence", folder / "sequence", "--panoptic-map", map_folder)
    truth_artifact = opened(GroundTruth, made("truth supports", scratch / "ground_truth", *told))
    given: dict[str, Any] = {"panoptic_map": opened(PanopticMap, map_folder)}
    truth = load_truth(truth_artifact, np.eye(4), OPTIONS.minimum_visible_points)
    overlaps = overlaps_of(truth, given["panoptic_map"])
    library = opened(CadLibrary, folder.parent / "cad_library")
    for arm in arms:
        # `cad` takes every mesh that it finds in its folder for a thing of the scene, those of an earlier run too.
        shutil.rmtree(scratch / arm.name, ignore_errors=True)
        graph = unrecorded("graph", scratch / arm.name / "graph", arm.graph, seed=SEED, **given)
        scene = unrecorded(
            "cad", scratch / arm.name / "cad_scene", arm.cad, seed=SEED, contact_graph=graph, library=library, **given
        )
        loose = to_be_free(graph.info, truth.graph, overlaps)
        physics, moved = settle(scene, loose, scratch / arm.name / "interactive_scene")
        distance, edges = measure_graph(truth, graph.info, overlaps)
        yield arm.name, Outcome(distance, edges, physics=physics, unsettled=moved)


def overlaps_of(truth: TrueRoom, panoptic_map: PanopticMap) -> dict[tuple[int, int], float]:
    """IoU of true and predicted instances over the true points that were seen (`point_overlaps`)."""
    predicted = load_map(panoptic_map)
    labels = label_true_points(truth, predicted, OPTIONS.label_distance)
    return point_overlaps(truth, labels, {entry.instance: entry.class_name for entry in predicted.info.entities})


def measure_graph(
    truth: TrueRoom, graph: ContactGraphFile, overlaps: Mapping[tuple[int, int], float]
) -> tuple[dict[str, float], dict[str, tuple[int, int, int]]]:
    """Return the edit distance with its parts, and (true, predicted, agreed) edges by relation."""
    comparison, edges = judge(truth, graph, overlaps)
    parts = {name: float(value) for name, value in distance_figures(comparison).items() if value is not None}
    return parts, {name: (found.true_count, found.predicted_count, found.agreed) for name, found in edges.items()}


def physics_of(
    report: SettleReport, other: Mapping[str, BodyMotion], loose: Mapping[str, Collection[str]]
) -> dict[str, float]:
    """Return the figures of a settle test.

    `other`: movable bodies as another engine saw them; `loose`: ending of a figure's name -> things that have to be
    free: one that is held, since nothing level is below it or it lies in something, is none that is at rest.
    """
    struck = {name for pair in report.collisions for name in (pair.first, pair.second)}
    stay = {body.name for body in report.bodies if body.stays}
    stay_there = {name for name, body in other.items() if body.stays}
    free = {body.name for body in report.bodies}
    figures = {
        "settled_rooms": float(report.settled),
        "settled_rooms_mujoco": float(report.settled and all(body.stays for body in other.values())),
        "movable": float(len(report.bodies)),
        "unsettled": float(len(report.unsettled)),
        "unsettled_mujoco": float(len(other) - len(stay_there)),
        "joints": float(len(report.joints)),
        "blocked_joints": float(len(report.blocked)),
        "max_penetration_mm": report.max_penetration_mm,
        "collisions": float(len(report.collisions)),
    }
    for ending, names in loose.items():
        own = set(names)
        figures |= {
            f"loose{ending}": float(len(own)),
            f"at_rest{ending}": float(len(stay & own)),
            f"at_rest_both{ending}": float(len(stay & stay_there & own)),
            f"colliding{ending}": float(len(struck & own)),
            f"held{ending}": float(len(own - free)),
        }
    return figures


def what_moved(report: SettleReport) -> tuple[str, ...]:
    """Return what did not stay, what is blocked and what lies in what, in words."""
    words = [f"{b.name} moved {1000 * b.moved:.0f} mm, {np.degrees(b.turned):.0f} deg" for b in report.unsettled]
    words += [f"{j.joint} blocked by {j.hit_link}" for j in report.blocked]
    words += [f"{o.first} lies {1000 * o.depth:.0f} mm in {o.second}" for o in report.collisions]
    return tuple(words)


def why_no_success(result: ObjectResult) -> str:
    """Return the first reason that keeps an object from success."""
    if not result.detected:
        return "missed"
    if result.model is None or result.alignment is None:
        return "no model"
    if not result.class_right:
        return f"class {result.model_class}"
    error = result.alignment
    return (
        f"{1000 * error.translation:.0f} mm, {np.degrees(error.rotation):.0f} deg, scale {100 * error.scale:.0f} %, "
        f"{result.model} for {result.true_model}"
    )
