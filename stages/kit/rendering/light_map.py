"""Light on every surface, computed once for a static scene: area lights with soft shadows, sky, and one bounce.

The sample points lie on a regular barycentric grid over every triangle, so a hit is shaded by three look-ups. This is
gathering in the sense of Immel et al. 1986 / Ward 1988 with one diffuse bounce.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import open3d as o3d
from numba import prange
from scenewright.stages.kit.compiled import compiled
from scenewright.stages.kit.rendering.surfaces import TriangleSoup

LIGHT_POINTS = 4
"""Every lamp is sampled at so many points squared."""
DIRECTIONS = 48
"""Rays that look for light over every sample: a Vogel disk lifted to the hemisphere (Malley's method)."""
MOST_SUBDIVISIONS = 128
"""Most subdivisions of a triangle's edge in the map; a bound on its memory."""
RAY_DIRECTION = 3
"""Rays (N, 6): the origin, and from this column on the direction."""
GOLDEN_ANGLE = np.pi * (3.0 - np.sqrt(5.0))
"""Turn between two samples of a Vogel disk [rad]."""
BURIED_SHARE = 0.5
"""A sample from which this share of directions meets back faces lies inside a solid."""


@dataclass(frozen=True)
class AreaLight:
    """A rectangular lamp. It shines to the side of its normal (edge_u x edge_v) with a cosine falloff."""

    center: tuple[float, float, float]
    edge_u: tuple[float, float, float]
    """Full edge vector [m]."""
    edge_v: tuple[float, float, float]
    color: tuple[float, float, float] = (1.0, 1.0, 1.0)
    """Radiance, linear RGB."""

    @property
    def area(self) -> float:
        """Area [m^2]."""
        return float(np.linalg.norm(np.cross(self.edge_u, self.edge_v)))

    @property
    def normal(self) -> np.ndarray:
        """Direction of shining (3,)."""
        cross = np.cross(self.edge_u, self.edge_v)
        return cross / np.linalg.norm(cross)

    def points(self, per_edge: int) -> np.ndarray:
        """Return (per_edge^2, 3) cell centres [m]."""
        steps = (np.arange(per_edge) + 0.5) / per_edge - 0.5
        u, v = np.meshgrid(steps, steps, indexing="ij")
        return (
            np.asarray(self.center)
            + u.reshape(-1, 1) * np.asarray(self.edge_u)
            + v.reshape(-1, 1) * np.asarray(self.edge_v)
        )


@dataclass(frozen=True)
class SoftLight:
    """How a light map is made."""

    sky: tuple[float, float, float] = (1.0, 1.0, 1.0)
    """Radiance that a ray meets when it leaves the scene, linear RGB."""
    texel: float = 0.05
    """Distance of samples [m]."""


class LightMap(NamedTuple):
    """Irradiance over pi (the radiance of a white matt surface) at the grid points of every triangle. Compiled
    functions take it as it is."""

    offset: np.ndarray
    """(T,) int64, first sample of a triangle."""
    subdivisions: np.ndarray
    """(T,) int32, n; a triangle has (n + 1)(n + 2) / 2 samples."""
    light: np.ndarray
    """(S, 3) float32, linear RGB."""


@compiled
def _subdivisions(corners: np.ndarray, texel: float, most: int) -> np.ndarray:
    count = corners.shape[0]
    result = np.empty(count, dtype=np.int32)
    for t in range(count):
        longest = 0.0
        for k in range(3):
            length = 0.0
            for axis in range(3):
                d = corners[t, (k + 1) % 3, axis] - corners[t, k, axis]
                length += d * d
            longest = max(longest, np.sqrt(length))
        result[t] = min(most, max(1, int(np.ceil(longest / texel))))
    return result


@compiled(parallel=True)
def _samples(
    corners: np.ndarray,
    corner_normals: np.ndarray,
    face_normals: np.ndarray,
    offset: np.ndarray,
    subdivisions: np.ndarray,
    lift: float,
    total: int,
) -> tuple[np.ndarray, np.ndarray]:
    positions = np.empty((total, 3), dtype=np.float32)
    normals = np.empty((total, 3), dtype=np.float32)
    for t in prange(corners.shape[0]):
        n = subdivisions[t]
        row = offset[t]
        for i in range(n + 1):
            for j in range(n + 1 - i):
                # Pulled in towards the centroid, so that a sample on an edge does not lie inside the neighbour.
                inset = min(0.02, 0.1 / n)
                u = max(i / n, inset)
                v = max(j / n, inset)
                w = max(1.0 - i / n - j / n, inset)
                scale = 1.0 / (u + v + w)
                u, v, w = u * scale, v * scale, w * scale
                length = 0.0
                for axis in range(3):
                    value = (
                        w * corner_normals[t, 0, axis] + u * corner_normals[t, 1, axis] + v * corner_normals[t, 2, axis]
                    )
                    normals[row, axis] = value
                    length += value * value
                    positions[row, axis] = (
                        w * corners[t, 0, axis]
                        + u * corners[t, 1, axis]
                        + v * corners[t, 2, axis]
                        + lift * face_normals[t, axis]
                    )
                length = np.sqrt(length)
                for axis in range(3):
                    normals[row, axis] = normals[row, axis] / length if length > 1e-9 else face_normals[t, axis]
                row += 1
    return positions, normals


@compiled
def lookup(light: np.ndarray, offset: int, n: int, u: float, v: float, channel: int) -> float:
    """Interpolate one channel of the light map at barycentric (u, v) of a triangle with n subdivisions."""
    a, b = u * n, v * n
    i, j = int(a), int(b)
    i = min(max(i, 0), n - 1)
    j = min(max(j, 0), n - 1 - i)
    fa, fb = a - i, b - j
    row = offset + i * (n + 1) - (i * (i - 1)) // 2
    following = row + (n + 1 - i)
    if fa + fb <= 1.0 or j + 1 > n - i - 1:
        return (
            (1.0 - fa - fb) * light[row + j, channel]
            + fa * light[following + j, channel]
            + fb * light[row + j + 1, channel]
        )
    return (
        (fa + fb - 1.0) * light[following + j + 1, channel]
        + (1.0 - fa) * light[row + j + 1, channel]
        + (1.0 - fb) * light[following + j, channel]
    )


@compiled(parallel=True)
def _rays_to(positions: np.ndarray, rows: np.ndarray, target: np.ndarray) -> np.ndarray:
    rays = np.empty((len(rows), 6), dtype=np.float32)
    for k in prange(len(rows)):
        for axis in range(3):
            rays[k, axis] = positions[rows[k], axis]
            rays[k, RAY_DIRECTION + axis] = target[axis] - positions[rows[k], axis]
    return rays


@compiled(parallel=True)
def _form_factor(
    positions: np.ndarray, normals: np.ndarray, point: np.ndarray, shine: np.ndarray, area: float
) -> np.ndarray:
    """cos cos' dA / (pi r^2) from every sample to a patch of a lamp."""
    result = np.zeros(len(positions), dtype=np.float32)
    for k in prange(len(positions)):
        dx = point[0] - positions[k, 0]
        dy = point[1] - positions[k, 1]
        dz = point[2] - positions[k, 2]
        square = dx * dx + dy * dy + dz * dz
        cosine_here = normals[k, 0] * dx + normals[k, 1] * dy + normals[k, 2] * dz
        cosine_there = -(shine[0] * dx + shine[1] * dy + shine[2] * dz)
        if cosine_here > 0.0 and cosine_there > 0.0:
            result[k] = cosine_here * cosine_there / (square * square * np.pi) * area
    return result


@compiled(parallel=True)
def _gather_rays(positions: np.ndarray, normals: np.ndarray, start: int, end: int, x: float, y: float) -> np.ndarray:
    """One ray a sample in the cosine-distributed local direction (x, y, sqrt(1 - x^2 - y^2))."""
    z = np.sqrt(max(0.0, 1.0 - x * x - y * y))
    rays = np.empty((end - start, 6), dtype=np.float32)
    for k in prange(end - start):
        row = start + k
        nx, ny, nz = normals[row, 0], normals[row, 1], normals[row, 2]
        # Frame of Duff et al. 2017: continuous but for nz = 0, so neighbouring samples shoot alike.
        sign = 1.0 if nz >= 0.0 else -1.0
        a = -1.0 / (sign + nz)
        b = nx * ny * a
        for axis in range(3):
            rays[k, axis] = positions[row, axis]
        rays[k, RAY_DIRECTION] = x * (1.0 + sign * nx * nx * a) + y * b + z * nx
        rays[k, RAY_DIRECTION + 1] = x * sign * b + y * (sign + ny * ny * a) + z * ny
        rays[k, RAY_DIRECTION + 2] = x * (-sign * nx) + y * (-ny) + z * nz
    return rays


class _Radiant(NamedTuple):
    """What a gathering ray may meet: triangles with their direct light, or the sky; float32."""

    direct: LightMap
    face_normals: np.ndarray
    """(T, 3)"""
    albedo: np.ndarray
    """(T, 3)"""
    sky: np.ndarray
    """(3,)"""
    ambient: np.ndarray
    """(3,)"""


class _Gathered(NamedTuple):
    """Rays (R, 6) from neighbouring samples, and the triangles (R,) and places on them (R, 2) that they meet."""

    rays: np.ndarray
    primitive: np.ndarray
    uvs: np.ndarray


@compiled(parallel=True)
def _add_bounce(
    total: np.ndarray, inside: np.ndarray, start: int, gathered: _Gathered, radiant: _Radiant, weight: float
) -> None:
    """Add one gathered direction, from sample `start` on, to `total` (S, 3) in place; `inside` (S,) sums the weight of
    rays that met a back face."""
    rays, primitive, uvs = gathered
    (offset, subdivisions, direct), face_normals, albedo, sky, ambient = radiant
    triangles = len(offset)
    for k in prange(len(primitive)):
        t = np.int64(primitive[k])
        if t < triangles:
            along = 0.0
            for axis in range(3):
                along += rays[k, RAY_DIRECTION + axis] * face_normals[t, axis]
            if along > 0.0:
                inside[start + k] += weight
                continue
        for channel in range(3):
            if t >= triangles:
                value = sky[channel]
            else:
                direct_light = lookup(direct, offset[t], subdivisions[t], uvs[k, 0], uvs[k, 1], channel)
                value = albedo[t, channel] * (direct_light + ambient[channel])
            total[start + k, channel] += weight * value


@compiled(parallel=True)
def _fill_buried(light: np.ndarray, buried: np.ndarray, offset: np.ndarray, subdivisions: np.ndarray) -> None:
    """Give samples inside another solid the mean of their neighbours, ring by ring: what stands on a surface must not
    darken it beyond its own outline by interpolation. Triangles that are buried whole stay dark."""
    di = np.array([1, -1, 0, 0, 1, -1])
    dj = np.array([0, 0, 1, -1, -1, 1])
    for t in prange(len(offset)):
        n, first = subdivisions[t], offset[t]
        for _ in range(3):
            filled = np.zeros((n + 1) * (n + 2) // 2, dtype=np.bool_)
            for i in range(n + 1):
                for j in range(n + 1 - i):
                    row = i * (n + 1) - i * (i - 1) // 2 + j
                    if not buried[first + row]:
                        continue
                    count, red, green, blue = 0, 0.0, 0.0, 0.0
                    for k in range(6):
                        a, b = i + di[k], j + dj[k]
                        if a < 0 or b < 0 or a + b > n:
                            continue
                        neighbour = first + a * (n + 1) - a * (a - 1) // 2 + b
                        if not buried[neighbour]:
                            count += 1
                            red += light[neighbour, 0]
                            green += light[neighbour, 1]
                            blue += light[neighbour, 2]
                    if count > 0:
                        light[first + row, 0] = red / count
                        light[first + row, 1] = green / count
                        light[first + row, 2] = blue / count
                        filled[row] = True
            for row in range(len(filled)):
                if filled[row]:
                    buried[first + row] = False


def bake(
    scene: o3d.t.geometry.RaycastingScene,
    soup: TriangleSoup,
    lights: tuple[AreaLight, ...],
    ambient: np.ndarray,
    soft_light: SoftLight,
) -> LightMap:
    """Compute the light map of a soup that is the one geometry of `scene`.

    `ambient` (3,) float32 stands for the bounces after the first.
    """
    subdivisions = _subdivisions(soup.corners, soft_light.texel, MOST_SUBDIVISIONS)
    counts = (subdivisions.astype(np.int64) + 1) * (subdivisions + 2) // 2
    offset = np.concatenate([[0], np.cumsum(counts)[:-1]]).astype(np.int64)
    total = int(counts.sum())
    positions, normals = _samples(
        soup.corners, soup.corner_normals, soup.face_normals, offset, subdivisions, 2e-3, total
    )
    direct = np.zeros((total, 3), dtype=np.float32)
    for light in lights:
        patch = light.area / LIGHT_POINTS**2
        for point in light.points(LIGHT_POINTS).astype(np.float32):
            factor = _form_factor(positions, normals, point, light.normal.astype(np.float32), patch)
            rows = np.flatnonzero(factor)
            rays = _rays_to(positions, rows, point)
            blocked = scene.test_occlusions(o3d.core.Tensor.from_numpy(rays), 1e-4, 0.999).numpy() != 0
            lit = rows[~blocked]
            direct[lit] += factor[lit, None] * np.asarray(light.color, dtype=np.float32)
    radiant = _Radiant(
        LightMap(offset, subdivisions, direct),
        soup.face_normals,
        soup.corner_colors.mean(axis=1),
        np.asarray(soft_light.sky, dtype=np.float32),
        ambient,
    )
    light_map = direct.copy()
    inside = np.zeros(total, dtype=np.float32)
    chunk = 1 << 19
    for k in range(DIRECTIONS):
        radius, angle = np.sqrt((k + 0.5) / DIRECTIONS), k * GOLDEN_ANGLE
        x, y = float(radius * np.cos(angle)), float(radius * np.sin(angle))
        for start in range(0, total, chunk):
            end = min(total, start + chunk)
            rays = _gather_rays(positions, normals, start, end, x, y)
            hits = scene.cast_rays(o3d.core.Tensor.from_numpy(rays))
            gathered = _Gathered(rays, hits["primitive_ids"].numpy(), hits["primitive_uvs"].numpy())
            _add_bounce(light_map, inside, start, gathered, radiant, 1.0 / DIRECTIONS)
    _fill_buried(light_map, inside > BURIED_SHARE, offset, subdivisions)
    return LightMap(offset, subdivisions, light_map)
