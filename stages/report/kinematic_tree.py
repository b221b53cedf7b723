"""The contact graph beside the kinematic tree of the scene's URDF, the same thing in the same row of both."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from xml.etree.ElementTree import Element

from scenewright.schemas.contact_graph import SCENE_NODE, ContactGraphFile
from scenewright.schemas.scene_parts import TREE_RELATIONS
from scenewright.stages.kit.drawing.palette import entity_color, hex_color
from scenewright.stages.kit.drawing.tree_layout import tree_layout
from scenewright.stages.kit.simulation.urdf_split import PART_SEPARATOR, owner_of_link, read_urdf
from scenewright.stages.report.graph_drawing import GAP, LETTER, ROW, DrawnEdge, DrawnNode, elbow

GUTTER = 60
"""Gap between the two trees [px]."""
TOP = 48
"""Space for the headings over the trees [px]."""


@dataclass(frozen=True)
class UrdfJoint:
    """A joint of a URDF."""

    name: str
    type: str
    parent: str
    child: str
    limits: str
    """`0 to 1.60` [rad or m], empty without."""


@dataclass(frozen=True)
class Corresponding:
    """Two trees to draw side by side, and a line for every row in which both have a node."""

    width: float
    height: float
    graph_nodes: tuple[DrawnNode, ...]
    graph_edges: tuple[DrawnEdge, ...]
    link_nodes: tuple[DrawnNode, ...]
    joint_edges: tuple[DrawnEdge, ...]
    guides: tuple[tuple[float, float, float], ...]
    """x from, x to, y."""
    graph_left: float
    link_left: float
    kinds: tuple[str, ...]
    """Types of the joints that are there."""
    only_graph: tuple[str, ...]
    """Nodes of the graph that are no link."""
    only_urdf: tuple[str, ...]
    """Links that belong to no node of the graph."""


def read_joints(path: Path) -> tuple[list[str], list[UrdfJoint]]:
    """Return the links and joints of a URDF in file order. Raises BadInput when it is missing or no URDF."""
    robot = read_urdf(path)
    links = [link.get("name", "") for link in robot.findall("link")]
    joints = []
    for joint in robot.findall("joint"):
        parent, child, limit = joint.find("parent"), joint.find("child"), joint.find("limit")
        if parent is None or child is None:
            continue
        joints.append(
            UrdfJoint(
                joint.get("name", ""),
                joint.get("type", ""),
                parent.get("link", ""),
                child.get("link", ""),
                "" if limit is None else _limits(limit),
            )
        )
    return links, joints


def _limits(limit: Element) -> str:
    try:
        return f"{float(limit.get('lower', 0)):.2f} to {float(limit.get('upper', 0)):.2f}"
    except ValueError:
        return ""


def corresponding_trees(graph: ContactGraphFile, links: list[str], joints: list[UrdfJoint]) -> Corresponding:
    """Lay both trees out. Rows: the tree of the graph, with the moving parts of each body below it as its children.

    `links`, `joints`: of the URDF, its root link stands for the scene. Raises ValueError when the graph has a circle or
    no root.
    """
    if SCENE_NODE not in {node.id for node in graph.nodes}:
        raise ValueError(f"no node {SCENE_NODE!r}")
    children = {joint.child for joint in joints}
    root = next((link for link in links if link not in children), "")
    bodies = {node.id for node in graph.nodes if node.id != SCENE_NODE}
    node_of = {link: SCENE_NODE if link == root else owner_of_link(link, bodies) for link in links}
    owner_of_part = {link: owner for link, owner in node_of.items() if owner not in (None, link, SCENE_NODE)}
    layout = _rows(graph, owner_of_part)
    left_boxes = _boxes({node.id: node.id for node in graph.nodes}, {n.id: layout[n.id] for n in graph.nodes}, 8.0)
    link_left = max((x + width for x, _, width in left_boxes.values()), default=0.0) + GUTTER
    names = {link: owner for link, owner in node_of.items() if owner in (link, SCENE_NODE)}
    label_of = {
        link: link.rsplit(PART_SEPARATOR, 1)[-1] if link in owner_of_part else link for link in (*names, *owner_of_part)
    }
    depths = _link_depths(joints, root)
    places = {
        link: (float(depths.get(link, 0)), layout[link if link in owner_of_part else str(names[link])][1])
        for link in label_of
    }
    right_boxes = _boxes(label_of, places, link_left)
    classes = {node.id: node for node in graph.nodes}

    def color(name: str | None) -> str:
        node = classes.get(name or "")
        return "" if node is None else hex_color(entity_color(node.instance, node.class_name))

    graph_nodes = tuple(
        DrawnNode(*left_boxes[n.id], n.id, n.node_type, color(n.id), f"{n.id} ({n.node_type})") for n in graph.nodes
    )
    link_nodes = tuple(
        DrawnNode(
            *right_boxes[link],
            label_of[link],
            "scene" if link == root else "part" if link in owner_of_part else "rigid",
            color(node_of[link]),
            f"link {link}",
        )
        for link in label_of
    )
    return Corresponding(
        width=max((x + width for x, _, width in right_boxes.values()), default=link_left) + 12,
        height=TOP + 20 + ROW * max((row for _, row in layout.values()), default=0.0),
        graph_nodes=graph_nodes,
        graph_edges=_graph_edges(graph, left_boxes),
        link_nodes=link_nodes,
        joint_edges=tuple(
            DrawnEdge(elbow(right_boxes[j.parent], right_boxes[j.child]), j.type, _joint_title(j))
            for j in joints
            if j.parent in right_boxes and j.child in right_boxes
        ),
        guides=_free_guides(
            [
                (left_boxes[owner][0] + left_boxes[owner][2], right_boxes[link][0], right_boxes[link][1])
                for link, owner in names.items()
                if owner in left_boxes
            ],
            {**left_boxes, **right_boxes},
        ),
        graph_left=8.0,
        link_left=link_left,
        kinds=tuple(sorted({joint.type for joint in joints})),
        only_graph=tuple(sorted(bodies - set(links))),
        only_urdf=tuple(sorted(link for link, owner in node_of.items() if owner is None)),
    )


def _rows(graph: ContactGraphFile, owner_of_part: Mapping[str, str | None]) -> dict[str, tuple[float, float]]:
    """(depth, row) of nodes and of the links that are parts of them."""
    parents: dict[str, str | None] = {node.id: None for node in graph.nodes}
    for link in graph.links:
        if link.relation in TREE_RELATIONS and link.target in parents and link.source in parents:
            parents[link.target] = link.source
    return tree_layout({**parents, **owner_of_part})


def _link_depths(joints: list[UrdfJoint], root: str) -> dict[str, int]:
    """Joints between the root link and each link."""
    depths = {root: 0}
    waiting = list(joints)
    while waiting:
        reached = [joint for joint in waiting if joint.parent in depths]
        if not reached:
            break
        for joint in reached:
            depths[joint.child] = depths[joint.parent] + 1
        waiting = [joint for joint in waiting if joint.child not in depths]
    return depths


def _boxes(
    texts: Mapping[str, str], places: Mapping[str, tuple[float, float]], start: float
) -> dict[str, tuple[float, float, float]]:
    """Name -> (x, y, width): a column is as wide as its widest box."""
    widths = {name: LETTER * len(text) + 30 for name, text in texts.items()}
    columns: dict[int, float] = {}
    for name, (depth, _) in places.items():
        columns[int(depth)] = max(columns.get(int(depth), 0.0), widths[name])
    column_left = {0: start}
    for depth in range(max(columns, default=0) + 1):
        column_left[depth + 1] = column_left[depth] + columns.get(depth, 0.0) + GAP
    return {name: (column_left[int(depth)], TOP + ROW * row, widths[name]) for name, (depth, row) in places.items()}


def _graph_edges(graph: ContactGraphFile, boxes: Mapping[str, tuple[float, float, float]]) -> tuple[DrawnEdge, ...]:
    return tuple(
        DrawnEdge(elbow(boxes[link.source], boxes[link.target]), link.relation, link.says)
        for link in graph.links
        if link.relation in TREE_RELATIONS and link.source in boxes and link.target in boxes
    )


def _joint_title(joint: UrdfJoint) -> str:
    text = f"{joint.name}: {joint.type} joint from {joint.parent} to {joint.child}"
    return f"{text}, {joint.limits} {'rad' if joint.type == 'revolute' else 'm'}" if joint.limits else text


def _free_guides(
    guides: list[tuple[float, float, float]], boxes: Mapping[str, tuple[float, float, float]]
) -> tuple[tuple[float, float, float], ...]:
    """The lines (x from, x to, y) that cross no box on their way."""
    return tuple(
        (start, end, y)
        for start, end, y in guides
        if not any(abs(at - y) < ROW / 2 and start + 1 < x < end for x, at, _ in boxes.values())
    )
