"""Things thrown about: boxes, cans, balls and small library models put on whatever is level, by a map of heights."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import trimesh
from scenewright.stages.kit.geometry.transforms import transform_from_yaw
from scenewright.stages.kit.rendering.ray_casting import SceneRenderer

LEVEL = 0.006
"""Heights under one thing may differ by this much [m]."""
BLOCKED = 50.0
"""Height of what nothing can stand on (round or hollow tops) [m]."""
SUPPORTED_SHARE = 0.75
"""Share of a footprint that something must carry; the rest may stand over the edge."""


@dataclass
class HeightMap:
    """Height of the topmost surface on a grid."""

    origin: np.ndarray
    """(2,) centre of cell (0, 0) [m]."""
    cell: float
    """[m]"""
    height: np.ndarray
    """(NX, NY) [m]."""

    def cells_of(self, outline: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
        """Return the indices of the cells whose centres lie in a convex outline (N, 2), counter-clockwise [m]; None
        when it leaves the grid."""
        low = np.floor((outline.min(axis=0) - self.origin) / self.cell).astype(int)
        high = np.ceil((outline.max(axis=0) - self.origin) / self.cell).astype(int)
        if np.any(low < 0) or np.any(high >= self.height.shape):
            return None
        i, j = np.meshgrid(np.arange(low[0], high[0] + 1), np.arange(low[1], high[1] + 1), indexing="ij")
        points = self.origin + self.cell * np.stack([i, j], axis=-1)
        inside = np.ones(i.shape, dtype=bool)
        for start, end in zip(outline, np.roll(outline, -1, axis=0), strict=True):
            edge, offset = end - start, points - start
            inside &= edge[0] * offset[..., 1] - edge[1] * offset[..., 0] >= 0
        return (i[inside], j[inside]) if inside.any() else None

    def support(self, cells: tuple[np.ndarray, np.ndarray]) -> float | None:
        """Return the height on which a thing with this footprint stands level, or None."""
        under = self.height[cells]
        top = float(under.max())
        if top >= BLOCKED or np.mean(under > top - LEVEL) < SUPPORTED_SHARE:
            return None
        return top


def height_map(renderer: SceneRenderer, low: np.ndarray, high: np.ndarray, top: float, cell: float) -> HeightMap:
    """Return the heights seen from straight above, from height `top` [m], over the rectangle low..high (2,) [m].

    A place where the surface is not level counts as blocked.
    """
    import open3d as o3d

    count = np.maximum(np.floor((high - low) / cell).astype(int), 2)
    i, j = np.meshgrid(np.arange(count[0]), np.arange(count[1]), indexing="ij")
    places = low + cell * np.stack([i, j], axis=-1).reshape(-1, 2)
    rays = np.concatenate([places, np.full((len(places), 1), top), np.tile([0.0, 0.0, -1.0], (len(places), 1))], axis=1)
    answer = renderer.scene.cast_rays(o3d.core.Tensor.from_numpy(rays.astype(np.float32)))
    hit = answer["t_hit"].numpy()
    level = np.abs(answer["primitive_normals"].numpy()[:, 2]) > 0.995
    height = np.where(np.isfinite(hit) & level, top - hit, BLOCKED)
    return HeightMap(np.asarray(low, dtype=float), cell, height.reshape(tuple(count)))


@dataclass(frozen=True)
class Thing:
    """One thing to put down: its mesh stands on z = 0 around the origin."""

    class_name: str
    mesh: trimesh.Trimesh
    flat_top: bool
    """Whether others may stand on it."""


def put_down(
    thing: Thing, heights: HeightMap, low: np.ndarray, high: np.ndarray, random: np.random.Generator, attempts: int = 12
) -> trimesh.Trimesh | None:
    """Return the mesh of the thing where it stands, in the world frame, and raise the map there; None when no place
    was found in the rectangle low..high (2,) [m]."""
    bottom = trimesh.convex.convex_hull(thing.mesh).vertices[:, :2]
    corners = bottom[_hull_order(bottom)]
    for _ in range(attempts):
        pose = transform_from_yaw(float(random.uniform(-np.pi, np.pi)), np.array([*random.uniform(low, high), 0.0]))
        outline = corners @ pose[:2, :2].T + pose[:2, 3]
        cells = heights.cells_of(outline)
        ground = heights.support(cells) if cells is not None else None
        if ground is None:
            continue
        pose[2, 3] = ground
        mesh = thing.mesh.copy()
        mesh.apply_transform(pose)
        heights.height[cells] = ground + thing.mesh.bounds[1, 2] if thing.flat_top else BLOCKED
        return mesh
    return None


def _hull_order(points: np.ndarray) -> np.ndarray:
    from scipy.spatial import ConvexHull

    return ConvexHull(points).vertices


def primitives(random: np.random.Generator, scale: float = 1.0) -> Iterator[Thing]:
    """Yield things without end: boxes (class box), and cans, cones, balls, lying rolls, prisms and tubs (object);
    edges of 2 to 30 cm times `scale`."""
    kinds = ("box", "box", "box", "can", "can", "roll", "ball", "prism", "cone", "tub")
    while True:
        kind = kinds[int(random.integers(len(kinds)))]
        radius, height = float(random.uniform(0.02, 0.07)) * scale, float(random.uniform(0.03, 0.24)) * scale
        if kind == "box":
            edges = np.exp(random.uniform(np.log(0.025), np.log(0.28), 3)) * scale
            mesh = trimesh.creation.box(extents=edges)
        elif kind == "can":
            mesh = trimesh.creation.cylinder(radius=radius, height=height, sections=24)
        elif kind == "roll":
            mesh = trimesh.creation.cylinder(radius=radius, height=height, sections=24)
            mesh.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [0, 1, 0]))
        elif kind == "ball":
            mesh = trimesh.creation.icosphere(subdivisions=2, radius=radius)
            mesh.apply_scale([1.0, float(random.uniform(0.7, 1.0)), float(random.uniform(0.6, 1.3))])
        elif kind == "prism":
            mesh = trimesh.creation.cylinder(radius=1.3 * radius, height=height, sections=int(random.integers(3, 8)))
        elif kind == "cone":
            mesh = trimesh.creation.cone(radius=radius, height=height, sections=20)
        else:
            wall = 0.12 * radius
            mesh = trimesh.creation.annulus(radius - wall, radius, height, sections=24)
            floor = trimesh.creation.cylinder(radius=radius, height=wall, sections=24)
            floor.apply_translation([0, 0, -0.5 * height + 0.5 * wall])
            mesh = trimesh.util.concatenate([mesh, floor])
        mesh.apply_translation([0, 0, -mesh.bounds[0, 2]])
        mesh.visual.face_colors = np.array([*random.integers(20, 245, 3), 255], dtype=np.uint8)
        yield Thing("box" if kind == "box" else "object", mesh, kind in ("box", "can", "prism"))
