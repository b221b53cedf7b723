"""Edits of a contact graph: what carries a thing, and whether it is free to move, as a person says."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scenewright.schemas.contact_graph import SCENE_NODE, ContactGraphFile, GraphNode
from scenewright.schemas.edits import Mark, Support
from scenewright.schemas.scene_parts import TREE_RELATIONS, Box, Relation
from scenewright.stages.edit.anchoring import Conflict, Fitting, find
from scenewright.stages.edit.applying import Done, Table
from scenewright.stages.edit.map_state import Thing
from scenewright.stages.kit.geometry.boxes import (
    bottom,
    box_corners,
    clip_polygon,
    footprint,
    polygon_area,
    refined_box,
    top,
)
from scenewright.stages.kit.geometry.planes import level_plane, plane_height

STANDS = ("supports", "contains")
PERSON_SAID = "a person said so"
"""Why the carrier of a thing is unknown, where an edit took it away."""
LARGEST_EXTENSION = 1.0
"""Boxes are extended down to what carries them by at most this [m], as `graph` does."""
HIDDEN_WORTH = 0.7
"""A plane that nobody saw, at the bottom of what stands on it, is worth one that was seen 0.3 m from there."""
LEVEL = 0.5
"""Planes whose normal's z is below this are upright [-]."""
ORDER_TOLERANCE = 0.03
"""How far beyond its carrier's height the bottom of a thing may be: heights of fused surfaces are off by this [m]."""


@dataclass
class GraphState:
    """A contact graph while it is edited; the graph is replaced, never written into."""

    graph: ContactGraphFile

    def things(self) -> list[Thing]:
        """Return the nodes that have a box, in the order of the graph; the instance is the place in it."""
        return [
            Thing(place, node.class_name, node.box, node=node.id)
            for place, node in enumerate(self.graph.nodes)
            if node.box is not None
        ]

    def name_of(self, instance: int) -> str:
        """Return the id of the node at a place."""
        return self.graph.nodes[instance].id

    def called(self, points: np.ndarray, reach: float) -> None:
        """A graph knows no surface."""

    def replace_node(self, node: GraphNode) -> None:
        """Put a node into the place of the one with its id."""
        nodes = tuple(node if other.id == node.id else other for other in self.graph.nodes)
        self.graph = self.graph.model_copy(update={"nodes": nodes})


def support(state: GraphState, edit: Support, fitting: Fitting) -> Done:
    """Hang the thing where the person says, on the plane of what carries it that fits it best."""
    place = find(edit.of, state, fitting).instance
    child = state.graph.nodes[place]
    if child.node_type == "layout":
        raise Conflict(f"{child.id} is part of the building: nothing carries it")
    before = state.graph.parent_link(child.id)
    if edit.on is None:
        link = Relation(source=SCENE_NODE, target=child.id, relation="unknown", confidence=1.0, because=PERSON_SAID)
        parent = None
    else:
        parent = state.graph.nodes[find(edit.on, state, fitting).instance]
        if parent.id in and_below(state.graph, child.id):
            raise Conflict(f"{parent.id} is {child.id}, or stands on it: it cannot carry it")
        link = Relation(source=parent.id, target=child.id, relation=edit.relation, confidence=1.0)
    if before is not None and (before.source, before.relation) == (link.source, link.relation):
        _put(state, child, before.model_copy(update={"confidence": 1.0}))
        return Done("already", (place,), _said(link))
    _put(state, *_placed(state, child, parent, link))
    return Done("applied", (place,), _said(link) + ("" if before is None else f", not {before.source}"))


def mark(state: GraphState, edit: Mark, fitting: Fitting) -> Done:
    """Say whether the thing is free to move."""
    place = find(edit.of, state, fitting).instance
    node = state.graph.nodes[place]
    if edit.as_ == "movable":
        if node.node_type == "layout":
            raise Conflict(f"{node.id} is part of the building: it cannot be free")
        link = state.graph.parent_link(node.id)
        if link is not None and link.relation not in STANDS:
            what = "nothing is known to carry it" if link.relation == "unknown" else "it hangs"
            raise Conflict(f"{node.id} cannot be free: {what}, so that it would fall")
    if node.mark == edit.as_:
        return Done("already", (place,), f"it is marked {edit.as_}")
    state.replace_node(node.model_copy(update={"mark": edit.as_}))
    return Done("applied", (place,))


def _said(link: Relation) -> str:
    return "nothing known carries it" if link.source == SCENE_NODE else f"{link.source} {link.relation} it"


def and_below(graph: ContactGraphFile, name: str) -> set[str]:
    """Return a node and all that it carries, directly or not."""
    found, open_nodes = {name}, [name]
    while open_nodes:
        for child in graph.children(open_nodes.pop()):
            if child not in found:
                found.add(child)
                open_nodes.append(child)
    return found


