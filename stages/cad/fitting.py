"""Ours: refine pose and joint values on the object's vertices, after the plane-based alignment."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from schemas.base import as_vector
from stages.cad.model_surfaces import ModelSurface, alignment_error, to_model, to_world
from stages.cad.shapes import Placement, Shape, relative_planes
from stages.kit.formats.cad_models import part_transforms
from stages.kit.geometry.transforms import apply, inverse, transform_from_yaw

ITERATIONS = 15
ROBUST_DISTANCE = 0.03
"""Vertices farther from the model than this pull with constant force (Huber) [m]."""
SCALE_PRIOR = 0.05
"""Weight of (ln alpha / alpha_0)^2 against the mean squared distance [m^2]: vertices that say nothing of the scale
leave it where the planes put it."""
GRID = 9
GOLDEN_STEPS = 8
LEAST_GAIN = 0.02
"""A joint value other than the stored state's must lower the alignment error by this share."""
SAME_PART = 0.003
"""A plane belongs to the part that its corners are this close to [m]."""


def refine_pose(surface: ModelSurface, placement: Placement, points: np.ndarray, *, free_height: bool) -> Placement:
    """Return the placement after iterative closest points in (scale, yaw, shift), if that lowers the alignment error.

    Point-to-plane distances from vertices (N, 3) with Huber weights; the foot of the model stays on its supporting
    plane (p_z constraint of 2.11) unless `free_height` (things on walls stand on nothing). The thesis stops at the
    planes, whose offsets are biased where only edges or noise were seen.
    """
    best = replace(placement, alignment_error=alignment_error(surface, placement, points))
    current, first_scale = best, placement.scale
    foot = float(to_world(placement, surface.hull_points(placement.shape.joints))[:, 2].min())
    for _ in range(ITERATIONS):
        distance, nearest, normals = surface.closest(to_model(current, points), current.shape.joints)
        target = to_world(current, nearest)
        normal = normals @ current.rotation.T
        gap = np.einsum("ij,ij->i", normal, points - target)
        weight = np.minimum(1.0, ROBUST_DISTANCE / np.maximum(current.scale * distance, 1e-9)) / len(points)
        anchor = np.array([*current.translation[:2], foot])
        arm = target - anchor
        turn = np.column_stack([-arm[:, 1], arm[:, 0], np.zeros(len(arm))])
        columns = [
            np.einsum("ij,ij->i", normal, arm),
            np.einsum("ij,ij->i", normal, turn),
            normal[:, 0],
            normal[:, 1],
        ]
        if free_height:
            columns.append(normal[:, 2])
        jacobian = np.stack(columns, axis=1)
        matrix = jacobian.T @ (weight[:, None] * jacobian) + 1e-9 * np.eye(jacobian.shape[1])
        right = jacobian.T @ (weight * gap)
        matrix[0, 0] += SCALE_PRIOR**2
        right[0] -= SCALE_PRIOR**2 * math.log(current.scale / first_scale)
        step = np.linalg.solve(matrix, right)
        growth, angle = math.exp(float(np.clip(step[0], -0.1, 0.1))), float(np.clip(step[1], -0.3, 0.3))
        shift = np.clip(np.array([step[2], step[3], step[4] if free_height else 0.0]), -0.2, 0.2)
        spin = transform_from_yaw(angle, np.zeros(3))[:3, :3]
        # The model grows and turns about its foot below the model origin.
        translation = anchor + growth * spin @ (current.translation - anchor) + shift
        current = replace(
            current, scale=current.scale * growth, rotation=spin @ current.rotation, translation=translation
        )
        foot += float(shift[2])
        error = alignment_error(surface, current, points)
        current = replace(current, alignment_error=error)
        if error < best.alignment_error:
            best = current
        if abs(growth - 1) < 1e-5 and abs(angle) < 1e-5 and np.abs(shift).max() < 1e-5:
            break
    return best


def refine_joints(surface: ModelSurface, placement: Placement, points: np.ndarray) -> Placement:
    """Return the placement with every joint at the value that fits the vertices (N, 3) best.

    Each joint by itself: a grid over its range, then golden section around the best. The stored states are a few
    degrees or centimetres apart from what was seen. A joint that the vertices do not tell stays in its state.
    """
    joints = dict(placement.shape.joints)
    local = to_model(placement, points)

    def error(name: str, value: float) -> float:
        distance = surface.closest(local, {**joints, name: value})[0]
        return placement.scale * float(np.sqrt(np.mean(distance**2)))

    for joint in surface.model.joints:
        before_value = joints.get(joint.name, 0.0)
        before = error(joint.name, before_value)
        values = np.linspace(joint.lower, joint.upper, GRID)
        errors = [error(joint.name, float(value)) for value in values]
        k = int(np.argmin(errors))
        low, high = float(values[max(k - 1, 0)]), float(values[min(k + 1, GRID - 1)])
        value, found = golden_section(partial(error, joint.name), low, high, GOLDEN_STEPS)
        if errors[k] < found:
            value, found = float(values[k]), errors[k]
        if found < (1.0 - LEAST_GAIN) * before:
            joints[joint.name] = value
    if joints == placement.shape.joints:
        return placement
    shape = shape_at(surface, placement.shape, joints)
    moved = replace(placement, shape=shape)
    return replace(moved, alignment_error=alignment_error(surface, moved, points))


def golden_section(function: Callable[[float], float], low: float, high: float, steps: int) -> tuple[float, float]:
    """Return (argument, value) near a minimum of a scalar function within [low, high]."""
    ratio = (math.sqrt(5.0) - 1.0) / 2.0
    a, b = high - ratio * (high - low), low + ratio * (high - low)
    value_a, value_b = function(a), function(b)
    for _ in range(steps):
        if value_a <= value_b:
            high, b, value_b = b, a, value_a
            a = high - ratio * (high - low)
            value_a = function(a)
        else:
            low, a, value_a = a, b, value_b
            b = low + ratio * (high - low)
            value_b = function(b)
    return (a, value_a) if value_a <= value_b else (b, value_b)


def shape_at(surface: ModelSurface, shape: Shape, joints: dict[str, float]) -> Shape:
    """Return the shape with other joint values: its planes move with the parts that they lie on."""
    old, new = part_transforms(surface.model, shape.joints), part_transforms(surface.model, joints)
    moving = [joint.part for joint in surface.model.joints]
    planes = []
    for plane in shape.surfaces:
        probe = np.array([plane.center, *plane.corners])
        owner = next(
            (p for p in moving if surface.part_distances(apply(inverse(old[p]), probe), p).max() < SAME_PART), None
        )
        if owner is None:
            planes.append(plane)
            continue
        motion = new[owner] @ inverse(old[owner])
        normal = motion[:3, :3] @ np.asarray(plane.normal)
        center = apply(motion, np.asarray(plane.center))
        corners = apply(motion, np.asarray(plane.corners).reshape(-1, 3))
        planes.append(
            plane.model_copy(
                update={
                    "normal": as_vector(normal),
                    "offset": -float(normal @ center),
                    "center": as_vector(center),
                    "corners": tuple(as_vector(corner) for corner in corners),
                }
            )
        )
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
