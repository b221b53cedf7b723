"""Pixels that no geometric segment holds but that a panoptic mask claims: thin, small and noisy things."""

from __future__ import annotations

import numpy as np
from scenewright.stages.kit.compiled import compiled
from scenewright.stages.segment.overlaps import overlap_table
from scenewright.stages.segment.panoptic import PanopticFrame


@compiled
def _components(claims: np.ndarray, depth: np.ndarray, ratio: float, minimum_pixels: int, first: int) -> np.ndarray:
    height, width = claims.shape
    result = np.zeros((height, width), dtype=np.int32)
    queue = np.empty(height * width, dtype=np.int64)
    visited = np.zeros((height, width), dtype=np.bool_)
    label = first
    for v0 in range(height):
        for u0 in range(width):
            claim = claims[v0, u0]
            if claim == 0 or visited[v0, u0]:
                continue
            head, tail = 0, 1
            queue[0] = v0 * width + u0
            visited[v0, u0] = True
            while head < tail:
                v, u = queue[head] // width, queue[head] % width
                head += 1
                for row in range(max(0, v - 1), min(height, v + 2)):
                    for column in range(max(0, u - 1), min(width, u + 2)):
                        if visited[row, column] or claims[row, column] != claim:
                            continue
                        if abs(depth[row, column] - depth[v, u]) <= ratio * depth[v, u]:
                            visited[row, column] = True
                            queue[tail] = row * width + column
                            tail += 1
            if tail >= minimum_pixels:
                for k in range(tail):
                    result[queue[k] // width, queue[k] % width] = label
                label += 1
    return result


def claim_unlabelled(
    geometric: np.ndarray, panoptic: np.ndarray, depth: np.ndarray, *, minimum_pixels: int, ratio: float = 0.02
) -> np.ndarray:
    """Return geometric labels (H, W) in which unlabelled pixels with depth that a mask claims form segments.

    `panoptic` (H, W) mask ids, 0 = none; `depth` (H, W) [m], 0 invalid. A new segment is a connected (8-neighbour)
    region of one mask without a depth jump over `ratio`, of at least `minimum_pixels`; so that what a mask took of
    the far background stays apart, and the Euclidean clustering can remove it. This is ours: the published fusion
    has only what the depth segmentation separates, and loses cups two metres away.
    """
    claims = np.where((geometric == 0) & (depth > 0), panoptic, 0).astype(np.int32)
    new = _components(claims, depth, ratio, minimum_pixels, int(geometric.max(initial=0)) + 1)
    return np.where(new > 0, new, geometric)


def claim_small(
    geometric: np.ndarray, small: np.ndarray, panoptic: PanopticFrame, *, minimum_pixels: int
) -> np.ndarray:
    """Return geometric labels (H, W) in which small regions that a thing claims leave the segment they were given to.

    `small` (H, W) regions under the least segment size, 0 elsewhere. A region leaves when more than half of it lies in
    one mask of a thing, and that mask is not the one that most of the segment lies in. Ours: the legs of a chair are
    small regions within the floor, and every frame would vote them floor.
    """
    size = np.bincount(small.ravel())
    masks = overlap_table(small, panoptic.ids)
    things = np.zeros(masks.shape[1], dtype=bool)
    things[[i for i, mask in panoptic.masks.items() if mask.is_thing and i < things.size]] = True
    claimed = np.where(things, masks, 0)
    winner = claimed.argmax(axis=1)
    enough = (2 * claimed.max(axis=1) > size) & (size >= minimum_pixels)
    enough[0] = False
    segments = overlap_table(geometric, panoptic.ids).argmax(axis=1)
    released = enough[small] & (segments[geometric] != winner[small])
    number = np.cumsum(enough) + int(geometric.max(initial=0))
    return np.where(released, number[small], geometric).astype(np.int32)
