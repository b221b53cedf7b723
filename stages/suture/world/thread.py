"""A thread as it falls: a smooth random curve with slack and loops that does not go through the pad."""

from __future__ import annotations

import numpy as np
from scenewright.stages.suture.world.pad import ROUNDED, height

THREAD_RADIUS = 0.00019
"""Half the thickness of a 2-0 thread [m]: it is 0.35 to 0.4 mm thick."""
STEP = 0.0012
"""Distance between points of a thread [m]; by eye."""


def loose_thread(
    start: np.ndarray, direction: np.ndarray, length: float, random: np.random.Generator, loops: float
) -> np.ndarray:
    """Return the centre line (N, 3) [m] of a thread of `length` [m] that leaves `start` along `direction`.

    The bend changes slowly (a thread is stiff over millimetres); `loops` of 0..1 says how strongly it curls. It sinks
    towards the pad (world z up) and rests on it.
    """
    count = max(int(length / STEP), 8)
    heading = np.asarray(direction, dtype=float)
    heading = heading / np.linalg.norm(heading)
    points = np.empty((count + 1, 3))
    points[0] = start
    bend = random.normal(0.0, 30.0, 3)
    for index in range(count):
        bend += -0.05 * bend + random.normal(0.0, 5.0 + 17.0 * loops, 3)
        bend *= min(1.0, 220.0 / (float(np.linalg.norm(bend)) + 1e-9))
        heading = heading + STEP * (np.cross(bend, heading) + np.array([0.0, 0.0, -18.0]))
        distance = np.linalg.norm(points[index, :2])
        if distance > 0.06:
            heading[:2] -= STEP * 25.0 * points[index, :2] / distance
        heading /= np.linalg.norm(heading)
        step = points[index] + STEP * heading
        floor = height(float(step[0]), float(step[1]), ROUNDED) + THREAD_RADIUS
        if step[2] < floor:
            step[2] = floor
            heading[2] = max(heading[2], 0.0)
            heading /= np.linalg.norm(heading) + 1e-12
        points[index + 1] = step
    return points
