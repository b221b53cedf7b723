"""Which voxels of a log were full and later empty, or the other way round, and when.

Every frame votes on every voxel that it sees: full near the measured depth, empty well before it. A voxel is believed
to be full or empty when `frames_seen` more frames said so than the opposite, and changes when the opposite is believed
later. What lies behind the measured depth is not seen, so that what was hidden and comes into sight is no change.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import cv2
import numba
import numpy as np
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.kit.compiled import compiled

NEAREST = 0.3
"""Nearer depth is not used [m]."""
NOISE = 0.005
"""Depth is trusted within the voxel's half diagonal and this times its square [m]: three deviations of a Kinect."""
EDGE = 5
"""A voxel is empty only where all depth in a window of so many pixels is behind it: edges of things flicker."""
NEAREST_VOXEL = 0.2
"""Voxels whose middle is nearer to the camera are not asked [m]; by eye."""
MOST_FLIPS = 3
"""Voxels that change oftener say nothing."""


@dataclass
class Watched:
    """A grid of voxels (X, Y, Z) and what is known of each."""

    origin: np.ndarray
    """(3,) corner of the grid [m]."""
    edge: float
    shape: tuple[int, int, int]
    votes: np.ndarray = field(init=False)
    """int8: full is positive."""
    belief: np.ndarray = field(init=False)
    """int8: 1 full, -1 empty, 0 not known."""
    flips: np.ndarray = field(init=False)
    first_full: np.ndarray = field(init=False)
    """int32: first frame that saw it full; -1: none."""
    last_full: np.ndarray = field(init=False)
    last_empty: np.ndarray = field(init=False)
    left: np.ndarray = field(init=False)
    """int32 (X, Y, Z, 2): last frame that saw it full before it was empty, and that in which it is believed to be
    empty; -1."""
    came: np.ndarray = field(init=False)
    """int32 (X, Y, Z, 2): the same of a voxel that was empty and became full."""

    def __post_init__(self) -> None:
        self.votes = np.zeros(self.shape, dtype=np.int8)
        self.belief = np.zeros(self.shape, dtype=np.int8)
        self.flips = np.zeros(self.shape, dtype=np.int8)
        self.first_full = np.full(self.shape, -1, dtype=np.int32)
        self.last_full = np.full(self.shape, -1, dtype=np.int32)
        self.last_empty = np.full(self.shape, -1, dtype=np.int32)
        self.left = np.full((*self.shape, 2), -1, dtype=np.int32)
        self.came = np.full((*self.shape, 2), -1, dtype=np.int32)

    def look(
        self, depth: np.ndarray, camera: Camera, world_from_camera: np.ndarray, frame: int, far: float, least: int
    ) -> None:
        """Let a frame vote. `depth` (H, W) [m], 0 invalid, is used up to `far` [m]; `least`: votes for a belief."""
        usable = np.where((depth > NEAREST) & (depth < far), depth, np.float32(np.inf)).astype(np.float32)
        nearest = cv2.erode(usable, np.ones((EDGE, EDGE), np.uint8))
        rotation = world_from_camera[:3, :3].T
        shift = rotation @ (self.origin + 0.5 * self.edge - world_from_camera[:3, 3])
        _vote(
            self.votes,
            self.belief,
            self.flips,
            self.first_full,
            self.last_full,
            self.last_empty,
            self.left,
            self.came,
            self.edge * rotation,
            shift,
            np.array([camera.fx, camera.fy, camera.cx, camera.cy]),
            usable,
            nearest,
            0.87 * self.edge,
            frame,
            least,
        )

    def cells(self, points: np.ndarray) -> np.ndarray:
        """Return the cells (N, 3) of points (N, 3) [m], those outside moved to the nearest inside."""
        indices = np.floor((points - self.origin) / self.edge).astype(int)
        return np.asarray(np.clip(indices, 0, np.array(self.shape) - 1))

    @property
    def moved_away(self) -> np.ndarray:
        """(X, Y, Z) bool: full first, empty later."""
        is_moved: np.ndarray = (self.left[..., 0] >= 0) & (self.flips <= MOST_FLIPS)
        return is_moved

    @property
    def moved_in(self) -> np.ndarray:
        """(X, Y, Z) bool: empty first, full later."""
        is_moved: np.ndarray = (self.came[..., 0] >= 0) & (self.flips <= MOST_FLIPS)
        return is_moved


