"""The body and the parts that move on it in the library's model frame [m], closed.

Limits are shifted and turned around so that 0 is closed and the larger end is open. Scaling is uniform: it acts on
joint origins and on the limits of slides, not on those of hinges.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scenewright.schemas.base import as_vector
from scenewright.schemas.errors import BadInput
from scenewright.schemas.scene_parts import Joint
from scenewright.stages.kit.geometry.file_axes import Direction
from scenewright.stages.kit.geometry.solids import Solid
from scenewright.stages.kit.geometry.transforms import apply, transform_from
from scenewright.stages.library.importing.frames import model_rotation
from scenewright.stages.library.importing.grouping import Group
from scenewright.stages.library.importing.handles import with_handle
from scenewright.stages.library.importing.pieces import convex_pieces
from scenewright.stages.library.importing.source_model import SourceModel, Surface
from scenewright.stages.library.modelling import BODY
from scipy.spatial.transform import Rotation

MOST_PARTS = 500
"""Most parts of a model that move."""
FARTHEST = 1e5
"""Farthest from the origin of a model that anything may lie [m]; a bound, by eye."""
LONGEST_SLIDE = 1e4
"""Longest way of a sliding joint [m]; a bound, by eye."""


@dataclass(frozen=True)
class Part:
    """A part in the model frame [m], closed."""

    name: str
    surfaces: tuple[Surface, ...]
    pieces: tuple[Solid, ...]
    mass: float | None
    joint: Joint | None


def placed_parts(
    source: SourceModel,
    groups: Sequence[Group],
    rotation: np.ndarray,
    unit: float,
    *,
    collision_given: bool,
    decompose: bool,
) -> tuple[list[Part], list[str]]:
    """Return the parts [m] under model_from_source `rotation` (3, 3), closed, before they are centred.

    Raises BadInput for parts without shape.
    """
    findings: list[str] = []
    placed: list[Part] = []
    if len(groups) > MOST_PARTS:
        raise BadInput(f"{source.source}: {len(groups)} moving parts, more than {MOST_PARTS}", hint="split it")
    model_from_root = np.eye(4)
    model_from_root[:3, :3] = unit * rotation
    names = {BODY}
    for group in groups:
        joint, root_from_closed = None, np.eye(4)
        if group.joint is not None and group.root_from_child is not None:
            joint, root_from_closed = _library_joint(group, rotation, unit, names)
            names.add(joint.part)
        visual: list[Surface] = []
        collision_surfaces: list[Surface] = []
        for link, pose in group.links:
            pose_in_model = model_from_root @ root_from_closed @ pose
            drawn_surfaces = link.visual or link.collision
            visual += [surface.moved(pose_in_model) for surface in drawn_surfaces]
            collision_surfaces += [surface.moved(pose_in_model) for surface in (link.collision or link.visual)]
        if not visual:
            if group.joint is None and len(groups) > 1:
                raise BadInput(f"{source.source}: the root link has no shape")
            findings.append(f"part {group.name!r:.40} has no shape: left out")
            continue
        deciding = collision_surfaces if collision_given else visual
        _check_reach(source, deciding, visual)
        pieces, piece_findings = convex_pieces(deciding, decompose=decompose)
        if not pieces:
            pieces, piece_findings = convex_pieces(visual, decompose=decompose)
        findings += piece_findings
        if not pieces:
            findings.append(f"part {group.name!r:.40} is a line or a point: left out")
            continue
        masses = [link.mass for link, _ in group.links if link.mass is not None]
        if joint is not None:
            joint = with_handle(joint, group, visual, model_from_root @ root_from_closed)
        part_name = BODY if joint is None else joint.part
        placed.append(Part(part_name, tuple(visual), tuple(pieces), sum(masses) if masses else None, joint))
    if not placed or placed[0].name != BODY:
        raise BadInput(f"{source.source}: no body with a shape")
    return placed, findings


def _check_reach(source: SourceModel, deciding: Sequence[Surface], visual: Sequence[Surface]) -> None:
    """Refuse what reaches so far that no hull of it has a volume. Raises BadInput."""
    if _within_reach(deciding):
        return
    if _within_reach(visual):
        raise BadInput(f"{source.source}: collision shapes are not finite, or far away", hint="--collision visual")
    raise BadInput(f"{source.source}: shapes are not finite, or far away", hint="correct their poses and sizes")


def _within_reach(surfaces: Sequence[Surface]) -> bool:
    return all((np.abs(surface.vertices) < FARTHEST).all() for surface in surfaces)


def normal_limits(axis: np.ndarray, lower: float, upper: float) -> tuple[float, np.ndarray, float, float]:
    """Return (value that is closed, axis, lower, upper) with 0 closed and the larger end of the range positive.

    Closed is 0 where the range holds it, else its nearer end.
    """
    closed = float(np.clip(0.0, lower, upper))
    lower, upper = lower - closed, upper - closed
    if -lower > upper:
        return closed, -axis, -upper, -lower
    return closed, axis, lower, upper


def _library_joint(group: Group, rotation: np.ndarray, unit: float, used_names: set[str]) -> tuple[Joint, np.ndarray]:
    """Return the joint in the model frame [m], and the motion (4, 4) in the root frame that closes the part."""
    source, root_from_child = group.joint, group.root_from_child
    assert source is not None and root_from_child is not None
    axis = root_from_child[:3, :3] @ (source.axis / np.linalg.norm(source.axis))
    origin = apply(root_from_child, source.anchor[None])[0]
    closed, turned, lower, upper = normal_limits(axis, source.lower, source.upper)
    root_from_closed = np.eye(4)
    if closed != 0.0:
        if source.kind == "prismatic":
            root_from_closed[:3, 3] = closed * axis
            origin = origin + closed * axis
        else:
            turn = Rotation.from_rotvec(closed * axis).as_matrix()
            root_from_closed = transform_from(turn, origin - turn @ origin)
    length = unit if source.kind == "prismatic" else 1.0
    if source.kind == "prismatic" and upper * length > LONGEST_SLIDE:
        raise BadInput(f"joint {source.name!r:.60} slides by {upper * length:.3g} m, more than {LONGEST_SLIDE:g} m")
    part = plain_name(group.name) or "part"
    while part in used_names:
        part += "_"
    return (
        Joint(
            name=plain_name(source.name) or f"{part}_joint",
            type="prismatic" if source.kind == "prismatic" else "revolute",
            part=part,
            origin=as_vector(unit * rotation @ origin),
            axis=as_vector(rotation @ turned),
            lower=float(lower * length),
            upper=float(upper * length),
        ),
        root_from_closed,
    )


def turned(parts: Sequence[Part], front: Direction) -> list[Part]:
    """Return upright parts turned about z so that the horizontal direction `front` becomes -y."""
    rotation = model_rotation((0.0, 0.0, 1.0), front)
    return [_moved_part(part, transform_from(rotation, np.zeros(3))) for part in parts]


def _moved_part(part: Part, transform: np.ndarray) -> Part:
    joint = part.joint
    if joint is not None:
        rotation = transform[:3, :3]
        joint = joint.model_copy(
            update={
                "origin": as_vector(apply(transform, np.array([joint.origin]))[0]),
                "axis": as_vector(rotation @ np.asarray(joint.axis)),
                "handle": None if joint.handle is None else as_vector(apply(transform, np.array([joint.handle]))[0]),
                "handle_axis": None
                if joint.handle_axis is None
                else as_vector(rotation @ np.asarray(joint.handle_axis)),
            }
        )
    return Part(
        part.name,
        tuple(surface.moved(transform) for surface in part.surfaces),
        tuple(piece.moved(transform) for piece in part.pieces),
        part.mass,
        joint,
    )


def centered(parts: Sequence[Part]) -> list[Part]:
    """Return the parts with the origin in the centre of the bottom of what is seen of them."""
    points = np.concatenate([surface.vertices for part in parts for surface in part.surfaces])
    low, high = points.min(axis=0), points.max(axis=0)
    shift = np.eye(4)
    shift[:3, 3] = -np.array([0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), low[2]])
    return [_moved_part(part, shift) for part in parts]


def plain_name(name: str) -> str:
    """Return a name of ASCII letters, digits, _ . - at most 80, other characters replaced by _."""
    return re.sub(r"[^A-Za-z0-9_.\-]+", "_", name).strip("_.-")[:80]
