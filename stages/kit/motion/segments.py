"""Motions as data: pieces of path of the whole body, with what the fingers do at their ends."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np


@dataclass(frozen=True)
class Segment:
    """A piece of motion: a path, then an event of the gripper."""

    path: np.ndarray
    """(N, 3 + J): base x, y [m], yaw [rad] and arm (J,) [rad]; straight between rows."""
    opening: float
    """Distance of the fingers during the path [m]."""
    pace: float = 1.0
    """Share of the full speed."""
    event: Literal["", "grasp", "release"] = ""
    item: str | None = None
    """What is grasped or released."""
    firm: bool = False
    """Whether a grasp takes all the force that the fingers have."""
    label: str = ""
    """Name of the key frame to be taken at the end; "" takes none."""


@dataclass(frozen=True)
class Manipulation:
    """What the robot does from one place of its base: segments that start and end with the arm folded."""

    base: np.ndarray
    """(3,)"""
    segments: tuple[Segment, ...]
    joint_values: dict[str, float] = field(default_factory=dict)
    """Values of scene joints after it."""
    item_pose: np.ndarray | None = None
    """world_from_item after a place."""
    tool_from_item: np.ndarray | None = None
    body_from_tool: np.ndarray | None = None
    """The grasp, after a pick."""


def whole_body(base: np.ndarray, arms: np.ndarray) -> np.ndarray:
    """Return (N, 3 + J) rows of one base pose (3,) with arm values (N, J)."""
    return np.concatenate([np.tile(base, (len(arms), 1)), arms], axis=1)
