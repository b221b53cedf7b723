"""A door or a drawer as the robot believes in it: of what was seen of its front, and of what such furniture is like.

**Assumed** by the class of furniture as seen: a dresser's front is a drawer that comes straight out, a fridge's a leaf,
any other's what its mask says; the hinge of a leaf is at the edge far from the handle; furniture with a door is hollow.
All else is measured: which side the handle is on, where and how long its bar is, how wide and high the front, and how
far it is open by the arm's joints. Which fronts a piece has is told in `front_seeing.py`.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import atan2, ceil

import numpy as np
from scenewright.schemas.base import Vector3, as_vector
from scenewright.schemas.scene_parts import Joint
from scenewright.stages.agent.senses import Position
from scenewright.stages.agent.world.physics.shapes import jointed_text, slab
from scenewright.stages.kit.geometry.transforms import apply, inverse
from scenewright.stages.kit.motion.doors import body_from_moved

WITH_DRAWERS, WITH_LEAVES = ("dresser",), ("fridge",)
OF_EITHER = ("cabinet", "drawer unit", "wardrobe")
"""Furniture with doors or drawers, and a top on which things lie as well."""
PARTS = ("handle", "door", "drawer")
"""Words for what moves of furniture: no things."""
THICK, LEAF = 0.03, 0.02
"""Thickness of walls, and of leaves and drawer fronts [m]; by eye."""
HALF_BAR = 0.01
"""Half of a bar's thickness: the middle of a handle lies so far behind what is seen of it [m]."""
ROOM = 0.008
"""Room around a bar that the hand keeps when it goes past it [m]; by eye."""
OVER = 0.025
"""Believed of a front over where its mask ends, which is a pixel too low [m]."""
BEHIND_BAR = 0.03
"""Room of a hand's fingers behind a bar: so far is a front from it where it was not seen itself [m]."""
STAYS = 0.04
"""Length of a drawer that stays in [m]."""
WIDEST = 1.9
"""Angle to which a leaf opens [rad]."""
NEAR_HINGE = 0.15
"""Points of a leaf this near to its hinge tell little of its angle [m]."""
SEEN_AT_ONCE = 0.6
"""Height of the inside that one look into it shows [m]: the wrist camera sees 54 degrees, from about so far. By eye."""
NARROWEST = 0.25
"""Least width of a front that was looked at, and not its edge [m]; by eye."""
EDGE_CELL = 0.01
"""Edge of a cell on which a front's outline is told [m]; by eye."""
ABOUT, BOARD = 0.015, 0.035
"""The top of a shelf's board is known to so much, and its underside is so far below it, as believed [m]; by eye."""
GAP = 0.005
"""Room between what moves and its neighbours [m]; by eye."""
TRAY = 0.5
"""Height of the sides of a drawer, as a share of its front's."""


