"""Key frames of a posed log: those that show new surface, or known surface from a new direction, the sharpest nearby.

The path of each camera is cut where it has turned or moved far enough. Of each piece the sharpest frame is asked what
it adds to the frames that were chosen before it; one that adds little is left out.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import cv2
import numpy as np
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.ingest.source import Entry, LoadedFrame, Unusable
from scenewright.stages.kit.formats.foxglove import decode_color, millimetres_to_depth
from scenewright.stages.kit.geometry.cameras import back_project
from scenewright.stages.kit.geometry.surface_samples import STRIDE_ANGLE
from scenewright.stages.kit.geometry.transforms import apply

TURN = np.radians(5.0)
"""A piece of a path ends where the camera has turned so far [rad]: a sixth of a usual field of view. By eye."""
MOVE = 0.05
"""... or has moved by this share of the median depth: 6 degrees of parallax. By eye."""
USUAL_DEPTH = 2.0
"""Median depth before any frame was looked at, and of frames without depth [m]."""
LOOKED_AT = 3
"""Frames of a piece of the path that are compared for sharpness: ends and middle."""
EDGE = 0.1
"""Edge of the cells in which seen surface is counted [m]; by eye."""
FARTHEST = 5.0
"""Farther depth is not counted [m]: its samples lie farther apart than cells do."""
DIRECTIONS = 2
"""Steps into which each coordinate of a direction is cut, on either side of 0: some 30 degrees each."""
ENOUGH = 3
"""Looks at a cell from one direction after which another adds nothing: masks vote, and one vote is none. By eye."""
ADDS = 0.1
"""Least share of a frame's cells that are new for it to be chosen. By eye."""
SHARPNESS_WIDTH = 320
"""Width at which sharpness is measured [pixels]: noise of single pixels is none."""


def key_frames(entries: Iterable[Entry], cameras: Mapping[str, Camera]) -> list[Entry]:
    """Return the entries that are key frames, in their order.

    Every entry needs a pose (4, 4). An entry that cannot be loaded is left to whoever writes it, and counts as blurred.
    """
    seen = {name: SeenSurface() for name in cameras}
    pieces = {name: Piece() for name in cameras}
    chosen: list[Entry] = []
    place: dict[int, int] = {}
    for entry in entries:
        place[id(entry)] = len(place)
        piece = pieces[entry.camera_name]
        if piece.entries and not piece.reaches(entry):
            chosen += _chosen(piece, seen[entry.camera_name], cameras[entry.camera_name])
            piece.entries.clear()
        piece.entries.append(entry)
    for name, piece in pieces.items():
        chosen += _chosen(piece, seen[name], cameras[name])
    return sorted(chosen, key=lambda entry: place[id(entry)])


@dataclass
class Piece:
    """A piece of a camera's path: frames that see nearly the same."""

    entries: list[Entry] = field(default_factory=list)
    depth: float = USUAL_DEPTH
    """Median depth of the frame that was looked at last [m]."""

    def reaches(self, entry: Entry) -> bool:
        """Whether a frame is as near to the first one as the frames of a piece are."""
        first, other = self.entries[0].world_from_camera, entry.world_from_camera
        assert first is not None and other is not None
        cosine = (np.trace(first[:3, :3].T @ other[:3, :3]) - 1) / 2
        moved = float(np.linalg.norm(first[:3, 3] - other[:3, 3]))
        return bool(cosine > np.cos(TURN)) and moved < MOVE * self.depth


