"""From detected boxes to masks, with the help of the depth: the cup in the box and not the table under it."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

INSIDE_SHARE = 0.6
"""A geometric segment with this share of its pixels in a box is a part of the detected thing."""
SURFACE_SHARE = 0.35
"""The same for things that consist of one large face, of which a detector often boxes a part (table, bed)."""
RING_FACTOR = 1.6
"""The support of a thing is measured in a ring around its box, up to this many times its size."""
TOP_CLEARANCE = 0.03
"""Height over a table's top from which on nothing is part of the table [m]."""


@dataclass(frozen=True)
class FrameGeometry:
    """What box_mask looks at, all (H, W, ...)."""

    labels: np.ndarray
    """Geometric segments, 0 = none."""
    points: np.ndarray
    """[m], camera frame."""
    available: np.ndarray
    """bool: there is depth."""
    normals: np.ndarray
    """Camera frame."""
    world_from_camera: np.ndarray | None
    """(4, 4), None without a pose."""
    segment_pixels: np.ndarray
    """(n + 1,) available pixels of every segment."""


def frame_geometry(
    labels: np.ndarray, points: np.ndarray, normals: np.ndarray, world_from_camera: np.ndarray | None
) -> FrameGeometry:
    """Prepare a frame; all arrays (H, W, ...), camera frame."""
    available = points[..., 2] > 0
    pixels = np.bincount(labels[available], minlength=int(labels.max(initial=0)) + 1)
    return FrameGeometry(labels, points, available, normals, world_from_camera, pixels)


def box_mask(
    box: np.ndarray, geometry: FrameGeometry, *, large_face: bool = False, flat_topped: bool = False
) -> np.ndarray:
    """Return the mask (H, W) bool of the thing that a detector boxed (x0, y0, x1, y1); empty when there is none.

    Geometric segments mostly inside the box are parts of the thing. From a segment that reaches out of the box (the
    table under a cup that no crease separates) only the points that rise over its plane are taken, the plane being
    fitted around the box. Of all that, the largest Euclidean cluster stays, points in the middle of the box counting
    twice. `large_face` is for things like tables, `flat_topped` removes what stands on the top.
    """
    height, width = geometry.labels.shape
    x0, y0, x1, y1 = _pixel_box(box, width, height)
    mask = np.zeros((height, width), dtype=bool)
    if x1 <= x0 or y1 <= y0:
        return mask
    window = (slice(y0, y1), slice(x0, x1))
    labels, available = geometry.labels[window], geometry.available[window]
    inside = np.bincount(labels[available], minlength=geometry.segment_pixels.size)
    foreground = np.zeros(labels.shape, dtype=bool)
    for label in np.flatnonzero(inside):
        share = inside[label] / geometry.segment_pixels[label]
        of_label = available & (labels == label)
        if label and (
            share >= INSIDE_SHARE or (large_face and share >= SURFACE_SHARE and inside[label] > 0.2 * labels.size)
        ):
            foreground |= of_label
        elif inside[label] >= 0.03 * labels.size:
            foreground |= of_label & _over_support(int(label), (x0, y0, x1, y1), geometry)
    if flat_topped and geometry.world_from_camera is not None:
        foreground &= ~_not_of_table(foreground, window, geometry)
    if foreground.any():
        mask[window] = _main_cluster(foreground, geometry.points[window])
    return mask


def _pixel_box(box: np.ndarray, width: int, height: int) -> tuple[int, int, int, int]:
    x0, y0, x1, y1 = (int(round(float(value))) for value in box)
    return max(0, x0), max(0, y0), min(width, x1), min(height, y1)


