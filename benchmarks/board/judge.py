"""What a reconstruction is worth, by the truth of a generated room: plain numbers, judged by the code of this checkout.

Counts stand beside shares, so that nobody has to believe what a share is of. A figure that is not there has no key.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scenewright.schemas.cad_scene import CadScene
from scenewright.schemas.contact_graph import SCENE_NODE, ContactGraph, ContactGraphFile, GraphNode
from scenewright.schemas.ground_truth import GroundTruth, TrueObject
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.schemas.sequence import Sequence as SequenceArtifact
from scenewright.stages.evaluate import (
    EvaluateParameters,
    ObjectResult,
    Part,
    PredictedMap,
    TrueRoom,
    compare_graphs,
    instance_candidates,
    label_true_points,
    load_map,
    load_truth,
    measure_quality,
    optional_nodes,
    point_overlaps,
    quality_thesis_code,
    replacements_of,
    true_shapes,
)
from scenewright.stages.kit.formats.mobility import BUILT_IN, STANDS
from scenewright.stages.kit.measurement.average_precision import class_precision, mean_precision
from scenewright.stages.kit.measurement.edge_agreement import edge_agreement
from scenewright.stages.kit.measurement.panoptic_quality import average_quality, average_quality_thesis_code
from scenewright.stages.urdf import mujoco_motions
from scenewright.stages.urdf.settle_report import settle_report

from benchmarks.board.inputs import RoomInputs
from benchmarks.board.reconstruct import Reconstruction
from benchmarks.steps import opened

OPTIONS = EvaluateParameters.model_validate({})
LARGE = 0.5
"""A thing whose longest edge is at least this is large [m]."""
STANDS_WHERE = 0.10
"""A thing stands where it stood when its centre is at most this far off [m]."""
RELATIONS = ("support", "supports", "contains", "carries_on_wall")
ANY = "any"
"""Stands for all classes where candidates are listed by class."""
Figures = dict[str, float]


@dataclass(frozen=True)
class Truth:
    """A room's truth, read once for all arms."""

    artifact: GroundTruth
    room: TrueRoom
    world_from_log: np.ndarray


def read_truth(inputs: RoomInputs, made: Reconstruction) -> Truth:
    """Return the truth in the world of a reconstruction. Raises BadInput."""
    world_from_log = np.array(opened(SequenceArtifact, made.sequence).info.gravity.world_from_log)
    artifact = opened(GroundTruth, inputs.truth)
    return Truth(artifact, load_truth(artifact, world_from_log, OPTIONS.minimum_visible_points), world_from_log)


def judge(inputs: RoomInputs, made: Reconstruction) -> Figures:
    """Return all figures of one arm in one room. Raises BadInput where an artifact cannot be read."""
    truth = read_truth(inputs, made)
    panoptic_map = opened(PanopticMap, made.panoptic_map)
    predicted = load_map(panoptic_map)
    graph = opened(ContactGraph, made.graph).info
    labels = label_true_points(truth.room, predicted, OPTIONS.label_distance)
    classes = {entry.instance: entry.class_name for entry in predicted.info.entities}
    overlaps = point_overlaps(truth.room, labels, classes)
    objects = replacements_of(
        true_shapes(truth.artifact, truth.world_from_log),
        truth.room,
        opened(CadScene, made.cad_scene),
        overlaps=overlaps,
        minimum_iou=OPTIONS.node_match_iou,
    ).objects
    return {
        **of_map(truth.room, predicted, labels),
        **of_graph(truth.room, graph, overlaps),
        **of_things(truth.room, graph, objects),
        **of_physics(made, truth.room, graph, overlaps),
    }


