"""What has to be there that nobody saw: a top has legs, a box a bottom, a front something behind it.

Things stand. Where the seen part of one would not, the least is added with which it does: a bottom where its sides end
near the ground, else legs below its corners, else first some depth on the side that no camera saw. Nothing is added
where cameras saw that nothing is, or where something else stands; so a table gets legs, and never a skirt. A bottom
within 4 cm of what was seen is no addition to ask for: heights are exact to no more.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from scenewright.stages.cad.free_space import FreeSpace
from scenewright.stages.cad.surroundings import Convex, convex_of, near_any
from scenewright.stages.kit.formats.scene_supports import LARGEST_STEP
from scenewright.stages.kit.geometry.steadiness import FOOT_THICKNESS, stands_steadily
from scenewright.stages.kit.geometry.transforms import transform_from_yaw
from scipy.spatial import cKDTree
from shapely.geometry import MultiPoint

LEG = 0.04
"""Edge of a leg [m]: those of chairs and tables have 3 to 6 cm; by eye."""
NEAR_GROUND = 0.10
"""Sides that end so near above the ground [m] go on to it."""
SPACING = 0.01
"""Largest distance between the points at which is asked whether a place is taken [m]: half a voxel of a map."""
CLOSED = 0.5
"""Share of its outline along which the sides of a box were seen near the ground: half, from one corner."""
FEW = 16
"""Every so many of these points are asked first: most of what has no room has none anywhere."""
DEEPER = 0.04
"""Step in which depth is added [m]."""
DEEPEST = 0.7
"""Most depth that is added [m]: kitchens and cupboards are 0.6 m deep."""
ONE_SIDED = 0.5
"""Least share of the surface by which one upright side is seen more than the one across from it."""
CLEARANCE = 0.005
"""Room that is left to what stands behind [m]."""
STILL = np.zeros(3)
CORNERS = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
TOLERANCE = 0.002
"""What lies no deeper in something else touches it [m]."""


@dataclass(frozen=True)
class Room:
    """Where nothing may be added."""

    free_space: FreeSpace
    others: tuple[Convex, ...]
    """What else stands there, but for what carries the thing."""
    turn: np.ndarray
    """(3, 3): world from the frame of the thing."""
    seen: cKDTree
    """Of what was seen of the thing, where it was seen, world frame [m]."""
    went: np.ndarray
    """(3,) how far the thing went from there [m]: what was empty around it goes along."""
    known: dict[tuple[tuple[float, float], float, float], bool] = field(default_factory=dict)
    """Legs that were asked for."""

    def fills(self, points: np.ndarray) -> np.ndarray:
        """Return (N,) bool: points (N, 3), frame of the thing, in something else."""
        return near_any(points @ self.turn.T, self.others, -TOLERANCE)

    def is_empty(self, points: np.ndarray) -> np.ndarray:
        """Return (N,) bool: points (N, 3), frame of the thing, that were seen empty."""
        return self.free_space.is_empty(points @ self.turn.T - self.went, self.seen)

    def has_room(self, pieces: Sequence[np.ndarray]) -> bool:
        """Whether convex pieces, corners (N, 3), frame of the thing, lie neither in what was seen empty nor in
        something else."""
        for points in map(inside_points, pieces):
            for some in (points[::FEW], points):
                if self.is_empty(some).any() or self.fills(some).any():
                    return False
        return True

    def has_leg(self, place: tuple[float, float], low: float, high: float) -> bool:
        """Whether there is room for a leg at a place (2,) between two heights [m]; asked once."""
        leg = (place, low, round(high, 3))
        if leg not in self.known:
            self.known[leg] = self.has_room([_between(np.array(place) + 0.5 * LEG * CORNERS, low, high)])
        return self.known[leg]


@dataclass(frozen=True)
class Completion:
    """What is added to a thing."""

    pieces: tuple[np.ndarray, ...] = ()
    """Corners (N, 3) of convex pieces [m], world frame; none where the thing stands by itself."""
    what: str = ""
    """In words."""


def completion_of(
    points: np.ndarray,
    faces: np.ndarray,
    pieces: Sequence[np.ndarray],
    rests_at: float,
    yaw: float,
    free_space: FreeSpace,
    others: Sequence[Convex],
    went: np.ndarray = STILL,
) -> Completion | None:
    """Return what makes a thing stand on a floor at height `rests_at` [m], None where nothing does that has room.

    `points` (V, 3) [m] and `faces` (F, 3), counter-clockwise as seen from outside, are what was seen of it, world
    frame, z up; `pieces` the corners (N, 3) of its shape in physics; `yaw` [rad] is that of its box. `others`: what
    else stands there, but for what carries it; `went` (3,): how far it stands from where it was seen [m].
    """
    low, high = points.min(axis=0) - DEEPEST, points.max(axis=0) + DEEPEST
    low[2] = min(low[2], rests_at)
    near = tuple(piece for piece in others if (piece.low < high).all() and (piece.high > low).all())
    room = Room(free_space, near, transform_from_yaw(yaw, np.zeros(3))[:3, :3], cKDTree(points - went), went)
    own = points @ room.turn
    seen = [piece @ room.turn for piece in pieces]
    if stands_steadily(seen, rests_at):
        return Completion()
    ends_low = bool(own[:, 2].min() <= rests_at + NEAR_GROUND)
    for depth, grown in _deepened(own, faces, seen, room, to_wall=ends_low):
        for added, what in _feet(np.concatenate([own, *grown]), rests_at, room):
            if stands_steadily([*seen, *grown, *added], rests_at):
                words = [f"{1000 * depth:.0f} mm of depth behind what was seen"] if grown else []
                inferred = tuple(piece @ room.turn.T for piece in (*grown, *added))
                return Completion(inferred, " and ".join([*words, *([what] if added else [])]))
    return None


def inside_points(corners: np.ndarray, spacing: float = SPACING) -> np.ndarray:
    """Return points (N, 3) all over a convex piece, corners (M, 3) [m], its bounds too, at most `spacing` apart along
    each axis."""
    low, high = corners.min(axis=0), corners.max(axis=0)
    counts = np.maximum(1, np.ceil((high - low) / spacing - 1e-9)).astype(int) + 1
    axes = [np.linspace(low[a], high[a], counts[a]) for a in range(3)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    return grid[near_any(grid, [convex_of(corners)], 1e-9)]


def _feet(points: np.ndarray, rests_at: float, room: Room) -> Iterator[tuple[list[np.ndarray], str]]:
    """Yield what may carry points (N, 3) at `rests_at` [m]: nothing, a bottom, legs; only where there is room."""
    yield [], ""
    low = points[points[:, 2] <= rests_at + NEAR_GROUND, :2]
    if len(low) and np.ptp(low, axis=0).min() >= LEG and _enclosed(low) >= CLOSED:
        bottom = _between(low, rests_at, rests_at + FOOT_THICKNESS)
        is_near = points[:, 2].min() - rests_at <= LARGEST_STEP  # heights are exact to no more
        if is_near or not room.is_empty(inside_points(bottom)).any():  # what else is there its sides stand in already
            yield [bottom], "a bottom"
    underside = points[:, 2].min() + 0.5 * np.ptp(points[:, 2])
    for upper in (points[points[:, 2] <= underside], points):  # a chair stands on legs below its seat, not its back
        legs = _legs(upper, rests_at, room)
        if legs:
            longest = max(np.ptp(leg[:, 2]) for leg in legs)
            yield legs, f"{len(legs)} leg{'s' * (len(legs) > 1)} of up to {1000 * longest:.0f} mm"


def _enclosed(level: np.ndarray) -> float:
    """Return the share of the outline of level points (N, 2) along which there are some: four legs stand at corners
    alone, the sides of a box all around."""
    outline = MultiPoint(level).convex_hull.exterior
    along = np.arange(0.0, outline.length, SPACING)
    places = np.array([outline.interpolate(distance).coords[0] for distance in along])
    distance, _ = cKDTree(level).query(places)
    return float(np.mean(distance <= LEG))


def _between(level: np.ndarray, low: float, high: float) -> np.ndarray:
    """Return level points (N, 2) at two heights (2 N, 3)."""
    return np.concatenate([np.column_stack([level, np.full(len(level), z)]) for z in (low, high)])


def _legs(points: np.ndarray, rests_at: float, room: Room) -> list[np.ndarray]:
    """Return legs from points (N, 3) down to `rests_at` [m]: where there is room, the farthest out towards the four
    corners, within the bounds of the points. What reaches the ground there is a leg already."""
    least, extent = points[:, :2].min(axis=0), np.ptp(points[:, :2], axis=0)
    counts = np.maximum(1, extent / LEG + 1e-9).astype(np.int64)
    width = np.maximum(extent / counts, 1e-9)
    within = np.minimum((points[:, :2] - least) / width, counts - 1).astype(np.int64)
    cells, number = np.unique(within, axis=0, return_inverse=True)
    lowest = np.full(len(cells), np.inf)
    np.minimum.at(lowest, number.ravel(), points[:, 2])
    middles = least + (cells + 0.5) * width
    spread = middles - middles.mean(axis=0)
    spread /= np.maximum(np.ptp(spread, axis=0), LEG)
    ground = rests_at + FOOT_THICKNESS

    def is_foot(k: int) -> bool:
        """Whether a leg below a cell was seen, or has room."""
        return bool(lowest[k] <= ground) or room.has_leg(tuple(middles[k].tolist()), rests_at, float(lowest[k]))

    def outermost(corner: np.ndarray) -> int | None:
        """Return the cell of a foot that is farthest out towards a corner."""
        return next(filter(is_foot, np.argsort(-(spread @ corner), kind="stable").tolist()), None)

    chosen = sorted({k for corner in CORNERS if (k := outermost(corner)) is not None})
    return [_between(middles[k] + 0.5 * LEG * CORNERS, rests_at, lowest[k]) for k in chosen if lowest[k] > ground]


def _deepened(
    points: np.ndarray, faces: np.ndarray, seen: Sequence[np.ndarray], room: Room, *, to_wall: bool
) -> Iterator[tuple[float, list[np.ndarray]]]:
    """Yield depths [m] that a thing may have behind what was seen of it, and its pieces swept over them: none; up to
    what stands behind it (`to_wall`); then ever more from a little on. What was seen from all sides has none."""
    yield 0.0, []
    behind = _unseen_side(points, faces)
    if behind is None:
        return
    steps = np.arange(DEEPER, DEEPEST + 1e-9, DEEPER)
    first = _to_what_stands_behind(points, behind, room) if to_wall else []
    for depth in (*first, *steps):
        swept = [np.concatenate([piece, piece + depth * behind]) for piece in seen]
        if room.has_room(swept):
            yield float(depth), swept


def _to_what_stands_behind(points: np.ndarray, behind: np.ndarray, room: Room) -> list[float]:
    """Return how much depth points (N, 3) may have before something stands there [m], or nothing where that is much."""
    for depth in np.arange(CLEARANCE, DEEPEST, CLEARANCE):
        if room.fills(points + depth * behind).any():
            return [float(depth) - 2 * CLEARANCE] if depth > DEEPER else []
    return []


def _unseen_side(points: np.ndarray, faces: np.ndarray) -> np.ndarray | None:
    """Return the level axis (3,) away from the side from which a thing was seen; None without such a side."""
    corners = points[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    upright = normals[np.abs(normals[:, 2]) < np.linalg.norm(normals[:, :2], axis=1), :2]
    total = np.linalg.norm(upright, axis=1).sum()
    facing = upright.sum(axis=0)
    axis = int(np.argmax(np.abs(facing)))
    if total <= 0 or abs(facing[axis]) < ONE_SIDED * total:
        return None
    direction = np.zeros(3)
    direction[axis] = -np.sign(facing[axis])
    return direction
