"""What can be done with a model, from its shape and its joints: opened, filled, stood on, taken hold of.

Works on convex pieces and joints alone, so that parametric and imported models are told the same way.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scenewright.schemas.base import as_vector
from scenewright.schemas.cad_library import Affordances, CadModel, GraspPlace, InnerVolume, JointUse, SupportSurface
from scenewright.schemas.scene_parts import Joint, SurfacePlane
from scenewright.stages.kit.geometry.solids import Solid
from scenewright.stages.library.joint_kinds import joint_kind
from scenewright.stages.library.rays import SolidRays

OPENING_KINDS = ("door", "drawer", "lid")
LEVEL = 0.98
"""Things stay on planes whose normal's z is at least this (11 degrees)."""
LEAST_CLEARANCE = 0.03
"""Surfaces with less room above carry nothing [m]."""
LEAST_WIDTH = 0.04
"""Narrower surfaces carry nothing [m]."""
LEAST_DEPTH, LEAST_DEPTH_SHARE = 0.035, 0.12
"""A room is at least this high [m], an open vessel also this share of its smaller width: trays and plates are none."""
WALL_REACH = 0.10
"""A wall stands at most this far beyond the edge of the floor [m]."""
WALL_LEVEL = 0.3
"""Share of the free height at which walls under a cover are looked for: below the apron of a table."""
LEVELS = (0.1, 0.3, 0.5, 0.7, 0.9)
"""Shares of the free height at which a way out is looked for."""
RIM_STEPS = 24
"""Heights at which a rim is looked for."""
ROUND_FILL = 0.88
"""A floor that fills less of its rectangle is round: its volume stands on the largest square within."""
SIDEWAYS = np.array([[1.0, 0, 0], [-1.0, 0, 0], [0, 1.0, 0], [0, -1.0, 0]])
"""Horizontal unit directions in which a way out is looked for."""
UP = np.array([0.0, 0, 1.0])
"""Direction against gravity."""
LIFT = 1e-3
"""Distance by which samples are lifted off the surface that they lie on [m]."""


@dataclass(frozen=True)
class _Shape:
    """A closed model made ready for questions."""

    rays: SolidRays
    owner: np.ndarray
    """(S,) number of the part of every solid; 0 is the body."""
    opener: dict[int, Joint]
    """Number of a part -> the door, drawer or lid joint that moves it."""
    top: float
    parts: tuple[str, ...]

    def without(self, distances: np.ndarray, parts: Sequence[int]) -> np.ndarray:
        """Return distances (R, S) as if the solids of these parts were not there."""
        return np.where(np.isin(self.owner, list(parts))[None], np.inf, distances)


def affordances(model: CadModel, solids: Mapping[str, Sequence[Solid]]) -> Affordances:
    """Return what can be done with a model. `solids`: part -> its convex pieces in the model frame, closed [m]."""
    corners = {part: np.concatenate([solid.vertices for solid in solids[part]]) for part in model.parts}
    all_points = np.concatenate(list(corners.values()))
    kinds = {joint.name: joint_kind(joint, corners[joint.part], all_points) for joint in model.joints}
    numbers = {part: k for k, part in enumerate(model.parts)}
    shape = _Shape(
        rays=SolidRays([solid for part in model.parts for solid in solids[part]]),
        owner=np.repeat(np.arange(len(model.parts)), [len(solids[part]) for part in model.parts]),
        opener={numbers[joint.part]: joint for joint in model.joints if kinds[joint.name] in OPENING_KINDS},
        top=float(all_points[:, 2].max()),
        parts=model.parts,
    )
    uses = tuple(
        JointUse(
            joint=joint.name,
            part=joint.part,
            kind=kinds[joint.name],
            behind=_behind(joint, corners[joint.part], shape, numbers[joint.part]),
        )
        for joint in model.joints
    )
    behind = {use.joint: use.behind for use in uses}
    carries, contains = [], []
    for index, plane in enumerate(model.states[0].planes):
        surface = _support(index, plane, shape) if plane.horizontal else None
        through = None if surface is None else _ways_in(plane, surface, shape)
        if surface is None or through is None:
            continue
        volume = _inner_volume(plane, surface, through, shape, behind)
        carries.append(surface.model_copy(update={"inside": volume is not None}))
        if volume is not None:
            contains.append(volume)
    return Affordances(
        model=model.id,
        movable=model.movable,
        openable=tuple(use.joint for use in uses if use.kind in OPENING_KINDS),
        joints=uses,
        contains=_apart(contains),
        carries=tuple(sorted(carries, key=lambda surface: (-surface.area, surface.plane))),
        grasps=_grasps(model),
    )


