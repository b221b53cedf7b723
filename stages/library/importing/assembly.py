"""From a SourceModel to a CAD model: one body and the parts that move on it, in the library's model frame.

The library's joints all hang on the body and are closed at 0. What moves on a moving part is held fast on it, limits
are shifted and turned around so that 0 is closed and the larger end is open. Scaling is uniform: it acts on joint
origins and on the limits of slides, not on those of hinges.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from schemas.base import as_vector
from schemas.cad_library import CadModel, ModelState
from schemas.errors import BadInput
from schemas.scene_parts import Joint
from schemas.vocabulary import load_vocabulary
from stages.kit.formats.model_writer import PartGeometry
from stages.kit.geometry.solids import Solid, mass_properties, volume
from stages.kit.geometry.transforms import apply, transform_from
from stages.library.importing.frames import model_rotation
from stages.library.importing.pictures import few_colors
from stages.library.importing.pieces import convex_pieces
from stages.library.importing.source_model import (
    Direction,
    SourceJoint,
    SourceLink,
    SourceModel,
    Surface,
)
from stages.library.modelling import BODY, joint_values, motion
from stages.library.surfaces import surface_planes

SMALLEST_RANGE = {"revolute": 1e-3, "prismatic": 1e-4}
"""A joint that moves less is held fast [rad, m]."""
KNOB_SHARE = 0.2
"""Moving parts smaller than this share of the model's diagonal get no states of their own."""
FRONT_SHARE = 0.35
"""How far out of the middle, of the half extent, moving parts or a back rest lie to tell the front."""
DRAWER_LEVEL, DRAWER_WIDTH = 0.2, 0.3
"""A drawer slides level (|z| of its axis), and is wider than this share of its depth."""
BACKED = ("chair", "sofa", "bench", "toilet", "bed")
CONTAINERS = ("cabinet", "wall_cabinet", "shelf", "fridge", "microwave", "oven", "bin", "cup", "bowl", "box", "sink")
WIDEST_GRASP = 0.08
"""Opening of a two-finger gripper [m]."""
HANDLE = re.compile(r"handle|grip|knob|pull", re.IGNORECASE)
LARGEST_MASS = 1000.0
"""[kg]; larger ones are questioned, and none is assumed to be larger."""
LIGHTEST, HEAVIEST = 5.0, 12000.0
"""Mean density over the collision pieces [kg/m^3]."""
MOST_STATES_OF = 12
"""Joints that get states of their own."""


@dataclass(frozen=True)
class Group:
    """A part of the result: links that are fast to one another, in the frame of the source's root link."""

    name: str
    links: tuple[tuple[SourceLink, np.ndarray], ...]
    """Each with root_from_link (4, 4)."""
    joint: SourceJoint | None = None
    root_from_child: np.ndarray | None = None


@dataclass(frozen=True)
class Part:
    """A part in the model frame [m], closed."""

    name: str
    surfaces: tuple[Surface, ...]
    pieces: tuple[Solid, ...]
    mass: float | None
    joint: Joint | None


@dataclass(frozen=True)
class Assembled:
    """A CAD model with its geometry, and what is to be said about it."""

    model: CadModel
    parts: tuple[PartGeometry, ...]
    findings: tuple[str, ...]
    collision_pieces: int


