"""What loops say of odometry: by how much the path had drifted when the camera came back."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from scenewright.schemas.trajectory import LoopClosure
from scenewright.stages.kit.registration.rigid_motion import between, distance_of
from scenewright.stages.poses.estimation import Estimate

LEAST_WAY = 0.5
"""Loops over less way than this say nothing of drift [m]."""


def path_length(centres: np.ndarray) -> float:
    """Return the length of the way through points (N, 3) [m]."""
    return float(np.linalg.norm(np.diff(centres, axis=0), axis=1).sum())


def loop_closures(estimate: Estimate) -> tuple[LoopClosure, ...]:
    """Return every verified loop with what odometry alone had made of it."""
    keys = estimate.track.keys
    weights = estimate.solution.weights[len(estimate.edges) - len(estimate.loops) :]
    steps = [distance_of(between(a.part_from_key, b.part_from_key)) for a, b in pairwise(keys)]
    travelled = np.concatenate([[0.0], np.cumsum(steps)])
    result = []
    for loop, weight in zip(estimate.loops, weights, strict=True):
        first, second = keys[loop.target], keys[loop.source]
        error = travelled_length = None
        if first.part == second.part:
            by_odometry = between(first.part_from_key, second.part_from_key)
            error = distance_of(between(loop.alignment.target_from_source, by_odometry))
            travelled_length = float(travelled[loop.source] - travelled[loop.target])
        result.append(
            LoopClosure(
                first=first.frame,
                second=second.frame,
                found_by=loop.found_by,
                weight=float(weight),
                overlap=loop.alignment.overlap,
                odometry_error=error,
                path_length=travelled_length,
            )
        )
    return tuple(result)


def drift_of(loops: tuple[LoopClosure, ...]) -> float | None:
    """Return the median odometry error per way [m/m] over believed loops, or None without any that is long enough."""
    shares = [
        loop.odometry_error / loop.path_length
        for loop in loops
        if loop.weight >= 0.5
        and loop.odometry_error is not None
        and loop.path_length is not None
        and loop.path_length >= LEAST_WAY
    ]
    return float(np.median(shares)) if shares else None
