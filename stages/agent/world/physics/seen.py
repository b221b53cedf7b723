"""What the cameras saw so far: furniture and surfaces of things in the map frame, and boxes of it for the arm."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import hypot

import numpy as np
from scenewright.schemas.base import as_vector
from scenewright.stages.agent.obstacle_map import ObstacleMap
from scenewright.stages.agent.senses import Base, Position, SeenFurniture
from scenewright.stages.agent.world.physics import head
from scenewright.stages.agent.world.physics.beliefs import Believed
from scenewright.stages.agent.world.physics.eyes import FIXTURE, OVERLAP, Surface, overlap
from scenewright.stages.agent.world.physics.front_seeing import open_shelf
from scenewright.stages.agent.world.physics.fronts import OF_EITHER, WITH_DRAWERS, WITH_LEAVES, Front, footprint
from scenewright.stages.agent.world.physics.robot_in_room import RobotInRoom
from scenewright.stages.kit.geometry.cameras import back_project
from scenewright.stages.kit.geometry.transforms import apply
from scenewright.stages.kit.rendering.object_views import Picture

FOUND_WITHIN = 0.12
"""A surface this near to a position is meant by it [m]."""
FLOOR, FLOOR_AROUND = 0.05, 1.6
"""What begins lower lies on the floor [m], and how far around its middle a look at the floor tells of it [m]."""
NEARER = 0.08
"""The folded elbow goes over a drawer: the base stands so much nearer to it than to furniture [m]."""
BESIDE_PART = 0.06
"""What the head sees so near to a leaf or a drawer is of it [m]."""
WIDEST = 0.5
"""Largest width of what lies about on furniture or in it [m]; by eye."""
AROUND = 1.4
"""What is farther from the base does not matter to the arm [m]."""
COMFORT = 4.5
"""Cells of the map within which a turn of the pedestal (0.28 m) with its folded arm (0.39 m) may touch something."""


class Seen:
    """The map of one robot. `clearance`: cells that its base keeps from what is occupied."""

    def __init__(self, robot: RobotInRoom, clearance: float) -> None:
        self._robot = robot
        self.pieces: list[head.SeenPiece] = []
        self.surfaces: list[Surface] = []
        self.fronts: dict[str, Front] = {}
        """Doors and drawers of which the handle was seen, by the names of `boxes`: of each piece the one that was
        opened last, or that will be opened next."""
        self.waiting: dict[str, list[Front]] = {}
        """Other doors and drawers of the same pieces that were not opened yet, the next one first."""
        self.obstacles = ObstacleMap(robot.base, clearance, COMFORT)

    def furniture(self) -> list[SeenFurniture]:
        """Return the pieces of which enough was seen."""
        pieces_seen = []
        for number, piece in enumerate(self.pieces):
            if len(piece.cubes) < head.LEAST:
                continue
            pieces_seen.append(self.piece_seen(number))
        return pieces_seen

    def piece_seen(self, number: int) -> SeenFurniture:
        """Return a piece as arms know it: with its drawer, where that is out."""
        piece = self.pieces[number]
        low, high = piece.box
        front = self.fronts.get(f"furniture_{number}")
        opened = front is not None and front.value > 0
        outward: float | None = None
        if front is not None and opened and not front.slides:
            outward = float(np.arctan2(*front.map_from_front[1::-1, 0]))
        if front is not None and opened and front.slides:
            near, far = self._stands_over(number, NEARER)
            low, high = np.array([*near, low[2]]), np.array([*far, high[2]])
        centre, size = (low + high) / 2, np.maximum(high - low, 0.1)
        return SeenFurniture(
            piece.label,
            (float(centre[0]), float(centre[1])),
            (float(size[0]), float(size[1])),
            float(high[2]),
            piece.label in (*WITH_DRAWERS, *WITH_LEAVES, *OF_EITHER),
            opened,
            outward,
            () if front is None else front.levels,
            piece.label in OF_EITHER,
            bool(self.waiting.get(f"furniture_{number}")),
        )

    def _stands_over(self, number: int, less: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
        """Return the corners (2,), (2,) over which a piece stands, with its drawer, `less` [m] of that one's front; a
        leaf is left out."""
        front, (low, high) = self.fronts.get(f"furniture_{number}"), self.pieces[number].box
        if front is None:
            return low[:2], high[:2]
        near, far = footprint(front, less)
        return (near, far) if front.alone else (np.minimum(near, low[:2]), np.maximum(far, high[:2]))

    def keep_floor(self, picture: Picture, map_from_camera: np.ndarray, front: Front) -> None:
        """Measure the height on which things inside an open front lie: the most frequent height there [m]."""
        points = apply(map_from_camera, back_project(picture.depth, picture.camera, stride=2).reshape(-1, 3))
        heights = points[front.inside(points), 2]
        if len(heights) > 200:
            counts, edges = np.histogram(heights, bins=np.arange(0.0, front.size[2], 0.005))
            level = edges[counts.argmax()] + 0.0025
            floor = float(np.median(heights[np.abs(heights - level) < 0.006]))
            self.fronts[front.name] = replace(self.fronts[front.name], floor=floor)

    def moved(self, name: str, value: float) -> Front:
        """Believe that the door of furniture is open so far, 0: shut; the base goes around it. Return its front."""
        self.fronts[name] = replace(self.fronts[name], value=value)
        outlines = [front.outline() for front in self.fronts.values() if front.value > 0]
        self.obstacles.put_aside(np.concatenate([*outlines, np.zeros((0, 2))]))
        return self.fronts[name]

    def of_parts(self, points: np.ndarray) -> np.ndarray:
        """Return (N,) bool: points (N, 3) of leaves and drawers, which are no lasting obstacles."""
        on_part = np.zeros(len(points), bool)
        for front in self.fronts.values():
            on_part |= front.of_part(points, BESIDE_PART)
        return on_part

    def front_of(self, piece: int | None) -> Front | None:
        """Return the front of a piece, if it is open."""
        front = self.fronts.get(f"furniture_{piece}")
        return front if front is not None and front.value > 0 else None

    def front_at(self, at: Sequence[float] | np.ndarray) -> Front | None:
        """Return the open front of the furniture or drawer that a position is in."""
        point = np.array([at[:3]], float)
        return next((f for f in self.fronts.values() if f.value > 0 and f.inside(point)[0]), None)

    def keep_shelf(self, piece: int | None) -> None:
        """Believe that a piece of which the inside was seen is an open shelf, open to where the robot stands."""
        if piece is None or (f"furniture_{piece}" in self.fronts and not self.fronts[f"furniture_{piece}"].leafless):
            return
        name, seen = f"furniture_{piece}", self.pieces[piece]
        points = np.array(sorted(seen.cubes)) * head.GRAIN
        shelf = open_shelf(name, seen.label, seen.box, points, self._robot.believed)
        if shelf is not None:
            self.fronts[name] = shelf

    def keep_top(self, picture: Picture, map_from_camera: np.ndarray, piece: int | None) -> None:
        """Measure the height of the top of furniture that fills the picture: the most frequent height [m]."""
        if piece is None:
            return
        points = apply(map_from_camera, back_project(picture.depth, picture.camera, stride=3).reshape(-1, 3))
        low, high = self.pieces[piece].box
        inside = np.all((points[:, :2] > low[:2]) & (points[:, :2] < high[:2]), axis=1)
        heights = points[inside & (np.abs(points[:, 2] - high[2]) < 0.08), 2]
        if len(heights) > 200:
            counts, edges = np.histogram(heights, bins=np.arange(high[2] - 0.08, high[2] + 0.081, 0.005))
            top = edges[counts.argmax()] + 0.0025
            self.pieces[piece].measured_top = float(np.median(heights[np.abs(heights - top) < 0.006]))

    def piece_at(self, at: Position) -> int | None:
        """Return the number of the piece at a position, with a hand's breadth around it; None for the floor."""
        if at[2] < FLOOR:
            return None
        for number, piece in enumerate(self.pieces):
            low, high = self._stands_over(number)
            if len(piece.cubes) >= head.LEAST and np.all((at[:2] > low - 0.1) & (at[:2] < high + 0.1)):
                return number
        return None

    def nearest(self, at: Position) -> Surface | None:
        """Return what was seen nearest to a position, if it is meant by that."""
        away = {k: hypot(s.middle[0] - at[0], s.middle[1] - at[1]) for k, s in enumerate(self.surfaces)}
        best = min(away, key=lambda k: away[k], default=None)
        return None if best is None or away[best] > FOUND_WITHIN else self.surfaces[best]

    def belongs(self, surface: Surface, at: Position, piece: int | None, close: bool) -> bool:
        """Whether a surface is of a piece of furniture, or lies where a look from near by was at."""
        middle = surface.middle
        away = hypot(middle[0] - at[0], middle[1] - at[1])
        if close:
            return away <= FOUND_WITHIN
        if piece is None:
            return at[2] < FLOOR and float(surface.low[2]) < FLOOR and away <= FLOOR_AROUND
        low, high = self.pieces[piece].box
        front = self.front_of(piece)
        if front is not None and front.inside(middle[None])[0]:
            return True
        return bool(
            np.all((middle[:2] > low[:2] - 0.05) & (middle[:2] < high[:2] + 0.05)) and middle[2] > high[2] - 0.1
        )

    def keep(self, fresh: list[Surface], at: Position, piece: int | None, close: bool) -> None:
        """Replace what was known of a piece of furniture, or of where a look from near by was at, by what was seen. Of
        what is only partly in the picture, what was seen before is kept."""
        earlier_surfaces = [s for s in self.surfaces if self.belongs(s, at, piece, close)]
        better = {
            id(s): earlier for s in fresh if s.cut for earlier in earlier_surfaces if overlap(s, earlier) > OVERLAP
        }
        away = [s for s in self.surfaces if not any(s is earlier for earlier in earlier_surfaces)]
        self.surfaces = away + [better.get(id(s), s) for s in fresh]

    def boxes(self, without: Position | None = None, base: Base | None = None) -> dict[str, Believed]:
        """Return what is around a base pose in the map, the robot's own if none is given; what covers a position is
        left out."""
        robot_position = np.array([base.x, base.y]) if base is not None else self._robot.believed[:2]
        boxes: dict[str, Believed] = {}
        for number, piece in enumerate(self.pieces):
            low, high = piece.box
            off = np.maximum(0.0, np.maximum(low[:2] - robot_position, robot_position - high[:2]))
            if len(piece.cubes) >= head.LEAST and np.hypot(*off) < AROUND:
                if f"furniture_{number}" in self.fronts:
                    boxes[f"furniture_{number}"] = self.fronts[f"furniture_{number}"]
                    continue
                top = min(float(high[2]), piece.top) - 0.004
                inner = 0.02
                boxes[f"furniture_{number}"] = (
                    np.array([*(low[:2] + inner), 0.0]),
                    np.array([*(high[:2] - inner), top]),
                )
        for number, surface in enumerate(self.surfaces):
            low, high = surface.low, surface.high
            if (
                not (without is not None and _covers(surface, without))
                and np.hypot(*(surface.middle[:2] - robot_position)) < AROUND
            ):
                boxes[f"thing_{number}"] = (low, high)
        return boxes

    def taken(self, at: Position) -> bool:
        """Whether something stands at a position that is no thing and on which nothing is put. Of that only the near
        side is seen: on furniture with such a thing the top itself has to have been."""
        fixtures = [surface for surface in self.surfaces if surface.label == FIXTURE]
        piece = self.piece_at(at)
        if piece is None or any(_covers(surface, at) for surface in fixtures):
            return any(_covers(surface, at) for surface in fixtures)
        there = any(self.piece_at(as_vector(surface.middle)) == piece for surface in fixtures)
        return there and self.front_at(at) is None and not self.pieces[piece].bare_at(at[0], at[1])

    def beside_on(self, at: Position) -> tuple[str, ...]:
        """Return the names, as of `boxes`, of what lies on the thing that covers a position."""
        carriers = [s for s in self.surfaces if _covers(s, at)]
        lying = (k for k, s in enumerate(self.surfaces) if any(s is not c and _covers(c, s.middle) for c in carriers))
        return tuple(f"thing_{k}" for k in lying)

    def rim(self, at: Position, support: float) -> float:
        """Return the height [m] of the top of what was seen around a position, `support` where that is nothing."""
        return max([support, *(float(s.high[2]) for s in self.surfaces if _covers(s, at))])

    def support(self, at: Position) -> float:
        """Return the height [m] of what was seen at a position: of a thing there, else of the furniture."""
        for surface in self.surfaces:
            close_points = np.hypot(*(surface.points[:, :2] - at[:2]).T) < 0.035
            if close_points.sum() > 5:
                return float(np.median(surface.points[close_points, 2]))
        piece, front = self.piece_at(at), self.front_at(at)
        if front is not None and front.levels:
            return min(front.levels, key=lambda level: abs(level - at[2]))
        return at[2] if piece is None else self.pieces[piece].top


def too_wide(surface: Surface) -> bool:
    """Whether a surface is too wide for a thing: it is of furniture, whatever its mask says."""
    return float((surface.high - surface.low)[:2].max()) >= WIDEST


def _covers(surface: Surface, at: Sequence[float] | np.ndarray) -> bool:
    """Whether a position is within the outline of a surface, or a finger's breadth from it."""
    low, high, point = surface.low[:2], surface.high[:2], np.array(at[:2])
    return bool(np.all((point > low - 0.03) & (point < high + 0.03)))