def grouped(source: SourceModel) -> tuple[list[Group], list[str]]:
    """Return the body and the moving parts of a source. Raises BadInput for joints that make no tree."""
    links = {link.name: link for link in source.links}
    where = source.source
    if len(links) < len(source.links):
        raise BadInput(f"{where}: two links have one name")
    joint_of: dict[str, SourceJoint] = {}
    for joint in source.joints:
        if joint.parent not in links or joint.child not in links:
            raise BadInput(f"{where}: joint {joint.name!r:.60} names a link that does not exist")
        if joint.child in joint_of:
            raise BadInput(f"{where}: link {joint.child!r:.60} has two parents")
        joint_of[joint.child] = joint
    roots = [name for name in links if name not in joint_of]
    if len(roots) != 1:
        raise BadInput(f"{where}: {len(roots)} root links, expected 1")
    children: dict[str, list[SourceJoint]] = {}
    for joint in source.joints:
        children.setdefault(joint.parent, []).append(joint)
    findings: list[str] = []
    members: dict[str, list[tuple[SourceLink, np.ndarray]]] = {roots[0]: [(links[roots[0]], np.eye(4))]}
    heads: dict[str, tuple[SourceJoint, np.ndarray]] = {}
    waiting = [(roots[0], roots[0], np.eye(4))]
    seen = {roots[0]}
    while waiting:
        name, head, root_from_link = waiting.pop(0)
        for joint in children.get(name, []):
            pose = root_from_link @ joint.parent_from_child
            own = _kept(joint, findings)
            if own is not None and head != roots[0]:
                findings.append(f"joint {joint.name!r:.40} moves on a part that moves: held fast")
                own = None
            group = head if own is None else joint.child
            if own is not None:
                heads[group] = (own, pose)
            members.setdefault(group, []).append((links[joint.child], pose))
            seen.add(joint.child)
            waiting.append((joint.child, group, pose))
    if len(seen) < len(links):
        raise BadInput(f"{where}: joints lead in a circle")
    groups = [Group(BODY, tuple(members[roots[0]]))]
    for head, (joint, pose) in heads.items():
        groups.append(Group(head, tuple(members[head]), joint, pose))
    return groups, findings


def _kept(joint: SourceJoint, findings: list[str]) -> SourceJoint | None:
    """Return the joint as one that moves, or None for one that does not."""
    if joint.kind in ("fixed", "floating"):
        return None
    if joint.kind == "unknown":
        findings.append(f"joint {joint.name!r:.40} is of a kind that is left out: held fast")
        return None
    if np.linalg.norm(joint.axis) < 1e-9:
        findings.append(f"joint {joint.name!r:.40} has an axis of length 0: held fast")
        return None
    if joint.kind == "continuous":
        return replace(joint, kind="revolute", lower=-np.pi, upper=np.pi)
    if joint.lower > joint.upper:
        findings.append(f"joint {joint.name!r:.40}: lower and upper limit changed places")
        joint = replace(joint, lower=joint.upper, upper=joint.lower)
    if joint.kind == "revolute" and max(-joint.lower, joint.upper) > 4 * np.pi:
        findings.append(f"joint {joint.name!r:.40} turns by {max(-joint.lower, joint.upper):.0f} rad: degrees?")
    if joint.upper - joint.lower < SMALLEST_RANGE[joint.kind]:
        findings.append(f"joint {joint.name!r:.40} has no range: held fast")
        return None
    return joint


def normal_limits(axis: np.ndarray, lower: float, upper: float) -> tuple[float, np.ndarray, float, float]:
    """Return (value that is closed, axis, lower, upper) with 0 closed and the larger end of the range positive.

    Closed is 0 where the range holds it, else its nearer end.
    """
    closed = float(np.clip(0.0, lower, upper))
    lower, upper = lower - closed, upper - closed
    if -lower > upper:
        return closed, -axis, -upper, -lower
    return closed, axis, lower, upper


def source_points(groups: Sequence[Group]) -> np.ndarray:
    """Return the vertices (N, 3) of all parts as the file poses them, root frame and file's unit. Raises BadInput."""
    points = [
        apply(pose, surface.vertices)
        for group in groups
        for link, pose in group.links
        for surface in link.visual or link.collision
    ]
    if not points:
        raise BadInput("holds no shapes")
    return np.concatenate(points)


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
    parts: list[Part] = []
    whole = np.eye(4)
    whole[:3, :3] = unit * rotation
    names = {BODY}
    for group in groups:
        joint, root_from_closed = None, np.eye(4)
        if group.joint is not None and group.root_from_child is not None:
            joint, root_from_closed = _library_joint(group, rotation, unit, names)
            names.add(joint.part)
        visual: list[Surface] = []
        given: list[Surface] = []
        for link, pose in group.links:
            place = whole @ root_from_closed @ pose
            shown = link.visual or link.collision
            visual += [surface.moved(place) for surface in shown]
            given += [surface.moved(place) for surface in (link.collision or link.visual)]
        if not visual:
            if group.joint is None and len(groups) > 1:
                raise BadInput(f"{source.source}: the root link has no shape")
            findings.append(f"part {group.name!r:.40} has no shape: left out")
            continue
        pieces, said = convex_pieces(given if collision_given else visual, decompose=decompose)
        if not pieces:
            pieces, said = convex_pieces(visual, decompose=decompose)
        findings += said
        if not pieces:
            findings.append(f"part {group.name!r:.40} is a line or a point: left out")
            continue
        masses = [link.mass for link, _ in group.links if link.mass is not None]
        if joint is not None:
            joint = _with_handle(joint, group, visual, whole @ root_from_closed)
        part_name = BODY if joint is None else joint.part
        parts.append(Part(part_name, tuple(visual), tuple(pieces), sum(masses) if masses else None, joint))
    if not parts or parts[0].name != BODY:
        raise BadInput(f"{source.source}: no body with a shape")
    return parts, findings


