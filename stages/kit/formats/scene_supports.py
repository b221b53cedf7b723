"""Where things without CAD model rest: the planes of the contact graph, made exact in the collision shapes.

A reconstructed table top is uneven by a voxel or two, and a reconstructed cup ends where the camera saw it end. The
contact graph knows better: it says which plane carries what. So the boxes that stand for the table end at that plane
below what it carries, and the hull that stands for the cup reaches down to it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scenewright.schemas.contact_graph import ContactGraphFile, GraphNode
from scenewright.schemas.scene_parts import Box
from scenewright.stages.kit.geometry.boxes import bottom, box_yaw
from scenewright.stages.kit.geometry.convex_pieces import convex_pieces
from shapely import contains_xy
from shapely.geometry import MultiPoint, Polygon

LARGEST_STEP = 0.04
"""What a surface may stick out of the plane that stands for it, or a thing hover over it [m]: twice the usual voxel."""
FEWEST_CORNERS = 4
"""Fewer span no solid: what sticks out of a plane there is a spike."""
PAD_THICKNESS = 0.02
"""Thickness of the pad under a carried body [m]; by eye."""
MARGIN = 0.01
"""Room around a carried thing that is levelled too [m]."""


@dataclass(frozen=True)
class Carried:
    """The footprint (world frame) of a thing that rests on a plane at `height` [m]."""

    box: Box
    height: float
    hidden: bool = False
    """Whether nobody saw the plane."""

    def polygon(self, margin: float = 0.0) -> Polygon:
        """Return the footprint, grown by `margin` [m] on all sides."""
        half = 0.5 * np.array(self.box.size[:2]) + margin
        corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * half
        yaw = box_yaw(self.box)
        turn = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
        return Polygon(corners @ turn.T + np.array(self.box.center[:2]))


def support_height(graph: ContactGraphFile, nodes: dict[str, GraphNode], name: str) -> float | None:
    """Return the height [m] of the level plane that a node stands or lies on, however much lower that is.

    None when the graph names no such plane, or one that is more than 4 cm above the bottom of the node's box.
    """
    link, node = graph.parent_link(name), nodes.get(name)
    if link is None or link.plane is None or node is None or node.box is None or link.source not in nodes:
        return None
    if link.relation not in ("supports", "contains") or link.plane >= len(nodes[link.source].planes):
        return None
    plane = nodes[link.source].planes[link.plane]
    normal = np.array(plane.normal)
    if abs(normal[2]) < 0.9:
        return None
    x, y, _ = node.box.center
    height = float(-(plane.offset + normal[0] * x + normal[1] * y) / normal[2])
    return height if height - bottom(node.box) <= LARGEST_STEP else None


def resting_height(graph: ContactGraphFile, nodes: dict[str, GraphNode], name: str) -> float | None:
    """Return the height [m] of the plane that a node stands or lies on. None where `support_height` is, or more than
    4 cm below the bottom of the node's box."""
    height, node = support_height(graph, nodes, name), nodes.get(name)
    if height is None or node is None or node.box is None:
        return None
    return height if bottom(node.box) - height <= LARGEST_STEP else None


def carried_by(graph: ContactGraphFile, nodes: dict[str, GraphNode], name: str) -> list[Carried]:
    """Return what rests on the level planes of a node, in the order of the graph's links."""
    carried = []
    for link in graph.links:
        if link.source != name or link.relation not in ("supports", "contains") or link.target not in nodes:
            continue
        height, box = resting_height(graph, nodes, link.target), nodes[link.target].box
        if height is not None and box is not None:
            is_hidden = link.plane is not None and nodes[name].planes[link.plane].hidden
            carried.append(Carried(box, height, is_hidden))
    return carried


