"""A collision query as a value: what the hand carries, and what may be touched, when a configuration is checked."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True, eq=False)
class CollisionQuery:
    """What a configuration is checked under. Nothing is carried, and nothing may be touched, unless it is said."""

    may_touch: frozenset[str] = frozenset()
    """Links of scene bodies that hand and fingers may touch."""
    rests_on: Mapping[str, float] = field(default_factory=dict)
    """How deep [m] what is carried may be in links of scene bodies."""
    carried: str | None = None
    """The body that moves with the tool."""
    tool_from_carried: np.ndarray = field(default_factory=lambda: np.eye(4))
    """(4, 4): world_from_carried = world_from_tool @ tool_from_carried."""


NOTHING = CollisionQuery()
"""An empty hand that touches nothing."""


def touching(links: Iterable[str]) -> CollisionQuery:
    """Return the query of an empty hand that may touch links."""
    return CollisionQuery(frozenset(links))


def carrying(
    name: str, tool_from_carried: np.ndarray, links: Iterable[str] = (), rests_on: Mapping[str, float] | None = None
) -> CollisionQuery:
    """Return the query of a hand that carries a body (pose (4, 4) in the tool) and may touch links."""
    return CollisionQuery(frozenset(links), dict(rests_on or {}), name, tool_from_carried)
