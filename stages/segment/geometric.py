"""Geometric segments of a depth image: regions bounded by concave creases and depth jumps.

Furrer et al. 2018 ("Incremental Object Database", the segmentation that Voxblox++ and Han 2024, section 2.3.1 use):
normals, per-pixel minimum convexity over a window, depth discontinuities, both made into one edge map, connected
components of what is left. Constants: those Han's system was run with.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import cv2
import numpy as np
from numba import prange
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.kit.compiled import compiled
from scenewright.stages.kit.geometry.cameras import back_project
from scenewright.stages.segment.normals import planes_of, surface_normals

REFERENCE_AREA = 640 * 480
"""Pixel counts among the parameters hold for images of this many pixels."""


@dataclass(frozen=True)
class GeometricSettings:
    """Constants of the convexity segmentation; see stages/segment/parameters.py for their meaning."""

    grid_columns: int = 320
    smoothing_window: int = 7
    smoothing_deviation: float = 0.009
    normal_window: int = 9
    normal_step: int = 2
    normal_distance_factor: float = 0.05
    convexity_window: int = 5
    convexity_threshold: float = 0.97
    convexity_mask_threshold: float = -0.0005
    mutual_convexity: bool = True
    discontinuity_ratio: float = 0.01
    discontinuity_window: int = 3
    opening: int = 1
    closing: int = 1
    minimum_pixels: int = 200


@dataclass(frozen=True)
class GeometricFrame:
    """Geometric segments of one frame, with what was computed on the way."""

    labels: np.ndarray
    """(H, W) int32, 0 = none, else 1..n."""
    points: np.ndarray
    """(H, W, 3) float32 [m], camera frame, of the smoothed depth; zero where depth is invalid."""
    small: np.ndarray
    """(H, W) int32 regions under the least size, 1..m, 0 elsewhere: `labels` gives them to what surrounds them, but a
    mask may know better (a chair's leg before the floor)."""
    source: np.ndarray
    """(H, W) int32 pixel of the grid that each pixel is like, -1 for none."""
    grid_normals: np.ndarray
    """(h, w, 3) float32 normals of the grid."""

    @cached_property
    def normals(self) -> np.ndarray:
        """(H, W, 3) float32 unit vectors that face the camera, zero where there is none."""
        return taken(self.grid_normals, self.source)


def smooth_depth(depth: np.ndarray, *, window: int = 7, deviation: float = 0.009) -> np.ndarray:
    """Return z-depth (H, W) float32 [m] after a bilateral filter of `window` pixels on the inverse depth.

    The noise of structured light and time of flight grows with the square of the depth, so that of the inverse depth
    is nearly constant: one `deviation` [1/m] (0.009; the noise is about 0.002, Nguyen et al. 2012) serves all ranges.
    Missing depth stays missing and takes no part. Not in the published system, whose input was smooth.
    """
    valid = depth > 0
    inverse = np.where(valid, 1 / np.where(valid, depth, 1), np.float32(-1000)).astype(np.float32)
    smooth = cv2.bilateralFilter(inverse, window, deviation, window / 3, borderType=cv2.BORDER_REPLICATE)
    return np.where(valid & (smooth > 1e-4), 1 / np.maximum(smooth, np.float32(1e-4)), 0).astype(np.float32)


Row = tuple[np.ndarray, np.ndarray, np.ndarray]


@compiled(error_model="numpy")
def _lower_by_neighbour(
    here: Row, normals: Row, there: Row, others: Row, mask_threshold: float, mutual: bool, lowest: np.ndarray
) -> None:
    """Lower the least convexity (N,) of the pixels of a row by that to one neighbour of each; points and normals as
    three (N,) each. Without branches: several pixels are looked at at a time."""
    here_x, here_y, here_z = here
    there_x, there_y, there_z = there
    normal_x, normal_y, normal_z = normals
    other_x, other_y, other_z = others
    zero = np.float32(0.0)
    for k in range(len(lowest)):
        nx, ny, nz = normal_x[k], normal_y[k], normal_z[k]
        mx, my, mz = other_x[k], other_y[k], other_z[k]
        cosine = mx * nx + my * ny + mz * nz
        dx, dy, dz = there_x[k] - here_x[k], there_y[k] - here_y[k], there_z[k] - here_z[k]
        over = dx * nx + dy * ny + dz * nz
        theirs = dx * mx + dy * my + dz * mz
        over = over - theirs if mutual else over
        # A neighbour on or below the tangent plane is convex (1); one above it counts by its normal.
        counts = (here_z[k] > zero) & (there_z[k] > zero) & (-over <= mask_threshold) & (cosine < lowest[k])
        lowest[k] = cosine if counts else lowest[k]


@compiled
def _row_of_convexity(
    points: Row, normals: Row, v: int, window: int, mask_threshold: float, mutual: bool, lowest: np.ndarray
) -> None:
    """Lower the least convexity (W,) of row v by all neighbours; coordinates are images (H, W)."""
    xs, ys, zs = points
    normal_xs, normal_ys, normal_zs = normals
    height, width = zs.shape
    half = window // 2
    for row in range(max(0, v - half), min(height, v + half + 1)):
        for du in range(-half, half + 1):
            a, b = max(0, -du), min(width, width - du)
            _lower_by_neighbour(
                (xs[v, a:b], ys[v, a:b], zs[v, a:b]),
                (normal_xs[v, a:b], normal_ys[v, a:b], normal_zs[v, a:b]),
                (xs[row, a + du : b + du], ys[row, a + du : b + du], zs[row, a + du : b + du]),
                (normal_xs[row, a + du : b + du], normal_ys[row, a + du : b + du], normal_zs[row, a + du : b + du]),
                mask_threshold,
                mutual,
                lowest[a:b],
            )


@compiled(parallel=True)
def _minimum_convexity(points: Row, normals: Row, window: int, mask_threshold: float, mutual: bool) -> np.ndarray:
    """Least convexity (H, W) of points and normals whose coordinates are images (H, W) of their own."""
    result: np.ndarray = np.ones(points[2].shape, dtype=np.float32)
    for v in prange(result.shape[0]):
        _row_of_convexity(points, normals, v, window, mask_threshold, mutual, result[v])
    return result


def minimum_convexity(
    points: np.ndarray, normals: np.ndarray, *, window: int = 5, mask_threshold: float = -0.0005, mutual: bool = True
) -> np.ndarray:
    """Return the smallest convexity of every pixel to its neighbours, (H, W) float32 in -1..1.

    `points` and `normals` (H, W, 3) float32, normals facing the camera. The convexity to a neighbour q of p is 1 where
    -(q - p).n_p > mask_threshold [m] (q lies not above the tangent plane of p), else n_p.n_q (Furrer et al. 2018).
    With `mutual` the height counts from both sides, (q - p).(n_p - n_q) (Stein et al. 2014, "LCCP"): a window that
    reaches over a ridge tilts the normals before it, and the flat beside it then seems to rise, which the one-sided
    test takes for a crease; it also takes depth noise for one.
    """
    return _minimum_convexity(planes_of(points), planes_of(normals), window, mask_threshold, mutual)


def depth_discontinuity(depth: np.ndarray, *, ratio: float = 0.01, window: int = 3) -> np.ndarray:
    """Return (H, W) bool: the depth within `window` differs from the pixel's own by more than `ratio` of it.

    `depth` (H, W) float32 [m], 0 invalid; invalid neighbours count for nothing, invalid pixels are False.
    """
    kernel = np.ones((window, window), dtype=np.uint8)
    valid = depth > 0
    farthest = cv2.dilate(depth, kernel, borderType=cv2.BORDER_REPLICATE)
    nearest = cv2.erode(np.where(valid, depth, np.float32(1e6)), kernel, borderType=cv2.BORDER_REPLICATE)
    return valid & (np.maximum(farthest - depth, depth - nearest) > ratio * depth)


def edge_map(
    depth: np.ndarray, points: np.ndarray, normals: np.ndarray, jumps: np.ndarray, settings: GeometricSettings
) -> np.ndarray:
    """Return (H, W) bool: pixels on a concave crease, on a depth jump, or without depth.

    `jumps` (H, W) bool as `depth_discontinuity` has them.
    The convex map is opened and the jumps are closed by squares of 2k+1 pixels, as the original does.
    """
    convexity = minimum_convexity(
        points,
        normals,
        window=settings.convexity_window,
        mask_threshold=settings.convexity_mask_threshold,
        mutual=settings.mutual_convexity,
    )
    convex: np.ndarray = (convexity > settings.convexity_threshold).astype(np.uint8)
    jump_mask: np.ndarray = jumps.astype(np.uint8)
    if settings.opening:
        convex = cv2.morphologyEx(convex, cv2.MORPH_OPEN, np.ones((2 * settings.opening + 1,) * 2, np.uint8))
    if settings.closing:
        jump_mask = cv2.morphologyEx(jump_mask, cv2.MORPH_CLOSE, np.ones((2 * settings.closing + 1,) * 2, np.uint8))
    return (convex == 0) | (jump_mask != 0) | (depth <= 0) | ~normals.any(axis=2)


@compiled
def _fill_edges(labels: np.ndarray, points: np.ndarray, normals: np.ndarray, ratio: float) -> None:
    """Breadth-first growth of the labels over unlabelled pixels with depth, never across a depth jump.

    A step from p to q is no jump when the depth changes by less than `ratio`, or when q lies that close to the
    tangent plane of p: surfaces seen at a grazing angle change their depth fast without ending.
    """
    height, width = labels.shape
    queue = np.empty(height * width, dtype=np.int64)
    head = 0
    tail = 0
    for v in range(height):
        for u in range(width):
            if labels[v, u] > 0:
                queue[tail] = v * width + u
                tail += 1
    while head < tail:
        v, u = queue[head] // width, queue[head] % width
        head += 1
        label = labels[v, u]
        z = points[v, u, 2]
        for side in range(4):
            row = v + (1 if side == 0 else -1 if side == 1 else 0)
            column = u + (1 if side == 2 else -1 if side == 3 else 0)
            if row < 0 or row >= height or column < 0 or column >= width:
                continue
            if labels[row, column] != 0 or points[row, column, 2] <= 0.0:
                continue
            height_over_plane = (
                (points[row, column, 0] - points[v, u, 0]) * normals[v, u, 0]
                + (points[row, column, 1] - points[v, u, 1]) * normals[v, u, 1]
                + (points[row, column, 2] - z) * normals[v, u, 2]
            )
            has_normal = normals[v, u, 2] != 0.0 or normals[v, u, 0] != 0.0 or normals[v, u, 1] != 0.0
            if abs(points[row, column, 2] - z) <= ratio * z or (has_normal and abs(height_over_plane) <= ratio * z):
                labels[row, column] = label
                queue[tail] = row * width + column
                tail += 1


@compiled
def _sole_neighbours(labels: np.ndarray, small: np.ndarray) -> np.ndarray:
    """For every small label the one large label it touches: 0 when it touches none, -1 when several."""
    height, width = labels.shape
    sole = np.zeros(small.size, dtype=np.int32)
    for v in range(height):
        for u in range(width):
            for side in range(2):
                row, column = v + side, u + 1 - side
                if row >= height or column >= width:
                    continue
                a, b = labels[v, u], labels[row, column]
                if a == b or a == 0 or b == 0 or small[a] == small[b]:
                    continue
                inner, outer = (a, b) if small[a] else (b, a)
                if sole[inner] == 0:
                    sole[inner] = outer
                elif sole[inner] != outer:
                    sole[inner] = -1
    return sole


@compiled
def _relabel(labels: np.ndarray, largest: int) -> np.ndarray:
    height, width = labels.shape
    number = np.zeros(largest + 1, dtype=np.int32)
    result = np.zeros((height, width), dtype=np.int32)
    count = 0
    for v in range(height):
        for u in range(width):
            label = labels[v, u]
            if label == 0:
                continue
            if number[label] == 0:
                count += 1
                number[label] = count
            result[v, u] = number[label]
    return result


def relabel(labels: np.ndarray) -> np.ndarray:
    """Return the labels (H, W) >= 0 renumbered 1..n in the order in which they first appear row by row; 0 stays."""
    return _relabel(labels, int(labels.max(initial=0)))


def label_regions(
    edges: np.ndarray, points: np.ndarray, normals: np.ndarray, *, minimum_pixels: int, ratio: float
) -> np.ndarray:
    """Return geometric segment labels (H, W) int32, 0 = none; the first result of `label_all_regions`."""
    return label_all_regions(edges, points, normals, minimum_pixels=minimum_pixels, ratio=ratio)[0]


def label_all_regions(
    edges: np.ndarray, points: np.ndarray, normals: np.ndarray, *, minimum_pixels: int, ratio: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return geometric segment labels (H, W) int32, 0 = none, from an edge map (H, W) bool, and the small regions.

    `points` (H, W, 3) [m], z = 0 without depth; `normals` (H, W, 3), zero where there is none. Connected
    (4-neighbour) regions without edges are segments; edge pixels join the nearest segment on their side of a depth
    jump of `ratio`; a region under `minimum_pixels` joins the one large segment that surrounds it, or is none. The
    second result (H, W) int32 holds those regions as they were, 0 elsewhere.
    """
    _, labels = cv2.connectedComponents((~edges).astype(np.uint8), connectivity=4, ltype=cv2.CV_32S)
    small = np.bincount(labels.ravel()) < minimum_pixels
    small[0] = False
    _fill_edges(labels, points, normals, ratio)
    sole = _sole_neighbours(labels, small)
    identity = np.arange(small.size)
    lookup = np.where(small, np.maximum(sole, 0), identity).astype(np.int32)
    return relabel(lookup[labels]), relabel(np.where(small, identity, 0).astype(np.int32)[labels])


def pixels_at(count: int, shape: tuple[int, ...]) -> int:
    """Return a pixel count given for 640x480 rescaled to the area of an image of `shape` (H, W), at least 1."""
    return max(1, round(count * shape[0] * shape[1] / REFERENCE_AREA))


def segment_depth(depth: np.ndarray, camera: Camera, settings: GeometricSettings | None = None) -> GeometricFrame:
    """Return the geometric segments of a z-depth image (H, W) [m], 0 invalid (Han 2024, section 2.3.1).

    They are found on a grid of every so many-th pixel, about `grid_columns` across: a map has voxels of centimetres,
    and pixels of 640 x 480 are millimetres apart. The pixels between are like the one around them nearest in depth.
    """
    settings = settings or GeometricSettings()
    depth = np.ascontiguousarray(depth, dtype=np.float32)
    if settings.smoothing_window:
        depth = smooth_depth(depth, window=settings.smoothing_window, deviation=settings.smoothing_deviation)
    step = max(1, round(depth.shape[1] / settings.grid_columns)) if settings.grid_columns else 1
    points = back_project(depth, camera)
    jumps = depth_discontinuity(depth, ratio=settings.discontinuity_ratio, window=settings.discontinuity_window)
    grid = np.ascontiguousarray(points[::step, ::step])
    grid_depth = np.ascontiguousarray(depth[::step, ::step])
    settings = on_grid(settings, step)
    normals = surface_normals(
        grid, window=settings.normal_window, step=settings.normal_step, distance_factor=settings.normal_distance_factor
    )
    labels, small = label_all_regions(
        edge_map(grid_depth, grid, normals, jumps[::step, ::step], settings),
        grid,
        normals,
        minimum_pixels=pixels_at(settings.minimum_pixels, grid_depth.shape),
        ratio=settings.discontinuity_ratio,
    )
    source = nearest_of_grid(depth, grid_depth, step, settings.discontinuity_ratio)
    return GeometricFrame(taken(labels, source), points, taken(small, source), source, normals)


def on_grid(settings: GeometricSettings, step: int) -> GeometricSettings:
    """Return the settings for every step-th pixel: windows reach as far, and depth may differ as much
    more. Opening and closing stay counts of the grid's pixels."""

    def window(pixels: int) -> int:
        return 2 * max(1, pixels // 2 // step) + 1

    return replace(
        settings,
        normal_window=window(settings.normal_window),
        normal_step=max(1, settings.normal_step // step),
        convexity_window=window(settings.convexity_window),
        discontinuity_ratio=settings.discontinuity_ratio * step,
    )


@compiled(error_model="numpy")
def nearest_of_grid(depth: np.ndarray, grid_depth: np.ndarray, step: int, ratio: float) -> np.ndarray:
    """Return for each pixel (H, W) the number of the grid's pixel (h, w) around it that is nearest in depth, int32; -1
    where none is within `ratio` x depth, and without depth."""
    height, width = depth.shape
    rows, columns = grid_depth.shape
    source = np.full((height, width), -1, dtype=np.int32)
    for v in range(height):
        above = v // step
        below = min(above + (1 if v % step else 0), rows - 1)
        for u in range(width):
            z = depth[v, u]
            if z <= 0.0:
                continue
            left = u // step
            right = min(left + (1 if u % step else 0), columns - 1)
            least = np.float32(ratio) * z
            for row in range(above, below + 1):
                for column in range(left, right + 1):
                    off = abs(grid_depth[row, column] - z)
                    if grid_depth[row, column] > 0.0 and off < least:
                        least, source[v, u] = off, row * columns + column
    return source


def taken(values: np.ndarray, source: np.ndarray) -> np.ndarray:
    """Return for each pixel what the grid (h, w) or (h, w, 3) has at its `source` (H, W), 0 for none."""
    return _taken(values.reshape(-1, *values.shape[2:]), source)


@compiled
def _taken(values: np.ndarray, source: np.ndarray) -> np.ndarray:
    result = np.zeros(source.shape + values.shape[1:], dtype=values.dtype)
    for v in range(source.shape[0]):
        for u in range(source.shape[1]):
            if source[v, u] >= 0:
                result[v, u] = values[source[v, u]]
    return result
