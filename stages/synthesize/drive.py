"""The drive of a robot: along a line, a loop or a figure of eight on the free floor, looking ahead."""

from __future__ import annotations

from typing import Literal

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.rendering.ray_casting import SceneRenderer
from scenewright.stages.synthesize.free_space import FreeSpace
from scenewright.stages.synthesize.parameters import OTHER_ROOM
from scenewright.stages.synthesize.walk import (
    CLEARANCE,
    GAZE_SMOOTHING,
    RATE,
    STEP,
    Walk,
    draw_tremor,
    resample,
    smooth_path,
)
from scipy.ndimage import gaussian_filter1d
from scipy.sparse.csgraph import dijkstra

Shape = Literal["line", "loop", "eight"]
HEIGHTS = (1.5, 0.9)
"""Heights of the camera, one round each [m]."""
PITCH = -0.25
"""A robot's camera looks a little down [rad]."""
WAYPOINTS = 16
"""Points of a round; by eye."""
REACH = 0.8
"""Share of the free floor's half extent that a drive reaches."""


def plan_drive(
    shape: Shape, rounds: int, space: FreeSpace, renderer: SceneRenderer, speed: float, random: np.random.Generator
) -> Walk:
    """Drive `shape` so many rounds (1 or 2), each at its height of HEIGHTS, at `speed` [m/s] and without a stop. A line
    is driven back in its second round.

    Raises BadInput when the camera would come closer than CLEARANCE to a surface.
    """
    outbound = _floor_path(shape, space)
    legs = [outbound, outbound[::-1] if shape == "line" else outbound][:rounds]
    heights = np.repeat(HEIGHTS[:rounds], [len(leg) for leg in legs])
    path = smooth_path(np.concatenate(legs), space)
    eye = np.column_stack([path, gaussian_filter1d(heights, 0.25 / STEP, mode="nearest")])
    time = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(eye, axis=0), axis=1))]) / speed
    samples = np.arange(int(np.ceil(time[-1] * RATE)) + 1) / RATE
    eye = np.column_stack([np.interp(samples, time, eye[:, k]) for k in range(3)])
    eye = gaussian_filter1d(eye, 0.12 * RATE, axis=0, mode="nearest")
    closest = float(renderer.distance(eye).min())
    if closest < CLEARANCE:
        raise BadInput(
            f"the camera would come within {closest:.2f} m of a surface", hint=f"{OTHER_ROOM}, or another --path"
        )
    ahead = np.gradient(gaussian_filter1d(eye[:, :2], 0.25 * RATE, axis=0, mode="nearest"), axis=0)
    yaw = gaussian_filter1d(np.unwrap(np.arctan2(ahead[:, 1], ahead[:, 0])), GAZE_SMOOTHING * RATE, mode="nearest")
    return Walk(eye, yaw, np.full(len(eye), PITCH), draw_tremor(random))


def _floor_path(shape: Shape, space: FreeSpace) -> np.ndarray:
    """Return the floor points (N, 2) [m], every STEP, of the shape as the free floor allows it."""
    nodes = _ends(space) if shape == "line" else _around(shape, space)
    legs = [space.path(a, b) for a, b in zip(nodes, nodes[1:], strict=False) if a != b]
    if not legs:
        raise BadInput("there is no floor to drive on", hint=OTHER_ROOM)
    points = np.concatenate([legs[0][:1], *(leg[1:] for leg in legs)])
    return resample(points, np.array([0]))[0]


def _ends(space: FreeSpace) -> list[int]:
    """Two nodes that are far from each other by floor: the farthest of the farthest of the first."""
    start = int(np.argmax(dijkstra(space.graph, indices=0)))
    return [start, int(np.argmax(dijkstra(space.graph, indices=start)))]


def _around(shape: Shape, space: FreeSpace) -> list[int]:
    """Nodes next to an ellipse, or to Gerono's lemniscate along the longer side, within the free floor."""
    cells = space.cells()
    middle, half = (cells.max(axis=0) + cells.min(axis=0)) / 2, (cells.max(axis=0) - cells.min(axis=0)) / 2
    angle = np.linspace(0.0, 2 * np.pi, WAYPOINTS + 1)
    if shape == "loop":
        curve = np.column_stack([np.cos(angle), np.sin(angle)])
    else:
        curve = np.column_stack([np.sin(angle), np.sin(2 * angle)])
        if half[1] > half[0]:
            curve = curve[:, ::-1]
    return [space.nearest_node(point) for point in middle + REACH * half * curve]
