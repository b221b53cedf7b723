"""The kinematic tree as a plan believes it to be at one moment."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class TreeState:
    """Names are those of the plan."""

    parents: dict[str, str]
    """Movable body -> what carries it."""
    poses: dict[str, np.ndarray]
    """Movable body -> world_from_body (4, 4)."""
    joints: dict[str, float]
    held: str | None = None
