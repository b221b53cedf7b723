"""How well one plane supports one object: equations 2.1 to 2.3 of Han 2024, and what every method needs beside."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scenewright.schemas.scene_parts import Box
from scenewright.stages.graph.nodes import Entity, Patch
from scenewright.stages.kit.geometry.boxes import bottom, footprint_overlap
from scenewright.stages.kit.geometry.planes import plane_height

INSIDE_SHARE = 0.7
"""A child is inside a container when this share of its footprint is within the container's."""
ORDER_TOLERANCE = 0.03
"""How much lower than its support a child's box may reach, as heights of fused surfaces are off by this [m]."""
SAME_TOP = 0.01
"""Tops and planes nearer than this are at the same height [m]."""


@dataclass(frozen=True)
class Candidate:
    """One way in which `child` may hang in the tree."""

    child: str
    parent: str
    score: float
    relation: Literal["supports", "contains", "carries_on_wall", "hangs_from"]
    gap: float
    """Signed height D of the child's bottom over the plane [m] (2.1)."""
    overlap: float
    """A(v_p, v_c) as measured (2.2)."""
    height: float
    """Of the plane under the child [m]."""
    patch: int | None
    """Index into the parent's patches; None when the plane is hidden and must be registered."""
    hidden: Patch | None = None
    touching: bool = False
    """Whether the plane is seen in contact with the child's bottom (stages/graph/touching.py)."""


def height_gap(child: Box, patch: Patch) -> float:
    """Equation 2.1: D(v_c, pi) = p_c - (-d + s_c / 2), the signed height of the child's bottom over the plane [m]."""
    return bottom(child) - plane_height(patch.plane, np.asarray(child.center[:2]))


def support_score(gap: float, overlap: float) -> float:
    """Equation 2.3: {1 - min[1, |D|]} * A, with D in metres."""
    return (1.0 - min(1.0, abs(gap))) * overlap


def inside_share(child: Box, container: Box) -> float:
    """Return the share of the child's footprint that lies within the container's."""
    area = float(child.size[0] * child.size[1])
    return footprint_overlap(child, container) / area if area > 0.0 else 0.0


def stands_inside(child: Entity, parent: Entity, height: float, *, container: bool) -> bool:
    """Whether the child stands within a `container`: on an inner plane at `height`, top below the container's top."""
    return (
        container
        and child.top <= parent.top + SAME_TOP
        and height < parent.top - SAME_TOP
        and inside_share(child.box, parent.box) >= INSIDE_SHARE
    )


def possible_parents(child: Entity, entities: list[Entity]) -> Iterator[Entity]:
    """Yield the candidate parents of an object (section 2.2.2): all nodes whose bottom is below the child's, but the
    ceiling."""
    for parent in entities:
        if parent.name == child.name or parent.class_name == "ceiling":
            continue
        if parent.bottom < child.bottom + ORDER_TOLERANCE:
            yield parent


def best_first(candidates: list[Candidate], entities: list[Entity]) -> list[Candidate]:
    """Return the candidates by score; ties fall to the smaller instance label, then the earlier patch."""
    order = {entity.name: entity.instance for entity in entities}
    return sorted(candidates, key=lambda c: (-c.score, order[c.parent], -1 if c.patch is None else c.patch))