@compiled
def _in_sight(
    steps: np.ndarray, shift: np.ndarray, intrinsics: np.ndarray, height: int, width: int, i: int, j: int, count: int
) -> tuple[int, int]:
    """Return from and to which of the `count` voxels of a row (i, j) any can lie in the image, one more at either end.

    Along a row depth and pixel times depth are linear, and so is each border of the image.
    """
    fx, fy, cx, cy = intrinsics
    x, y, z = (
        shift[0] + steps[0, 0] * i + steps[0, 1] * j,
        shift[1] + steps[1, 0] * i + steps[1, 1] * j,
        shift[2] + steps[2, 0] * i + steps[2, 1] * j,
    )
    dx, dy, dz = steps[0, 2], steps[1, 2], steps[2, 2]
    start, end = 0, count
    for value, slope in (
        (z - NEAREST_VOXEL, dz),
        (fx * x + (cx + 0.5) * z, fx * dx + (cx + 0.5) * dz),
        ((width - cx - 0.5) * z - fx * x, (width - cx - 0.5) * dz - fx * dx),
        (fy * y + (cy + 0.5) * z, fy * dy + (cy + 0.5) * dz),
        ((height - cy - 0.5) * z - fy * y, (height - cy - 0.5) * dz - fy * dy),
    ):
        if slope == 0.0:
            end = end if value >= 0.0 else start
            continue
        border = min(max(-value / slope, -2.0), count + 2.0)
        if slope > 0.0:
            start = max(start, int(np.floor(border)) - 1)
        else:
            end = min(end, int(np.ceil(border)) + 2)
    return start, end


@compiled(parallel=True, nogil=True)
def _vote(  # noqa: PLR0913
    votes: np.ndarray,
    belief: np.ndarray,
    flips: np.ndarray,
    first_full: np.ndarray,
    last_full: np.ndarray,
    last_empty: np.ndarray,
    left: np.ndarray,
    came: np.ndarray,
    steps: np.ndarray,
    shift: np.ndarray,
    intrinsics: np.ndarray,
    depth: np.ndarray,
    nearest: np.ndarray,
    half: float,
    frame: int,
    least: int,
) -> None:
    height, width = depth.shape
    fx, fy, cx, cy = intrinsics
    for i in numba.prange(votes.shape[0]):  # every voxel for itself
        for j in range(votes.shape[1]):
            start, end = _in_sight(steps, shift, intrinsics, height, width, i, j, votes.shape[2])
            for k in range(start, end):
                z = shift[2] + steps[2, 0] * i + steps[2, 1] * j + steps[2, 2] * k
                if z < NEAREST_VOXEL:
                    continue
                u = int(np.floor(fx * (shift[0] + steps[0, 0] * i + steps[0, 1] * j + steps[0, 2] * k) / z + cx + 0.5))
                if u < 0 or u >= width:
                    continue
                v = int(np.floor(fy * (shift[1] + steps[1, 0] * i + steps[1, 1] * j + steps[1, 2] * k) / z + cy + 0.5))
                if v < 0 or v >= height or not np.isfinite(depth[v, u]):
                    continue
                reach = half + NOISE * z * z
                if abs(depth[v, u] - z) <= reach:
                    last_full[i, j, k] = frame
                    if first_full[i, j, k] < 0:
                        first_full[i, j, k] = frame
                    votes[i, j, k] = min(least, votes[i, j, k] + 1)
                    if votes[i, j, k] == least and belief[i, j, k] != 1:
                        if belief[i, j, k] == -1:
                            came[i, j, k, 0], came[i, j, k, 1] = last_empty[i, j, k], frame
                            flips[i, j, k] += 1
                        belief[i, j, k] = 1
                elif nearest[v, u] - z > 2.0 * reach:
                    last_empty[i, j, k] = frame
                    votes[i, j, k] = max(-least, votes[i, j, k] - 1)
                    if votes[i, j, k] == -least and belief[i, j, k] != -1:
                        if belief[i, j, k] == 1:
                            left[i, j, k, 0], left[i, j, k, 1] = last_full[i, j, k], frame
                            flips[i, j, k] += 1
                        belief[i, j, k] = -1
