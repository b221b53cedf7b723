"""A unit that is said of a description: its mesh files have it; joints, poses and primitives are in metres.

URDF, SDF and MJCF are in metres by their specifications, and mesh files beside them are not always. Only where parts
would then lie far from one another is the whole description taken to be in that unit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scenewright.stages.kit.geometry.transforms import apply
from scenewright.stages.library.importing.frames import unit_name
from scenewright.stages.library.importing.grouping import Group, grouped
from scenewright.stages.library.importing.source_model import SourceModel, Surface

LEAST_FACTOR = 10.0
"""The units that models come in differ by this much at least, inches aside."""


def names_meshes(source: SourceModel) -> bool:
    """Whether a description names mesh files."""
    return any(s.mesh_origin is not None for link in source.links for s in (*link.visual, *link.collision))


def in_unit(source: SourceModel, unit: float) -> tuple[SourceModel, float, str]:
    """Return a description whose mesh files are in units of `unit` metres, metres a unit of all of it, and a finding.

    The finding is empty when the mesh files alone are in that unit.
    """
    meshes_alone, whole = _with_meshes_in(source, unit), _with_meshes_in(source, 1.0)
    if not _torn_apart(meshes_alone) or _torn_apart(whole):
        return meshes_alone, 1.0, ""
    return whole, unit, f"joints and poses are in {unit_name(unit)} as well: parts would lie far apart otherwise"


def _with_meshes_in(source: SourceModel, unit: float) -> SourceModel:
    def changed(surfaces: tuple[Surface, ...]) -> tuple[Surface, ...]:
        return tuple(surface.in_unit(unit) for surface in surfaces)

    links = (replace(link, visual=changed(link.visual), collision=changed(link.collision)) for link in source.links)
    return replace(source, links=tuple(links), mesh_unit=None)


def _torn_apart(source: SourceModel) -> bool:
    """Whether parts lie so far apart as only lengths in two units do."""
    gap = _widest_gap(grouped(source)[0])
    return gap is not None and gap.length > LEAST_FACTOR * gap.smaller


def apart(groups: Sequence[Group]) -> tuple[str, float] | None:
    """Return the link that lies farther from all others than any link is long, and how far [the file's unit]."""
    gap = _widest_gap(groups)
    return (gap.link, gap.length) if gap is not None and gap.length > gap.largest else None


@dataclass(frozen=True)
class _Gap:
    """Between the bounding boxes of a link and of all others."""

    link: str
    length: float
    smaller: float
    """Diagonal of the smaller of the two boxes."""
    largest: float
    """Diagonal of the largest link."""


def _widest_gap(groups: Sequence[Group]) -> _Gap | None:
    names, bounds = [], []
    for group in groups:
        for link, pose in group.links:
            drawn = link.visual or link.collision
            if drawn:
                points = np.concatenate([apply(pose, surface.vertices) for surface in drawn])
                names.append(link.name)
                bounds.append([points.min(axis=0), points.max(axis=0)])
    if len(names) < 2:
        return None
    low, high = np.array(bounds)[:, 0], np.array(bounds)[:, 1]
    others_low, others_high = _least_of_others(low), -_least_of_others(-high)
    gaps = np.linalg.norm(np.maximum(0.0, np.maximum(low - others_high, others_low - high)), axis=1)
    sizes, sizes_of_others = np.linalg.norm(high - low, axis=1), np.linalg.norm(others_high - others_low, axis=1)
    widest = int(np.lexsort((sizes, -gaps))[0])
    smaller = float(min(sizes[widest], sizes_of_others[widest]))
    return _Gap(names[widest], float(gaps[widest]), smaller, float(sizes.max()))


def _least_of_others(values: np.ndarray) -> np.ndarray:
    """Return for each row (N >= 2, 3) the least values of all other rows."""
    first, second = np.partition(values, 1, axis=0)[:2]
    alone = (values == first) & ((values == first).sum(axis=0) == 1)
    return np.where(alone, second, first)


def far_hinge(groups: Sequence[Group]) -> tuple[str, float] | None:
    """Return a hinge whose axis passes farther from its part than the part is long, and how far, or None."""
    for group in groups:
        joint, pose = group.joint, group.root_from_child
        points = [apply(p, s.vertices) for link, p in group.links for s in link.visual or link.collision]
        if joint is None or pose is None or joint.kind == "prismatic" or not points:
            continue
        corners = np.concatenate(points)
        axis = pose[:3, :3] @ (joint.axis / np.linalg.norm(joint.axis))
        from_anchor = corners - apply(pose, joint.anchor[None])[0]
        distance = float(np.linalg.norm(np.cross(from_anchor, axis), axis=1).min())
        if distance > float(np.linalg.norm(np.ptp(corners, axis=0))):
            return joint.name, distance
    return None
