"""Ours: doors and windows as plates in the holes of the walls; a door turns where it meets its wall.

A door that stands open shows where its hinge is: at the upright edge that lies in a wall's plane. Of a shut one nobody
saw the side, and it is inferred.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scenewright.schemas.contact_graph import GraphNode
from scenewright.stages.kit.geometry.transforms import apply, inverse, transform_from

PANE_THICKNESS = 0.04
"""Of doors and windows [m]; by eye."""
GAP = 0.01
"""Between a door and what is around it [m]; by eye."""
IN_WALL = 0.2
"""A door or window so near to a wall's plane is in the wall, and a hinge so near to it is at the wall [m]."""
PARALLEL = 0.95
"""Cosine of the angle of two planes from which they are along each other; by eye."""
LEAST_UPRIGHT = 0.3
"""Largest z of the normal of what is upright."""
UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class Hinge:
    """How a door turns."""

    at_left: bool
    """Whether it turns about its left edge, seen from the room."""
    angle: float
    """At which it was seen; 0 is shut [rad], positive into the room."""
    because: str


@dataclass(frozen=True)
class Pane:
    """A door or window as it was seen, or shut."""

    node: str
    frame: np.ndarray
    """world_from_pane (4, 4): origin at the lower left corner of its face, x along it, y up, z into the room. Of a door
    with a hinge: where it would be shut."""
    width: float
    height: float
    hinge: Hinge | None = None

    @property
    def corners(self) -> np.ndarray:
        """Return (4, 3) of the face, world frame."""
        flat = np.array([[0, 0, 0], [self.width, 0, 0], [self.width, self.height, 0], [0, self.height, 0]])
        return apply(self.frame, flat)


def pane_of(node: GraphNode, walls: Sequence[np.ndarray], room: np.ndarray, floor: float) -> Pane | None:
    """Return a door or window by its largest upright plane; None where it shows none.

    `walls`: world_from_face (4, 4) of the faces of walls, z into the room; `room`: (3,) in the room; `floor`: height
    [m], to which a door goes on.
    """
    upright = [p for p in node.planes if len(p.corners) == 4 and abs(p.normal[2]) < LEAST_UPRIGHT]
    if not upright:
        return None
    plane = max(upright, key=lambda each: each.area)
    corners, normal = np.array(plane.corners), np.array([*plane.normal[:2], 0.0])
    normal /= np.linalg.norm(normal)
    if normal @ (room - corners.mean(axis=0)) < 0:
        normal = -normal
    along = np.cross(UP, normal)
    turn = np.column_stack([along, UP, normal])
    local = (corners - corners.mean(axis=0)) @ turn
    low = corners[:, 2].min()
    low = floor + GAP if node.class_name == "door" and low - floor < IN_WALL else low
    origin = corners.mean(axis=0) + local[:, 0].min() * along
    origin[2] = low
    width, height = float(np.ptp(local[:, 0])), float(corners[:, 2].max() - low)
    seen = Pane(node.id, transform_from(turn, origin), width, height)
    return seen if node.class_name != "door" else _hinged(seen, walls)


def _hinged(seen: Pane, walls: Sequence[np.ndarray]) -> Pane:
    """Return a door shut in the wall that it belongs to, with its hinge and how far it is open; as it was seen where no
    wall is near."""
    best: tuple[float, Pane] | None = None
    for wall in walls:
        local = apply(inverse(wall), seen.corners)
        depth = np.abs(local[:2, 2])  # of the left and of the right edge
        if depth.min() > IN_WALL:
            continue
        shut = abs(float(seen.frame[:3, 2] @ wall[:3, 2])) > PARALLEL
        if shut and depth.max() <= IN_WALL:
            because = "it was seen shut, and the side of its hinge is inferred"
            found = Pane(seen.node, seen.frame, seen.width, seen.height, Hinge(True, 0.0, because))
        elif not shut:
            found = _shut(seen, wall, local, at_left=bool(depth[0] <= depth[1]))
        else:
            continue
        if best is None or depth.min() < best[0]:
            best = (float(depth.min()), found)
    return seen if best is None else best[1]


def _shut(seen: Pane, wall: np.ndarray, local: np.ndarray, *, at_left: bool) -> Pane:
    """Return an open door as it would be shut: its face in that of the wall, on the side of its hinge on which it
    turns by less."""
    near, far = (local[0], local[1]) if at_left else (local[1], local[0])
    goes_right = bool(far[0] >= near[0])
    angle = float(np.arctan2(far[2] - near[2], abs(far[0] - near[0])))
    left = near[0] if goes_right else near[0] - seen.width
    origin = apply(wall, np.array([[left, local[0, 1], 0.0]]))[0]
    frame = wall.copy()
    frame[:3, 3] = origin
    because = f"it was seen open by {abs(np.degrees(angle)):.0f} degrees, its hinge where it meets the wall"
    return Pane(seen.node, frame, seen.width, seen.height, Hinge(goes_right, angle, because))