def _samples(plane: SurfacePlane) -> np.ndarray:
    """Return points (5, 3) just over a plane: its middle, and half way from there to its corners."""
    middle = np.asarray(plane.center)
    corners = np.asarray(plane.corners).reshape(-1, 3)
    return np.concatenate([middle[None], 0.5 * (middle + corners)]) + LIFT * UP


def _edges(plane: SurfacePlane) -> tuple[float, float]:
    """Return the smaller and the larger edge of the plane's rectangle [m]."""
    corners = np.asarray(plane.corners).reshape(-1, 3)
    lengths = np.linalg.norm(np.roll(corners, -1, axis=0) - corners, axis=1)
    return float(lengths.min()), float(lengths.max())


def _support(index: int, plane: SurfacePlane, shape: _Shape) -> SupportSurface | None:
    """Return the surface that a plane is to things, None when it is too narrow or too low under something."""
    if plane.normal[2] < LEVEL or len(plane.corners) != 4 or _edges(plane)[0] < LEAST_WIDTH:
        return None
    samples = _samples(plane)
    below = shape.rays.distances(samples, -UP)
    nearest = below.min(axis=1)
    over = samples[nearest < 5 * LIFT]
    if len(over) == 0:
        return None
    part = shape.parts[int(shape.owner[int(below[int(np.argmin(nearest))].argmin())])]
    free = float(shape.rays.distances(over, UP).min())
    if free < LEAST_CLEARANCE:
        return None
    clearance = None if np.isinf(free) else round(free + LIFT, 6)
    return SupportSurface(plane=index, part=part, area=plane.area, clearance=clearance)


def _inner_volume(
    plane: SurfacePlane,
    surface: SupportSurface,
    through: tuple[str, ...],
    shape: _Shape,
    behind: Mapping[str, tuple[str, ...]],
) -> InnerVolume | None:
    """Return the room over a floor that walls enclose, None when there is none.

    Under a cover three walls of four are enough (a bookcase); an open vessel has four and ends where the lowest does.
    """
    corners = np.asarray(plane.corners)
    low, high = corners[:, :2].min(axis=0), corners[:, :2].max(axis=0)
    reach = 0.5 * (high - low) + WALL_REACH
    middle = np.asarray(plane.center)
    if surface.clearance is None:
        depth = _rim(middle, reach, shape)
        if depth < max(LEAST_DEPTH, LEAST_DEPTH_SHARE * _edges(plane)[0]):
            return None
    else:
        depth = surface.clearance
        if depth < LEAST_DEPTH or len(_walls(middle + WALL_LEVEL * depth * UP, reach, shape)) < 3:
            return None
    own_part = shape.opener.get(shape.parts.index(surface.part))
    joints = (*behind[own_part.name], own_part.name) if own_part is not None else through
    if plane.area < ROUND_FILL * float(np.prod(high - low)):
        low, high = (0.5 * (low + high) + sign * np.sqrt(0.125) * (high - low) for sign in (-1.0, 1.0))
    return InnerVolume(
        part=surface.part,
        box_minimum=as_vector(np.round([*low, middle[2]], 6) + 0.0),
        box_maximum=as_vector(np.round([*high, middle[2] + depth], 6) + 0.0),
        plane=surface.plane,
        reached_through=joints,
    )