def _library_joint(group: Group, rotation: np.ndarray, unit: float, taken: set[str]) -> tuple[Joint, np.ndarray]:
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
    part = plain_name(group.name) or "part"
    while part in taken:
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


def _with_handle(joint: Joint, group: Group, visual: Sequence[Surface], model_from_root: np.ndarray) -> Joint:
    """Return the joint with the place where its part is grasped, when a shape, a link or a mark is called so."""
    points: np.ndarray | None = None
    named = [surface.vertices for surface in visual if HANDLE.search(surface.name)]
    for link, pose in group.links:
        if link is not group.links[0][0] and HANDLE.search(f"{link.name} {link.role}"):
            named += [apply(model_from_root @ pose, s.vertices) for s in link.visual or link.collision]
    middle = None
    if named:
        points = np.concatenate(named)
        middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    else:
        marks = [
            (name, apply(model_from_root @ pose, at[None])[0]) for link, pose in group.links for name, at in link.marks
        ]
        if marks:
            middle = next((at for name, at in marks if HANDLE.search(name)), marks[0][1])
            near = [s.vertices for s in visual if _reaches(s.vertices, middle, 0.01)]
            points = min(near, key=lambda v: float(np.prod(np.ptp(v, axis=0)))) if near else None
    if middle is None:
        return joint
    direction = None
    if points is not None:
        _, extents, axes = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)
        if extents[0] > 1.5 * extents[1]:
            direction = axes[0] * (1.0 if axes[0][np.argmax(np.abs(axes[0]))] > 0 else -1.0)
    return joint.model_copy(
        update={
            "handle": as_vector(middle),
            "handle_axis": None if direction is None else as_vector(np.round(direction, 6) + 0.0),
        }
    )


def _reaches(vertices: np.ndarray, point: np.ndarray, margin: float) -> bool:
    return bool((vertices.min(axis=0) - margin <= point).all() and (point <= vertices.max(axis=0) + margin).all())


def told_front(parts: Sequence[Part], class_name: str) -> tuple[Direction, str] | None:
    """Return where the model looks (a horizontal axis of the frame the parts are in) and what tells it, or None.

    Doors and drawers lie at the front; the upper third of a chair, a sofa, a bed lies at its back.
    """
    points = np.concatenate([surface.vertices for part in parts for surface in part.surfaces])
    low, high = points.min(axis=0), points.max(axis=0)
    middle, half = 0.5 * (low + high), np.maximum(0.5 * (high - low), 1e-9)
    total = np.zeros(2)
    for part in parts[1:]:
        own = np.concatenate([surface.vertices for surface in part.surfaces])
        least, most = own.min(axis=0), own.max(axis=0)
        weight = float(np.linalg.norm(most - least))
        out = _drawn_out(part, most - least)
        total += weight * (((0.5 * (least + most) - middle) / half)[:2] if out is None else out)
    weights = sum(
        float(np.linalg.norm(np.ptp(np.concatenate([s.vertices for s in p.surfaces]), axis=0))) for p in parts[1:]
    )
    if weights > 0:
        found = _dominant(total / weights)
        if found is not None:
            return found, "joints"
    if class_name in BACKED:
        centers, areas = _face_centers(parts)
        upper = centers[:, 2] > low[2] + 0.7 * (high[2] - low[2])
        if areas[upper].sum() > 0:
            back = np.average(centers[upper], axis=0, weights=areas[upper])
            found = _dominant(-((back - middle) / half)[:2])
            if found is not None:
                return found, "back rest"
    return None


