"""Things as convex pieces, and how deep two of them lie in each other (FCL)."""

from __future__ import annotations

from dataclasses import dataclass

import fcl
import numpy as np

CONTACTS = 20
"""Most contacts of two pieces that FCL returns."""


@dataclass(frozen=True)
class Solid:
    """Convex pieces of a placed model, ready for collision queries."""

    low: np.ndarray
    """(P, 3) bounds of each piece [m]."""
    high: np.ndarray
    shapes: tuple[fcl.Convex, ...]
    objects: tuple[fcl.CollisionObject, ...]

    def shifted(self, offset: np.ndarray) -> Solid:
        """Return the solid moved by `offset` (3,) [m]; the shapes are shared."""
        places = [fcl.Transform(each.getTranslation() + offset) for each in self.objects]
        moved = tuple(
            fcl.CollisionObject(shape, transform) for shape, transform in zip(self.shapes, places, strict=True)
        )
        return Solid(self.low + offset, self.high + offset, self.shapes, moved)


@dataclass(frozen=True)
class Penetration:
    """The deepest contact of two solids."""

    depth: float
    """[m], 0 when they are apart."""
    direction: np.ndarray
    """(3,) unit, from the first towards the second."""


APART = Penetration(0.0, np.array([0.0, 0.0, 1.0]))
"""Result for solids that do not meet."""


def convex_solid(pieces: list[tuple[np.ndarray, np.ndarray]]) -> Solid:
    """Return a solid of convex pieces, each vertices (V, 3) in the world frame and faces (F, 3)."""
    shapes, low, high = [], [], []
    for vertices, faces in pieces:
        table = np.concatenate([np.full((len(faces), 1), 3), faces], axis=1).astype(np.int32).ravel()
        shapes.append(fcl.Convex(np.ascontiguousarray(vertices), len(faces), table))
        low.append(vertices.min(axis=0))
        high.append(vertices.max(axis=0))
    objects = tuple(fcl.CollisionObject(shape) for shape in shapes)
    return Solid(np.array(low).reshape(-1, 3), np.array(high).reshape(-1, 3), tuple(shapes), objects)


def penetration(a: Solid, b: Solid) -> Penetration:
    """Return the deepest contact between the convex pieces of two solids (FCL, GJK and EPA)."""
    deepest = APART
    if len(a.objects) == 0 or len(b.objects) == 0:
        return deepest
    meet = np.all(a.low[:, None] < b.high[None], axis=2) & np.all(b.low[None] < a.high[:, None], axis=2)
    for i, j in np.argwhere(meet):
        # How far b's box has to go to leave a's along each axis, forwards or backwards: no pair is deeper than that.
        forwards, backwards = a.high[i] - b.low[j], b.high[j] - a.low[i]
        away = np.minimum(forwards, backwards)
        axis = int(np.argmin(away))
        if away[axis] <= deepest.depth:
            continue
        result = fcl.CollisionResult()
        request = fcl.CollisionRequest(num_max_contacts=CONTACTS, enable_contact=True)
        if fcl.collide(a.objects[i], b.objects[j], request, result):
            contact = max(result.contacts, key=lambda c: c.penetration_depth)
            depth, direction = float(contact.penetration_depth), np.array(contact.normal, dtype=float)
            if depth > away[axis]:
                # EPA stops early on deep contacts and overestimates.
                depth = float(away[axis])
                direction = np.eye(3)[axis] * (1.0 if forwards[axis] <= backwards[axis] else -1.0)
            if depth > deepest.depth:
                deepest = Penetration(depth, direction)
    return deepest
