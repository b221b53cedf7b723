"""Contact graphs: boxes in the room, edges between them, and the graph as a graph."""

from __future__ import annotations

import numpy as np

from cli.viewing.canvas import SHELL, Canvas, Color, bytes_of
from cli.viewing.inputs import input_artifact
from cli.viewing.meshes import load_mesh
from schemas.contact_graph import ContactGraph, ContactGraphFile, GraphNode
from schemas.panoptic_map import PanopticMap
from schemas.scene_parts import TREE_RELATIONS
from stages.kit.drawing.palette import RELATION_COLORS, UNLABELLED, instance_color
from stages.kit.geometry.boxes import box_corners
from stages.kit.measurement.relation_evidence import evidence

HIDDEN = ("boxes_before_refinement", "boxes_of_layout", SHELL)
"""Drawn, but not shown until somebody asks for it: it hides the room."""


def draw_contact_graph(graph: ContactGraph, canvas: Canvas) -> None:
    """Draw the graph over the meshes of the map it was made from, where that map is still there."""
    draw_graph(graph.info, canvas)
    panoptic_map = input_artifact(graph, PanopticMap)
    if panoptic_map is not None:
        for node in graph.info.nodes:
            if node.mesh is not None and panoptic_map.path(node.mesh).exists():
                canvas.mesh(f"meshes/{node.id}", load_mesh(panoptic_map.path(node.mesh)), front_only=True)


def draw_graph(graph: ContactGraphFile, canvas: Canvas, *hidden: str) -> None:
    """Draw boxes, supporting planes, edges between box centres, and the graph in a view of its own.

    What lies under the `hidden` paths, too, is not shown until somebody asks for it.
    """
    boxed = [node for node in graph.nodes if node.box is not None]
    for path, group in (
        ("boxes", [node for node in boxed if node.node_type != "layout"]),
        ("boxes_of_layout", [node for node in boxed if node.node_type == "layout"]),
    ):
        boxes = [node.box for node in group if node.box is not None]
        canvas.boxes(path, boxes, [node.id for node in group], [_color(node) for node in group])
    for node in boxed:
        if node.box is not None:
            corners = box_corners(node.box)
            canvas.enclose(corners.min(axis=0), corners.max(axis=0))
    canvas.view("world", *HIDDEN, *hidden)
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
            labels = [f"{link.source} {relation.replace('_', ' ')} {link.target}: {evidence(link)}" for link in links]
            canvas.line(f"edges/{relation}", strips, [_rgb(color)] * len(strips), radius=0.008, labels=labels)
    met = [link for link in graph.links if link.contact is not None]
    if met:
        colors = [bytes_of(_rgb(RELATION_COLORS[link.relation])) for link in met]
        canvas.points("contacts", np.array([link.contact for link in met]), np.array(colors, np.uint8), radius=0.015)
    tree = [(link.source, link.target) for link in graph.links if link.relation in TREE_RELATIONS]
    canvas.graph([node.id for node in graph.nodes], [_color(node) for node in graph.nodes], tree)
    canvas.document("relations", relation_table(graph))


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
