"""The joint that takes the surface a part left to the surface it came to.

Two priors about furniture, and nothing about classes: what slides moves at right angles to its front, and what turns
has its hinge in the plane of its leaf. So every pair of planes, one of what was left and one of what came, says one
joint: parallel planes a slide along their normal, others a turn about the line in which they meet. The pair is chosen
by how much of each face lies on the other state's surface when it is moved. (Ditto, Jiang et al. 2022, takes two
states as well, and learns parts and joints; here nothing is learned.)
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Literal, Protocol

import numpy as np
from scenewright.stages.kit.geometry.planes import fit_plane, plane_rectangle, ransac_planes
from scenewright.stages.kit.geometry.point_clouds import clusters, thin_to_grid
from scenewright.stages.kit.geometry.transforms import apply, inverse, transform_from
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

PLANE = 0.015
"""Points so near to a plane are of it [m]."""
LEAST_SHARE, MOST_PLANES = 0.06, 6
"""Least share of a state's points in a face, and most faces of a state; by eye."""
LEAST_AREA = 0.015
"""A face smaller than this is no leaf [m^2]."""
GRID = 0.02
"""Faces are compared by points this far apart [m]."""
NEAR = 0.04
"""Moved points lie on the other state's surface within this: the far side of a leaf may be what is seen of it [m]."""
PARALLEL, SQUARE = np.radians(10.0), np.radians(12.0)
"""Planes that slide into each other are parallel up to the first; those that turn differ by the second or more."""
LEAST_SLIDE = 0.04
"""Least way of a drawer [m]."""
HINGE = 0.25
"""The hinge is at most so far from the leaf's edge, in that state in which more of it was seen [m]."""
MOST_STAYS = 0.4
"""A place of which more is still as it was before was not left [share]."""
FARTHEST = 1.5
"""The middle of a leaf moves at most so far [m]."""
LEAST_ARM = 0.02
"""Least distance of a leaf's middle from its axis [m]."""
EXPLAINED = 0.3
"""A region of which a joint explains this share changed by it."""
PIECE = 0.1
"""A face may have gaps so wide (a shelf behind, a handle) [m]."""


@dataclass(frozen=True)
class Cloud:
    """Points (N, 3) of one state [m], world frame, and normals (N, 3) that face the camera."""

    points: np.ndarray
    normals: np.ndarray

    def without(self, gone: np.ndarray) -> Cloud:
        """Return it without the rows of a mask (N,)."""
        return Cloud(self.points[~gone], self.normals[~gone])


@dataclass(frozen=True)
class Face:
    """A flat piece of a state."""

    normal: np.ndarray
    """(3,), to the side from which it was seen."""
    points: np.ndarray
    """(K, 3) on a grid [m]."""
    corners: np.ndarray
    """(4, 3) of its rectangle [m]."""

    @property
    def middle(self) -> np.ndarray:
        """(3,) [m]."""
        return np.asarray(self.corners.mean(axis=0))


@dataclass(frozen=True)
class Motion:
    """A joint, and how far it moved."""

    type: Literal["revolute", "prismatic"]
    axis: np.ndarray
    origin: np.ndarray
    travel: float

    @property
    def after_from_before(self) -> np.ndarray:
        """(4, 4): moves points of the first state to the second."""
        if self.type == "prismatic":
            return transform_from(np.eye(3), self.travel * self.axis)
        turn = Rotation.from_rotvec(self.travel * self.axis).as_matrix()
        return transform_from(turn, self.origin - turn @ self.origin)


@dataclass(frozen=True)
class FoundJoint:
    """A motion, the faces that say it, and how well it explains both states."""

    motion: Motion
    leaf: Face
    leaf_after: Face
    overlap: float
    left: tuple[int, ...]
    """Which of the regions that something left it explains, the leaf's own first."""
    came: tuple[int, ...]
    """Which of those that something came to."""


