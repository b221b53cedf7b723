"""The contact graph as shapes of an SVG: a tree from left to right, one row a leaf."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from scenewright.schemas.contact_graph import ContactGraphFile, GraphNode
from scenewright.schemas.errors import BadInput
from scenewright.schemas.outside import LARGEST_SHOWN, file_text
from scenewright.schemas.scene_parts import TREE_RELATIONS, Relation
from scenewright.stages.kit.drawing.palette import entity_color, hex_color
from scenewright.stages.kit.drawing.tree_layout import tree_layout
from scenewright.stages.kit.measurement.relation_evidence import evidence

ROW = 30
"""Height of a row [px]."""
LETTER = 7.1
"""Width of a letter in the boxes [px]; by eye."""
GAP = 46
"""Gap between the columns [px]."""


@dataclass(frozen=True)
class DrawnNode:
    """A node: a rounded box with a dot in its instance's colour."""

    x: float
    y: float
    width: float
    name: str
    kind: str
    """Node type, a CSS class."""
    color: str
    title: str
    mark: str = ""
    """What is wrong with it according to the evaluation: `extra node`, ..."""


@dataclass(frozen=True)
class DrawnEdge:
    """A relation as an SVG path."""

    path: str
    relation: str
    title: str


@dataclass(frozen=True)
class DrawnGraph:
    """Everything to draw."""

    width: float
    height: float
    nodes: tuple[DrawnNode, ...]
    edges: tuple[DrawnEdge, ...]
    proximal: tuple[DrawnEdge, ...]
    relations: tuple[str, ...]
    missing: tuple[str, ...] = ()
    """True nodes that are not in it, where an evaluation says so."""


def draw_graph(
    graph: ContactGraphFile, marks: Mapping[str, str] | None = None, missing: tuple[str, ...] = ()
) -> DrawnGraph:
    """Lay a contact graph out. `marks`: node id -> what is wrong with it."""
    marks = marks or {}
    parents: dict[str, str | None] = {node.id: None for node in graph.nodes}
    for link in graph.links:
        if link.relation in TREE_RELATIONS and link.target in parents and link.source in parents:
            parents[link.target] = link.source
    layout = tree_layout(parents)
    widths: dict[int, float] = {}
    for node in graph.nodes:
        depth = int(layout[node.id][0])
        widths[depth] = max(widths.get(depth, 0.0), _node_width(node))
    column_left = {0: 8.0}
    for depth in sorted(widths):
        column_left[depth + 1] = column_left[depth] + widths[depth] + GAP
    boxes = {
        node.id: (column_left[int(layout[node.id][0])], 20 + ROW * layout[node.id][1], _node_width(node))
        for node in graph.nodes
    }
    nodes = tuple(
        DrawnNode(
            *boxes[node.id],
            node.id,
            node.node_type,
            hex_color(entity_color(node.instance, node.class_name)),
            _node_title(node),
            marks.get(node.id, ""),
        )
        for node in graph.nodes
    )
    edges, proximal = [], []
    for link in graph.links:
        if link.source not in boxes or link.target not in boxes:
            continue
        if link.relation not in TREE_RELATIONS:
            proximal.append(DrawnEdge(_arc(boxes[link.source], boxes[link.target]), link.relation, _link_title(link)))
        else:
            edges.append(DrawnEdge(elbow(boxes[link.source], boxes[link.target]), link.relation, _link_title(link)))
    rows = max((row for _, row in layout.values()), default=0.0)
    return DrawnGraph(
        width=max((x + width for x, _, width in boxes.values()), default=0.0) + (70 if proximal else 12),
        height=40 + ROW * rows,
        nodes=nodes,
        edges=tuple(edges),
        proximal=tuple(proximal),
        relations=tuple(sorted({link.relation for link in graph.links})),
        missing=missing,
    )


def marks_from_evaluation(evaluation: Path) -> tuple[dict[str, str], tuple[str, ...]]:
    """Read which nodes the evaluation found wrong, and which true nodes are missing. Empty without its table.

    Raises BadInput for a table that is none.
    """
    path = evaluation / "tables" / "graph_edit_distance.csv"
    if not path.is_file():
        return {}, ()
    marks: dict[str, str] = {}
    missing: list[str] = []
    try:
        rows = list(csv.DictReader(io.StringIO(file_text(path, LARGEST_SHOWN), newline="")))
    except csv.Error as error:
        raise BadInput(f"{path}: no table: {error}", hint="evaluate again") from None
    for row in rows:
        wrong, predicted, true = row.get("error") or "", row.get("predicted") or "", row.get("true") or ""
        if predicted:
            parent = row.get("true parent") or "nothing"
            marks[predicted] = wrong + (f", truly on {parent}" if wrong == "wrong support" else "")
        elif true:
            missing.append(true)
    return marks, tuple(missing)


def _node_width(node: GraphNode) -> float:
    return LETTER * len(node.id) + 30


def elbow(parent: tuple[float, float, float], child: tuple[float, float, float]) -> str:
    """Return the SVG path from the right end of a box (x, y, width) to the left end of another, with round corners."""
    x0, y0, x1, y1 = parent[0] + parent[2], parent[1], child[0], child[1]
    bend = x1 - GAP / 2
    if abs(y1 - y0) < 0.5:
        return f"M{x0:.1f},{y0:.1f}H{x1:.1f}"
    radius = min(8.0, abs(y1 - y0) / 2)
    turn = radius if y1 > y0 else -radius
    return (
        f"M{x0:.1f},{y0:.1f}H{bend - radius:.1f}Q{bend:.1f},{y0:.1f} {bend:.1f},{y0 + turn:.1f}"
        f"V{y1 - turn:.1f}Q{bend:.1f},{y1:.1f} {bend + radius:.1f},{y1:.1f}H{x1:.1f}"
    )


def _arc(a: tuple[float, float, float], b: tuple[float, float, float]) -> str:
    x0, y0, x1, y1 = a[0] + a[2], a[1], b[0] + b[2], b[1]
    reach = max(x0, x1) + 22 + 0.06 * abs(y1 - y0)
    return f"M{x0:.1f},{y0:.1f}C{reach:.1f},{y0:.1f} {reach:.1f},{y1:.1f} {x1:.1f},{y1:.1f}"


def _node_title(node: GraphNode) -> str:
    lines = [f"{node.id} ({node.node_type})"]
    if node.box is not None:
        x, y, z = node.box.size
        lines.append(f"box {x:.2f} x {y:.2f} x {z:.2f} m, centre {', '.join(f'{c:.2f}' for c in node.box.center)}")
    if node.planes:
        horizontal = sum(plane.horizontal for plane in node.planes)
        hidden = sum(plane.hidden for plane in node.planes)
        lines.append(f"{len(node.planes)} planes, {horizontal} horizontal" + (f", {hidden} hidden" if hidden else ""))
    if node.model_id:
        lines.append(f"CAD model {node.model_id}" + (f", scale {node.scale:.2f}" if node.scale else ""))
    lines.append(f"confidence {node.confidence:.2f}")
    return "\n".join(lines)


def _link_title(link: Relation) -> str:
    return f"{link.says}, {evidence(link)}"