def _put(state: GraphState, child: GraphNode, link: Relation) -> None:
    """Let a relation be the child's only one in the tree. A second carrier that is the first now, or any where there is
    none, goes; and who carries it is not said to be beside it."""
    state.replace_node(child)
    kept = []
    for other in state.graph.links:
        ends = {other.source, other.target}
        if other.target == child.id and other.relation in TREE_RELATIONS:
            continue
        if other.target == child.id and other.relation == "also_supports" and link.source in (other.source, SCENE_NODE):
            continue
        if other.relation == "proximal" and ends == {link.source, child.id}:
            continue
        kept.append(other)
    state.graph = state.graph.model_copy(update={"links": (link, *kept)})


def _placed(
    state: GraphState, child: GraphNode, parent: GraphNode | None, link: Relation
) -> tuple[GraphNode, Relation]:
    """Return the child with its box on what carries it, and the relation with the plane, gap and overlap."""
    box = child.box_observed or child.box
    assert box is not None  # it was found by it
    if parent is None or link.relation not in STANDS:
        child = child.model_copy(update={"box": box})
        return child, link if parent is None else _hanging(link, box, parent)
    best = carrying(box, parent)
    if best is None:
        return child.model_copy(update={"box": box}), link
    plane, gap, share = best
    if plane == len(parent.planes):
        outline = clip_polygon(footprint(parent.box), footprint(box)) if parent.box is not None else footprint(box)
        hidden = level_plane(outline, bottom(box), hidden=True)
        state.replace_node(parent.model_copy(update={"planes": (*parent.planes, hidden)}))
    measured = {"plane": plane, "gap": gap, "overlap": share}
    child = child.model_copy(update={"box": refined_box(box, bottom(box) - gap, LARGEST_EXTENSION)})
    return child, link.model_copy(update=measured)


def carrying(box: Box, parent: GraphNode, *, seen: bool = False) -> tuple[int, float, float] | None:
    """Return index, gap [m] and overlap of the parent's plane that speaks most for carrying a box (equations 2.1 to
    2.3); the index after the last for one that nobody saw, unless `seen`; None when no surface of it lies below."""
    ground, ranked = footprint(box), []
    area = max(polygon_area(ground), 1e-12)
    for k, plane in enumerate(parent.planes):
        if plane.horizontal and len(plane.corners) == 4:
            outline = np.asarray(plane.corners)[:, :2]
            outline = outline if polygon_area(outline) > 0 else outline[::-1]
            share = min(1.0, polygon_area(clip_polygon(ground, outline)) / area)
            gap = bottom(box) - plane_height(plane, np.asarray(box.center[:2]))
            if share > 0:
                ranked.append(((1.0 - min(1.0, abs(gap))) * share, k, gap, share))
    if parent.box is not None and not seen:
        share = min(1.0, polygon_area(clip_polygon(footprint(parent.box), ground)) / area)
        if share > 0 and bottom(parent.box) - ORDER_TOLERANCE <= bottom(box) <= top(parent.box) + ORDER_TOLERANCE:
            ranked.append((HIDDEN_WORTH * share, len(parent.planes), 0.0, share))
    if not ranked:
        return None
    _, k, gap, share = max(ranked, key=lambda entry: (entry[0], -entry[1]))
    return k, gap, share


def relink(state: GraphState, name: str) -> None:
    """Measure anew what carries a node that was moved, and what it carries: the nearest planes, gaps, overlaps."""
    node, links = state.graph.node(name), []
    for link in state.graph.links:
        if link.relation in (*STANDS, "also_supports") and name in (link.source, link.target):
            parent, child = state.graph.node(link.source), state.graph.node(link.target)
            best = None if child.box is None or parent.id == SCENE_NODE else carrying(child.box, parent, seen=True)
            plane, gap, share = best or (None, None, None)
            link = link.model_copy(update={"plane": plane, "gap": gap, "overlap": share})
        elif name == link.source and (link.plane or 0) >= len(node.planes):
            link = link.model_copy(update={"plane": None})
        links.append(link)
    state.graph = state.graph.model_copy(update={"links": tuple(links)})


def _hanging(link: Relation, box: Box, parent: GraphNode) -> Relation:
    """Return the relation with the plane that a box hangs at or below, and how far it is from it."""
    upright = link.relation == "carries_on_wall"
    corners, ranked = box_corners(box), []
    for k, plane in enumerate(parent.planes):
        if (abs(plane.normal[2]) < LEVEL) == upright:
            distance = float(np.abs(corners @ np.asarray(plane.normal) + plane.offset).min())
            ranked.append((distance, k))
    if not ranked:
        return link
    distance, k = min(ranked)
    return link.model_copy(update={"plane": k, "gap": distance})


GRAPH_EDITS: Table[GraphState] = {Support: support, Mark: mark}
