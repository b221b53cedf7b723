"""Collisions between placed models, and min-conflicts over the candidates (Han 2024, section 2.4.4)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import fcl
import numpy as np

from stages.cad.model_surfaces import ModelSurface, to_world
from stages.cad.shapes import Placement

CONTACTS = 20


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
        moved = tuple(fcl.CollisionObject(shape, place) for shape, place in zip(self.shapes, places, strict=True))
        return Solid(self.low + offset, self.high + offset, self.shapes, moved)


@dataclass(frozen=True)
class Penetration:
    """The deepest contact of two solids."""

    depth: float
    """[m], 0 when they are apart."""
    direction: np.ndarray
    """(3,) unit, from the first towards the second."""


APART = Penetration(0.0, np.array([0.0, 0.0, 1.0]))


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


def placed_solid(placement: Placement, surface: ModelSurface) -> Solid:
    """Return the convex collision pieces of a placed model, ready for collision queries."""
    return convex_solid(placed_pieces(placement, surface))


def placed_pieces(placement: Placement, surface: ModelSurface) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return vertices (V, 3) in the world and faces (F, 3) of the convex collision pieces of a placed model."""
    return [(to_world(placement, v), f) for v, f in surface.posed_pieces(placement.shape.joints)]


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


@dataclass(frozen=True)
class Selection:
    """Result of min-conflicts."""

    choice: tuple[int, ...]
    """Index of the candidate of each object."""
    conflicts_before: int
    """Colliding pairs with the first candidate of every object."""
    conflicts_after: int
    steps: int


def min_conflicts(
    counts: list[int],
    depth: Callable[[int, int, int, int], float],
    *,
    tolerance: float,
    iterations: int,
    random: np.random.Generator,
) -> Selection:
    """Choose one candidate per object such that no pair interpenetrates (min-conflicts, [MJP92] in the thesis).

    `counts`: number of candidates of each object, best first; `depth(i, a, j, b)`: penetration [m] of candidate a of
    object i and candidate b of object j, 0 for pairs that may touch. Every step takes a random object in conflict and
    gives it the candidate with the smallest summed penetration; equal ones fall to the better candidate. Returns the
    best choice met, which is the first one again when nothing is better.
    """
    choice = [0] * len(counts)

    def colliding(selected: list[int]) -> list[tuple[int, int, float]]:
        conflicts = []
        for i in range(len(selected)):
            for j in range(i + 1, len(selected)):
                value = depth(i, selected[i], j, selected[j])
                if value > tolerance:
                    conflicts.append((i, j, value))
        return conflicts

    pairs = colliding(choice)
    before = len(pairs)
    best, best_rank = list(choice), (len(pairs), sum(pair[2] for pair in pairs))
    steps = 0
    while pairs and steps < iterations:
        steps += 1
        conflicted = sorted({k for pair in pairs for k in pair[:2]})
        i = conflicted[int(random.integers(len(conflicted)))]
        sums = []
        for a in range(counts[i]):
            values = [depth(i, a, j, choice[j]) for j in range(len(counts)) if j != i]
            sums.append(sum(value for value in values if value > tolerance))
        choice[i] = int(np.argmin(np.round(sums, 6)))
        pairs = colliding(choice)
        rank = (len(pairs), sum(pair[2] for pair in pairs))
        if rank < best_rank:
            best, best_rank = list(choice), rank
    return Selection(tuple(best), before, best_rank[0], steps)
