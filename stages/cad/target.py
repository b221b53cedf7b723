"""An object that a CAD model is sought for, and what every stand-in has to satisfy."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scenewright.schemas.cad_library import CadModel
from scenewright.schemas.contact_graph import ContactGraphFile, GraphNode
from scenewright.schemas.scene_parts import Relation
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.cad.explained import NEAR
from scenewright.stages.cad.free_space import FreeSpace
from scenewright.stages.cad.model_surfaces import ModelSurface, to_world
from scenewright.stages.cad.parameters import CadParameters
from scenewright.stages.cad.placing import placed_planes, supporting_surface, wall_depths, within
from scenewright.stages.cad.shapes import Observed, Placement, observed_frames
from scenewright.stages.kit.geometry.boxes import bottom


@dataclass(frozen=True)
class Surroundings:
    """An object of the graph, and what its stand-in has to get along with."""

    node: GraphNode
    graph: ContactGraphFile
    free_space: FreeSpace
    within: float = NEAR
    """Surface so near is explained [m]."""

    @property
    def walls(self) -> list[GraphNode]:
        """Nodes of walls."""
        return [entry for entry in self.graph.nodes if entry.class_name == "wall"]

    @property
    def hangs(self) -> bool:
        """Whether it stands on nothing: on a wall, from the ceiling."""
        link = self.graph.parent_link(self.node.id)
        return link is not None and link.relation in ("carries_on_wall", "hangs_from")

    @property
    def floats(self) -> bool:
        """Whether nothing is known to carry it: part of it is missing."""
        link = self.graph.parent_link(self.node.id)
        return link is not None and link.relation == "unknown"

    @cached_property
    def surface_below(self) -> Relation | None:
        """The relation by which what floats would stand on the nearest level surface below its middle, None without.
        Its gap is down from the box [m]; its confidence that of what is inferred."""
        if not self.floats or self.node.box is None:
            return None
        middle, height = np.asarray(self.node.box.center), bottom(self.node.box)
        gaps = [
            (height - plane.center[2], other.id, k)
            for other in self.graph.nodes
            for k, plane in enumerate(other.planes)
            if other.id != self.node.id and plane.horizontal and plane.center[2] <= height and within(plane, middle)
        ]
        if not gaps:
            return None
        gap, name, k = min(gaps)
        return Relation(source=name, target=self.node.id, relation="supports", confidence=0.5, plane=k, gap=gap)

    @property
    def stands_at(self) -> float:
        """Height of what it stands on, or of the nearest level surface below what floats [m]."""
        height = support_height_of(self.node)
        return height if self.surface_below is None else height - (self.surface_below.gap or 0.0)


@dataclass(frozen=True)
class Target:
    """What candidates are made of and compared with."""

    points: np.ndarray
    """(N, 3) vertices of the object, world [m]."""
    normals: np.ndarray
    """(N, 3) unit normals."""
    around: Surroundings
    models: list[CadModel]
    surfaces: dict[str, ModelSurface]
    """Model id -> surface, for every one of `models` at least."""

    @property
    def node(self) -> GraphNode:
        """The object's node."""
        return self.around.node

    @property
    def movable(self) -> bool:
        """Whether things of its class are moved, and may lie."""
        return load_vocabulary().by_name(self.node.class_name).movable

    def frames(self, *, all_frames: bool) -> list[Observed]:
        """Return the frames that models are oriented in (`shapes.observed_frames`)."""
        links = [link for link in self.around.graph.links if link.source == self.node.id]
        carried = [link for link in links if link.relation in ("supports", "contains")]
        carrying = frozenset(link.plane for link in carried if link.plane is not None)
        height = support_height_of(self.node)
        return observed_frames(self.node, self.points, carrying, height, all_frames=all_frames)


def support_height_of(node: GraphNode) -> float:
    """Return -d^s of the plane that the node stands on [m]: after refinement that is the bottom of its box (2.1)."""
    if node.box is None:
        raise ValueError(f"{node.id} has no box")
    return bottom(node.box)


def scale_fits(placement: Placement, parameters: CadParameters) -> bool:
    """Whether the scale is one that is admitted."""
    return parameters.minimum_scale <= placement.scale <= parameters.maximum_scale


def stands_in_wall(placement: Placement, target: Target, parameters: CadParameters) -> bool:
    """Whether a placed model reaches deeper into a wall than what a wall's thickness explains."""
    return any(depth > parameters.wall_penetration for depth, _ in _walls_within(placement, target))


def out_of_walls(placement: Placement, target: Target) -> Placement:
    """Return a placed model moved out of the walls that it reaches into: there it will stand."""
    for depth, normal in _walls_within(placement, target):
        placement = replace(placement, translation=placement.translation + depth * normal)
    return placement


def _walls_within(placement: Placement, target: Target) -> list[tuple[float, np.ndarray]]:
    box = target.node.box
    if box is None:
        return []
    points = to_world(placement, target.surfaces[placement.shape.model.id].hull_points(placement.shape.joints))
    return wall_depths(points, np.asarray(box.center), target.around.walls)


def unsupported_children(placement: Placement, around: Surroundings, parameters: CadParameters) -> tuple[str, ...]:
    """Return the children for which no surface of the placed model satisfies (2.2) near where they stand."""
    planes = placed_planes(placement)
    missing = []
    for link in around.graph.links:
        child = around.graph.node(link.target).box
        if link.source != around.node.id or link.relation not in ("supports", "contains") or child is None:
            continue
        surface = supporting_surface(
            planes,
            child,
            bottom(child),
            area_threshold=parameters.area_threshold,
            tolerance=parameters.support_tolerance,
        )
        if surface is None:
            missing.append(link.target)
    return tuple(missing)