@dataclass(frozen=True)
class Front:
    """A front in its own frame: the middle of the furniture's foot, x out of the front, z up, metres."""

    name: str
    label: str
    """Class of the furniture."""
    map_from_front: np.ndarray
    size: tuple[float, float, float]
    """Depth, width, height of the furniture."""
    panel: tuple[float, float, float, float]
    """What moves, from y to y and from z to z, as seen."""
    bar: tuple[tuple[float, ...], tuple[float, ...]]
    """Lower and upper corner of the handle."""
    slides: bool
    value: float = 0.0
    """How far it is open, as felt [rad] or [m]."""
    floor: float | None = None
    """Height on which things inside lie, as seen [m]."""
    leafless: bool = False
    """An open shelf: nothing moves, it is always open."""
    levels: tuple[float, ...] = ()
    """Heights of the boards of an open shelf, as seen [m], the lowest first."""
    across: tuple[float, float] | None = None
    """From y to y of the whole furniture, where this is one of several fronts; the rest of it is taken for solid."""

    @property
    def alone(self) -> bool:
        """Whether it is the only front of its furniture."""
        return self.across is None

    @property
    def middle(self) -> np.ndarray:
        """Middle of its handle when it is shut (3,), in the map."""
        return apply(self.map_from_front, np.array([self.joint.handle]))[0]

    @property
    def low(self) -> float:
        """Height from which on it is hollow behind the front [m]."""
        return self.panel[2] - 0.03 if self.slides or not self.alone else 0.0

    @property
    def joint(self) -> Joint:
        """How it moves."""
        x, (y0, y1, _, _) = self.size[0] / 2, self.panel
        at = (np.array(self.bar[0]) + self.bar[1]) / 2
        tall = self.bar[1][2] - self.bar[0][2] > self.bar[1][1] - self.bar[0][1]
        hinge = y1 if at[1] < (y0 + y1) / 2 else y0
        return Joint(
            name=f"{self.name}__joint",
            type="prismatic" if self.slides else "revolute",
            part=f"{self.name}__front",
            origin=(0.0, 0.0, 0.0) if self.slides else (x - LEAF, float(hinge), 0.0),
            axis=(1.0, 0.0, 0.0) if self.slides else (0.0, 0.0, 1.0 if hinge > at[1] else -1.0),
            lower=0.0,
            upper=self.size[0] - STAYS if self.slides else WIDEST,
            handle=as_vector(at),
            handle_axis=(0.0, 0.0, 1.0) if tall else (0.0, 1.0, 0.0),
        )

    def urdf(self) -> str:
        """Return URDF text of it: walls around a hollow, and what moves before it."""
        x, w, h = self.size[0] / 2, self.size[1] / 2, self.size[2]
        y0, y1, z0, z1 = self.panel
        inner = x - LEAF
        still = [
            slab((-x, -w, 0.0), (THICK - x, w, h)),
            slab((-x, -w, 0.0), (inner, THICK - w, h)),
            slab((-x, w - THICK, 0.0), (inner, w, h)),
            slab((-x, -w, 0.0), (inner, w, z0 if self.slides else max(z0, THICK))),
            slab((-x, -w, max(z1 if self.slides else 0.0, h - THICK)), (inner, w, h)),
            *(slab(low, high) for low, high in self.solid()),
        ]
        low, high = np.array(self.bar[0]) - ROOM, np.array(self.bar[1]) + ROOM
        still += [slab((-x, -w, level - BOARD), (inner, w, level - ABOUT)) for level in self.levels]
        if self.leafless:  # a speck within its back
            return jointed_text(self.name, tuple(still), (slab((-x, 0.0, 0.0), (0.002 - x, 0.002, 0.002)),), self.joint)
        moving = [slab((inner, y0, z0), (x, y1, z1 + OVER)), slab(as_vector(low), as_vector(high))]
        if self.slides:
            edge = z0 + TRAY * (z1 - z0)
            far = STAYS - x
            moving += [
                slab((far, y0 + THICK, z0), (inner, y1 - THICK, z0 + 0.005)),
                slab((far, y0 + THICK, z0), (inner, y0 + THICK + 0.01, edge)),
                slab((far, y1 - THICK - 0.01, z0), (inner, y1 - THICK, edge)),
            ]
        return jointed_text(self.name, tuple(still), tuple(moving), self.joint)

    def solid(self) -> list[tuple[Vector3, Vector3]]:
        """Return the corners of what is beside, below and above it of furniture with several fronts, own frame."""
        if self.across is None:
            return []
        x, w, h = self.size[0] / 2, self.size[1] / 2, self.size[2]
        (y0, y1), (z0, z1) = self.across, self.panel[2:]
        boxes: list[tuple[Vector3, Vector3]] = [
            ((-x, y0, 0.0), (x, -w, h)),
            ((-x, w, 0.0), (x, y1, h)),
            ((-x, -w, 0.0), (x, w, z0 - GAP)),
            ((-x, -w, z1 + OVER + GAP), (x, w, h)),
        ]
        return [(low, high) for low, high in boxes if all(b - a > THICK for a, b in zip(low, high, strict=True))]

    def local(self, points: np.ndarray) -> np.ndarray:
        """Return points (N, 3) of the map in its own frame."""
        return apply(inverse(self.map_from_front), points)

    def inside(self, points: np.ndarray) -> np.ndarray:
        """Return (N,) bool: points of the map that are within it, or within its drawer where that is now."""
        in_front_frame = self.local(points)
        out = self.value if self.slides else 0.0
        x, w = self.size[0] / 2, self.size[1] / 2
        return (
            (in_front_frame[:, 0] > out - x)
            & (in_front_frame[:, 0] < x + out)
            & (np.abs(in_front_frame[:, 1]) < w)
            & (in_front_frame[:, 2] > self.low)
            & (in_front_frame[:, 2] < (self.size[2] - 0.05 if self.alone else self.panel[3]))
        )

    @property
    def inward(self) -> float:
        """Heading straight into it [rad]."""
        return float(np.arctan2(*-self.map_from_front[1::-1, 0]))

    def behind(self, at: np.ndarray) -> float:
        """Return how far a point (3,) of the map is behind the open front of a shelf [m]; 0 in a drawer, which is open
        from above."""
        return 0.0 if self.slides else max(0.0, self.size[0] / 2 - float(self.local(at[None])[0, 0]))

    def before(self, base: np.ndarray) -> bool:
        """Whether a base pose (3,) of the map is on the side that the front is on."""
        return bool(self.local(np.array([[*base[:2], 0.0]]))[0, 0] > self.size[0] / 2)

    def openings(self) -> list[Position]:
        """Return places of the map in the middle of a shelf, at the heights at which it is looked into, the upper ones
        first."""
        z0, z1 = (0.0, self.size[2]) if self.alone else self.panel[2:]
        count = max(1, ceil((z1 - z0) / SEEN_AT_ONCE))
        heights = z1 - (np.arange(count) + 0.5) / count * (z1 - z0)
        places = apply(self.map_from_front, np.column_stack([np.zeros((count, 2)), heights]))
        return [(float(x), float(y), float(z)) for x, y, z in places]

    def of_part(self, points: np.ndarray, room: float) -> np.ndarray:
        """Return (N,) bool: points of the map that are of what moves, where it is now, or within `room` [m] of it."""
        if self.leafless:
            return np.zeros(len(points), bool)
        shut = apply(inverse(body_from_moved(self.joint, self.value)), self.local(points))
        y0, y1, z0, z1 = self.panel
        back = STAYS - self.size[0] / 2 if self.slides else self.size[0] / 2 - LEAF
        low, high = np.array([back, y0, z0]), np.array([max(self.size[0] / 2, self.bar[1][0]), y1, z1])
        return np.all((shut > low - room) & (shut < high + room), axis=1)

    def outline(self) -> np.ndarray:
        """Return points (N, 2) of the map over which what moves stands now, 5 cm apart at most."""
        if self.leafless:
            return np.zeros((0, 2))
        x, (y0, y1, _, _) = self.size[0] / 2, self.panel
        xs = np.arange(STAYS - x if self.slides else x - LEAF, x, 0.05)
        grid = np.stack(np.meshgrid(xs, np.arange(y0, y1 + 0.04, 0.05), [0.5]), -1).reshape(-1, 3)
        return apply(self.map_from_front @ body_from_moved(self.joint, self.value), grid)[:, :2]

    def value_seen(self, points: np.ndarray) -> float:
        """Return how far it is open by points (N, 3) of the map that were seen of what moves [rad] or [m]."""
        in_front_frame = self.local(points)
        if self.slides:
            return edges(in_front_frame[:, :2])[1] - self.size[0] / 2
        joint = self.joint
        from_hinge = in_front_frame[:, :2] - np.array(joint.origin)[:2]
        far = from_hinge[np.hypot(*from_hinge.T) > NEAR_HINGE] * (1.0, -joint.axis[2])
        return float(np.median(np.arctan2(far[:, 0], far[:, 1]))) if len(far) else self.value

    def value_of_bar(self, points: np.ndarray) -> float:
        """Return how far a drawer is open by points (N, 3) of the map that were seen of its handle [m]."""
        return float(np.percentile(self.local(points)[:, 0], 95)) - self.bar[1][0]

    def level_with(self, points: np.ndarray) -> bool:
        """Whether the middle of points (N, 3) of the map is as high as what moves."""
        return bool(self.panel[2] < np.median(points[:, 2]) < self.panel[3])

    def felt(self, tool: np.ndarray, contact: np.ndarray) -> float:
        """Return the joint value at which a point that was at `contact` (3,), own frame, when it was shut is where the
        tool (3,) of the map is now."""
        at = self.local(tool[None])[0]
        if self.slides:
            return float(at[0] - contact[0])
        hinge = np.array(self.joint.origin)[:2]
        before, now = contact[:2] - hinge, at[:2] - hinge
        turned = atan2(now[1], now[0]) - atan2(before[1], before[0])
        return float((turned * self.joint.axis[2] + np.pi) % (2 * np.pi) - np.pi)


def edges(points: np.ndarray) -> tuple[float, float]:
    """Return from where to where a surface of points (N, 2) [m] reaches along the first axis: to the outermost
    centimetres that hold at least half as much of it as the middle one does: beyond are strays."""
    cells = np.unique(np.floor(points / EDGE_CELL).astype(int), axis=0)
    columns, counts = np.unique(cells[:, 0], return_counts=True)
    full = columns[counts >= np.median(counts) / 2]
    return float(full.min() * EDGE_CELL), float((full.max() + 1) * EDGE_CELL)


def footprint(front: Front, less: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Return the corners (2,), (2,) of the map over which furniture with its drawer stands, `less` [m] of its front; a
    leaf is left out."""
    x, w, out = front.size[0] / 2, front.size[1] / 2, (front.value if front.slides else 0.0) - less
    corners = apply(front.map_from_front, np.array([(-x, -w, 0.0), (x + out, w, 0.0)]))[:, :2]
    return corners.min(axis=0), corners.max(axis=0)
