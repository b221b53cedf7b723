"""Errors of the joints of an articulated replacement, whose model may be another than the true one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from scenewright.stages.evaluate.model_shapes import PlacedShape
from scenewright.stages.kit.geometry.transforms import apply
from scenewright.stages.kit.measurement.shape_symmetry import angle_between
from scipy.optimize import linear_sum_assignment

ANGLE_WEIGHT = 0.5
"""Metres that a radian between axes counts for when joints are paired."""
NEVER = 1e6
"""Cost of a pair that may not be matched."""


@dataclass(frozen=True)
class PlacedJoint:
    """A joint in the world."""

    name: str
    type: Literal["revolute", "prismatic"]
    origin: np.ndarray
    """(3,) a point of the axis [m]."""
    axis: np.ndarray
    """(3,) unit."""
    lower: float
    upper: float
    """Limits [rad or m], scaled."""
    value: float
    center: np.ndarray
    """(3,) middle of the closed moving part's box [m]: tells one drawer from the next."""


@dataclass(frozen=True)
class JointError:
    """A true joint and the joint that stands for it; errors are None where none does."""

    joint: str
    type: Literal["revolute", "prismatic"]
    partner: str | None = None
    angle: float | None = None
    """Between the two axes as lines, [0, pi/2] [rad]."""
    offset: float | None = None
    """Revolute: distance of the true joint's origin from the other axis [m]. None for prismatic joints, whose axis
    may lie anywhere."""
    limits: float | None = None
    """Larger of the errors of the two limits [rad or m], in the true joint's direction."""
    value: float | None = None
    """|value - true value| [rad or m]."""


def placed_joints(placed: PlacedShape) -> list[PlacedJoint]:
    """Return the joints of a model as it stands, limits and values of sliding ones scaled with it."""
    poses = placed.shape.part_poses({})
    joints = []
    for joint in placed.joints:
        factor = placed.scale if joint.type == "prismatic" else 1.0
        part = placed.shape.parts.get(joint.part)
        middle = np.array(joint.origin, dtype=float)
        if part is not None:
            corners = apply(poses[joint.part], part.triangles.reshape(-1, 3))
            middle = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
        joints.append(
            PlacedJoint(
                name=joint.name,
                type=joint.type,
                origin=apply(placed.world_from_model, placed.scale * np.array(joint.origin, dtype=float)),
                axis=placed.rotation @ np.array(joint.axis, dtype=float),
                lower=factor * joint.lower,
                upper=factor * joint.upper,
                value=factor * placed.values.get(joint.name, 0.0),
                center=apply(placed.world_from_model, placed.scale * middle),
            )
        )
    return joints


def line_distance(point: np.ndarray, origin: np.ndarray, axis: np.ndarray) -> float:
    """Return the distance [m] of a point (3,) from the line through `origin` along the unit `axis`."""
    away = point - origin
    return float(np.linalg.norm(away - (away @ axis) * axis))


def joint_errors(true: list[PlacedJoint], estimated: list[PlacedJoint]) -> list[JointError]:
    """Pair joints of the same type one to one by least summed distance, and compare them; one entry a true joint.

    The distance is that of the axes (revolute) or of the middles of the moving parts (both), plus their angle.
    """
    cost = np.array([[_distance(a, b) for b in estimated] for a in true]).reshape(len(true), len(estimated))
    partners: dict[int, int] = {}
    if cost.size:
        rows, columns = linear_sum_assignment(cost)
        partners = {int(i): int(j) for i, j in zip(rows, columns, strict=True) if cost[i, j] < NEVER}
    return [
        _compare(joint, estimated[partners[i]]) if i in partners else JointError(joint.name, joint.type)
        for i, joint in enumerate(true)
    ]


def _distance(true: PlacedJoint, estimated: PlacedJoint) -> float:
    if true.type != estimated.type:
        return NEVER
    apart = float(np.linalg.norm(true.center - estimated.center)) + ANGLE_WEIGHT * _line_angle(
        true.axis, estimated.axis
    )
    if true.type == "revolute":
        apart += line_distance(true.origin, estimated.origin, estimated.axis)
    return apart


def _line_angle(a: np.ndarray, b: np.ndarray) -> float:
    angle = angle_between(a, b)
    return min(angle, np.pi - angle)


def _compare(true: PlacedJoint, estimated: PlacedJoint) -> JointError:
    lower, upper, value = estimated.lower, estimated.upper, estimated.value
    if true.axis @ estimated.axis < 0:  # the same motion, counted the other way round
        lower, upper, value = -upper, -lower, -value
    return JointError(
        joint=true.name,
        type=true.type,
        partner=estimated.name,
        angle=_line_angle(true.axis, estimated.axis),
        offset=line_distance(true.origin, estimated.origin, estimated.axis) if true.type == "revolute" else None,
        limits=max(abs(lower - true.lower), abs(upper - true.upper)),
        value=abs(value - true.value),
    )
