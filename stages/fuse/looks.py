"""What the masks of each look say of the things of the finished map.

Ours. Points of a look lie on a thing of the map and in a mask. A mask speaks of the one thing that it overlaps most, by
intersection over union in the picture: the mask of a table is silent about the cup on it. The looks are kept while the
map is being built, as its things are known at the end.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scenewright.schemas.scene_parts import Camera
from scenewright.schemas.segments import FrameSegment, Witness
from scenewright.stages.fuse.integration import intrinsics_of
from scenewright.stages.fuse.names import Said
from scenewright.stages.kit.geometry.cells import row_keys
from scipy.spatial import cKDTree

SAMPLES = 8000
"""About so many points of a picture are asked."""
KEPT = 256
"""More looks than this are thinned evenly."""
FEWEST = 4
"""A look sees a thing at so many points at least."""
OVERLAP = 0.25
"""Intersection over union from which on a mask is of a thing."""
REACH = 2.0
"""A point lies on the surface that is as close [voxels]."""


@dataclass(frozen=True)
class Look:
    """Points of one picture that lie in the map's reach."""

    voxel: np.ndarray
    """(N, 3) int32: where they are [voxels]."""
    mask: np.ndarray
    """(N,) uint16: number of the mask, from 1; 0 none."""
    said: tuple[tuple[int, float], ...]
    """Class and score of each mask."""
    witnesses: tuple[tuple[Witness, ...], ...] = ()
    """Of several networks what each said of each mask."""


@dataclass
class Looks:
    """The looks of a log, thinned evenly; `voxel_size` [m]."""

    voxel_size: float
    kept: tuple[Look, ...] = ()
    every: int = 1
    """Every how many-th look is kept."""
    _seen: int = 0

    def add_frame(
        self,
        camera: Camera,
        depth: np.ndarray,
        index_image: np.ndarray,
        segments: Sequence[FrameSegment],
        world_from_camera: np.ndarray,
        *,
        near: float,
        far: float,
    ) -> None:
        """Take in a look: depth (H, W) [m], index_image (H, W) the number of the segment at each pixel, from 1 in the
        order of `segments`, 0 none; world_from_camera (4, 4). Points between `near` and `far` [m] count."""
        self._seen += 1
        if (self._seen - 1) % self.every:
            return
        self.kept += (look_of(camera, depth, index_image, segments, world_from_camera, near, far, self.voxel_size),)
        if len(self.kept) > KEPT:
            self.kept, self.every = self.kept[::2], 2 * self.every

    def said_of(self, points: Sequence[tuple[np.ndarray, np.ndarray]]) -> dict[int, Said]:
        """Return by instance what was said of it. `points`: per look the mask and the instance of each, from `on`."""
        looks: dict[int, int] = defaultdict(int)
        scores: dict[int, dict[int, float]] = defaultdict(lambda: defaultdict(float))
        networks = 1 + max((w.network for look in self.kept for mask in look.witnesses for w in mask), default=-1)
        heard: dict[tuple[int, int], dict[int, float]] = defaultdict(lambda: defaultdict(float))
        for look, (mask, thing) in zip(self.kept, points, strict=True):
            seen, spoken = spoken_of(mask, thing, len(look.said))
            for k in seen:
                looks[k] += 1
            for number, k in spoken.items():
                class_id, score = look.said[number - 1]
                scores[k][class_id] += score
                for witness in look.witnesses[number - 1] if look.witnesses else ():
                    heard[k, witness.network][witness.class_id] += witness.score
        return {
            k: Said(float(n), _shares(scores[k], n), tuple(_shares(heard[k, each], n) for each in range(networks)))
            for k, n in sorted(looks.items())
        }

    def on(self, vertices: np.ndarray, instance: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
        """Return per look the mask (N,) of every point and the instance (N,) that it lies on, 0 none.

        vertices (V, 3) [m], instance (V,), 0 none.
        """
        if not self.kept:
            return []
        if not len(vertices):
            return [(look.mask, np.zeros(len(look.mask), np.int64)) for look in self.kept]
        ends = np.cumsum([len(look.mask) for look in self.kept])
        voxels = np.concatenate([look.voxel for look in self.kept])
        _, first, cell_of = np.unique(row_keys(voxels.astype(np.int64)), return_index=True, return_inverse=True)
        cells = voxels[first]
        near, nearest = cKDTree(vertices).query(
            (cells + 0.5) * self.voxel_size, distance_upper_bound=REACH * self.voxel_size
        )
        of_cell = np.where(np.isfinite(near), instance[np.minimum(nearest, len(instance) - 1)], 0)
        things = np.split(of_cell[cell_of.ravel()], ends[:-1])
        return [(look.mask, thing) for look, thing in zip(self.kept, things, strict=True)]


def look_of(
    camera: Camera,
    depth: np.ndarray,
    index_image: np.ndarray,
    segments: Sequence[FrameSegment],
    world_from_camera: np.ndarray,
    near: float,
    far: float,
    voxel_size: float,
) -> Look:
    """Return the look of a frame; arguments as in `Looks.add_frame`. Segments of one class and instance are a mask."""
    stride = max(1, round(float(np.sqrt(depth.size / SAMPLES))))
    mask_of: dict[tuple[int, int], int] = {}
    said: list[tuple[int, float]] = []
    witnesses: list[tuple[Witness, ...]] = []
    mask_of_index = np.zeros(len(segments) + 1, np.uint16)
    for number, segment in enumerate(segments, 1):
        if segment.class_id:
            key = (segment.class_id, segment.instance)
            if key not in mask_of:
                said.append((segment.class_id, segment.score))
                witnesses.append(segment.witnesses)
                mask_of[key] = len(said)
            mask_of_index[number] = mask_of[key]
    z = depth[::stride, ::stride]
    rows, columns = np.nonzero((z >= near) & (z <= far))
    z = z[rows, columns].astype(float)
    fx, fy, cx, cy = intrinsics_of(camera)
    rays = np.stack([(stride * columns - cx) / fx, (stride * rows - cy) / fy, np.ones(len(z))], axis=1)
    points = (z[:, None] * rays) @ world_from_camera[:3, :3].T + world_from_camera[:3, 3]
    mask = mask_of_index[index_image[::stride, ::stride][rows, columns]]
    several = tuple(witnesses) if any(witnesses) else ()
    return Look(np.floor(points / voxel_size).astype(np.int32), mask, tuple(said), several)


def _shares(scores: Mapping[int, float], looks: int) -> dict[int, float]:
    """Return the mean score a look of each class, ascending."""
    return {c: min(score / looks, 1.0) for c, score in sorted(scores.items())}


def spoken_of(mask: np.ndarray, thing: np.ndarray, masks: int) -> tuple[list[int], dict[int, int]]:
    """Return the things that a look saw, and {mask: the thing that it speaks of}.

    mask (N,) from 1 to `masks`, thing (N,): what each point lies in and on, 0 none.
    """
    things, place = np.unique(thing, return_inverse=True)
    shared = np.zeros((masks + 1, len(things)))
    np.add.at(shared, (mask, place.ravel()), 1)
    union = shared.sum(axis=0)[None] + shared.sum(axis=1)[:, None] - shared
    seen = (shared.sum(axis=0) >= FEWEST) & (things > 0)
    overlap = np.where(seen, shared / np.maximum(union, 1), 0.0)
    spoken = {}
    for m in range(1, masks + 1) if len(things) else ():
        best = int(overlap[m].argmax())
        if overlap[m, best] >= OVERLAP:
            spoken[m] = int(things[best])
    return things[seen].tolist(), spoken