def _drawn_out(part: Part, size: np.ndarray) -> np.ndarray | None:
    """Return the horizontal direction (2,) in which a drawer of this size (3,) comes out; None for other parts.

    A sliding door slides too, but it is thin across its way.
    """
    joint = part.joint
    if joint is None or joint.type != "prismatic" or abs(joint.axis[2]) > DRAWER_LEVEL:
        return None
    way = np.abs(np.asarray(joint.axis[:2]))
    along, across = float(size[:2] @ way), float(size[:2] @ way[::-1])
    return np.asarray(joint.axis[:2]) if across > DRAWER_WIDTH * along else None


def _dominant(offset: np.ndarray) -> Direction | None:
    axis = int(np.argmax(np.abs(offset)))
    if abs(offset[axis]) < FRONT_SHARE or abs(offset[axis]) < 1.5 * abs(offset[1 - axis]):
        return None
    direction = [0.0, 0.0, 0.0]
    direction[axis] = float(np.sign(offset[axis]))
    return (direction[0], direction[1], direction[2])


def _face_centers(parts: Sequence[Part]) -> tuple[np.ndarray, np.ndarray]:
    corners = np.concatenate([surface.vertices[surface.faces] for part in parts for surface in part.surfaces])
    doubled = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    return corners.mean(axis=1), doubled


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


def assembled(
    parts: Sequence[Part],
    model_id: str,
    class_name: str,
    *,
    contains: bool | None,
    density: float,
    recipe: dict[str, float | int | str],
) -> Assembled:
    """Return the library's record and geometry of centred parts."""
    findings: list[str] = []
    movable = load_vocabulary().by_name(class_name).movable
    parts = [replace(part, joint=None if part.joint is None else _rounded(part.joint)) for part in parts]
    joints = tuple(part.joint for part in parts if part.joint is not None)
    joints = tuple(_unique_names(joints))
    geometries = _geometries(parts, density, findings)
    bounds = np.concatenate([surface.vertices for part in parts for surface in part.surfaces])
    size = np.ptp(bounds, axis=0)
    diagonal = float(np.linalg.norm(size))
    opened = tuple(
        joint
        for joint, part in zip(joints, parts[1:], strict=True)
        if np.linalg.norm(np.ptp(np.concatenate([s.vertices for s in part.surfaces]), axis=0)) > KNOB_SHARE * diagonal
    )[:MOST_STATES_OF]
    states = tuple(_state(parts, joints, values) for values in joint_values(joints, opened))
    width = float(min(size[0], size[1]))
    holds = contains if contains is not None else class_name in CONTAINERS
    model = CadModel(
        id=model_id,
        class_name=class_name,
        articulated=bool(joints),
        mass=round(sum(part.properties.mass for part in geometries), 6),
        states=states,
        joints=joints,
        movable=movable,
        contains=holds,
        grasp_width=round(width, 4) if movable and width <= WIDEST_GRASP else None,
        parts=tuple(part.name for part in parts),
        recipe=recipe,
    )
    return Assembled(model, tuple(geometries), tuple(findings), sum(len(part.pieces) for part in parts))


def _rounded(joint: Joint) -> Joint:
    def short(values: tuple[float, float, float] | None, digits: int) -> tuple[float, float, float] | None:
        return None if values is None else as_vector(np.round(values, digits) + 0.0)

    axis = np.asarray(joint.axis) / np.linalg.norm(joint.axis)
    return joint.model_copy(
        update={
            "origin": short(joint.origin, 7),
            "axis": as_vector(np.round(axis, 9) + 0.0),
            "lower": round(joint.lower, 7) + 0.0,
            "upper": round(joint.upper, 7) + 0.0,
            "handle": short(joint.handle, 6),
            "handle_axis": short(joint.handle_axis, 6),
        }
    )


