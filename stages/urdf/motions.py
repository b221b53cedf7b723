"""What became of bodies that were let go, in any engine: looked at as time goes, told by where they end."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation

MOVED_LIMIT = 0.01
"""A movable body that moves further has not stayed [m]."""
TURNED_LIMIT = math.radians(2.0)
"""A movable body that turns further has not stayed [rad]."""
WATCHED = 0.05
"""How often is looked at what was let go [s]."""


@dataclass(frozen=True)
class BodyMotion:
    """What became of one movable body."""

    name: str
    moved: float
    """Distance between where its centre of mass was and where it is [m]."""
    turned: float
    """Angle between how it stood and how it stands [rad]."""
    fell_through: bool
    """Whether all of it ended below the top of the floor (without a floor: below everything that is fixed)."""
    moved_limit: float = MOVED_LIMIT
    turned_limit: float = TURNED_LIMIT
    leaves: float | None = None
    """When it first was beyond a limit, as far as it was looked at [s]."""
    margin: float | None = None
    """How far it is from what decides whether it stays (`settle_margins`); None: far."""
    poses: tuple[np.ndarray, ...] = field(default=(), compare=False, repr=False)
    """(4, 4) of its frame in the world, every WATCHED seconds from the start on."""
    times: tuple[float, ...] = field(default=(), compare=False, repr=False)
    """When it was looked at [s], beginning with 0."""
    centers: tuple[np.ndarray, ...] = field(default=(), compare=False, repr=False)
    """(4, 4) of its centre of mass and principal axes in the world at these times."""

    @property
    def stays(self) -> bool:
        """Whether it stayed where it was, within the limits."""
        return self.moved <= self.moved_limit and self.turned <= self.turned_limit and not self.fell_through

    def by(self, seconds: float) -> tuple[float, float]:
        """Return how far [m] and by how much [rad] it had gone when it was last looked at until then [s]."""
        seen = [center for time, center in zip(self.times, self.centers, strict=True) if time <= seconds + 1e-9]
        return gone(self.centers[0], seen[-1])


def watched(
    step: Callable[[int], None], look: Callable[[], dict[str, np.ndarray]], seconds: float, time_step: float
) -> tuple[list[float], list[dict[str, np.ndarray]]]:
    """Let a world run for `seconds` [s] in steps of `time_step` [s]; return when it was looked at, and what was seen:
    body -> (4, 4) of its centre of mass. The first look is before the first step."""
    steps, every = round(seconds / time_step), max(1, round(WATCHED / time_step))
    times, looks = [0.0], [look()]
    for done in range(0, steps, every):
        count = min(every, steps - done)
        step(count)
        times.append((done + count) * time_step)
        looks.append(look())
    return times, looks


def motion_of(
    name: str,
    times: Sequence[float],
    centers: Sequence[np.ndarray],
    *,
    fell_through: bool,
    moved_limit: float,
    turned_limit: float,
    poses: tuple[np.ndarray, ...] = (),
) -> BodyMotion:
    """Return what became of a body whose centre of mass was at `centers` (4, 4) at `times` [s]."""
    went = [gone(centers[0], center) for center in centers]
    beyond = (
        time
        for time, (moved, turned) in zip(times, went, strict=True)
        if not (moved <= moved_limit and turned <= turned_limit)
    )
    return BodyMotion(
        name,
        *went[-1],
        fell_through=fell_through,
        moved_limit=moved_limit,
        turned_limit=turned_limit,
        leaves=next(beyond, None),
        poses=poses,
        times=tuple(times),
        centers=tuple(centers),
    )


def gone(before: np.ndarray, after: np.ndarray) -> tuple[float, float]:
    """Return how far [m] and by how much [rad] a pose (4, 4) is another one; infinite where an engine lost it."""
    if not np.isfinite(after).all():
        return np.inf, np.inf
    turned = Rotation.from_matrix(before[:3, :3].T @ after[:3, :3]).magnitude()
    return float(np.linalg.norm(after[:3, 3] - before[:3, 3])), float(turned)