def _over_support(label: int, box: tuple[int, int, int, int], geometry: FrameGeometry) -> np.ndarray:
    """Return which pixels of the box rise towards the camera over the plane that the segment forms around the box."""
    height, width = geometry.labels.shape
    x0, y0, x1, y1 = box
    grow_x, grow_y = (RING_FACTOR - 1) / 2 * (x1 - x0) + 4, (RING_FACTOR - 1) / 2 * (y1 - y0) + 4
    u0, v0, u1, v1 = _pixel_box(np.array([x0 - grow_x, y0 - grow_y, x1 + grow_x, y1 + grow_y]), width, height)
    ring = geometry.labels[v0:v1, u0:u1] == label
    ring &= geometry.available[v0:v1, u0:u1]
    ring[y0 - v0 : y1 - v0, x0 - u0 : x1 - u0] = False
    support = geometry.points[v0:v1, u0:u1][ring].astype(float)
    nothing = np.zeros((y1 - y0, x1 - x0), dtype=bool)
    if len(support) < 40:
        return nothing
    support = support[:: max(1, len(support) // 2000)]
    center, normal, residual = _fit_trimmed_plane(support)
    depth = geometry.points[y0:y1, x0:x1, 2]
    noise = 0.008 + 0.004 * depth**2
    if residual > 0.01 + 0.004 * float(center[2]) ** 2:
        return nothing  # The surroundings are no plane: nothing can be said.
    if normal @ center > 0:
        normal = -normal
    return (geometry.points[y0:y1, x0:x1] - center) @ normal > noise


def _fit_trimmed_plane(points: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Return centre, normal and root mean square residual [m] of a plane, after dropping the worst points twice."""
    for keep in (0.8, 0.8, 1.0):
        center = points.mean(axis=0)
        centred = points - center
        normal = np.linalg.eigh(centred.T @ centred)[1][:, 0]
        distance = np.abs(centred @ normal)
        if keep < 1:
            points = points[distance <= np.quantile(distance, keep)]
    return center, normal, float(np.sqrt((distance**2).mean()))


def _not_of_table(foreground: np.ndarray, window: tuple[slice, slice], geometry: FrameGeometry) -> np.ndarray:
    """Return which foreground pixels lie over the table's top, or lower but outside of what the top covers."""
    assert geometry.world_from_camera is not None
    turn, place = geometry.world_from_camera[:3, :3], geometry.world_from_camera[:3, 3]
    world, up = geometry.points[window] @ turn.T + place, geometry.normals[window] @ turn[2]
    heights = world[..., 2]
    level = foreground & (up > 0.9)
    if not level.any() or level.sum() < 0.1 * foreground.sum():
        return np.zeros_like(foreground)
    values = heights[level]
    bins = np.floor((values - values.min()) / 0.02).astype(int)
    votes = np.convolve(np.bincount(bins), np.ones(3), mode="same")
    peak = int(np.argmax(votes))
    top = float(np.median(values[np.abs(bins - peak) <= 1]))
    over = heights > top + TOP_CLEARANCE
    surface = level & (np.abs(heights - top) < TOP_CLEARANCE)
    below = foreground & (heights < top - 0.08)
    outside = np.zeros_like(foreground)
    if surface.sum() >= 20 and below.any():
        outside[below] = _distance_outside(world[below][:, :2], world[surface][::4, :2]) > 0.05
    return over | outside


def _distance_outside(points: np.ndarray, covered: np.ndarray) -> np.ndarray:
    """Return how far points (N, 2) lie outside the convex hull of `covered` (M, 2) [m], negative within; the distance
    is to the hull's side lines, which is exact beside a side and too small around a corner."""
    hull = cv2.convexHull(covered.astype(np.float32))[:, 0].astype(float)
    along = np.roll(hull, -1, axis=0) - hull
    length = np.maximum(np.linalg.norm(along, axis=1), 1e-9)
    outward = np.stack([along[:, 1], -along[:, 0]], axis=1) / length[:, None]
    if np.einsum("ij,ij->i", outward, hull - hull.mean(axis=0)).sum() < 0:
        outward = -outward
    return (points @ outward.T - np.einsum("ij,ij->i", outward, hull)).max(axis=1)


def _grid_cells(points: np.ndarray, size: float) -> tuple[np.ndarray, int]:
    """Return for every point (N, 3) the number (0..n-1) of its occupied grid cell of edge `size` [m], and n.

    Cells are numbered by x, then y, then z. A table of all cells of the bounding box is much faster than sorting.
    """
    cell = np.floor((points - points.min(axis=0)) / size).astype(np.int64)
    shape = cell.max(axis=0) + 1
    key = (cell[:, 0] * shape[1] + cell[:, 1]) * shape[2] + cell[:, 2]
    if int(shape.prod()) > 20_000_000:
        return np.unique(key, return_inverse=True)[1], int(np.unique(key).size)
    occupied = np.zeros(int(shape.prod()), dtype=bool)
    occupied[key] = True
    number = np.cumsum(occupied) - 1
    return number[key], int(occupied.sum())


def _main_cluster(foreground: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return the foreground pixels (h, w) of the heaviest Euclidean cluster; the middle of the window counts twice."""
    rows, columns = np.nonzero(foreground)
    cloud = points[rows, columns].astype(float)
    low, high = np.percentile(cloud, [10, 90], axis=0)
    extent = float(np.linalg.norm(high - low))
    distance = float(np.clip(0.15 * extent, 0.03, 0.12))
    cell_of, count = _grid_cells(cloud, distance / 2)
    counts = np.bincount(cell_of, minlength=count)
    centers = np.stack([np.bincount(cell_of, cloud[:, k]) / counts for k in range(3)], axis=1)
    pairs = cKDTree(centers).query_pairs(distance, output_type="ndarray")
    graph = coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(count, count))
    cluster = connected_components(graph, directed=False)[1][cell_of]
    height, width = foreground.shape
    middle = (np.abs(rows - height / 2) < 0.3 * height) & (np.abs(columns - width / 2) < 0.3 * width)
    best = int(np.argmax(np.bincount(cluster, 1.0 + middle)))
    result = np.zeros_like(foreground)
    result[rows[cluster == best], columns[cluster == best]] = True
    return result
