"""The walk of a person with a handheld sensor: a tour past all views, smoothed, timed, with the hand's tremor."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.geometry.transforms import look_at, transform_from
from scenewright.stages.kit.rendering.ray_casting import SceneRenderer
from scenewright.stages.synthesize.free_space import FreeSpace
from scenewright.stages.synthesize.parameters import OTHER_ROOM
from scenewright.stages.synthesize.viewpoints import View
from scipy.ndimage import gaussian_filter1d
from scipy.sparse.csgraph import dijkstra

STEP = 0.02
"""Spacing of path samples [m]."""
CLEARANCE = 0.325
"""The planned camera keeps this distance to every surface; 0.3 m are left when the hand trembles [m]."""
DWELL = 0.9
"""Extra seconds at a view."""
GAZE_SMOOTHING = 0.8
"""Standard deviation of the smoothing of where to look [s]."""
RATE = 60.0
"""Samples of the walk per second."""


@dataclass(frozen=True)
class Walk:
    """The walk at RATE samples per second."""

    eye: np.ndarray
    """(N, 3) [m], without the hand's tremor."""
    yaw: np.ndarray
    """(N,) heading of the view, unwrapped [rad]."""
    pitch: np.ndarray
    """(N,) [rad], down is negative."""
    tremor: Tremor

    @property
    def duration(self) -> float:
        """[s]"""
        return (len(self.eye) - 1) / RATE

    def pose(self, time: float) -> np.ndarray:
        """Return world_from_camera (4, 4) at a time [s]."""
        where = np.clip(time * RATE, 0, len(self.eye) - 1)
        low = min(int(where), len(self.eye) - 2)
        share = where - low
        eye = (1 - share) * self.eye[low] + share * self.eye[low + 1]
        yaw = (1 - share) * self.yaw[low] + share * self.yaw[low + 1]
        pitch = (1 - share) * self.pitch[low] + share * self.pitch[low + 1]
        shift, turn = self.tremor.at(time)
        yaw, pitch, roll = yaw + turn[0], pitch + turn[1], turn[2]
        direction = np.array([np.cos(pitch) * np.cos(yaw), np.cos(pitch) * np.sin(yaw), np.sin(pitch)])
        level = look_at(np.zeros(3), direction)
        cosine, sine = np.cos(roll), np.sin(roll)
        rolled = level[:3, :3] @ np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
        return transform_from(rolled, eye + shift)