class Room(Protocol):
    """What is known of the room beside the surface that changed. Regions are numbered as the clouds are."""

    def at_once(self, left: int, came: int) -> bool:
        """Whether a region that something left and one that something came to changed at one time."""
        ...

    def was_full(self, points: np.ndarray, left: int, came: int) -> np.ndarray:
        """Whether (N,) bool something was near points (N, 3) before these regions changed."""
        ...

    def came_full(self, points: np.ndarray) -> np.ndarray:
        """Whether (N,) bool something came to, or near to, points (N, 3)."""
        ...

    def stays_full(self, points: np.ndarray, left: int, came: int) -> np.ndarray:
        """Whether (N,) bool something is at points (N, 3) that was there before and is seen there afterwards."""
        ...


def find_joints(
    before: Sequence[Cloud], after: Sequence[Cloud], room: Room, minimum_overlap: float, random: np.random.Generator
) -> Iterator[FoundJoint]:
    """Yield the joints that explain what changed, best first: what one explains is taken away, and the rest is looked
    at again.

    `before`, `after`: the surface of each region that something left, or came to; `minimum_overlap`: less is no joint.
    """
    clouds = [list(before), list(after)]
    flat = [[faces(cloud, random) for cloud in state] for state in clouds]
    while True:
        best = best_joint(flat, room)
        if best is None or best[2] < minimum_overlap:
            return
        motion, (row, leaf, column, face), overlap = best
        gone = [
            [explained(motion, leaf, face, cloud.points, later=later == 1) for cloud in state]
            for later, state in enumerate(clouds)
        ]
        left, came = (
            tuple(k for k, rows in enumerate(state) if len(rows) and np.mean(rows) > EXPLAINED) for state in gone
        )
        yield FoundJoint(motion, leaf, face, overlap, first_of(row, left), first_of(column, came))
        for later, state in enumerate(gone):
            for k, rows in enumerate(state):
                if rows.any():
                    clouds[later][k] = clouds[later][k].without(rows)
                    flat[later][k] = faces(clouds[later][k], random)


def first_of(number: int, numbers: tuple[int, ...]) -> tuple[int, ...]:
    """Return the numbers with one of them, or another, at their head."""
    return (number, *(candidate for candidate in numbers if candidate != number))


def best_joint(
    flat: Sequence[Sequence[Sequence[Face]]], room: Room
) -> tuple[Motion, tuple[int, Face, int, Face], float] | None:
    """Return the motion with the largest overlap, which faces say it, and the overlap; None where no two faces do.

    The face of the later state has to lie on surface of the earlier one when it is moved back, which is gone or hidden
    by now, and what is seen to be gone has to lie where something came.
    """
    best: tuple[Motion, tuple[int, Face, int, Face], float] | None = None
    for (row, leaves), (column, others) in product(enumerate(flat[0]), enumerate(flat[1])):
        if not room.at_once(row, column):
            continue
        for leaf, face in product(leaves, others):
            motion = motion_between(leaf, face)
            if motion is None:
                continue
            moved_back = apply(inverse(motion.after_from_before), face.points)
            forward = float(np.mean(room.came_full(apply(motion.after_from_before, leaf.points))))
            back = float(np.mean(room.was_full(moved_back, row, column)))
            stays = float(np.mean(room.stays_full(moved_back, row, column)))
            overlap = 0.0 if stays > MOST_STAYS else min(forward, back)
            if best is None or overlap > best[2]:
                best = (motion, (row, leaf, column, face), overlap)
    return best


def faces(cloud: Cloud, random: np.random.Generator) -> list[Face]:
    """Return the flat pieces of a state, large ones first."""
    points, normals = thin_to_grid(cloud.points, cloud.normals, GRID)
    if len(points) < 20:
        return []
    pieces = []
    for plane in ransac_planes(
        points, normals, distance_threshold=PLANE, random=random, minimum_share=LEAST_SHARE, maximum_planes=MOST_PLANES
    ):
        piece = points[plane.inliers]
        label = clusters(piece, PIECE)
        piece, facing = piece[label == 0], normals[plane.inliers][label == 0].mean(axis=0)
        if len(piece) * GRID**2 < LEAST_AREA:
            continue
        dense = cloud.points[np.abs((cloud.points - piece.mean(axis=0)) @ plane.normal) < 2 * PLANE]
        dense = dense[cKDTree(piece).query(dense)[0] < GRID]
        normal = robust_normal(dense, plane.normal)
        normal = normal if normal @ facing > 0 else -normal
        pieces.append(Face(normal, piece, plane_rectangle(piece, normal)[0]))
    return pieces


