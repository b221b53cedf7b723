"""Jaws that close: what they catch, how the needle turns as they do, how well it is held."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scenewright.stages.kit.geometry.transforms import inverse, transform_from
from scenewright.stages.suture.motion.needle import ARC_POINTS, ARC_TANGENTS, about
from scenewright.stages.suture.rig import NEEDLE_RADIUS
from scenewright.stages.suture.trials.settings import World


@dataclass(frozen=True)
class Closing:
    """`caught`: the needle's new pose (4, 4), None when it was missed; `quality` 0 to 1 of the full holding force;
    `shift` [m] is how far the held point was moved; `touched` whether the jaws met the needle at all."""

    caught: np.ndarray | None
    quality: float
    shift: float
    touched: bool


def close(tool: np.ndarray, needle: np.ndarray, world: World, random: np.random.Generator) -> Closing:
    """Close open jaws at `tool` (4, 4) on a needle at `needle` (4, 4), both in the world frame.

    The wire is caught where it passes between the jaws: within their opening (y), width (x) and depth (z) of the
    control point. Closing brings it to the middle and turns it until it lies flat between their faces, and, by
    slip, a little more.
    """
    tool_from_needle = inverse(tool) @ needle
    points = ARC_POINTS @ tool_from_needle[:3, :3].T + tool_from_needle[:3, 3]
    opening = world.jaw_half_opening * np.clip(1.0 - 0.4 * points[:, 2] / world.jaw_half_depth, 0.6, 1.4)
    level = np.abs(points[:, 0]) <= world.jaw_half_width
    deep = np.abs(points[:, 2]) <= world.jaw_half_depth
    between = np.abs(points[:, 1]) <= opening
    if not (level & deep & between).any():
        within_jaws = np.abs(points[:, 1]) <= opening + 0.002
        return Closing(None, 0.0, 0.0, bool((level & deep & within_jaws).any()))
    rows = np.flatnonzero(level & deep & between)
    row = int(rows[np.argmin(np.abs(points[rows, 2]) + np.abs(points[rows, 0]))])
    point, tangent = points[row], tool_from_needle[:3, :3] @ ARC_TANGENTS[row]
    flat = np.array([tangent[0], 0.0, tangent[2]])
    flat = flat / max(float(np.linalg.norm(flat)), 1e-9)
    axis = np.cross(tangent, flat)
    sine = float(np.linalg.norm(axis))
    rotation = about(axis / sine, float(np.arcsin(min(sine, 1.0)))) if sine > 1e-9 else np.eye(3)
    normal = rotation @ tool_from_needle[:3, 2]
    slip = np.radians(world.closing_normal) * random.standard_normal(2)
    along = rotation @ tangent
    rotation = about(normal, np.radians(world.closing_in_plane) * random.standard_normal()) @ rotation
    rotation = about(along, float(slip[0])) @ rotation
    middle = np.array([point[0], 0.0, point[2]])
    tool_from_held = transform_from(
        rotation @ tool_from_needle[:3, :3], rotation @ (tool_from_needle[:3, 3] - point) + middle
    )
    flatness = abs(float(flat[0]))
    quality = (1.0 - 0.5 * abs(point[0]) / world.jaw_half_width) * (1.0 - 0.4 * abs(point[2]) / world.jaw_half_depth)
    shift = abs(float(point[1])) + NEEDLE_RADIUS * sine
    return Closing(tool @ tool_from_held, quality * (0.6 + 0.4 * flatness), shift, True)


def thread_between(tool: np.ndarray, rope: np.ndarray, world: World) -> bool:
    """Whether thread (N, 3) passes between open jaws at `tool` (4, 4) when they close."""
    inside = inverse(tool)
    middle = (rope[1:] + rope[:-1]) / 2.0
    points = np.concatenate([rope, middle]) @ inside[:3, :3].T + inside[:3, 3]
    return bool(
        (
            (np.abs(points[:, 0]) <= world.jaw_half_width)
            & (np.abs(points[:, 1]) <= world.jaw_half_opening)
            & (np.abs(points[:, 2]) <= world.jaw_half_depth)
        ).any()
    )