@dataclass(frozen=True)
class Tremor:
    """Sums of sines with drawn frequencies and phases: sway and bob of a walker, and a hand that is not still."""

    amplitude: np.ndarray
    """(6, K): x, y, z [m], yaw, pitch, roll [rad]."""
    frequency: np.ndarray
    """(6, K) [Hz]."""
    phase: np.ndarray

    def at(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        """Return (shift (3,) [m], turn (3,): yaw, pitch, roll [rad]) at a time [s]."""
        value = (self.amplitude * np.sin(2 * np.pi * self.frequency * time + self.phase)).sum(axis=1)
        return value[:3], value[3:]


def draw_tremor(random: np.random.Generator) -> Tremor:
    """Draw a tremor: about 4 mm and 0.5 degrees (standard deviation) between 0.4 and 3 Hz."""
    count = 5
    scale = np.array([0.0025, 0.0025, 0.0035, 0.005, 0.005, 0.006])[:, None]
    return Tremor(
        scale * random.uniform(0.5, 1.2, (6, count)),
        random.uniform(0.4, 3.0, (6, count)),
        random.uniform(0, 2 * np.pi, (6, count)),
    )


def order_views(views: list[View], space: FreeSpace) -> list[View]:
    """Return the views in the order of a short tour from the first one: nearest neighbour, then 2-opt.

    The cost between two views is the walking cost plus half a metre for every radian that the look turns.
    """
    nodes = [space.nearest_node(view.eye[:2]) for view in views]
    cost = dijkstra(space.graph, indices=nodes)[:, nodes]
    heading = np.array([np.arctan2(*(view.target - view.eye)[1::-1]) for view in views])
    turn = np.abs((heading[:, None] - heading[None] + np.pi) % (2 * np.pi) - np.pi)
    cost = cost + 0.5 * turn
    tour, unvisited = [0], set(range(1, len(views)))
    while unvisited:
        following = min(unvisited, key=lambda k: (cost[tour[-1], k], k))
        tour.append(following)
        unvisited.remove(following)
    return [views[k] for k in _two_opt(tour, cost)]


def _two_opt(tour: list[int], cost: np.ndarray) -> list[int]:
    """Reverse stretches of an open tour while that shortens it; the first stop stays."""
    improved = True
    while improved:
        improved = False
        for i in range(1, len(tour) - 1):
            for j in range(i + 1, len(tour)):
                before = cost[tour[i - 1], tour[i]]
                after = cost[tour[j], tour[j + 1]] if j + 1 < len(tour) else 0.0
                new_before = cost[tour[i - 1], tour[j]]
                new_after = cost[tour[i], tour[j + 1]] if j + 1 < len(tour) else 0.0
                if new_before + new_after < before + after - 1e-9:
                    tour = tour[:i] + tour[i : j + 1][::-1] + tour[j + 1 :]
                    improved = True
    return tour


def resample(points: np.ndarray, marks: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return points every STEP along a polyline (K, D), and the new rows of the old rows `marks`."""
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points[:, :2], axis=0), axis=1))])
    count = max(2, int(np.ceil(length[-1] / STEP)) + 1)
    grid = np.linspace(0.0, length[-1], count)
    result = np.column_stack([np.interp(grid, length, points[:, k]) for k in range(points.shape[1])])
    return result, np.round(length[marks] / max(length[-1], 1e-9) * (count - 1)).astype(int)


def smooth_path(path: np.ndarray, space: FreeSpace) -> np.ndarray:
    """Round off a floor path (N, 2) as far as the clearance allows: every point takes the widest filter that keeps
    it clear."""
    least_clearance = CLEARANCE + 0.01
    result = path
    for sigma in (0.08, 0.15, 0.3, 0.45):
        candidate = gaussian_filter1d(path, sigma / STEP, axis=0, mode="nearest")
        fine = (space.clearance_at(candidate) >= least_clearance).astype(float)
        # Blend with a smooth weight, so that switching filters makes no corner.
        weight = gaussian_filter1d(np.where(_erode(fine, int(0.5 / STEP)), 1.0, 0.0), 0.15 / STEP)[:, None]
        mixed = weight * candidate + (1 - weight) * result
        good = space.clearance_at(mixed) >= CLEARANCE
        if good.all():
            result = mixed
    return result


def _erode(flags: np.ndarray, reach: int) -> np.ndarray:
    bad = np.convolve(1.0 - flags, np.ones(2 * reach + 1), mode="same")
    return bad < 0.5


def plan_walk(
    views: list[View], space: FreeSpace, renderer: SceneRenderer, speed: float, random: np.random.Generator
) -> Walk:
    """Walk past the views in a good order. `speed` [m/s] holds between the views; before them it slows down.

    Raises BadInput when there is nothing to look at or the camera would come closer than CLEARANCE to a surface.
    """
    if not views:
        raise BadInput("there is nothing that the camera could look at", hint=OTHER_ROOM)
    views = order_views(views, space)
    points, marks = [views[0].eye[None, :2]], [0]
    total = 1
    for a, b in zip(views, views[1:], strict=False):
        leg = space.path(space.nearest_node(a.eye[:2]), space.nearest_node(b.eye[:2]))[1:]
        points.append(leg)
        total += len(leg)
        marks.append(total - 1)
    path, rows = resample(np.concatenate(points), np.array(marks))
    path = smooth_path(path, space)
    row_height = np.interp(np.arange(len(path)), *_unique(rows, np.array([view.eye[2] for view in views])))
    height = gaussian_filter1d(row_height, 0.25 / STEP, mode="nearest")
    eye = np.column_stack([path, height])

    # Time: walking, slower near views, plus a stop at each.
    nearest = np.min(np.abs(np.arange(len(path))[:, None] - rows[None]), axis=1) * STEP
    pace = speed * (0.45 + 0.55 * (1.0 - np.exp(-((nearest / 0.35) ** 2))))
    steps = np.linalg.norm(np.diff(eye, axis=0), axis=1) / (0.5 * (pace[1:] + pace[:-1]))
    dwell = np.zeros(len(path))
    np.add.at(dwell, rows, DWELL)
    dwell = gaussian_filter1d(dwell, 0.06 / STEP, mode="nearest")
    time = np.concatenate([[0.0], np.cumsum(steps)]) + np.cumsum(dwell) - dwell[0]
    samples = np.arange(int(np.ceil(time[-1] * RATE)) + 1) / RATE
    eye = np.column_stack([np.interp(samples, time, eye[:, k]) for k in range(3)])

    # Gaze: the nearest view's target in time, as angles, smoothed.
    moments = time[rows]
    owner = np.argmin(np.abs(samples[:, None] - moments[None]), axis=1)
    look = np.array([view.target for view in views])[owner] - eye
    flat = np.maximum(np.linalg.norm(look[:, :2], axis=1), 0.3)
    yaw = gaussian_filter1d(np.unwrap(np.arctan2(look[:, 1], look[:, 0])), GAZE_SMOOTHING * RATE, mode="nearest")
    pitch = gaussian_filter1d(np.arctan2(look[:, 2], flat), GAZE_SMOOTHING * RATE, mode="nearest")
    eye = gaussian_filter1d(eye, 0.12 * RATE, axis=0, mode="nearest")
    walk = Walk(eye, yaw, pitch, draw_tremor(random))
    closest = float(renderer.distance(eye).min())
    if closest < CLEARANCE:
        raise BadInput(f"the camera would come within {closest:.2f} m of a surface", hint=OTHER_ROOM)
    return walk


def _unique(rows: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return increasing rows and their first values, as np.interp wants them."""
    distinct_rows, first = np.unique(rows, return_index=True)
    return distinct_rows, values[first]


def frame_times(duration: float, frames: int, rate: float) -> np.ndarray:
    """Return (frames,) times [s]: even over the walk, multiples of 1/rate, strictly increasing.

    A walk that is too short for that many frames is recorded at the full rate and slowed down accordingly.
    """
    ticks = np.round(np.linspace(0.0, duration * rate, frames))
    if frames > 1 and np.diff(ticks).min() < 1:
        ticks = np.arange(frames, dtype=float)
    return ticks / rate
