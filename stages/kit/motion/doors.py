"""Doors and drawers: how a point on the moving part goes with the joint, and tool poses that push or pull it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import trimesh
from scenewright.schemas.scene_parts import Joint


@dataclass(frozen=True)
class ContactPoint:
    """Where the fingers meet the moving part. Body frame, joint at 0."""

    point: np.ndarray
    inward: np.ndarray
    """Unit direction in which the part is pushed at this point: shut, or from inside further open."""


def body_from_moved(joint: Joint, value: float) -> np.ndarray:
    """Return the (4, 4) displacement, body frame, of the moving part when the joint goes from 0 to `value`."""
    pose = np.eye(4)
    axis = np.array(joint.axis) / np.linalg.norm(joint.axis)
    if joint.type == "prismatic":
        pose[:3, 3] = axis * value
        return pose
    turn = _turn(axis, value)
    origin = np.array(joint.origin)
    pose[:3, :3] = turn
    pose[:3, 3] = origin - turn @ origin
    return pose


def _turn(axis: np.ndarray, angle: float) -> np.ndarray:
    """Return the rotation (3, 3) by an angle about a unit axis (Rodrigues' formula)."""
    x, y, z = axis.tolist()
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + math.sin(angle) * cross + (1.0 - math.cos(angle)) * (cross @ cross)


def closing_direction(joint: Joint, point: np.ndarray) -> np.ndarray:
    """Return the unit direction (3,), body frame at value 0, in which a point moves while the joint closes."""
    axis = np.array(joint.axis) / np.linalg.norm(joint.axis)
    direction = -axis if joint.type == "prismatic" else -np.cross(axis, point - np.array(joint.origin))
    return direction / np.linalg.norm(direction)


def push_points(
    joint: Joint,
    part: trimesh.Trimesh,
    random: np.random.Generator,
    count: int,
    height: tuple[float, float],
    *,
    opening: bool = False,
) -> list[ContactPoint]:
    """Return points on the outside of a moving part where it can be pushed shut, or on its inside where it can be
    pushed further open, far from the hinge first.

    `part` is the part's mesh in the body frame at value 0, `height` the range of z [m] in the body frame that the arm
    reaches. A ray along the push finds the surface; hits whose normal is slanted are left out.
    """
    sense = -1.0 if opening else 1.0
    vertices = np.asarray(part.vertices)
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    axis = np.array(joint.axis) / np.linalg.norm(joint.axis)
    middle = (low + high) / 2
    farthest = middle if joint.type == "prismatic" else _widest(joint, vertices, axis)
    direction = sense * closing_direction(joint, farthest)
    starts, sides = [], []
    for _ in range(count * 4):
        start = random.uniform(low, high)
        start[2] = random.uniform(max(low[2] + 0.02, height[0]), max(min(high[2] - 0.02, height[1]), low[2] + 0.03))
        start -= direction * (direction @ (start - middle) + 2.0)
        starts.append(start)
        sides.append(direction)
    hits, rays, triangles = part.ray.intersects_location(np.array(starts), np.array(sides), multiple_hits=False)
    points = []
    for hit, triangle in zip(hits, triangles, strict=True):
        if float(part.face_normals[triangle] @ direction) < -0.9:
            points.append(ContactPoint(hit, sense * closing_direction(joint, hit)))
    del rays
    if joint.type == "revolute":
        reach = max((_radius(joint, entry.point, axis) for entry in points), default=0.0)
        points = [entry for entry in points if _radius(joint, entry.point, axis) > 0.55 * reach]
        points.sort(key=lambda entry: -round(_radius(joint, entry.point, axis) / 0.08))
    return points[:count]


def _radius(joint: Joint, point: np.ndarray, axis: np.ndarray) -> float:
    relative = point - np.array(joint.origin)
    return float(np.linalg.norm(relative - axis * (axis @ relative)))


def _widest(joint: Joint, vertices: np.ndarray, axis: np.ndarray) -> np.ndarray:
    relative = vertices - np.array(joint.origin)
    radii = np.linalg.norm(relative - np.outer(relative @ axis, axis), axis=1)
    return vertices[int(radii.argmax())]


def tool_poses(
    joint: Joint,
    contact: ContactPoint,
    world_from_body: np.ndarray,
    values: np.ndarray,
    *,
    tilt: np.ndarray,
    roll: float,
    gap: float,
) -> list[np.ndarray]:
    """Return world_from_tool (4, 4) for each joint value (K,): the tool point `gap` [m] outside the contact point.

    The approach is the closing direction turned by `tilt` (K,) [rad] about the vertical; `roll` [rad] turns the
    closing axis of the fingers about the approach, 0 keeps it horizontal.
    """
    poses = []
    for value, turn in zip(values.tolist(), tilt.tolist(), strict=True):
        moved = world_from_body @ body_from_moved(joint, value)
        point = moved[:3, :3] @ contact.point + moved[:3, 3]
        inward = moved[:3, :3] @ contact.inward
        sine, cosine = math.sin(turn), math.cos(turn)
        x, y, z = cosine * inward[0] - sine * inward[1], sine * inward[0] + cosine * inward[1], inward[2]
        # The closing axis is horizontal, the third one perpendicular to both; then the hand rolls about its approach.
        flat = math.hypot(x, y)
        side = np.array([-y / flat, x / flat, 0.0]) if flat > 1e-6 else np.array([1.0, 0.0, 0.0])
        third = np.array([side[1] * z, -side[0] * z, side[0] * y - side[1] * x])
        pose = np.eye(4)
        pose[:3, 0] = math.cos(roll) * third + math.sin(roll) * side
        pose[:3, 1] = math.cos(roll) * side - math.sin(roll) * third
        pose[:3, 2] = (x, y, z)
        pose[:3, 3] = point - gap * inward
        poses.append(pose)
    return poses


def is_closed(joint: Joint, value: float) -> bool:
    """Whether a joint value counts as shut: below 0.08 rad or 2 cm, whatever the joint's range."""
    return value < (0.08 if joint.type == "revolute" else 0.02)


def open_value(joint: Joint) -> float:
    """Return the value to which a joint is opened: 1.4 rad, or 85 % of a drawer's (or smaller door's) range."""
    return min(1.4, 0.85 * joint.upper) if joint.type == "revolute" else 0.85 * joint.upper


def is_open(joint: Joint, value: float) -> bool:
    """Whether a joint is open enough to reach through: at least 0.9 rad or 60 % of its range."""
    return value >= min(0.9 if joint.type == "revolute" else np.inf, 0.6 * joint.upper)
