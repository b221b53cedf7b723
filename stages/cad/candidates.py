"""The candidates of one object: proposed by the method, checked against what it carries and where walls are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scenewright.schemas.cad_library import CadModel
from scenewright.schemas.cad_scene import Tried
from scenewright.schemas.contact_graph import GraphNode
from scenewright.schemas.scene_parts import Relation
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.cad.method import CadMethod
from scenewright.stages.cad.shapes import Placement, Shape
from scenewright.stages.cad.target import Target, unsupported_children
from scenewright.stages.kit.geometry.boxes import points_in_box
from scenewright.stages.kit.geometry.point_clouds import thin_to_grid

GRID = 0.01
"""Distance to which vertices are thinned out [m]; by eye."""
BOX_MARGIN = 0.01
"""Vertices outside the observed box by more than this were stray to the graph and are so here [m]."""
SAME_PLACE = (0.01, 0.03)
"""Placements of one model nearer than this in metres and radians are one candidate."""


@dataclass(frozen=True)
class Shortlist:
    """What the global check chooses from, for one object."""

    node: GraphNode
    placements: tuple[Placement, ...]
    """Valid candidates, best first."""
    rejected: dict[str, int]
    reason: str
    """Why there is no valid candidate, or in what the valid ones fall short."""
    tries: tuple[Tried, ...] = ()
    """In which ways something was sought, in order, and what came of it."""
    carrier: Relation | None = None
    """On what its model of a family stands, where nothing was known to carry it."""


def models_for(class_name: str, models: tuple[CadModel, ...]) -> list[CadModel]:
    """Return the library's models of the class, then of the classes that the vocabulary names as stand-ins (`library`):
    a desk may well be modelled by a table."""
    semantic = load_vocabulary().by_name(class_name)
    names = (class_name, *semantic.library)
    return [model for name in names for model in models if model.class_name == name]


def object_points(
    node: GraphNode, vertices: np.ndarray, normals: np.ndarray, count: int, random: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Return at most `count` points (N, 3) and normals of the object's mesh, evenly spread, without what the graph
    left out."""
    if node.box_observed is not None:
        inside = points_in_box(node.box_observed, vertices, margin=BOX_MARGIN)
        if inside.any():
            vertices, normals = vertices[inside], normals[inside]
    points, normals = thin_to_grid(vertices, normals, GRID)
    if len(points) > count:
        drawn = np.sort(random.choice(len(points), size=count, replace=False))
        points, normals = points[drawn], normals[drawn]
    return points, normals


def shortlist(target: Target, method: CadMethod) -> Shortlist:
    """Return the valid candidates of one object (sections 2.4.2, 2.4.3 and the first half of 2.4.4)."""
    node = target.node
    if not target.models:
        return Shortlist(node, (), {}, f"the library has no model of class {node.class_name}")
    proposals = method.propose(target)
    rejected = proposals.rejected
    placements: list[Placement] = []
    for placement in proposals.placements:
        reason = method.why_invalid(placement, target)
        if reason is None:
            placements.append(placement)
        else:
            rejected[reason] += 1
    fitting = len(placements)
    missing = {id(p): unsupported_children(p, target.around, method.parameters) for p in placements}
    allowed = method.missing_allowed([len(names) for names in missing.values()])
    placements = [p for p in placements if len(missing[id(p)]) <= allowed]
    rejected["does not support a child"] = fitting - len(placements)
    placements.sort(key=lambda p: p.score)
    unique = without_repeats(placements)
    rejected["same as a better candidate"] += len(placements) - len(unique)
    counted = {name: int(count) for name, count in sorted(rejected.items()) if count}
    reason = ""
    if not unique:
        reason = "no valid candidate: " + ", ".join(f"{name} {count}" for name, count in counted.items())
    elif missing[id(unique[0])]:
        reason = "does not quite support " + ", ".join(missing[id(unique[0])])
    return Shortlist(node, tuple(unique), counted, reason)


def without_repeats(placements: list[Placement]) -> list[Placement]:
    """Drop placements that a better one (earlier in the list) repeats: same model, place, turn and joints."""
    distinct: list[Placement] = []
    for placement in placements:
        for better in distinct:
            if better.shape.model.id != placement.shape.model.id:
                continue
            same_position = np.linalg.norm(better.translation - placement.translation) < SAME_PLACE[0]
            turn = np.arccos(np.clip((np.trace(better.rotation.T @ placement.rotation) - 1) / 2, -1, 1))
            joints = _joint_distance(better.shape, placement.shape)
            if same_position and turn < SAME_PLACE[1] and joints < SAME_PLACE[1]:
                break
        else:
            distinct.append(placement)
    return distinct


def _joint_distance(a: Shape, b: Shape) -> float:
    names = set(a.joints) | set(b.joints)
    return max((abs(a.joints.get(name, 0.0) - b.joints.get(name, 0.0)) for name in names), default=0.0)
