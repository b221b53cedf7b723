"""The triangle nearest to a point: a tree of boxes over triangles, compiled (Ericson 2005, sections 5.1.5 and 6.2)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scenewright.stages.kit.compiled import compiled

LEAF = 4
"""Most triangles of a leaf; by eye."""
DEPTH = 64
"""Most boxes that wait while a tree is searched: trees are cut in halves, so that they are no deeper than this."""


class TriangleTree(NamedTuple):
    """Triangles in the order of their leaves, and the boxes over them, the root first; or several, one behind another
    (`forest_of`)."""

    corners: np.ndarray
    """(F, 3, 3) [m]."""
    normals: np.ndarray
    """(F, 3), unit length; 0 for a triangle without area."""
    numbers: np.ndarray
    """(F,) index into the faces that the tree was made of."""
    low: np.ndarray
    """(B, 3) [m]."""
    high: np.ndarray
    """(B, 3) [m]."""
    links: np.ndarray
    """(B, 2): of a leaf its first triangle and how many; of others the second child, and 0: the first is the next."""


class NearestTriangle(NamedTuple):
    """Where points come closest to triangles."""

    distance: np.ndarray
    """(N,) [m]; infinite without triangles."""
    points: np.ndarray
    """(N, 3) [m]."""
    normals: np.ndarray
    """(N, 3) of the triangles."""
    numbers: np.ndarray
    """(N,) of the triangles."""


def tree_of(vertices: np.ndarray, faces: np.ndarray, numbers: np.ndarray | None = None) -> TriangleTree:
    """Return the tree over triangles: vertices (V, 3) [m], faces (F, 3), `numbers` (F,) by which they are told
    (default: their order)."""
    corners = np.ascontiguousarray(np.asarray(vertices, dtype=float)[np.asarray(faces).reshape(-1, 3)])
    numbers = np.arange(len(corners)) if numbers is None else np.asarray(numbers)
    order, low, high, links = _boxes(corners, corners.mean(axis=1))
    corners = corners[order]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.divide(normals, lengths, out=np.zeros_like(normals), where=lengths > 0.0)
    return TriangleTree(corners, normals, numbers[order].astype(np.int64), low, high, links)


def forest_of(trees: Sequence[TriangleTree]) -> tuple[TriangleTree, np.ndarray]:
    """Return trees as one, and the root of each of them in it (T,)."""
    boxes = np.cumsum([0, *(len(tree.low) for tree in trees)])
    triangles = np.cumsum([0, *(len(tree.corners) for tree in trees)])
    links = [tree.links.copy() for tree in trees]
    for own, box, triangle in zip(links, boxes[:-1], triangles[:-1], strict=True):
        own[:, 0] += np.where(own[:, 1] > 0, triangle, box)
    whole = TriangleTree(*map(np.concatenate, zip(*trees, strict=True)))
    return whole._replace(links=np.concatenate(links)), boxes[:-1]


def nearest_triangles(tree: TriangleTree, points: np.ndarray, root: int = 0) -> NearestTriangle:
    """Return where points (N, 3) [m] come closest to the triangles of a tree, or of that of a forest with this root."""
    points = np.ascontiguousarray(points, dtype=float)
    distance, foot, rows = _nearest(tree, root, points)
    if len(tree.corners) == 0:
        return NearestTriangle(distance, foot, np.zeros_like(foot), rows)
    return NearestTriangle(distance, foot, tree.normals[rows], tree.numbers[rows])


@compiled
def _boxes(corners: np.ndarray, middles: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return order (F,), low and high (B, 3), links (B, 2) of triangles (F, 3, 3) with these middles (F, 3): halves
    along the longest side of their middles' box, ties in the order of the triangles."""
    count = len(corners)
    order = np.arange(count)
    most = max(1, 2 * count)
    low, high, links = np.full((most, 3), np.inf), np.full((most, 3), -np.inf), np.zeros((most, 2), np.int64)
    stack = np.zeros((DEPTH, 3), np.int64)  # first triangle, behind the last one, box that waits for its second child
    stack[0] = 0, count, -1
    waiting, made = 1, 0
    while waiting > 0:
        waiting -= 1
        first, behind, parent = stack[waiting]
        box, made = made, made + 1
        if parent >= 0:
            links[parent, 0] = box
        for row in order[first:behind]:
            for corner in range(3):
                for axis in range(3):
                    low[box, axis] = min(low[box, axis], corners[row, corner, axis])
                    high[box, axis] = max(high[box, axis], corners[row, corner, axis])
        if behind - first <= LEAF:
            links[box] = first, behind - first
            continue
        longest, length = 0, -1.0
        for axis in range(3):
            along = middles[order[first:behind], axis]
            if along.max() - along.min() > length:
                longest, length = axis, along.max() - along.min()
        sorting = np.argsort(middles[order[first:behind], longest], kind="mergesort")
        order[first:behind] = order[first:behind][sorting]
        half = (first + behind) // 2
        stack[waiting] = half, behind, box
        stack[waiting + 1] = first, half, -1
        waiting += 2
    return order, low[:made].copy(), high[:made].copy(), links[:made].copy()


