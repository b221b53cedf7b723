"""One generated room through all arms of a case: map, contact graph, CAD scene, URDF scene, each measured."""

from __future__ import annotations

import shutil
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from benchmarks.graph.rooms import distance_figures, judge
from benchmarks.mapping.rooms import RoomFolder
from benchmarks.scene.arms import HELD_OUT, MASK_LEVEL, PERFECT, Arm
from benchmarks.scene.perfect_maps import perfect_map
from schemas.cad_library import CadLibrary
from schemas.cad_scene import CadScene
from schemas.contact_graph import ContactGraphFile
from schemas.ground_truth import GroundTruth
from schemas.panoptic_map import PanopticMap
from schemas.sequence import Sequence as SequenceArtifact
from stages.cad.candidates import Shortlist
from stages.cad.model_surfaces import ModelSurface
from stages.cad.stage import METHODS, choose_and_write, find_candidates
from stages.engine.reading import open_artifact
from stages.evaluate.correspondence import point_overlaps
from stages.evaluate.map_measures import label_true_points, load_map
from stages.evaluate.parameters import EvaluateParameters
from stages.evaluate.replacement_measures import ObjectResult, replacements_of
from stages.evaluate.truth import TrueRoom, load_truth
from stages.graph.stage import run as build_graph
from stages.kit.progress import SilentProgress
from stages.kit.stage import Context
from stages.urdf.parameters import UrdfParameters
from stages.urdf.settle_report import SettleReport, settle_report
from stages.urdf.stage import run as write_urdf


@dataclass(frozen=True)
class Outcome:
    """What one arm made of one room in one case: plain numbers, so that rooms run in processes of their own."""

    room: str
    arm: str
    case: str
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
    maps: Path
    """Folder of `make bench-mapping` with this room's maps: <level>/<arm>/panoptic_map."""
    libraries: Mapping[bool, CadLibrary]
    """Held out? -> library."""


def load_room(folder: RoomFolder, maps: Path, libraries: Mapping[bool, CadLibrary]) -> Room:
    """Read a room. Raises BadInput when its artifacts are missing or broken."""
    sequence = open_artifact(folder.sequence, SequenceArtifact)
    artifact = open_artifact(folder.ground_truth, GroundTruth)
    assert isinstance(sequence, SequenceArtifact) and isinstance(artifact, GroundTruth)
    world_from_log = np.array(sequence.info.gravity.world_from_log)
    truth = load_truth(artifact, world_from_log, EvaluateParameters().minimum_visible_points)
    return Room(folder.name, artifact, truth, world_from_log, maps, libraries)


@dataclass(frozen=True)
class Found:
    """What arms that differ in the global check alone share of one map and library."""

    shortlists: dict[str, Shortlist]
    surfaces: dict[str, ModelSurface]
    seconds: float


class Shared:
    """Contact graphs by map and method, candidates by case and method: made once, whichever arm asks first."""

    def __init__(self) -> None:
        self.graphs: dict[tuple[Path, str], ContactGraphFile] = {}
        self.overlaps: dict[Path, dict[tuple[int, int], float]] = {}
        self.found: dict[tuple[str, Path, str], Found] = {}


def run_case(
    room: Room, arms: Sequence[Arm], case: str, scratch: Path, seed: int, shared: Shared, *, keep: bool
) -> list[Outcome]:
    """Return the outcome of every arm. Artifacts are written under `scratch` and deleted again unless `keep`."""
    folder = scratch / room.name / case
    shutil.rmtree(folder, ignore_errors=True)
    if case == PERFECT:
        perfect_map(room.truth_artifact, folder / "map")
    outcomes = []
    for arm in arms:
        map_folder = folder / "map" if case == PERFECT else room.maps / MASK_LEVEL / arm.map_arm / "panoptic_map"
        outcomes.append(_run_arm(room, arm, case, PanopticMap(map_folder), folder / arm.name, seed, shared))
    if not keep:
        shutil.rmtree(folder)
    return outcomes


