"""Ours: refine pose and joint values on the object's vertices, after the plane-based alignment."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import product

import numpy as np
from scenewright.schemas.base import as_vector
from scenewright.stages.cad.alignment import turn_about_z
from scenewright.stages.cad.model_surfaces import ModelSurface, alignment_error, to_model, to_world
from scenewright.stages.cad.shapes import Placement, Shape, relative_planes
from scenewright.stages.kit.formats.cad_models import part_transforms
from scenewright.stages.kit.geometry.transforms import apply, inverse

ITERATIONS = 30
"""Most steps of a refinement; by eye."""
QUICK_ITERATIONS = 8
"""Most steps for candidates that may still turn out to be no good."""
LEAST_STEP = 3e-4
"""The refinement stops at smaller steps [m, rad, share of the scale]."""
ROBUST_DISTANCE = 0.03
"""Vertices farther from the model than this pull with constant force (Huber) [m]."""
SCALE_PRIOR = 0.02
"""Weight of (ln alpha / alpha_0)^2 against the mean squared distance, in squared diagonals of the model: vertices that
say nothing of the scale leave it where the planes put it."""
STATES_PER_JOINT = 4
"""Joint values that are tried in matching, between the limits."""
MOST_COMBINED = 2
"""Most joints whose values are tried in all combinations; with more, one joint is tried at a time."""
SAMPLE = 500
"""Vertices that the refinement looks at."""
GRID = 9
"""Joint values that are tried before the best is refined, between the limits; by eye."""
LEAST_GAIN = 0.02
"""A joint value other than the stored state's must lower the alignment error by this share."""
AJAR = {"revolute": 0.1, "prismatic": 0.03}
"""Joints that are less open than this are shut [rad, m], unless that costs `AJAR_GAIN`."""
AJAR_GAIN = 0.2
"""Share by which shutting a joint that is ajar must raise the alignment error for it to stay open."""
SAME_PART = 0.003
"""A plane belongs to the part that its corners are this close to [m]."""


def refine(
    surface: ModelSurface,
    placement: Placement,
    points: np.ndarray,
    normals: np.ndarray,
    *,
    free_height: bool,
    move_joints: bool = True,
    iterations: int = ITERATIONS,
) -> Placement:
    """Return the placement after iterative closest points in scale, yaw, shift and (`move_joints`) joint values, if
    that lowers the alignment error on the vertices (N, 3).

    Gauss-Newton on point-to-plane distances with Huber weights. The foot of the model stays on its supporting plane
    (the constraint on p_z in 2.11) unless `free_height` (things on walls stand on nothing). The thesis stops at the
    planes, whose offsets are biased where only edges or noise were seen, and at the stored states.
    """
    best = replace(placement, alignment_error=alignment_error(surface, placement, points, normals))
    scale, rotation, translation = placement.scale, placement.rotation, placement.translation
    joints, limits = dict(placement.shape.joints), surface.model.joints if move_joints else ()
    foot = float(to_world(placement, surface.hull_points(joints))[:, 2].min())
    prior = (SCALE_PRIOR * placement.scale * float(np.linalg.norm(placement.shape.size))) ** 2
    best_error, best_state = best.alignment_error, (scale, rotation, translation, dict(joints))
    for _ in range(iterations):
        nearest = surface.closest((points - translation) @ rotation / scale, joints, normals @ rotation)
        error = scale * float(np.sqrt(np.mean(nearest.distance**2)))
        if error < best_error:
            best_error, best_state = error, (scale, rotation, translation, dict(joints))
        target = scale * nearest.points @ rotation.T + translation
        normal = nearest.normals @ rotation.T
        gap = np.einsum("ij,ij->i", normal, points - target)
        weight = np.minimum(1.0, ROBUST_DISTANCE / np.maximum(scale * nearest.distance, 1e-9)) / len(points)
        # The model grows and turns about its foot below the model origin.
        anchor = np.array([*translation[:2], foot])
        arm = target - anchor
        motions = [arm, np.column_stack([-arm[:, 1], arm[:, 0], np.zeros(len(arm))])]
        columns = [np.einsum("ij,ij->i", normal, motion) for motion in motions]
        columns += [normal[:, 0], normal[:, 1]] + ([normal[:, 2]] if free_height else [])
        first_joint = len(columns)
        for joint in limits:
            owned = nearest.part == surface.model.parts.index(joint.part)
            axis = np.asarray(joint.axis)
            if joint.type == "revolute":
                motion = scale * np.cross(axis, nearest.points - np.asarray(joint.origin)) @ rotation.T
            else:
                motion = np.broadcast_to(scale * rotation @ axis, target.shape)
            columns.append(np.where(owned, np.einsum("ij,ij->i", normal, motion), 0.0))
        jacobian = np.stack(columns, axis=1)
        matrix = jacobian.T @ (weight[:, None] * jacobian) + 1e-9 * np.eye(len(columns))
        right = jacobian.T @ (weight * gap)
        matrix[0, 0] += prior
        right[0] -= prior * math.log(scale / placement.scale)
        values = np.array([joints.get(joint.name, 0.0) for joint in limits])
        low, high = (np.array([getattr(joint, side) for joint in limits]) for side in ("lower", "upper"))
        step = solve_within_limits(matrix, right, first_joint, low - values, high - values)
        growth, angle = math.exp(float(np.clip(step[0], -0.1, 0.1))), float(np.clip(step[1], -0.3, 0.3))
        shift = np.clip(np.array([step[2], step[3], step[4] if free_height else 0.0]), -0.2, 0.2)
        spin = turn_about_z(angle)
        translation = anchor + growth * spin @ (translation - anchor) + shift
        scale, rotation, foot = scale * growth, spin @ rotation, foot + float(shift[2])
        for joint, change in zip(limits, np.clip(step[first_joint:], -0.3, 0.3), strict=True):
            joints[joint.name] = float(np.clip(joints.get(joint.name, 0.0) + change, joint.lower, joint.upper))
        if np.abs(step).max() < LEAST_STEP:
            break
    final = _state(surface, placement, (scale, rotation, translation, joints), points, normals)
    if best_error < final.alignment_error:
        final = _state(surface, placement, best_state, points, normals)
    return final if final.alignment_error < best.alignment_error else best


