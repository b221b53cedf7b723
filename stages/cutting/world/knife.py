"""What a knife can do to one fragment, and why not. The fragment is first taken to free space and turned as needed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scenewright.schemas.plan import Failure
from scenewright.stages.cutting.world.body import Body, Plane


@dataclass(frozen=True)
class Knife:
    """A straight blade that comes down on a board. Lengths in metres."""

    length: float = 0.25
    """Of the edge: the longest line of a cut face."""
    height: float = 0.12
    """Of the blade over its edge: the least height to which a cut face can be laid."""
    thinnest: float = 0.001
    """What a cut leaves is at least so thick across the plane."""
    smallest: float = 0.004
    """A fragment whose longest edge is shorter cannot be held."""


class Refused(Exception):
    """A plane that the knife does not cut; `failure` says why, with numbers [m]."""

    def __init__(self, failure: Failure) -> None:
        super().__init__(failure.message)
        self.failure = failure


def _refusal(kind: str, message: str, **numbers: float) -> Refused:
    return Refused(Failure(kind=kind, message=message, numbers=numbers))


def cut(body: Body, plane: Plane, knife: Knife) -> list[Body]:
    """Return the fragments of a body cut by a plane, those on the side of its normal first.

    Raises Refused: `held_too_small`, `plane_misses`, `sliver`, `blade_too_short`, `blade_too_low`.
    """
    height = plane.height(body.vertices)
    above, below = float(height.max()), float(-height.min())
    low, high = body.vertices.min(axis=0), body.vertices.max(axis=0)
    longest = float((high - low).max())
    if longest < knife.smallest:
        raise _refusal(
            "held_too_small",
            f"the fragment is {1e3 * longest:.1f} mm long, what is shorter than {1e3 * knife.smallest:.1f} mm "
            "cannot be held",
            longest=longest,
            smallest=knife.smallest,
        )
    if above <= 0.0 or below <= 0.0:
        by = -min(above, below)
        raise _refusal("plane_misses", f"the plane misses the fragment by {1e3 * by:.1f} mm", by=by)
    thinner = min(above, below)
    if thinner < knife.thinnest:
        raise _refusal(
            "sliver",
            f"the plane leaves a sliver of {1e3 * thinner:.2f} mm, the thinnest is {1e3 * knife.thinnest:.1f} mm",
            thickness=thinner,
            thinnest=knife.thinnest,
        )
    long, wide = face_edges(body.section(plane))
    if long > knife.length:
        raise _refusal(
            "blade_too_short",
            f"the cut face is {1e3 * long:.0f} mm long, the blade {1e3 * knife.length:.0f} mm",
            face=long,
            blade=knife.length,
        )
    if wide > knife.height:
        raise _refusal(
            "blade_too_low",
            f"the cut face is at least {1e3 * wide:.0f} mm high, the blade {1e3 * knife.height:.0f} mm",
            face=wide,
            blade=knife.height,
        )
    first, second = body.halves(plane)
    return [*first, *second]


def face_edges(points: np.ndarray) -> tuple[float, float]:
    """Return the longer and the shorter edge [m] of the box around a cut face's points (N, 3), along principal axes."""
    if len(points) < 2:
        return 0.0, 0.0
    centred = points - points.mean(axis=0)
    _, _, axes = np.linalg.svd(centred, full_matrices=False)
    flat = centred @ axes.T
    edges = sorted(np.ptp(flat, axis=0)[:2], reverse=True)
    return float(edges[0]), float(edges[-1])
