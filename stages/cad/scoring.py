"""What makes one placed model a better stand-in than another, and what rules one out."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from schemas.contact_graph import ContactGraphFile, GraphNode
from stages.cad.free_space import FreeSpace
from stages.cad.matching import Match
from stages.cad.model_surfaces import ModelSurface, to_world
from stages.cad.parameters import CadParameters
from stages.cad.placing import (
    facing_wall,
    is_upright,
    placed_planes,
    size_misfit,
    supporting_surface,
    surface_share,
    wall_depth,
)
from stages.cad.shapes import Placement
from stages.kit.geometry.boxes import bottom

MOST_MOVE = 0.2
"""A child without any surface below or above it counts as if it moved this far [m]."""
CONTACT = 0.003
"""Points of a model that are this near to its lowest one bear it [m]."""
LEAST_MARGIN = 0.002
"""What tips over at a smaller push than this does not stay as it lies [m]."""


@dataclass(frozen=True)
class Surroundings:
    """An object of the graph, and what its stand-in has to get along with."""

    node: GraphNode
    graph: ContactGraphFile
    free_space: FreeSpace

    @property
    def walls(self) -> list[GraphNode]:
        """Nodes of walls."""
        return [entry for entry in self.graph.nodes if entry.class_name == "wall"]

    @property
    def hangs(self) -> bool:
        """Whether it stands on nothing: on a wall, from the ceiling."""
        link = self.graph.parent_link(self.node.id)
        return link is not None and link.relation in ("carries_on_wall", "hangs_from")


def score_of(
    match: Match,
    placement: Placement,
    error: float,
    surface: ModelSurface,
    around: Surroundings,
    parameters: CadParameters,
) -> float:
    """Ours: alignment error [m] plus what the vertices of a partial mesh do not tell: size, tilt, scale, children,
    front, and what was seen empty."""
    box = around.node.box
    return (
        error
        + parameters.misfit_weight * size_misfit(match.frame.size, placement)
        + parameters.tilt_weight * match.tilt
        + parameters.scale_weight * abs(math.log(placement.scale))
        + parameters.carrying_weight * carrying_misfit(placement, around)
        + parameters.facing_weight * (0.0 if box is None else facing_wall(placement, box, around.walls))
        + parameters.free_space_weight * filled_space(placement, surface, around.free_space)
    )


def filled_space(placement: Placement, surface: ModelSurface, free_space: FreeSpace) -> float:
    """Return how far the surface of a placed model lies in space that was seen empty: root mean square [m] over
    points of the surface, those in unseen space or on what was seen counting 0."""
    points = to_world(placement, surface.sample_points(placement.shape.joints))
    return float(np.sqrt(np.mean(free_space.depth_within(points) ** 2)))


def carrying_misfit(placement: Placement, around: Surroundings) -> float:
    """Return the mean height [m] by which children would have to move to stand on the placed model's surfaces."""
    children = [
        around.graph.node(link.target).box
        for link in around.graph.links
        if link.source == around.node.id and link.relation in ("supports", "contains")
    ]
    level = [plane for plane in placed_planes(placement) if plane.horizontal] if children else []
    moves = []
    for child in children:
        if child is not None:
            heights = [abs(p.center[2] - bottom(child)) for p in level if surface_share(p, child) > 0.0]
            moves.append(min([*heights, MOST_MOVE]))
    return float(np.mean(moves)) if moves else 0.0


def why_invalid(
    placement: Placement,
    surface: ModelSurface,
    around: Surroundings,
    parameters: CadParameters,
) -> str | None:
    """Return why a placement is no candidate whatever it carries, or None: scale, error, balance, walls."""
    if not parameters.minimum_scale <= placement.scale <= parameters.maximum_scale:
        return "refined scale out of range"
    if parameters.method == "ours" and placement.alignment_error > parameters.maximum_alignment_error:
        return "alignment error too large"
    points = to_world(placement, surface.hull_points(placement.shape.joints))
    if parameters.method == "ours" and not is_upright(placement) and not around.hangs:
        center = to_world(placement, surface.center_of_mass(placement.shape.joints)[None])[0]
        if balance_margin(points, center) < LEAST_MARGIN:
            return "does not stay as it lies"
    box = around.node.box
    if box is not None and wall_depth(points, np.asarray(box.center), around.walls) > parameters.wall_penetration:
        return "stands in a wall"
    return None


def balance_margin(points: np.ndarray, center_of_mass: np.ndarray) -> float:
    """Return how far [m] the centre of mass (3,) is inside the polygon that points (N, 3) rest on, negative outside it;
    the lowest `CONTACT` metres of the points bear. -inf when they bear on a line or a point."""
    bearing = points[points[:, 2] < points[:, 2].min() + CONTACT][:, :2]
    try:
        polygon = ConvexHull(bearing)
    except (QhullError, ValueError):
        return -math.inf
    return float(-(polygon.equations[:, :2] @ center_of_mass[:2] + polygon.equations[:, 2]).max())


def unsupported_children(placement: Placement, around: Surroundings, parameters: CadParameters) -> tuple[str, ...]:
    """Return the children for which no surface of the placed model satisfies (2.2) near where they stand."""
    planes = placed_planes(placement)
    missing = []
    for link in around.graph.links:
        child = around.graph.node(link.target).box
        if link.source != around.node.id or link.relation not in ("supports", "contains") or child is None:
            continue
        found = supporting_surface(
            planes,
            child,
            bottom(child),
            area_threshold=parameters.area_threshold,
            tolerance=parameters.support_tolerance,
        )
        if found is None:
            missing.append(link.target)
    return tuple(missing)
