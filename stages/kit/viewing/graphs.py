"""Contact graphs: boxes in the room, edges between them, and the graph as a graph."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scenewright.schemas.contact_graph import ContactGraphFile, GraphNode
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.schemas.scene_parts import TREE_RELATIONS
from scenewright.stages.kit.drawing.palette import RELATION_COLORS, UNLABELLED, instance_color
from scenewright.stages.kit.geometry.boxes import box_corners
from scenewright.stages.kit.measurement.relation_evidence import evidence
from scenewright.stages.kit.viewing.canvas import SHELL, Canvas, Color, Trust, bytes_of
from scenewright.stages.kit.viewing.meshes import load_mesh

DRAWN = ("boxes_of_layout", "boxes_before_refinement", "supporting_planes", "edges", "contacts")
"""What a graph draws beside the boxes of things."""
SURE = 0.8
"""Confidence from which nothing is said against a thing."""
NAMELESS = "object"
HIDDEN = ("boxes_before_refinement", "boxes_of_layout", SHELL)
"""Drawn, but not shown until somebody asks for it: it hides the room."""


def draw_graph_over(graph: ContactGraphFile, panoptic_map: PanopticMap | None, canvas: Canvas) -> None:
    """Draw the graph over the meshes of a map, and say what can be trusted."""
    draw_graph(graph, canvas)
    if panoptic_map is None:
        return
    for node in graph.nodes:
        if node.mesh is not None and panoptic_map.path(node.mesh).exists():
            canvas.mesh(f"meshes/{node.id}", load_mesh(panoptic_map.path(node.mesh)), front_only=True)


def trust_of(graph: ContactGraphFile, more: Mapping[str, Trust] | None = None) -> dict[str, Trust]:
    """Return how far the nodes of a graph can be trusted: that they are what they are called, and stand where it says.

    The least of the node's and its support's confidence; half of it for what no mask gave a name. `more`: what else is
    known of some of them.
    """
    trusts = {}
    for node in graph.nodes:
        if node.box is None:
            continue
        share, reasons = node.confidence, []
        if node.confidence < SURE:
            reasons.append(f"masks agree on it to {100 * node.confidence:.0f} %")
        if node.class_name == NAMELESS:
            share, reasons = 0.5 * share, [*reasons, "no mask gave it a name"]
        link = graph.parent_link(node.id)
        if link is not None and node.node_type != "layout":
            share = min(share, link.confidence)
            if link.confidence < SURE:
                reasons.append(f"{link.says}: {evidence(link)}")
        if (further := (more or {}).get(node.id)) is not None:
            share, reasons = min(share, further.share), [*reasons, *further.reasons]
        trusts[node.id] = Trust(share, tuple(reasons))
    return trusts


def draw_graph(
    graph: ContactGraphFile,
    canvas: Canvas,
    *hidden: str,
    trusted: Mapping[str, Trust] | None = None,
    name: str = "world",
    boxes: bool = True,
) -> None:
    """Draw boxes, supporting planes, edges between box centres, and the graph in a view of its own.

    What lies under the `hidden` paths, too, is not shown until somebody asks for it. `trusted`: what is known of nodes
    beside what the graph says; `name` of its view; `boxes`: whether those of the things are drawn.
    """
    boxed = [node for node in graph.nodes if node.box is not None]
    for path, group in (
        ("boxes", [node for node in boxed if node.node_type != "layout"]),
        ("boxes_of_layout", [node for node in boxed if node.node_type == "layout"]),
    ):
        node_boxes = [node.box for node in group if node.box is not None]
        if boxes or path != "boxes":
            canvas.boxes(path, node_boxes, [node.id for node in group], [_color(node) for node in group])
    for node in boxed:
        if node.box is not None:
            corners = box_corners(node.box)
            canvas.enclose(corners.min(axis=0), corners.max(axis=0))
    canvas.view(name, *HIDDEN, *hidden)
    observed = [node for node in boxed if node.box_observed is not None and node.box_observed != node.box]
    canvas.boxes(
        "boxes_before_refinement",
        [node.box_observed for node in observed if node.box_observed is not None],
        [f"{node.id} (observed)" for node in observed],
        [UNLABELLED] * len(observed),
        show_labels=False,
    )
    _draw_planes(graph, canvas)
    centers = {node.id: np.array(node.box.center) for node in boxed if node.box is not None}
    for relation, color in RELATION_COLORS.items():
        links = [k for k in graph.links if k.relation == relation and k.source in centers and k.target in centers]
        strips = [np.stack([centers[link.source], centers[link.target]]) for link in links]
        if strips:
            labels = [f"{link.says}: {evidence(link)}" for link in links]
            canvas.line(f"edges/{relation}", strips, [_rgb(color)] * len(strips), radius=0.008, labels=labels)
    met = [link for link in graph.links if link.contact is not None]
    if met:
        colors = [bytes_of(_rgb(RELATION_COLORS[link.relation])) for link in met]
        canvas.points("contacts", np.array([link.contact for link in met]), np.array(colors, np.uint8), radius=0.015)
    tree = [(link.source, link.target) for link in graph.links if link.relation in TREE_RELATIONS]
    canvas.graph([node.id for node in graph.nodes], [_color(node) for node in graph.nodes], tree)
    canvas.document("relations", relation_table(graph))
    canvas.trust(trust_of(graph, trusted))


def relation_table(graph: ContactGraphFile) -> str:
    """Return all relations in Markdown with confidence and evidence, the least certain first."""
    rows = [
        "| relation | from | to | confidence | plane | gap [mm] | overlap [%] | inside [%] | meet at [m] |",
        "|---|---|---|--:|--:|--:|--:|--:|---|",
    ]
    for link in sorted(graph.links, key=lambda k: (k.confidence, k.relation, k.source, k.target)):
        contact = "" if link.contact is None else " ".join(f"{value:.2f}" for value in link.contact)
        cells = (
            link.relation.replace("_", " "),
            link.source,
            link.target,
            f"{link.confidence:.2f}",
            "" if link.plane is None else str(link.plane),
            _scaled(link.gap, 1000),
            _scaled(link.overlap, 100),
            _scaled(link.inside, 100),
            contact,
        )
        rows.append(f"| {' | '.join(cells)} |")
    return "\n".join(rows)


def _scaled(value: float | None, factor: float) -> str:
    return "" if value is None else f"{factor * value:.0f}"


def _draw_planes(graph: ContactGraphFile, canvas: Canvas) -> None:
    strips, colors = [], []
    for node in graph.nodes:
        for plane in node.planes:
            if plane.horizontal and plane.corners:
                corners = np.array(plane.corners)
                strips.append(np.concatenate([corners, corners[:1]]))
                colors.append(_color(node))
    if strips:
        canvas.line("supporting_planes", strips, colors, radius=0.003)


def _color(node: GraphNode) -> Color:
    return instance_color(node.instance)


def _rgb(hexadecimal: str) -> Color:
    red, green, blue = (int(hexadecimal[i : i + 2], 16) / 255 for i in (1, 3, 5))
    return red, green, blue