@compiled
def _nearest(tree: TriangleTree, root: int, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return distances (N,), nearest points (N, 3) and rows of the tree's triangles (N,)."""
    distance, foot, rows = np.full(len(points), np.inf), np.zeros((len(points), 3)), np.zeros(len(points), np.int64)
    if len(tree.corners) == 0:
        return distance, foot, rows
    candidate = np.empty(3)
    for k in range(len(points)):
        distance[k], rows[k] = nearest_below(tree, root, points[k], np.inf, foot[k], candidate)
    return distance, foot, rows


@compiled
def nearest_below(
    tree: TriangleTree, root: int, point: np.ndarray, limit: float, foot: np.ndarray, candidate: np.ndarray
) -> tuple[float, int]:
    """Return distance [m] and row of the triangle below a root nearest to a point (3,), `limit` and -1 where none is
    closer than that; writes the nearest point to `foot` (3,). `candidate` (3,) is room to work in."""
    boxes, reach = np.empty(DEPTH, np.int64), np.empty(DEPTH)
    best, row = limit * limit, -1
    boxes[0], reach[0] = root, _to_box(tree.low[root], tree.high[root], point)
    waiting = 1
    while waiting > 0:
        waiting -= 1
        if reach[waiting] >= best:
            continue
        box = boxes[waiting]
        first, count = tree.links[box]
        if count > 0:
            for triangle in range(first, first + count):
                squared = _to_triangle(tree.corners[triangle], point, candidate)
                if squared < best:
                    best, row = squared, triangle
                    foot[:] = candidate
            continue
        near, far = box + 1, first
        to_near, to_far = _to_box(tree.low[near], tree.high[near], point), _to_box(tree.low[far], tree.high[far], point)
        if to_far < to_near:
            near, far, to_near, to_far = far, near, to_far, to_near
        boxes[waiting], reach[waiting] = far, to_far
        boxes[waiting + 1], reach[waiting + 1] = near, to_near
        waiting += 2
    return (np.sqrt(best), row) if row >= 0 else (limit, row)


@compiled
def _to_box(low: np.ndarray, high: np.ndarray, point: np.ndarray) -> float:
    """Return the squared distance [m^2] of a point (3,) from a box."""
    total = 0.0
    for axis in range(3):
        outside = max(low[axis] - point[axis], point[axis] - high[axis], 0.0)
        total += outside * outside
    return total


@compiled
def _to_triangle(corners: np.ndarray, point: np.ndarray, foot: np.ndarray) -> float:
    """Return the squared distance [m^2] of a point (3,) from a triangle (3, 3); writes the nearest point to `foot`
    (Ericson 2005, section 5.1.5)."""
    d1 = d2 = d3 = d4 = d5 = d6 = 0.0
    for axis in range(3):
        a, b, c, p = corners[0, axis], corners[1, axis], corners[2, axis], point[axis]
        d1 += (b - a) * (p - a)
        d2 += (c - a) * (p - a)
        d3 += (b - a) * (p - b)
        d4 += (c - a) * (p - b)
        d5 += (b - a) * (p - c)
        d6 += (c - a) * (p - c)
    v = w = 0.0  # shares of the second and third corner
    va, vb, vc = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
    if d1 <= 0.0 and d2 <= 0.0:
        pass
    elif d3 >= 0.0 and d4 <= d3:
        v = 1.0
    elif vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        v = _share(d1, d1 - d3)
    elif d6 >= 0.0 and d5 <= d6:
        w = 1.0
    elif vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        w = _share(d2, d2 - d6)
    elif va <= 0.0 and d4 - d3 >= 0.0 and d5 - d6 >= 0.0:
        w = _share(d4 - d3, (d4 - d3) + (d5 - d6))
        v = 1.0 - w
    else:
        v, w = _share(vb, va + vb + vc), _share(vc, va + vb + vc)
    total = 0.0
    for axis in range(3):
        a = corners[0, axis]
        foot[axis] = a + v * (corners[1, axis] - a) + w * (corners[2, axis] - a)
        total += (point[axis] - foot[axis]) ** 2
    return total


@compiled
def _share(part: float, whole: float) -> float:
    """Return part / whole, 0 for a triangle without area."""
    return part / whole if whole > 0.0 else 0.0
