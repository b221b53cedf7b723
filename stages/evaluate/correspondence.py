"""Which predicted entity stands for which true one."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scenewright.schemas.contact_graph import ContactGraphFile, GraphNode
from scenewright.schemas.scene_parts import TREE_RELATIONS, Relation
from scenewright.stages.evaluate.truth import TrueRoom, stuff_classes
from scenewright.stages.kit.geometry.boxes import box_iou, box_yaw
from scenewright.stages.kit.measurement.panoptic_quality import intersection_over_union, merge_stuff
from scipy.optimize import linear_sum_assignment


def merge_stuff_nodes(graph: ContactGraphFile) -> tuple[ContactGraphFile, dict[str, str]]:
    """Make all nodes of one stuff class (walls, say) one node, as panoptic segmentation knows them.

    The thesis's maps have one instance per stuff class (section 2.3.1); a room of four true walls and a map with one
    wall are then no different graphs. Returns the graph and old id -> kept id. The kept node is the one of the
    smallest instance; edges between merged nodes vanish, equal edges become one, and an edge that would close a
    circle is left out.
    """
    stuff = stuff_classes()
    merged_id: dict[str, str] = {}
    first: dict[str, str] = {}
    for node in sorted(graph.nodes, key=lambda n: (n.instance, n.id)):
        is_stuff = node.node_type != "scene" and node.class_name in stuff
        merged_id[node.id] = first.setdefault(node.class_name, node.id) if is_stuff else node.id
    links: dict[tuple[str, str, str], Relation] = {}
    parents: dict[str, str] = {}
    for link in graph.links:
        source, target = merged_id.get(link.source, link.source), merged_id.get(link.target, link.target)
        if source == target:
            continue
        if link.relation in TREE_RELATIONS:
            if target in parents or _is_above(target, source, parents):
                continue
            parents[target] = source
        key = (min(source, target), max(source, target), link.relation)
        links.setdefault(key, link.model_copy(update={"source": source, "target": target}))
    nodes = tuple(node for node in graph.nodes if merged_id[node.id] == node.id)
    return graph.model_copy(update={"nodes": nodes, "links": tuple(links.values())}), merged_id


def _is_above(name: str, below: str, parents: Mapping[str, str]) -> bool:
    """Whether `name` is an ancestor of `below`. `parents` holds no circle."""
    while below in parents:
        below = parents[below]
        if below == name:
            return True
    return False


def point_overlaps(
    truth: TrueRoom, predicted_labels: np.ndarray, predicted_classes: Mapping[int, str]
) -> dict[tuple[int, int], float]:
    """IoU over the visible points of every (true instance, predicted instance), stuff of one class merged.

    `predicted_labels` (N,) instance that the map gives each true point. Merged labels are the smallest instance.
    """
    stuff = stuff_classes()
    true, _ = merge_stuff(truth.instances, {o.instance: o.class_name for o in truth.objects}, stuff)
    predicted, _ = merge_stuff(predicted_labels, predicted_classes, stuff)
    return intersection_over_union(true, predicted)


def node_affinity(
    true_nodes: list[GraphNode],
    predicted_nodes: list[GraphNode],
    overlaps: Mapping[tuple[int, int], float] | None,
    minimum_iou: float,
) -> np.ndarray:
    """Return (N, M) how surely nodes are the same entity, 0 where they cannot be.

    The IoU of the visible points where a map is there (`overlaps`), else of the boxes, from `minimum_iou` on. Nodes
    of one stuff class are always the same entity, there is only one.
    """
    stuff = stuff_classes()
    affinity = np.zeros((len(true_nodes), len(predicted_nodes)))
    for i, true in enumerate(true_nodes):
        for j, predicted in enumerate(predicted_nodes):
            if overlaps is not None:
                iou = overlaps.get((true.instance, predicted.instance), 0.0)
            else:
                iou = node_box_iou(true, predicted)
            if iou >= minimum_iou:
                affinity[i, j] = iou
            if true.class_name == predicted.class_name and true.class_name in stuff:
                affinity[i, j] = max(iou, minimum_iou)
    return affinity


def node_box_iou(a: GraphNode, b: GraphNode) -> float:
    """IoU of two nodes' boxes, 0 where one has none or leans."""
    if a.box is None or b.box is None:
        return 0.0
    try:
        box_yaw(a.box), box_yaw(b.box)
    except ValueError:
        return 0.0
    return box_iou(a.box, b.box)


def assign(affinity: np.ndarray) -> list[tuple[int, int]]:
    """Pair rows and columns one to one with the greatest summed affinity; pairs of affinity 0 are left out."""
    if not affinity.size:
        return []
    rows, columns = linear_sum_assignment(-affinity)
    return [(int(i), int(j)) for i, j in zip(rows, columns, strict=True) if affinity[i, j] > 0]