def _walls(point: np.ndarray, reach: np.ndarray, shape: _Shape) -> list[int]:
    """Return the numbers of the SIDEWAYS directions in which something stands within reach (2,) of the point (3,)."""
    return [
        k
        for k, direction in enumerate(SIDEWAYS)
        if float(shape.rays.distances(point[None], direction).min()) <= reach[k // 2]
    ]


def _rim(middle: np.ndarray, reach: np.ndarray, shape: _Shape) -> float:
    """Return the height over the floor's middle up to which walls stand on all four sides [m]."""
    heights = np.linspace(0.0, shape.top - middle[2], RIM_STEPS + 1)[1:]
    depth = 0.0
    for height in heights:
        if len(_walls(middle + (height - LIFT) * UP, reach, shape)) < 4:
            break
        depth = float(height)
    return depth


def _ways_in(plane: SurfacePlane, surface: SupportSurface, shape: _Shape) -> tuple[str, ...] | None:
    """Return the joints to open so that a straight line leads out, none of them where one does already; None: no way.

    What a drawer holds comes out with it.
    """
    if surface.clearance is None or shape.parts.index(surface.part) in shape.opener:
        return ()
    depth = surface.clearance
    samples = _samples(plane)
    shortest: tuple[str, ...] | None = None
    for direction in (*SIDEWAYS[::-1], UP):
        blocked: set[int] = set()
        free = 0
        for share in LEVELS if direction[2] == 0 else (LEVELS[0],):
            hits = shape.rays.distances(samples + share * depth * UP, direction)
            open_lines = np.isinf(shape.without(hits, list(shape.opener)).min(axis=1))
            free += int(open_lines[0] if direction[2] else open_lines.sum())  # upwards through a narrow neck
            for line in np.flatnonzero(open_lines):
                blocked |= {int(k) for k in shape.owner[np.isfinite(hits[line])]}
        names = tuple(shape.opener[k].name for k in sorted(blocked))
        if free >= (1 if direction[2] else 2) and (shortest is None or len(names) < len(shortest)):
            shortest = names
    return shortest


def _behind(joint: Joint, part: np.ndarray, shape: _Shape, number: int) -> tuple[str, ...]:
    """Return the joints of what stands closed in the way of a part that slides, `part` (N, 3) its corners."""
    if joint.type != "prismatic":
        return ()
    axis = np.asarray(joint.axis)
    travel = float(joint.upper)
    low, high = part.min(axis=0), part.max(axis=0)
    grid = np.array([[x, y, z] for x in (0.1, 0.5, 0.9) for y in (0.1, 0.5, 0.9) for z in (0.1, 0.5, 0.9)])
    hits = shape.rays.distances(low + grid * (high - low), axis).min(axis=0)
    ahead = {int(shape.owner[k]) for k in np.flatnonzero(hits < travel)}
    return tuple(shape.opener[k].name for k in sorted(ahead) if k != number and k in shape.opener)


def _apart(volumes: list[InnerVolume]) -> tuple[InnerVolume, ...]:
    """Return the volumes, largest first, without those whose middle lies in a larger one."""
    apart: list[InnerVolume] = []

    def size(volume: InnerVolume) -> float:
        return float(np.prod(np.asarray(volume.box_maximum) - np.asarray(volume.box_minimum)))

    for volume in sorted(volumes, key=lambda entry: (-round(size(entry), 9), entry.plane)):
        middle = 0.5 * (np.asarray(volume.box_minimum) + np.asarray(volume.box_maximum))
        if not any(
            (middle > accepted.box_minimum).all() and (middle < accepted.box_maximum).all() for accepted in apart
        ):
            apart.append(volume)
    return tuple(apart)


def _grasps(model: CadModel) -> tuple[GraspPlace, ...]:
    """Return the handles of the joints, and the whole thing where a gripper closes around it."""
    places = [
        GraspPlace(part=joint.part, joint=joint.name, point=joint.handle, axis=joint.handle_axis)
        for joint in model.joints
        if joint.handle is not None
    ]
    if model.movable and model.grasp_width is not None:
        state = model.states[0]
        middle = 0.5 * (np.asarray(state.box_minimum) + np.asarray(state.box_maximum))
        whole_model = GraspPlace(
            part=model.parts[0], point=as_vector(np.round(middle, 6) + 0.0), width=model.grasp_width
        )
        places.append(whole_model)
    return tuple(places)