def levelled(
    boxes: Sequence[tuple[np.ndarray, np.ndarray]], yaw: float, world_from_body: np.ndarray, carried: Sequence[Carried]
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return boxes (centre, size; body frame turned by `yaw` [rad]) that end at the planes under what is carried.

    Below each carried thing and 1 cm around it, a box that sticks out of the plane by up to 4 cm is cut there. One that
    lies on the plane and is not higher than the thing is left out: it is a piece of the thing that the map gave to what
    carries it. `world_from_body` turns about z alone.
    """
    hollow_boxes = []
    turn = yaw + np.arctan2(world_from_body[1, 0], world_from_body[0, 0])
    axes = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    cosine, sine = np.cos(yaw), np.sin(yaw)
    areas = [
        (body.polygon(MARGIN), body.height - world_from_body[2, 3], max(LARGEST_STEP, body.box.size[2] + MARGIN))
        for body in carried
    ]
    for center, size in boxes:
        low, high = center[2] - 0.5 * size[2], center[2] + 0.5 * size[2]
        corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * 0.5 * size[:2]
        in_body = np.array([cosine * center[0] - sine * center[1], sine * center[0] + cosine * center[1], 0.0])
        middle = (world_from_body[:3, :3] @ in_body + world_from_body[:3, 3])[:2]
        footprint = Polygon(corners @ axes.T + middle)
        for area, height, top in areas:
            step = LARGEST_STEP if low < height - MARGIN else top
            if height < high <= height + step and area.intersects(footprint):
                high = height
        if high - low > 1e-3:
            hollow_boxes.append(
                (np.array([center[0], center[1], 0.5 * (low + high)]), np.array([*size[:2], high - low]))
            )
    return hollow_boxes


def cut_below(
    pieces: Sequence[np.ndarray], world_from_body: np.ndarray, carried: Sequence[Carried]
) -> list[np.ndarray]:
    """Return the corner points (N, 3) of convex pieces (body frame), none in what is carried over them.

    A piece over whose plane something stands ends at that plane; what of it reaches more than 4 cm above stays as a
    piece of its own, unless that would reach over the thing. Where nothing would be left nothing is cut.
    `world_from_body` turns about z alone.
    """
    kept_pieces = list(pieces)
    for body in carried:
        area, height = body.polygon(MARGIN), body.height - world_from_body[2, 3]

        def meets(points: np.ndarray, area: Polygon = area) -> bool:
            in_world = points[:, :2] @ world_from_body[:2, :2].T + world_from_body[:2, 3]
            return bool(area.intersects(MultiPoint(in_world).convex_hull))

        cut = []
        for piece in kept_pieces:
            if piece[:, 2].max() <= height or piece[:, 2].min() >= height + body.box.size[2] or not meets(piece):
                cut.append(piece)
                continue
            low = piece.copy()
            low[:, 2] = np.minimum(low[:, 2], height)
            cut += [low] if piece[:, 2].min() < height - MARGIN else []
            high = piece[piece[:, 2] > height + LARGEST_STEP]
            high = high[~_within(high, world_from_body, area)]
            cut += [high] if len(high) >= FEWEST_CORNERS and not meets(high) else []
        kept_pieces = cut
    return kept_pieces or list(pieces)


def _within(points: np.ndarray, world_from_body: np.ndarray, area: Polygon) -> np.ndarray:
    in_world = points[:, :2] @ world_from_body[:2, :2].T + world_from_body[:2, 3]
    return np.asarray(contains_xy(area, in_world[:, 0], in_world[:, 1]))


def pads(carried: Sequence[Carried]) -> list[tuple[np.ndarray, np.ndarray, float]]:
    """Return a flat box (centre in the world frame, size, yaw) below each carried thing, its top in the plane: the
    camera did not see what a thing stands on."""
    pads = []
    for body in carried:
        x, y = body.box.center[:2]
        size = np.array([body.box.size[0], body.box.size[1], PAD_THICKNESS])
        pads.append((np.array([x, y, body.height - 0.5 * PAD_THICKNESS]), size, box_yaw(body.box)))
    return pads


def standing_points(vertices: np.ndarray, height: float) -> np.ndarray:
    """Return the vertices (V, 3), none below `height` [m], and their footprint at that height: the hull of all of them
    stands there on a flat bottom."""
    raised = np.array(vertices, dtype=float)
    raised[:, 2] = np.maximum(raised[:, 2], height)
    bottom = raised.copy()
    bottom[:, 2] = height
    return np.concatenate([raised, bottom])


def furniture_pieces(points: np.ndarray, faces: np.ndarray, rests_at: float | None) -> list[np.ndarray]:
    """Return the corner points (N, 3) of convex pieces of free furniture, from its mesh (V, 3) [m], (F, 3). Where it
    stands at a height `rests_at` [m], none reaches below."""
    pieces = convex_pieces(points, faces)
    if rests_at is not None:
        for piece in pieces:
            piece[:, 2] = np.maximum(piece[:, 2], rests_at)
    return pieces