def solve_within_limits(
    matrix: np.ndarray, right: np.ndarray, first: int, low: np.ndarray, high: np.ndarray
) -> np.ndarray:
    """Solve matrix @ step = right (K,) where the unknowns from `first` on must lie in [low, high].

    An unknown that leaves its range is held at the limit and the others are solved for again: clipping alone would
    leave the pose where it only makes sense together with a drawer that is pushed through the back of its cabinet.
    """
    step = np.zeros(len(right))
    free = np.ones(len(right), dtype=bool)
    while True:
        fixed = ~free
        reduced = right[free] - matrix[np.ix_(free, fixed)] @ step[fixed]
        step[free] = np.linalg.solve(matrix[np.ix_(free, free)], reduced)
        limited = np.clip(step[first:], low, high)
        beyond = np.flatnonzero(free[first:] & (np.abs(limited - step[first:]) > 1e-12))
        if len(beyond) == 0:
            return step
        step[first + beyond] = limited[beyond]
        free[first + beyond] = False


def _state(
    surface: ModelSurface,
    placement: Placement,
    state: tuple[float, np.ndarray, np.ndarray, dict[str, float]],
    points: np.ndarray,
    normals: np.ndarray,
) -> Placement:
    scale, rotation, translation, joints = state
    shape = placement.shape if joints == placement.shape.joints else shape_at(surface, placement.shape, joints)
    moved = replace(placement, shape=shape, scale=scale, rotation=rotation, translation=translation)
    return replace(moved, alignment_error=alignment_error(surface, moved, points, normals))


def search_joints(surface: ModelSurface, placement: Placement, points: np.ndarray, normals: np.ndarray) -> Placement:
    """Return the placement with every joint at the best of a grid of values, one joint after the other.

    The 1-D search on the alignment error over the vertices (N, 3) finds the valley that `refine` then descends. A
    joint that the vertices do not tell stays in its state.
    """
    joints = dict(placement.shape.joints)
    local, facing = to_model(placement, points), normals @ placement.rotation

    def error(name: str, value: float) -> float:
        return float(np.sqrt(np.mean(surface.closest(local, {**joints, name: value}, facing).distance ** 2)))

    for joint in surface.model.joints:
        before = error(joint.name, joints.get(joint.name, 0.0))
        errors = {float(v): error(joint.name, float(v)) for v in np.linspace(joint.lower, joint.upper, GRID)}
        value = min(errors, key=lambda v: (errors[v], v))
        if errors[value] < (1.0 - LEAST_GAIN) * before:
            joints[joint.name] = value
    return _state(
        surface, placement, (placement.scale, placement.rotation, placement.translation, joints), points, normals
    )


def joint_values_to_try(shape: Shape) -> list[dict[str, float]]:
    """Return joint configurations for matching: all combinations of a few values, or one joint at a time.

    The library stores the ends and the middle of each range; the box of a door at 60 degrees is unlike both.
    """
    joints = shape.model.joints
    values = {joint.name: np.linspace(joint.lower, joint.upper, STATES_PER_JOINT).tolist() for joint in joints}
    closed = {joint.name: 0.0 for joint in joints}
    if len(joints) <= MOST_COMBINED:
        return [dict(zip(values, combination, strict=True)) for combination in product(*values.values())]
    return [closed, *({**closed, name: value} for name in values for value in values[name] if value != 0.0)]


