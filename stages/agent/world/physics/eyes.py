"""Pictures become things: masks of a segmentation backend, points of each mask, and one object of all views of it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.agent.world.physics.shapes import COLORS, STAIN
from scenewright.stages.kit.acting.eyes.masks import Mask
from scenewright.stages.kit.geometry.point_clouds import normals_of_neighbours
from scenewright.stages.kit.rendering.object_views import Picture, cloud
from scipy.spatial import cKDTree

HEAD = Camera(width=160, height=120, fx=100.0, fy=100.0, cx=79.5, cy=59.5)
"""Intrinsics of the head camera."""
WRIST = Camera(width=240, height=180, fx=175.0, fy=175.0, cx=119.5, cy=89.5)
"""Intrinsics of the wrist camera."""
NEAR_BY = Camera(width=240, height=180, fx=350.0, fy=350.0, cx=119.5, cy=89.5)
"""The middle of the wrist camera's full resolution, of which looks at a whole surface take every second pixel."""
FIXTURE = "fixture"
"""What an oracle calls what stands on furniture or hangs on walls and is no thing: it is in the way."""
LEAST_POINTS = 16
"""Least points of an object (ConceptGraphs)."""
VOXEL, OVERLAP = 0.025, 0.5
"""Edge of a cell in which two clouds overlap [m], and the share from which they are one (ConceptGraphs)."""
COINCIDE = 0.03
"""Corners of the boxes of one thing that was taken for two classes are this near to each other [m]."""
NEIGHBOURS = 14
"""Points of which a surface normal is made."""
STAINED = 0.04
"""Share of a mask that is brown on a used cup."""


@dataclass(frozen=True)
class Surface:
    """An object of the robot's own map, map frame [m]."""

    label: str
    points: np.ndarray
    normals: np.ndarray
    color: str
    stain: float
    views: int
    cut: bool = False
    """Whether the edge of the picture cuts it in every view: it may be larger and its middle elsewhere."""

    @cached_property
    def low(self) -> np.ndarray:
        """Lower corner (3,)."""
        return np.percentile(self.points, 2, axis=0)

    @cached_property
    def high(self) -> np.ndarray:
        """Upper corner (3,)."""
        return np.percentile(self.points, 98, axis=0)

    @cached_property
    def middle(self) -> np.ndarray:
        """Of the box around it (3,)."""
        return (self.low + self.high) / 2

    def same_as(self, other: Surface) -> bool:
        """Whether two surfaces of different classes are of one thing: boxes that all but coincide."""
        return bool(
            np.all(np.abs(self.low - other.low) < COINCIDE) and np.all(np.abs(self.high - other.high) < COINCIDE)
        )


def seen_in(picture: Picture, masks: list[Mask], map_from_camera: np.ndarray, eye: np.ndarray) -> list[Surface]:
    """Return what one picture shows of each mask."""
    surfaces = []
    for entry in masks:
        points = cloud(picture, entry.mask, map_from_camera)
        if len(points) < LEAST_POINTS:
            continue
        pixels = picture.color[entry.mask].astype(float) / 255
        normals, cut = outward(points, eye), _at_an_edge(entry.mask)
        surfaces.append(Surface(entry.label, points, normals, color_name(pixels), stain_share(pixels), 1, cut))
    return surfaces


def _at_an_edge(mask: np.ndarray) -> bool:
    return bool(mask[[0, -1]].any() or mask[:, [0, -1]].any())


def outward(points: np.ndarray, eye: np.ndarray) -> np.ndarray:
    """Return surface normals (N, 3) of points, from the plane of their neighbours, towards the camera."""
    count = min(NEIGHBOURS, len(points))
    normals = normals_of_neighbours(points[cKDTree(points).query(points, k=count)[1]])
    towards = np.einsum("ni,ni->n", normals, eye - points) < 0
    normals[towards] *= -1
    return normals


def fuse(pieces: list[Surface]) -> list[Surface]:
    """Return one object for all pieces of a class that overlap, as ConceptGraphs joins what several views show."""
    objects: list[Surface] = []
    for piece in pieces:
        best = max(range(len(objects)), key=lambda k: overlap(piece, objects[k]), default=None)
        if best is None or overlap(piece, objects[best]) < OVERLAP:
            objects.append(piece)
            continue
        matched = objects[best]
        objects[best] = Surface(
            matched.label,
            np.concatenate([matched.points, piece.points]),
            np.concatenate([matched.normals, piece.normals]),
            matched.color,
            max(matched.stain, piece.stain),
            matched.views + 1,
            matched.cut and piece.cut,
        )
    return objects


def overlap(a: Surface, b: Surface) -> float:
    """Return the share of the smaller cloud that lies within a cell of the other one; 0 for different classes."""
    if a.label != b.label or np.any(a.low > b.high + VOXEL) or np.any(b.low > a.high + VOXEL):
        return 0.0
    small, large = (a, b) if len(a.points) < len(b.points) else (b, a)
    return float((cKDTree(large.points).query(small.points[::3])[0] < VOXEL).mean())


def color_name(pixels: np.ndarray) -> str:
    """Return the name of the colour that is nearest to the median of sRGB pixels (N, 3), light and dark aside."""
    middle = np.median(pixels, axis=0)
    spread = float(middle.max() - middle.min())
    if spread < 0.15:
        return "white"
    chroma = (middle - middle.min()) / spread
    away = {}
    for name, color in COLORS.items():
        reference = np.array(color)
        if np.ptp(reference) > 0.15:
            away[name] = float(np.abs(chroma - (reference - reference.min()) / np.ptp(reference)).sum())
    return min(away, key=lambda name: away[name])


def stain_share(pixels: np.ndarray) -> float:
    """Return the share of sRGB pixels (N, 3) that have the chroma of a stain and are dark."""
    stain_color = np.array(STAIN) / max(STAIN)
    bright = pixels.max(axis=1)
    close = np.abs(pixels / np.maximum(bright, 1e-3)[:, None] - stain_color).max(axis=1) < 0.25
    return float((close & (bright < 0.6)).mean())