def _run_arm(
    room: Room, arm: Arm, case: str, panoptic_map: PanopticMap, folder: Path, seed: int, shared: Shared
) -> Outcome:
    library, method = room.libraries[case == HELD_OUT], arm.graph.method
    of_graph = (panoptic_map.root, method)
    if of_graph not in shared.graphs:
        context = context_in(folder / "contact_graph", seed)
        shared.graphs[of_graph] = build_graph(panoptic_map, parameters=arm.graph, context=context).info
    graph = shared.graphs[of_graph]
    key = (case, panoptic_map.root, arm.cad.method)
    context = context_in(folder / "cad_scene", seed)
    replacing = METHODS[arm.cad.method](arm.cad)
    if key not in shared.found:
        surfaces: dict[str, ModelSurface] = {}
        start = time.process_time()
        shortlists = find_candidates(graph, panoptic_map, library, surfaces, replacing, context)
        shared.found[key] = Found(shortlists, surfaces, time.process_time() - start)
    found = shared.found[key]
    start = time.process_time()
    scene = choose_and_write(graph, panoptic_map, library, found.shortlists, found.surfaces, replacing, context)
    seconds = found.seconds + time.process_time() - start
    settled = settle(scene, folder / "interactive_scene", seed)
    if panoptic_map.root not in shared.overlaps:
        shared.overlaps[panoptic_map.root] = overlaps_of(room.truth, panoptic_map)
    overlaps = shared.overlaps[panoptic_map.root]
    measured = replacements_of(
        room.truth_artifact,
        room.truth,
        scene,
        world_from_log=room.world_from_log,
        overlaps=overlaps,
        minimum_iou=EvaluateParameters().node_match_iou,
        library_models=library.path("models"),
    )
    assert measured is not None
    objects = sum(node.node_type in ("rigid", "articulated") for node in graph.nodes)
    distance, edges = measure_graph(room.truth, graph, overlaps)
    summary = scene.info
    extra = {
        "seconds_per_object": seconds / max(1, objects),
        "conflicts_before": float(summary.conflicts_before),
        "conflicts_after": float(summary.conflicts_after),
    }
    return Outcome(
        room=room.name,
        arm=arm.name,
        case=case,
        graph=distance,
        edges=edges,
        cad={**measured.summary, **extra},
        failures=tuple((r.name, r.class_name, why_no_success(r)) for r in measured.objects if not r.success),
        physics=physics_of(settled),
        unsettled=what_moved(settled),
    )


def context_in(folder: Path, seed: int) -> Context:
    """Return a context that writes into `folder`, which is made where it is missing, without a word."""
    folder.mkdir(parents=True, exist_ok=True)
    return Context(folder, seed=seed, device="cpu", progress=SilentProgress())


def settle(scene: CadScene, folder: Path, seed: int) -> SettleReport:
    """Write the URDF scene and let it go."""
    write_urdf(scene, parameters=UrdfParameters(), context=context_in(folder, seed))
    return settle_report(folder)


def overlaps_of(truth: TrueRoom, panoptic_map: PanopticMap) -> dict[tuple[int, int], float]:
    """IoU of true and predicted instances over the true points that were seen (`point_overlaps`)."""
    predicted = load_map(panoptic_map)
    labels = label_true_points(truth, predicted, EvaluateParameters().label_distance)
    return point_overlaps(truth, labels, {entry.instance: entry.class_name for entry in predicted.info.entities})


def measure_graph(
    truth: TrueRoom, graph: ContactGraphFile, overlaps: Mapping[tuple[int, int], float]
) -> tuple[dict[str, float], dict[str, tuple[int, int, int]]]:
    """Return the edit distance with its parts, and (true, predicted, agreed) edges by relation."""
    comparison, edges = judge(truth, graph, overlaps)
    parts = {name: float(value) for name, value in distance_figures(comparison).items() if value is not None}
    return parts, {name: (found.true_count, found.predicted_count, found.agreed) for name, found in edges.items()}


def physics_of(report: SettleReport) -> dict[str, float]:
    """Return the figures of a settle test."""
    return {
        "settled_rooms": float(report.settled),
        "movable": float(len(report.bodies)),
        "unsettled": float(len(report.unsettled)),
        "joints": float(len(report.joints)),
        "blocked_joints": float(len(report.blocked)),
        "max_penetration_mm": report.max_penetration_mm,
        "collisions": float(len(report.collisions)),
    }


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
