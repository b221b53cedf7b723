"""Which Gaussians reach which tile, and blending tile by tile, forward and backward, compiled.

Every parallel loop writes to places of its own, and sums over tiles are made in their order, so that the number of
threads changes no bit.
"""

from __future__ import annotations

import math

import numba
import numpy as np
from scenewright.stages.kit.compiled import compiled
from scenewright.stages.kit.rendering.splatting import rasterizer

TILE = 16
"""Edge of a tile [px]."""
SMALLEST_ALPHA = np.float32(rasterizer.SMALLEST_ALPHA)
LARGEST_ALPHA = np.float32(rasterizer.LARGEST_ALPHA)
LEAST_TRANSMITTANCE = np.float32(rasterizer.LEAST_TRANSMITTANCE)
ONE, HALF = np.float32(1.0), np.float32(0.5)
"""Numbers of single precision, so that nothing is computed in double."""


@compiled
def list_tiles(order, reach, columns, rows):  # type: ignore[no-untyped-def]
    """Return starts (T + 1,) and members (M,): the Gaussians of each tile, row by row, in the given order, front first.

    `reach` (N, 4) is that of `projection.project`; Gaussians that reach no pixel are in no tile.
    """
    starts = np.zeros(columns * rows + 1, np.int64)
    for n in range(len(reach)):
        if reach[n, 0] <= reach[n, 1] and reach[n, 2] <= reach[n, 3]:
            for row in range(reach[n, 2] // TILE, reach[n, 3] // TILE + 1):
                for column in range(reach[n, 0] // TILE, reach[n, 1] // TILE + 1):
                    starts[row * columns + column + 1] += 1
    for k in range(1, len(starts)):
        starts[k] += starts[k - 1]
    members = np.empty(starts[-1], np.int32)
    filled = starts[:-1].copy()
    for n in order:
        if reach[n, 0] <= reach[n, 1] and reach[n, 2] <= reach[n, 3]:
            for row in range(reach[n, 2] // TILE, reach[n, 3] // TILE + 1):
                for column in range(reach[n, 0] // TILE, reach[n, 1] // TILE + 1):
                    tile = row * columns + column
                    members[filled[tile]] = n
                    filled[tile] += 1
    return starts, members


@compiled(parallel=True, fastmath=True)
def blend(starts, members, flat, reach, values, background, width, height):  # type: ignore[no-untyped-def]
    """Return channels (H, W, C), transmittance left (H, W), and how far down its tile's list each pixel looked (H, W).

    `flat` and `reach` are those of `projection.project`, `values` (N, C), `background` (C,), all float32.
    """
    channels = values.shape[1]
    columns, rows = (width + TILE - 1) // TILE, (height + TILE - 1) // TILE
    image = np.zeros((height, width, channels), np.float32)
    transmittance = np.ones((height, width), np.float32)
    looked = np.zeros((height, width), np.int32)
    for tile in numba.prange(columns * rows):
        x0, y0 = (tile % columns) * TILE, (tile // columns) * TILE
        x1, y1 = min(x0 + TILE, width) - 1, min(y0 + TILE, height) - 1
        clear = (x1 - x0 + 1) * (y1 - y0 + 1)
        for y in range(y0, y1 + 1):
            for x in range(x0, x1 + 1):
                looked[y, x] = starts[tile + 1] - starts[tile]
        for k in range(starts[tile], starts[tile + 1]):
            if clear == 0:
                break
            n = members[k]
            u, v, a, b, c, opacity = flat[n, 0], flat[n, 1], flat[n, 2], flat[n, 3], flat[n, 4], flat[n, 5]
            for y in range(max(y0, reach[n, 2]), min(y1, reach[n, 3]) + 1):
                dy = np.float32(y) - v
                for x in range(max(x0, reach[n, 0]), min(x1, reach[n, 1]) + 1):
                    dx = np.float32(x) - u
                    power = HALF * (a * dx * dx + c * dy * dy) + b * dx * dy
                    if power > flat[n, 6]:
                        continue
                    if looked[y, x] <= k - starts[tile]:
                        continue
                    alpha = min(LARGEST_ALPHA, opacity * np.float32(math.exp(-power)))
                    if alpha < SMALLEST_ALPHA:
                        continue
                    before = transmittance[y, x]
                    after = before * (ONE - alpha)
                    if after <= LEAST_TRANSMITTANCE:
                        looked[y, x] = k - starts[tile]
                        clear -= 1
                        continue
                    weight = alpha * before
                    for channel in range(channels):
                        image[y, x, channel] += weight * values[n, channel]
                    transmittance[y, x] = after
        for y in range(y0, y1 + 1):
            for x in range(x0, x1 + 1):
                for channel in range(channels):
                    image[y, x, channel] += transmittance[y, x] * background[channel]
    return image, transmittance, looked


@compiled(parallel=True, fastmath=True)
def blend_back(starts, members, flat, reach, values, left, looked, image_gradients, behind):  # type: ignore[no-untyped-def]
    """Return gradients (M, 6 + C) by u v a b c, opacity and values, of every entry of `members`.

    `left` and `looked` are those of `blend`; `image_gradients` (H, W, C); `behind` (H, W): derivative by the
    transmittance left, times it. Both `left` and `behind` are used up.
    """
    height, width, channels = image_gradients.shape
    columns, rows = (width + TILE - 1) // TILE, (height + TILE - 1) // TILE
    gradients = np.zeros((len(members), 6 + channels), np.float32)
    for tile in numba.prange(columns * rows):
        x0, y0 = (tile % columns) * TILE, (tile // columns) * TILE
        x1, y1 = min(x0 + TILE, width) - 1, min(y0 + TILE, height) - 1
        deepest = 0
        for y in range(y0, y1 + 1):
            for x in range(x0, x1 + 1):
                deepest = max(deepest, looked[y, x])
        for k in range(starts[tile] + deepest - 1, starts[tile] - 1, -1):
            n = members[k]
            u, v, a, b, c, opacity = flat[n, 0], flat[n, 1], flat[n, 2], flat[n, 3], flat[n, 4], flat[n, 5]
            row = gradients[k]
            for y in range(max(y0, reach[n, 2]), min(y1, reach[n, 3]) + 1):
                dy = np.float32(y) - v
                for x in range(max(x0, reach[n, 0]), min(x1, reach[n, 1]) + 1):
                    dx = np.float32(x) - u
                    power = HALF * (a * dx * dx + c * dy * dy) + b * dx * dy
                    if power > flat[n, 6]:
                        continue
                    if looked[y, x] <= k - starts[tile]:
                        continue
                    strength = np.float32(math.exp(-power))
                    alpha = min(LARGEST_ALPHA, opacity * strength)
                    if alpha < SMALLEST_ALPHA:
                        continue
                    before = left[y, x] / (ONE - alpha)
                    weight = alpha * before
                    color_gradient = np.float32(0.0)
                    for channel in range(channels):
                        gradient = image_gradients[y, x, channel]
                        color_gradient += gradient * values[n, channel]
                        row[6 + channel] += weight * gradient
                    by_alpha = before * color_gradient - behind[y, x] / (ONE - alpha)
                    behind[y, x] += weight * color_gradient
                    left[y, x] = before
                    if opacity * strength < LARGEST_ALPHA:
                        by_power = -alpha * by_alpha
                        row[0] -= by_power * (a * dx + b * dy)
                        row[1] -= by_power * (b * dx + c * dy)
                        row[2] += by_power * HALF * dx * dx
                        row[3] += by_power * dx * dy
                        row[4] += by_power * HALF * dy * dy
                        row[5] += by_alpha * strength
    return gradients


@compiled
def gathered(members, gradients, count):  # type: ignore[no-untyped-def]
    """Return the sums (N, D) float64 of gradients (M, D) over the entries of each Gaussian."""
    sums = np.zeros((count, gradients.shape[1]))
    for k in range(len(members)):
        for column in range(gradients.shape[1]):
            sums[members[k], column] += gradients[k, column]
    return sums
