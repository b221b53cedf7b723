"""Figures of the contact graph: edit distance, edges by relation, oriented boxes before and after refinement."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scenewright.schemas.contact_graph import ContactGraphFile, GraphNode
from scenewright.schemas.ground_truth import TrueObject
from scenewright.schemas.scene_parts import Box
from scenewright.stages.evaluate.correspondence import merge_stuff_nodes, node_affinity
from scenewright.stages.evaluate.graph_edit_distance import EditDistance, graph_edit_distance, support_tree
from scenewright.stages.evaluate.map_measures import precision_table, record_precision
from scenewright.stages.evaluate.parameters import EvaluateParameters
from scenewright.stages.evaluate.results import Part
from scenewright.stages.evaluate.truth import TrueRoom, thing_classes
from scenewright.stages.kit.geometry.boxes import box_iou, box_yaw, turned_to
from scenewright.stages.kit.measurement.average_precision import Candidates, class_precision
from scenewright.stages.kit.measurement.edge_agreement import edge_agreement
from scenewright.stages.kit.measurement.tables import Table

ANY_CLASS = "any"
"""Stands for the class where classes do not count."""


@dataclass(frozen=True)
class GraphComparison:
    """Both graphs with stuff merged, and the edit distance between them."""

    true: ContactGraphFile
    predicted: ContactGraphFile
    distance: EditDistance


def compare_graphs(
    truth: TrueRoom, graph: ContactGraphFile, overlaps: Mapping[tuple[int, int], float] | None, minimum_iou: float
) -> GraphComparison:
    """Edit distance between the true graph and `graph` over pairs of nodes that can be the same entity."""
    true_graph, _ = merge_stuff_nodes(truth.graph)
    predicted_graph, _ = merge_stuff_nodes(graph)
    true = support_tree(true_graph, optional=optional_nodes(truth, true_graph))
    predicted = support_tree(predicted_graph)
    affinity = node_affinity(
        [true_graph.node(name) for name in true.names],
        [predicted_graph.node(name) for name in predicted.names],
        overlaps,
        minimum_iou,
    )
    return GraphComparison(true_graph, predicted_graph, graph_edit_distance(true, predicted, affinity))


def optional_nodes(truth: TrueRoom, graph: ContactGraphFile) -> frozenset[str]:
    """Nodes of the true graph that the camera hardly saw (or that are no object of the ground truth)."""
    evaluated = {entry.instance for entry in truth.evaluated()}
    return frozenset(n.id for n in graph.nodes if n.node_type != "scene" and n.instance not in evaluated)


def measure_graph(part: Part, truth: TrueRoom, comparison: GraphComparison) -> None:
    """Record the edit distance with its break-down, and precision, recall, F1 of the edges by relation."""
    distance = comparison.distance
    ignored = optional_nodes(truth, comparison.true)
    part.set("edit_distance", distance.total)
    part.set("edit_distance_exact", float(distance.exact))
    part.set("wrong_supports", len(distance.wrong_supports))
    part.set("missing_detections", len(distance.missing))
    part.set("wrong_detections", distance.wrong_detections)
    part.set("extra_nodes", len(distance.extra))
    part.set("wrong_classes", len(distance.substituted))
    part.set("true_nodes", sum(n.node_type != "scene" and n.id not in ignored for n in comparison.true.nodes))
    part.set("predicted_nodes", sum(n.node_type != "scene" for n in comparison.predicted.nodes))
    if not distance.exact:
        part.notes.append("The graph edit distance is an upper bound: the search ran out of its budget.")
    edges = edge_agreement(comparison.true, comparison.predicted, dict(distance.pairs), ignored=ignored)
    for relation, agreement in edges.items():
        part.set(f"{relation}_precision", agreement.precision)
        part.set(f"{relation}_recall", agreement.recall)
        part.set(f"{relation}_f1", agreement.f1)
    part.tables.append(
        Table(
            "graph_edges",
            "Edges of the contact graph by relation",
            ("relation", "true", "predicted", "agreed", "precision", "recall", "F1"),
            tuple(
                (name.replace("_", " "), a.true_count, a.predicted_count, a.agreed, a.precision, a.recall, a.f1)
                for name, a in edges.items()
            ),
        )
    )
    part.tables.append(
        Table(
            "graph_edit_distance",
            f"Graph edit distance {distance.total}" + ("" if distance.exact else " (upper bound)"),
            ("error", "cost", "true", "predicted", "true parent", "predicted parent"),
            _error_rows(comparison),
            "As the thesis counts: a wrong support 2, everything else 1. All nodes of a stuff class count as one.",
        )
    )


def _error_rows(comparison: GraphComparison) -> tuple[tuple[str | int | None, ...], ...]:
    distance = comparison.distance

    def parent(graph: ContactGraphFile, name: str) -> str | None:
        link = graph.parent_link(name)
        return link.source if link else None

    rows: list[tuple[str | int | None, ...]] = []
    for t, p in distance.wrong_supports:
        rows.append(("wrong support", 2, t, p, parent(comparison.true, t), parent(comparison.predicted, p)))
    rows += [("missing detection", 1, t, None, parent(comparison.true, t), None) for t in distance.missing]
    rows += [("wrong class", 1, t, p, None, None) for t, p in distance.substituted]
    rows += [("extra node", 1, None, p, None, parent(comparison.predicted, p)) for p in distance.extra]
    return tuple(rows)


def measure_boxes(
    part: Part, truth: TrueRoom, graph: ContactGraphFile, points: Mapping[int, int], parameters: EvaluateParameters
) -> None:
    """AP of gravity-aligned boxes at IoU 0.5 over things, before (`box_observed`) and after refinement (`box`).

    `points`: instance -> number of vertices, the confidence (1 where unknown). Truth is the box of the whole
    object. Predictions on entities that were hardly seen count neither way.
    """
    for measure, field in (("obb_ap50_observed", "box_observed"), ("obb_ap50_refined", "box")):
        candidates = box_candidates(truth, graph, points, field, parameters.match_iou)
        result = {name: class_precision(listed, parameters.match_iou) for name, listed in candidates.items()}
        agnostic = result.pop(ANY_CLASS)
        record_precision(part, measure, result)
        part.set(f"{measure}_class_agnostic", agnostic.all_point)
        when = "before refinement" if field == "box_observed" else "after refinement"
        part.tables.append(precision_table(measure, f"Oriented-box AP at IoU 0.5 by class, {when}", result))


def box_candidates(
    truth: TrueRoom, graph: ContactGraphFile, points: Mapping[int, int], field: str, match_iou: float
) -> dict[str, Candidates]:
    """Return what box AP is computed from: by class of things, and `any` for all of them together.

    `points`: instance -> number of vertices, the confidence (1 where unknown); `field`: `box_observed` or `box`.
    """
    things = thing_classes()
    true = truth.evaluated(things_only=True)
    hidden = [o for o in truth.objects if o.instance in truth.optional]
    nodes = [
        (node, box)
        for node in graph.nodes
        if node.class_name in things and (box := box_of(node, field)) is not None and upright(box)
    ]
    nodes = [(n, b) for n, b in nodes if not _is_hidden(b, hidden, true, match_iou)]
    result: dict[str, Candidates] = {}
    for name in [*sorted({o.class_name for o in true} | {n.class_name for n, _ in nodes}), ANY_CLASS]:
        columns = [o for o in true if name in (o.class_name, ANY_CLASS)]
        rows = [(n, b) for n, b in nodes if name in (n.class_name, ANY_CLASS)]
        iou = np.array([[iou_with(b, o) for o in columns] for _, b in rows]).reshape(len(rows), len(columns))
        result[name] = Candidates(iou, np.array([float(points.get(n.instance, 1)) for n, _ in rows]))
    return result


def iou_with(box: Box, true: TrueObject) -> float:
    """Return the IoU of a predicted box with that of a true object. A round object has no yaw: the predicted box is
    turned to the true one's first, as pose benchmarks do for symmetric objects (Wang et al. 2019, NOCS)."""
    return box_iou(turned_to(box, box_yaw(true.box)) if true.round else box, true.box)


def _is_hidden(box: Box, hidden: list[TrueObject], visible: list[TrueObject], match_iou: float) -> bool:
    best_hidden = max((iou_with(box, true_object) for true_object in hidden), default=0.0)
    return best_hidden > match_iou and best_hidden > max(
        (iou_with(box, true_object) for true_object in visible), default=0.0
    )


def box_of(node: GraphNode, field: str) -> Box | None:
    """The node's box before or after refinement; a graph that records one only has it for both."""
    return getattr(node, field) or node.box


def upright(box: Box) -> bool:
    """Whether the box is gravity-aligned, as box IoU needs it."""
    try:
        box_yaw(box)
    except ValueError:
        return False
    return True
