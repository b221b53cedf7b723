"""Where furniture stands and how far it is open, by points of the sides of it that cameras saw.

A shut front that stands a decimetre before its place and a door that is a little open look alike to whoever asks for
one of them at a time. So every value of a joint is judged by where the furniture would stand then, and asked both ways:
what was seen should be of its surface, and the cameras should not have seen through it. A place is found by distances
from planes (point-to-plane, Chen and Medioni 1992), which slides along its sides freely and comes home in a few rounds;
nearest points alone creep by a millimetre or two a round.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scenewright.stages.kit.geometry.cameras import project
from scenewright.stages.kit.geometry.point_clouds import normals_of_neighbours
from scenewright.stages.kit.geometry.transforms import apply, inverse, transform_from_yaw
from scenewright.stages.kit.rendering.object_views import View
from scenewright.stages.plan.pose_fit import FAR, KEPT, SURE
from scipy.spatial import cKDTree

ROUNDS = 15
"""Steps of one fit; by eye."""
FEW, MANY = 500, 2000
"""Points seen that a first and a last fit go by."""
STEPS, FINE = 13, 7
"""Values of a joint that are tried over its range, and then around the best of them."""
AROUND, AROUND_OF = 16, 6000
"""Points by which a normal is told, of so many of all that were seen: far enough apart for their noise."""
LEVER = 0.1
"""A side that is turned the other way is as far as one that lies twice this far off [m]."""
GAP = 3.0
"""A seen point farther along the surface from the nearest point of it than so many of their usual distances lies beyond
an edge."""
LEAST_TOLD = 0.02
"""A way of moving of which fewer of the points tell is not gone (Zhang, Kaess and Singh 2016): a front that fills a
picture says nothing of where it stands along itself, and strays would."""
FACING = -0.2
"""Least cosine between the normal of what is seen and the way to a camera; noise and an error of place make it less
than nothing where a side is seen at a grazing angle."""
STILL = 1e-5
"""A smaller step ends a fit [m], [rad]."""

Surface = tuple[np.ndarray, np.ndarray]
"""Points (M, 3) all around and their outward normals (M, 3)."""


@dataclass(frozen=True)
class Range:
    """From where to where a joint goes."""

    name: str
    lower: float
    upper: float


@dataclass(frozen=True)
class FittedFurniture:
    """How furniture stands."""

    motion: np.ndarray
    """(4, 4) from where it is believed: a turn about the vertical and a level shift."""
    joints: dict[str, float]
    misfit: float
    """Mean distance of what was seen from the surface, plus that of the surface from what was seen behind it [m]."""


def fit_furniture(
    seen: np.ndarray,
    views: Sequence[View],
    surface_at: Callable[[dict[str, float]], Surface],
    ranges: Sequence[Range],
    believed: dict[str, float],
    allowed: Callable[[np.ndarray], bool] = lambda motion: True,
) -> FittedFurniture:
    """Return how furniture stands by points (N, 3) of it that cameras saw, and by all that these saw.

    `surface_at` joint values gives its surface where it is believed. Where it is `believed` to stand, or else where a
    joint has its stop, it stands if nothing else explains what is seen better by `SURE`. A motion (4, 4) that is not
    `allowed` is none: where little but a door is seen, furniture that is turned as far explains it as well.
    """
    eyes = np.array([view.eye for view in views])
    few_sides, many_sides = _sides(seen, eyes, FEW), _sides(seen, eyes, MANY)

    def placed(sides: Surface, values: dict[str, float], start: np.ndarray) -> FittedFurniture:
        surface = facing(surface_at(values), eyes, start)
        motion = fit_place(sides, surface, start)
        motion = motion if allowed(motion) else start
        return FittedFurniture(motion, values, misfit(sides[0], views, surface, motion))

    def best_of(
        sides: Surface, name: str, values: np.ndarray, found: FittedFurniture, starts: Sequence[np.ndarray]
    ) -> FittedFurniture:
        fits = [placed(sides, found.joints | {name: float(value)}, start) for start in starts for value in values]
        return min([found, *fits], key=lambda fit: fit.misfit)

    found = placed(few_sides, dict(believed), np.eye(4))
    for joint in ranges:
        found = best_of(
            few_sides, joint.name, np.linspace(joint.lower, joint.upper, STEPS), found, (np.eye(4), found.motion)
        )
    found = placed(many_sides, found.joints, found.motion)
    for joint in ranges:
        step = (joint.upper - joint.lower) / (STEPS - 1)
        for reach in (step, step / 2):  # place and joint come home together
            around = found.joints[joint.name] + np.linspace(-reach, reach, FINE)
            found = best_of(many_sides, joint.name, np.clip(around, joint.lower, joint.upper), found, (found.motion,))
        for resting_value in (believed[joint.name], joint.lower, joint.upper):
            resting = placed(many_sides, found.joints | {joint.name: resting_value}, found.motion)
            if resting.misfit < found.misfit + SURE:
                found = resting
                break
    surface = facing(surface_at(found.joints), eyes, np.eye(4))
    unmoved = misfit(many_sides[0], views, surface, np.eye(4))
    return FittedFurniture(np.eye(4), found.joints, unmoved) if unmoved < found.misfit + STILL else found


def fit_place(seen: Surface, surface: Surface, start: np.ndarray) -> np.ndarray:
    """Return the motion (4, 4), a turn about the vertical and a level shift, that brings a surface onto points and
    normals of it, beginning at `start` (4, 4).

    Trimmed: the nearest `KEPT` of the points count, normals counted as `LEVER` times as long. One beside the surface
    pulls along the normal there, one beyond an edge straight to it.
    """
    points, normals = surface
    beyond = _reach(cKDTree(points), points)
    tree = cKDTree(np.hstack([points, LEVER * normals]))
    motion = start.copy()
    for _ in range(ROUNDS):
        back = np.hstack([apply(inverse(motion), seen[0]), LEVER * seen[1] @ motion[:3, :3]])
        away, nearest = tree.query(back)
        nearest_rows = np.argsort(away, kind="stable")[: max(3, int(KEPT * len(back)))]
        surface_points, normal = (
            apply(motion, points[nearest[nearest_rows]]),
            normals[nearest[nearest_rows]] @ motion[:3, :3].T,
        )
        step = _level_step(surface_points, normal, seen[0][nearest_rows], beyond)
        motion = step @ motion
        if np.abs(step - np.eye(4)).max() < STILL:
            break
    return motion


def _level_step(points: np.ndarray, normals: np.ndarray, goals: np.ndarray, beyond: float) -> np.ndarray:
    """Return the turn about the vertical and level shift (4, 4) by one step of Gauss and Newton that brings points
    (N, 3) with normals (N, 3) to planes through their goals (N, 3), or to the goals where those are farther along the
    surface than `beyond` [m]."""
    offset = goals - points
    along = offset - np.einsum("ij,ij->i", offset, normals)[:, None] * normals
    over_edge = np.linalg.norm(along, axis=1) > beyond
    middle = points[:, :2].mean(axis=0)
    x, y = (points[:, :2] - middle).T
    rows = [np.column_stack([normals[:, 0], normals[:, 1], x * normals[:, 1] - y * normals[:, 0]])]
    sides = [np.einsum("ij,ij->i", offset, normals)]
    one, none = np.ones(int(over_edge.sum())), np.zeros(int(over_edge.sum()))
    rows += [np.column_stack([one, none, -y[over_edge]]), np.column_stack([none, one, x[over_edge]])]
    sides += [along[over_edge, 0], along[over_edge, 1]]
    matrix, side = np.concatenate(rows), np.concatenate(sides)
    reach = max(float(np.sqrt((x**2 + y**2).mean())), 1e-3)  # at which a turn is a shift
    matrix = matrix / (1.0, 1.0, reach)
    eigenvalues, eigenvectors = np.linalg.eigh(matrix.T @ matrix / len(points))
    certain_axes = eigenvectors[:, eigenvalues > LEAST_TOLD]
    moved = certain_axes @ ((certain_axes.T @ matrix.T @ side) / (eigenvalues[eigenvalues > LEAST_TOLD] * len(points)))
    shift_x, shift_y, turn = moved / (1.0, 1.0, reach)
    step: np.ndarray = transform_from_yaw(float(turn), np.zeros(3))
    step[:2, 3] = middle + np.array([shift_x, shift_y]) - step[:2, :2] @ middle
    return step


def facing(surface: Surface, eyes: np.ndarray, motion: np.ndarray) -> Surface:
    """Return the part of a surface, moved by a motion (4, 4), that faces one of the eyes (K, 3)."""
    points, normals = surface
    is_facing = np.zeros(len(points), dtype=bool)
    for eye in apply(inverse(motion), eyes):
        rays = eye - points
        is_facing |= np.einsum("ij,ij->i", rays, normals) > FACING * np.linalg.norm(rays, axis=1)
    return points[is_facing], normals[is_facing]


def misfit(seen: np.ndarray, views: Sequence[View], surface: Surface, motion: np.ndarray) -> float:
    """Return the mean distance [m] of points (N, 3) from a surface moved by a motion (4, 4), plus that of the surface
    from what was seen through it; each distance `FAR` at most. A point is as far off as the plane of the nearest point
    of the surface, or as that point itself where it lies beyond an edge."""
    points, normals = surface
    tree = cKDTree(points)
    back = apply(inverse(motion), seen)
    away, nearest = tree.query(back)
    beside = np.abs(np.einsum("ij,ij->i", back - points[nearest], normals[nearest]))
    along = np.sqrt(np.maximum(away**2 - beside**2, 0.0))
    outward = float(np.minimum(np.where(along < _reach(tree, points), beside, away), FAR).mean())
    behind = [_depth_behind(apply(motion, points), view) for view in views]
    in_sight = np.concatenate([depths[np.isfinite(depths)] for depths in behind]) if behind else np.zeros(0)
    return outward + (float(np.clip(in_sight, 0.0, FAR).mean()) if len(in_sight) else 0.0)


def _depth_behind(points: np.ndarray, view: View) -> np.ndarray:
    """Return how far behind points (N, 3) a picture shows something [m] (N,); nan where it shows nothing, where they
    are out of it, and where something before them hides them."""
    pixels, depth = project(apply(inverse(view.map_from_camera), points), view.picture.camera)
    height, width = view.picture.depth.shape
    at = np.rint(np.nan_to_num(pixels, nan=-1.0)).astype(int)
    inside = np.all((at >= 0) & (at < (width, height)), axis=1)
    at[~inside] = 0
    picture_depth = view.picture.depth[at[:, 1], at[:, 0]]
    behind: np.ndarray = np.where(inside & (picture_depth > 0), picture_depth - depth, np.nan)
    return np.where(behind > -FAR, behind, np.nan)


def _reach(tree: cKDTree, points: np.ndarray) -> float:
    """Return how far along the surface [m] the nearest point of it may be from a point on it."""
    return GAP * float(np.median(tree.query(points, k=2)[0][:, 1]))


def _sides(surface_points: np.ndarray, eyes: np.ndarray, most: int) -> Surface:
    """Return about `most` of the points (N, 3) that cameras at `eyes` (K, 3) saw, and the normals (N, 3) there, towards
    the nearest camera: of the plane through the points around."""
    points, cloud = _thin_out(surface_points, most), _thin_out(surface_points, AROUND_OF)
    around = cloud[cKDTree(cloud).query(points, k=min(AROUND, len(cloud)))[1]]
    normals = normals_of_neighbours(around)
    rays = eyes[cKDTree(eyes).query(points)[1]] - points
    return points, normals * np.where(np.einsum("ij,ij->i", normals, rays) < 0, -1.0, 1.0)[:, None]


def _thin_out(points: np.ndarray, most: int) -> np.ndarray:
    return points[:: max(1, len(points) // most)]