def robust_normal(points: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Return the unit normal of the plane through points (N, 3) near one of `normal`, without the outermost of them."""
    offset = -float(np.median(points @ normal))
    for _ in range(3):
        distance = np.abs(points @ normal + offset)
        inliers = points[distance <= max(0.005, 2.5 * 1.4826 * float(np.median(distance)))]
        if len(inliers) < 10:
            break
        normal, offset = fit_plane(inliers)
    return normal


def motion_between(leaf: Face, face: Face) -> Motion | None:
    """Return the motion that takes the plane of a leaf to that of a face of the later state, None where none does."""
    if float(np.linalg.norm(leaf.middle - face.middle)) > FARTHEST:
        return None
    angle = float(np.arccos(np.clip(leaf.normal @ face.normal, -1.0, 1.0)))
    if angle < PARALLEL:
        normal = leaf.normal + face.normal
        normal /= np.linalg.norm(normal)
        slide = float(normal @ (face.middle - leaf.middle))
        if abs(slide) < LEAST_SLIDE:
            return None
        return Motion("prismatic", np.sign(slide) * normal, leaf.middle, abs(slide))
    if min(angle, np.pi - angle) < SQUARE:
        return None
    axis = np.cross(leaf.normal, face.normal)
    axis /= np.linalg.norm(axis)
    middle = 0.5 * (leaf.middle + face.middle)
    origin = np.linalg.solve(
        np.stack([leaf.normal, face.normal, axis]),
        np.array([leaf.normal @ leaf.middle, face.normal @ face.middle, axis @ middle]),
    )
    arms, nearest = [], []
    for piece in (leaf, face):
        arm = piece.middle - origin
        arm -= (arm @ axis) * axis
        length = float(np.linalg.norm(arm))
        reach = (piece.points - origin) @ (arm / max(length, 1e-9))
        nearest.append(float(np.percentile(reach, 2)))
        if length < LEAST_ARM or nearest[-1] < -HINGE:
            return None
        arms.append(arm / length)
    if min(nearest) > HINGE:
        return None
    turn = float(np.arctan2(axis @ np.cross(arms[0], arms[1]), arms[0] @ arms[1]))
    return Motion("revolute", np.sign(turn) * axis, origin, abs(turn))


def explained(motion: Motion, leaf: Face, face: Face, points: np.ndarray, *, later: bool) -> np.ndarray:
    """Return (N,) bool: which points (N, 3) of the first or (`later`) the second state a joint explains. What a drawer
    brought along, its box, is explained too."""
    if not len(points):
        return np.zeros(0, dtype=bool)
    reach = 2 * NEAR
    if not later:
        moved = apply(motion.after_from_before, points)
        is_explained: np.ndarray = (cKDTree(leaf.points).query(points)[0] < reach) | (
            cKDTree(face.points).query(moved)[0] < reach
        )
    else:
        is_explained = cKDTree(face.points).query(points)[0] < reach
    return is_explained | between_fronts(motion, leaf, points)


def between_fronts(motion: Motion, leaf: Face, points: np.ndarray) -> np.ndarray:
    """Return (N,) bool: which points lie between the two places of a drawer's front."""
    if motion.type == "revolute":
        return np.zeros(len(points), dtype=bool)
    away = (points - leaf.middle) @ motion.axis
    inside: np.ndarray = (away > -NEAR) & (away < motion.travel + 2 * NEAR)
    for edge in np.diff(leaf.corners, axis=0)[:2]:
        length = float(np.linalg.norm(edge))
        inside &= np.abs((points - leaf.middle) @ edge) < length * (length / 2 + NEAR)
    return inside
