"""Ours: what makes one placed model a better stand-in than another."""

from __future__ import annotations

import math

import numpy as np
from scenewright.stages.cad.free_space import FreeSpace
from scenewright.stages.cad.matching import Match
from scenewright.stages.cad.model_surfaces import ModelSurface, to_world
from scenewright.stages.cad.parameters import CadParameters
from scenewright.stages.cad.placing import facing_wall, is_upright, placed_planes, size_misfit, surface_share
from scenewright.stages.cad.shapes import Placement
from scenewright.stages.cad.target import Surroundings
from scenewright.stages.kit.geometry.boxes import bottom
from scipy.spatial import ConvexHull, QhullError

MOST_MOVE = 0.2
"""A child without any surface below or above it counts as if it moved this far [m]."""
CONTACT = 0.003
"""Points of a model that are this near to its lowest one bear it [m]."""
LEAST_MARGIN = 0.002
"""Least push at which a thing tips over that stays as it lies [m]."""


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


def would_tip(placement: Placement, surface: ModelSurface) -> bool:
    """Whether a placed model that does not stand upright would not stay as it lies."""
    if is_upright(placement):
        return False
    points = to_world(placement, surface.hull_points(placement.shape.joints))
    center = to_world(placement, surface.center_of_mass(placement.shape.joints)[None])[0]
    return balance_margin(points, center) < LEAST_MARGIN


def balance_margin(points: np.ndarray, center_of_mass: np.ndarray) -> float:
    """Return how far [m] the centre of mass (3,) is inside the polygon that points (N, 3) rest on, negative outside it;
    the lowest `CONTACT` metres of the points bear. -inf when they bear on a line or a point."""
    bearing = points[points[:, 2] < points[:, 2].min() + CONTACT][:, :2]
    try:
        polygon = ConvexHull(bearing)
    except (QhullError, ValueError):
        return -math.inf
    return float(-(polygon.equations[:, :2] @ center_of_mass[:2] + polygon.equations[:, 2]).max())
