"""Global exploration: to the nearest frontier of the obstacle map, until there is none (Yamauchi 1997; 3.3.3)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scenewright.stages.agent.body import Body
from scenewright.stages.agent.obstacle_map import CELL
from scenewright.stages.agent.scene_map import SceneMap
from scenewright.stages.agent.senses import Base

MOST_STOPS = 60
"""Most stops of an exploration; by eye."""
NEAR = 0.5
"""Frontiers this near to where the robot has looked around already, or could not get, are left alone [m]."""


def explore(body: Body, scene: SceneMap, until: Callable[[], object] = lambda: None) -> int:
    """Drive through everything that can be reached, or until something is found; return the number of stops."""
    scene.sweep(body)
    visited = [(body.base.x, body.base.y)]
    for stop in range(MOST_STOPS):
        if until():
            return stop
        goal = _nearest_frontier(body.base, scene, np.array(visited))
        if goal is None:
            return stop
        visited.append(goal)
        x, y = goal
        yaw = float(np.arctan2(y - body.base.y, x - body.base.x))
        arrived = body.drive(Base(x, y, yaw), "").ok
        if arrived or np.hypot(body.base.x - x, body.base.y - y) < NEAR:  # there is no room to turn, but to look
            scene.sweep(body)
    return MOST_STOPS


def _nearest_frontier(base: Base, scene: SceneMap, left: np.ndarray) -> tuple[float, float] | None:
    points = scene.obstacles.frontiers()
    if not len(points):
        return None
    is_far = np.hypot(*(points[:, None] - left[None]).transpose(2, 0, 1)).min(axis=1) > NEAR
    points = points[is_far]
    field, origin = scene.obstacles.distances_from(base.x, base.y), np.array(scene.obstacles.origin)
    if not len(points):
        return None
    rows = np.rint((points - origin) / CELL).astype(int)
    away = field[rows[:, 0], rows[:, 1]]
    best = int(np.argmin(away))
    return (float(points[best, 0]), float(points[best, 1])) if np.isfinite(away[best]) else None