@dataclass
class SeenSurface:
    """How often each cell of surface was seen from each direction, by the frames that were chosen."""

    keys: np.ndarray = field(default_factory=lambda: np.zeros(0, np.int64))
    """(N,) ascending, of cells with directions."""
    looks: np.ndarray = field(default_factory=lambda: np.zeros(0, np.int32))

    def new_share(self, keys: np.ndarray) -> float:
        """Return the share of keys (N,), ascending, that were not seen often enough; 1 of none."""
        at = np.searchsorted(self.keys, keys)
        found = at < len(self.keys)
        found[found] = self.keys[at[found]] == keys[found]
        enough = np.zeros(len(keys), bool)
        enough[found] = self.looks[at[found]] >= ENOUGH
        return 1.0 - float(enough.mean()) if len(keys) else 1.0

    def add(self, keys: np.ndarray) -> None:
        """Count one more look at each of keys (N,), ascending."""
        joined = np.concatenate([self.keys, keys])
        looks = np.concatenate([self.looks, np.ones(len(keys), np.int32)])
        self.keys, place = np.unique(joined, return_inverse=True)
        self.looks = np.bincount(place, weights=looks, minlength=len(self.keys)).astype(np.int32)


def cells_seen(depth: np.ndarray, camera: Camera, world_from_camera: np.ndarray) -> np.ndarray:
    """Return the keys (N,) int64, ascending, of the cells that depth (H, W) [m, 0 invalid] shows, each with the
    direction from which it is seen."""
    stride = max(1, round(STRIDE_ANGLE * camera.fx))
    points = back_project(depth, camera, stride).reshape(-1, 3)
    points = apply(world_from_camera, points[(points[:, 2] > 0) & (points[:, 2] < FARTHEST)].astype(np.float64))
    towards = world_from_camera[:3, 3] - points
    towards /= np.maximum(np.linalg.norm(towards, axis=1, keepdims=True), 1e-9)
    cells = np.floor(points / EDGE).astype(np.int64) & 0xFFFF  # wraps after three kilometres
    bins = np.rint(towards * DIRECTIONS).astype(np.int64) + DIRECTIONS
    key = (cells[:, 0] << 48) ^ (cells[:, 1] << 32) ^ (cells[:, 2] << 16)
    return np.unique(key ^ (bins @ np.array([64, 8, 1])))


def sharpness(color: np.ndarray) -> float:
    """Return the variance of the Laplacian of a picture (H, W, 3) uint8, made small: the larger, the sharper.

    Pech-Pacheco et al. 2000. Compares pictures of nearly the same view alone.
    """
    height, width = color.shape[:2]
    size = (min(width, SHARPNESS_WIDTH), max(1, round(height * min(1.0, SHARPNESS_WIDTH / width))))
    grey = cv2.cvtColor(cv2.resize(color, size, interpolation=cv2.INTER_AREA), cv2.COLOR_RGB2GRAY)
    return float(cv2.Laplacian(grey, cv2.CV_32F).var())


def _chosen(piece: Piece, seen: SeenSurface, camera: Camera) -> Iterator[Entry]:
    """Yield the sharpest frame of a piece where it adds something."""
    looked_at = [piece.entries[k] for k in _spread(len(piece.entries))]
    if not looked_at:
        return
    loaded = [_loaded(entry) for entry in looked_at]
    sharp = [_sharpness(frame) for frame in loaded]
    best = int(np.argmax(sharp))
    entry, frame = looked_at[best], loaded[best]
    if frame is None or frame.depth is None:
        yield entry
        return
    depth = millimetres_to_depth(frame.depth)
    if depth.any():
        piece.depth = float(np.median(depth[depth > 0]))
    assert entry.world_from_camera is not None
    keys = cells_seen(depth, camera, entry.world_from_camera)
    if seen.new_share(keys) >= ADDS:
        seen.add(keys)
        yield entry


def _spread(count: int) -> Sequence[int]:
    """Return up to LOOKED_AT numbers below `count`, spread evenly."""
    return np.unique(np.linspace(0, count - 1, min(count, LOOKED_AT)).astype(int)).tolist() if count else []


def _loaded(entry: Entry) -> LoadedFrame | None:
    try:
        return entry.load()
    except Unusable:
        return None


def _sharpness(frame: LoadedFrame | None) -> float:
    """Return the sharpness of a frame's picture; 0 without one, less of a frame that cannot be loaded."""
    if frame is None:
        return -1.0
    color = decode_color(frame.color) if isinstance(frame.color, bytes) else frame.color
    return 0.0 if color is None else sharpness(color)