def of_map(room: TrueRoom, predicted: PredictedMap, labels: np.ndarray) -> Figures:
    """Return PQ over the classes that the room has, over those and the ghosts' too, and in the thesis's form; AP."""
    qualities = measure_quality(Part("map"), room, predicted, labels, OPTIONS)
    own = [quality for quality in qualities.values() if quality.true_positives + quality.false_negatives]
    ghosts = [quality for quality in qualities.values() if not quality.true_positives + quality.false_negatives]
    thesis = average_quality_thesis_code(quality_thesis_code(room, predicted, OPTIONS).values()).pq
    ranked = instance_candidates(room, predicted, labels)
    figures = {
        "pq": _mean([quality.pq for quality in own]),
        "sq": _mean([quality.sq for quality in own]),
        "rq": _mean([quality.rq for quality in own]),
        "pq_with_ghosts": average_quality([*own, *ghosts]).pq,
        "pq_thesis_form": thesis,
        "ghosts": float(sum(quality.false_positives for quality in ghosts)),
        "instance_ap": mean_precision([class_precision(c).all_point for name, c in ranked.items() if name != ANY]),
    }
    return _known(figures)


def of_graph(room: TrueRoom, graph: ContactGraphFile, overlaps: Mapping[tuple[int, int], float]) -> Figures:
    """Return the edit distance, and the counts of the edges by relation: true, predicted, agreed, F1."""
    comparison = compare_graphs(room, graph, overlaps, OPTIONS.node_match_iou)
    distance = comparison.distance
    ignored = optional_nodes(room, comparison.true)
    edges = edge_agreement(comparison.true, comparison.predicted, dict(distance.pairs), ignored=ignored)
    figures: dict[str, float | None] = {
        "edit_distance": float(distance.total),
        "missing_things": float(len(distance.missing)),
        "false_things": float(distance.wrong_detections),
    }
    for name in RELATIONS:
        found = edges[name]
        counts = {"true": found.true_count, "predicted": found.predicted_count, "agreed": found.agreed}
        figures |= {f"{name}_{what}": float(count) for what, count in counts.items()} | {f"{name}_f1": found.f1}
    return _known(figures)


def of_things(room: TrueRoom, graph: ContactGraphFile, objects: Sequence[ObjectResult]) -> Figures:
    """Return what became of the true things: of all, of large and small ones, and of those that were found."""
    true, nodes = room.by_name(), {node.id: node for node in graph.nodes}
    sizes = {"": list(objects), "_large": [], "_small": []}
    for each in objects:
        sizes["_large" if max(true[each.name].box.size) >= LARGE else "_small"].append(each)
    figures: dict[str, float | None] = {}
    for size, own in sizes.items():
        found = [each for each in own if each.detected]
        named = [each for each in found if nodes[str(each.node)].class_name == each.class_name]
        standing = [each for each in found if _off_by(true[each.name], nodes[str(each.node)]) <= STANDS_WHERE]
        figures |= {
            f"things{size}": float(len(own)),
            f"found_count{size}": float(len(found)),
            f"named_count{size}": float(len(named)),
            f"standing_count{size}": float(len(standing)),
            f"found{size}": _share(len(found), len(own)),
            f"named{size}": _share(len(named), len(own)),
            f"standing{size}": _share(len(standing), len(own)),
            f"replaced{size}": _share(sum(each.model is not None for each in own), len(own)),
            f"functional{size}": _share(sum(each.functional for each in own), len(own)),
            f"functional_of_found{size}": _share(sum(each.functional for each in found), len(found)),
            f"scan2cad{size}": _share(sum(each.success for each in own), len(own)),
        }
    off = [_off_by(true[each.name], nodes[str(each.node)]) for each in objects if each.detected]
    judged = [each.equivalence for each in objects if each.equivalence is not None]
    for name in ("class_and_relations", "affordance", "size_and_shape", "appearance"):
        figures[f"equal_{name}"] = _share(sum(bool(getattr(each, name)) for each in judged), len(judged))
    joints = [joint for each in objects for joint in each.joints]
    figures |= {
        "centre_off_mm": 1000 * float(np.median(off)) if off else None,
        "joints": float(len(joints)),
        "joints_found": _share(sum(joint.partner is not None for joint in joints), len(joints)),
        "joints_false": float(sum(each.spurious_joints for each in objects)),
    }
    return _known(figures)