def plane_owners(surface: ModelSurface, shape: Shape) -> list[str | None]:
    """Return for each plane of a shape the moving part that it lies on, or None for the body."""
    part_from_model = {part: inverse(t) for part, t in part_transforms(surface.model, shape.joints).items()}
    body, moving = surface.model.parts[0], {joint.part for joint in surface.model.joints}
    owners: list[str | None] = []
    for plane in shape.surfaces:
        probe, normal = np.array([plane.center, *plane.corners]), np.asarray(plane.normal)
        distance = {
            part: surface.part_distance(apply(t, probe), t[:3, :3] @ normal, part)
            for part, t in part_from_model.items()
        }
        nearest = min(surface.model.parts, key=lambda part: (round(distance[part], 4), part != body))
        owners.append(nearest if nearest in moving and distance[nearest] < SAME_PART else None)
    return owners


def shape_at(
    surface: ModelSurface, shape: Shape, joints: dict[str, float], owners: list[str | None] | None = None
) -> Shape:
    """Return the shape with other joint values: its planes move with the parts that they lie on (`plane_owners`)."""
    owners = plane_owners(surface, shape) if owners is None else owners
    old, new = part_transforms(surface.model, shape.joints), part_transforms(surface.model, joints)
    planes = []
    for plane, owner in zip(shape.surfaces, owners, strict=True):
        if owner is None:
            planes.append(plane)
            continue
        motion = new[owner] @ inverse(old[owner])
        normal = motion[:3, :3] @ np.asarray(plane.normal)
        center = apply(motion, np.asarray(plane.center))
        corners = apply(motion, np.asarray(plane.corners).reshape(-1, 3))
        moved = {
            "normal": as_vector(normal),
            "offset": -float(normal @ center),
            "center": as_vector(center),
            "corners": tuple(as_vector(corner) for corner in corners),
        }
        planes.append(plane.model_copy(update=moved))
    hull = surface.hull_points(joints)
    low, high = hull.min(axis=0), hull.max(axis=0)
    center = (low + high) / 2
    surfaces = tuple(planes)
    return Shape(
        model=shape.model,
        joints=dict(joints),
        center=center,
        size=high - low,
        planes=relative_planes(surfaces, center, np.array([p.horizontal for p in surfaces], dtype=bool)),
        surfaces=surfaces,
    )


def shapes_of_model(surface: ModelSurface, closed: Shape) -> list[Shape]:
    """Return the shapes of an articulated model that matching tries; the closed one comes first."""
    if not closed.model.joints:
        return [closed]
    owners = plane_owners(surface, closed)
    return [shape_at(surface, closed, joints, owners) for joints in joint_values_to_try(closed)]


def fitted(
    surface: ModelSurface, placement: Placement, points: np.ndarray, normals: np.ndarray, *, free_height: bool
) -> Placement:
    """Return the placement refined on the object's vertices (N, 3): pose, then joints, then both.

    The search works on a sample of the vertices, and its alignment error is that to surface that faces their way.
    """
    step = max(1, len(points) // SAMPLE)
    some, facing = points[::step], normals[::step]
    best = refine(surface, placement, some, facing, free_height=free_height, move_joints=False)
    if surface.model.joints:
        searched = search_joints(surface, best, some, facing)
        moved = refine(surface, searched, some, facing, free_height=free_height)
        if moved.alignment_error < (1.0 - LEAST_GAIN) * best.alignment_error:
            best = moved
        best = with_quiet_joints_closed(surface, best, some, facing, free_height=free_height)
    return best


def with_quiet_joints_closed(
    surface: ModelSurface, placement: Placement, points: np.ndarray, normals: np.ndarray, *, free_height: bool
) -> Placement:
    """Return the placement with those joints closed (0) whose closing costs next to nothing of the alignment error,
    once the pose has been refined again: what was not seen is taken to be closed, and noise opens every drawer by a
    centimetre."""
    current = placement
    for joint in surface.model.joints:
        joints = dict(current.shape.joints)
        if joints.get(joint.name, 0.0) == 0.0:
            continue
        gain = AJAR_GAIN if joints[joint.name] < AJAR[joint.type] else LEAST_GAIN
        joints[joint.name] = float(np.clip(0.0, joint.lower, joint.upper))
        state = (current.scale, current.rotation, current.translation, joints)
        closed = _state(surface, current, state, points, normals)
        if closed.alignment_error > (1.0 + gain) * current.alignment_error:
            closed = refine(surface, closed, points, normals, free_height=free_height, move_joints=False)
        if closed.alignment_error <= (1.0 + gain) * current.alignment_error:
            current = closed
    return current