def _unique_names(joints: Sequence[Joint]) -> list[Joint]:
    found: list[Joint] = []
    for joint in joints:
        name, number = joint.name, 1
        while name in {other.name for other in found}:
            number += 1
            name = f"{joint.name}_{number}"
        found.append(joint.model_copy(update={"name": name}))
    return found


def _geometries(parts: Sequence[Part], density: float, findings: list[str]) -> list[PartGeometry]:
    volumes = [sum(volume(piece) for piece in part.pieces) for part in parts]
    given = [part.mass for part in parts]
    if any(mass is not None for mass in given):
        known = sum(mass for mass in given if mass is not None)
        covered = sum(v for v, mass in zip(volumes, given, strict=True) if mass is not None)
        mean = known / covered
        masses = [mean * v if mass is None else mass for v, mass in zip(volumes, given, strict=True)]
    else:
        density = min(density, LARGEST_MASS / sum(volumes))
        masses = [density * v for v in volumes]
        findings.append(f"no mass: {sum(masses):.3g} kg at {density:g} kg/m3")
    mean_density = sum(masses) / sum(volumes)
    if sum(masses) > LARGEST_MASS or not LIGHTEST <= mean_density <= HEAVIEST:
        findings.append(f"mass of {sum(masses):.3g} kg ({mean_density:.2g} kg/m3) is unusual")
    result = []
    for part, mass, whole in zip(parts, masses, volumes, strict=True):
        origin = np.zeros(3) if part.joint is None else np.asarray(part.joint.origin)
        pieces = [piece.shifted(*(-origin)) for piece in part.pieces]
        properties = mass_properties(pieces, [mass / whole] * len(pieces))
        patches, colors = _painted(part.surfaces, origin)
        plain = [colors[0]] * len(pieces)
        result.append(PartGeometry(part.name, pieces, plain, properties, patches, colors))
    return result


@dataclass(frozen=True)
class Patch:
    """Triangles of one colour."""

    vertices: np.ndarray
    faces: np.ndarray


def _painted(surfaces: Sequence[Surface], origin: np.ndarray) -> tuple[list[Patch], list[tuple[int, int, int]]]:
    """Return the surfaces of a part in its frame as patches, one a colour, a few colours in all."""
    starts = np.cumsum([0, *(len(surface.vertices) for surface in surfaces)])
    vertices = np.concatenate([surface.vertices for surface in surfaces]) - origin
    faces = np.concatenate([surface.faces + start for surface, start in zip(surfaces, starts, strict=False)])
    colors = np.concatenate([surface.colors for surface in surfaces])
    corners = vertices[faces]
    areas = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    solid = areas > 1e-14  # slivers have no normal, and engines stumble over them
    if solid.any():
        faces, colors, areas = faces[solid], colors[solid], areas[solid]
    colors = few_colors(colors, areas)
    patches, palette = [], []
    for color in np.unique(colors, axis=0):
        chosen = faces[(colors == color).all(axis=1)]
        used, inner = np.unique(chosen, return_inverse=True)
        patches.append(Patch(vertices[used], inner.reshape(-1, 3)))
        palette.append((int(color[0]), int(color[1]), int(color[2])))
    return patches, palette


def _state(parts: Sequence[Part], joints: Sequence[Joint], values: dict[str, float]) -> ModelState:
    solids, points = list(parts[0].pieces), [surface.vertices for surface in parts[0].surfaces]
    for part, joint in zip(parts[1:], joints, strict=True):
        moved = motion(joint, values[joint.name])
        solids += [piece.moved(moved) for piece in part.pieces]
        points += [apply(moved, surface.vertices) for surface in part.surfaces]
    every = np.concatenate(points)
    return ModelState(
        joints=values,
        box_minimum=as_vector(np.round(every.min(axis=0), 9) + 0.0),
        box_maximum=as_vector(np.round(every.max(axis=0), 9) + 0.0),
        planes=surface_planes(solids),
    )


def plain_name(name: str) -> str:
    """Return a name of ASCII letters, digits, _ . - at most 80, other characters replaced by _."""
    return re.sub(r"[^A-Za-z0-9_.\-]+", "_", name).strip("_.-")[:80]