def _off_by(true: TrueObject, node: GraphNode) -> float:
    """Distance of a node's box from the true one's, middle to middle [m]; infinite for a node without a box."""
    if node.box is None:
        return float("inf")
    return float(np.linalg.norm(np.subtract(node.box.center, true.box.center)))


def of_physics(
    made: Reconstruction, room: TrueRoom, graph: ContactGraphFile, overlaps: Mapping[tuple[int, int], float]
) -> Figures:
    """Return what stays where it was put once the scene is let go, in Bullet and in MuJoCo.

    A thing that ought to be free and is held, since nothing level is below it or it lies in something, is none that is
    at rest. Shares are of the true things that ought to be free (`at_rest_of_true`) and of the found ones.
    """
    report = settle_report(made.scene)
    there = mujoco_motions(made.scene, report.seconds)
    struck = {name for pair in report.collisions for name in (pair.first, pair.second)}
    stay = {body.name for body in report.bodies if body.stays} & {body.name for body in there if body.stays}
    free = {body.name for body in report.bodies}
    found = loose_by_truth(graph, room, overlaps)
    seen = {entry.name for entry in room.evaluated(things_only=True)}
    true = loose_things(room.graph) & seen
    rest, of_true = len(stay & found.keys()), len(true)
    standing = {found[name] for name in stay & found.keys()} & true  # one that came in two pieces counts once
    return _known(
        {
            "loose_true": float(of_true),
            "loose_found": float(len(found)),
            "at_rest_count": float(rest),
            "at_rest_of_true": _share(len(standing), of_true),
            "at_rest_of_found": _share(rest, len(found)),
            "held_of_found": _share(len(found.keys() - free), len(found)),
            "colliding_of_found": _share(len(struck & found.keys()), len(found)),
            "settled": float(report.settled and all(body.stays for body in there)),
            "penetration_mm": report.max_penetration_mm,
            "joints_blocked": float(len(report.blocked)),
        }
    )


def loose_things(graph: ContactGraphFile) -> frozenset[str]:
    """Return the things that stand on the floor or on something and are not built in: those that ought to be free."""
    names = set()
    for node in things_of(graph):
        link = graph.parent_link(node.id)
        if (link is None or link.relation in STANDS) and node.class_name not in BUILT_IN:
            names.add(node.id)
    return frozenset(names)


def loose_by_truth(
    graph: ContactGraphFile, room: TrueRoom, overlaps: Mapping[tuple[int, int], float]
) -> dict[str, str | None]:
    """Return the found things that ought to be free, and the true thing that each shows: a thing that shows a true one
    is judged by what that is, whatever the graph calls it and hangs it on; what shows nothing true by its own name.

    `overlaps`: (true instance, found instance) -> IoU.
    """
    loose = loose_things(room.graph)
    names = {node.instance: node.id for node in things_of(room.graph)}
    shown = sorted((iou, true, found) for (true, found), iou in overlaps.items() if iou >= OPTIONS.node_match_iou)
    best = {found: names[true] for _, true, found in shown if true in names}
    own = loose_things(graph)
    result: dict[str, str | None] = {}
    for node in things_of(graph):
        true = best.get(node.instance)
        if (true in loose) if true is not None else (node.id in own):
            result[node.id] = true
    return result


def things_of(graph: ContactGraphFile) -> list[GraphNode]:
    """Return the nodes of a graph that are neither the scene nor of the building."""
    return [node for node in graph.nodes if node.id != SCENE_NODE and node.node_type != "layout"]


def _share(part: int, whole: int) -> float | None:
    return part / whole if whole else None


def _mean(values: Sequence[float]) -> float | None:
    return float(np.mean(values)) if values else None


def _known(figures: Mapping[str, float | None]) -> Figures:
    """Return the figures that are defined, to six digits."""
    return {name: float(f"{value:.6g}") for name, value in figures.items() if value is not None}
