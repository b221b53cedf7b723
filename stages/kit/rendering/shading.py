"""From ray hits to linear light: colour, pattern, light map or direct lights, highlight. One loop over pixels."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import prange
from scenewright.stages.kit.compiled import compiled
from scenewright.stages.kit.rendering.light_map import RAY_DIRECTION, LightMap, lookup
from scenewright.stages.kit.rendering.patterns import GLOSS, PATTERN, SHARPNESS, SKIRTING, pattern_factor, pattern_line

MISS = np.uint32(0xFFFFFFFF)
"""Triangle of a ray that hits nothing."""


class Hits(NamedTuple):
    """What N rays met."""

    rays: np.ndarray
    """(N, 6) float32 origin and direction [m]."""
    primitive: np.ndarray
    """(N,) uint32 triangle, MISS for none."""
    uvs: np.ndarray
    """(N, 2) float32 barycentric."""
    t: np.ndarray
    """(N,) float32, in lengths of the direction."""
    normals: np.ndarray
    """(N, 3) as surface_at."""
    cosine: np.ndarray
    """(N,) as surface_at."""


class Surfaces(NamedTuple):
    """Colours and materials of triangles, as in TriangleSoup."""

    corner_colors: np.ndarray
    material: np.ndarray
    material_table: np.ndarray


@compiled(parallel=True)
def camera_rays(
    pixels: np.ndarray, fx: float, fy: float, cx: float, cy: float, world_from_camera: np.ndarray
) -> np.ndarray:
    """Return rays (N, 6) float32 through pixels (N, 2) [px]; directions have unit z in the camera frame, so the hit
    parameter t is the z-depth."""
    rays = np.empty((len(pixels), 6), dtype=np.float32)
    for k in prange(len(pixels)):
        x = (pixels[k, 0] - cx) / fx
        y = (pixels[k, 1] - cy) / fy
        for axis in range(3):
            rays[k, axis] = world_from_camera[axis, 3]
            rays[k, RAY_DIRECTION + axis] = (
                world_from_camera[axis, 0] * x + world_from_camera[axis, 1] * y + world_from_camera[axis, 2]
            )
    return rays


@compiled(parallel=True)
def surface_at(
    rays: np.ndarray, primitive: np.ndarray, uvs: np.ndarray, corner_normals: np.ndarray, face_normals: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return (shading normals (N, 3) turned towards the camera, cosine of incidence (N,) of the true face)."""
    normals = np.zeros((len(rays), 3), dtype=np.float32)
    cosine = np.zeros(len(rays), dtype=np.float32)
    for k in prange(len(rays)):
        if primitive[k] == MISS:
            continue
        t = np.int64(primitive[k])
        u, v = uvs[k, 0], uvs[k, 1]
        w = 1.0 - u - v
        length, along, ray = 0.0, 0.0, 0.0
        for axis in range(3):
            value = w * corner_normals[t, 0, axis] + u * corner_normals[t, 1, axis] + v * corner_normals[t, 2, axis]
            normals[k, axis] = value
            length += value * value
            ray += rays[k, RAY_DIRECTION + axis] * rays[k, RAY_DIRECTION + axis]
            along += rays[k, RAY_DIRECTION + axis] * face_normals[t, axis]
        side = -1.0 if along > 0.0 else 1.0
        length = np.sqrt(length)
        for axis in range(3):
            normals[k, axis] = side * (normals[k, axis] / length if length > 1e-9 else face_normals[t, axis])
        cosine[k] = abs(along) / np.sqrt(ray)
    return normals, cosine


@compiled(parallel=True)
def surface_color(hits: Hits, surfaces: Surfaces, pixel_angle: float) -> np.ndarray:
    """Return the diffuse albedo (N, 3), linear, with patterns. `pixel_angle` is the width of a pixel at depth 1."""
    rays, primitive, uvs, t_hit, _, cosine = hits
    corner_colors, material, table = surfaces
    albedo = np.zeros((len(rays), 3), dtype=np.float32)
    for k in prange(len(rays)):
        if primitive[k] == MISS:
            continue
        t = np.int64(primitive[k])
        u, v = uvs[k, 0], uvs[k, 1]
        w = 1.0 - u - v
        row = table[material[t]]
        factor, warmth = 1.0, 0.0
        x = rays[k, 0] + t_hit[k] * rays[k, RAY_DIRECTION]
        y = rays[k, 1] + t_hit[k] * rays[k, RAY_DIRECTION + 1]
        z = rays[k, 2] + t_hit[k] * rays[k, RAY_DIRECTION + 2]
        # The geometric mean of a pixel's two extents on the slanted surface.
        footprint = t_hit[k] * pixel_angle / np.sqrt(max(float(cosine[k]), 0.05))
        if row[PATTERN] > 0.5:
            factor, warmth = pattern_factor(row, x, y, z, footprint)
        for channel in range(3):
            value = (
                w * corner_colors[t, 0, channel] + u * corner_colors[t, 1, channel] + v * corner_colors[t, 2, channel]
            )
            albedo[k, channel] = min(1.0, value * factor * (1.0 + 0.3 * warmth * (1.0 - channel)))
        if row[SKIRTING] > 0.0 and z < row[SKIRTING] + 0.01:
            # A painted board, its upper edge box-filtered over the pixel.
            below = min(1.0, max(0.0, (row[SKIRTING] - z) / max(footprint, 1e-4) + 0.5))
            rim = pattern_line(abs(row[SKIRTING] - 0.004 - z), 0.004, footprint)
            for channel in range(3):
                albedo[k, channel] = below * 0.70 * (1.0 - 0.35 * rim) + (1.0 - below) * albedo[k, channel]
    return albedo


@compiled(parallel=True)
def light_from_map(hits: Hits, light_map: LightMap) -> np.ndarray:
    """Return the light (N, 3) on matt white at the hits, from the light map."""
    primitive, uvs = hits.primitive, hits.uvs
    offset, subdivisions, light = light_map
    result = np.zeros((len(primitive), 3), dtype=np.float32)
    for k in prange(len(primitive)):
        if primitive[k] == MISS:
            continue
        t = np.int64(primitive[k])
        for channel in range(3):
            result[k, channel] = lookup(light, offset[t], subdivisions[t], uvs[k, 0], uvs[k, 1], channel)
    return result


@compiled(parallel=True)
def add_light(
    total: np.ndarray,
    highlight: np.ndarray,
    hits: Hits,
    surfaces: Surfaces,
    blocked: np.ndarray,
    point: np.ndarray,
    color: np.ndarray,
    diffuse: bool,
) -> None:
    """Add one point-like light in place: its diffuse part to `total` (N, 3) when `diffuse`, and its highlight
    (Blinn 1977) to `highlight` (N, 3), where it is not blocked. `color` is the intensity at any distance."""
    rays, primitive, _, t_hit, normals, _ = hits
    _, material, table = surfaces
    for k in prange(len(primitive)):
        if primitive[k] == MISS or blocked[k]:
            continue
        t = np.int64(primitive[k])
        row = table[material[t]]
        if not diffuse and row[GLOSS] <= 0.0:
            continue
        length, view, cosine = 0.0, 0.0, 0.0
        for axis in range(3):
            d = point[axis] - (rays[k, axis] + t_hit[k] * rays[k, RAY_DIRECTION + axis])
            length += d * d
            view += rays[k, RAY_DIRECTION + axis] * rays[k, RAY_DIRECTION + axis]
        length, view = np.sqrt(length), np.sqrt(view)
        half, square = 0.0, 0.0
        for axis in range(3):
            d = (point[axis] - (rays[k, axis] + t_hit[k] * rays[k, RAY_DIRECTION + axis])) / length
            h = d - rays[k, RAY_DIRECTION + axis] / view
            cosine += d * normals[k, axis]
            half += h * normals[k, axis]
            square += h * h
        if cosine <= 0.0:
            continue
        shine = row[GLOSS] * max(0.0, half / np.sqrt(square)) ** row[SHARPNESS] if row[GLOSS] > 0.0 else 0.0
        for channel in range(3):
            if diffuse:
                total[k, channel] += cosine * color[channel]
            highlight[k, channel] += shine * min(1.0, 4.0 * cosine) * color[channel]


@compiled
def shadow_rays(hits: Hits, point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return rays (M, 6) float32 from hits to a lamp at `point` (3,), a little above the surface, and which hits (M,)
    they are of: those that face it, as others get no light of it whatever stands between."""
    rays, primitive, _, t_hit, normals, _ = hits
    result = np.empty((len(primitive), 6), dtype=np.float32)
    asked = np.empty(len(primitive), dtype=np.int64)
    count = 0
    for k in range(len(primitive)):
        if primitive[k] == MISS:
            continue
        cosine = np.float64(0.0)
        for axis in range(3):
            place = rays[k, axis] + t_hit[k] * rays[k, RAY_DIRECTION + axis]
            cosine += np.float64(point[axis] - place) * normals[k, axis]
            result[count, axis] = place + np.float32(2e-3) * normals[k, axis]
            result[count, RAY_DIRECTION + axis] = point[axis] - result[count, axis]
        if cosine > -1e-5:
            asked[count] = k
            count += 1
    return result[:count], asked[:count]


@compiled(parallel=True)
def tone_map(linear: np.ndarray, exposure: float, table: np.ndarray) -> np.ndarray:
    """Return (N, 3) uint8 sRGB of linear light (N, 3): exposure, a soft shoulder over 0.6 that reaches white at
    infinity, then the sRGB curve from `table` (4096,) uint8."""
    result = np.empty(linear.shape, dtype=np.uint8)
    for k in prange(len(linear)):
        for channel in range(3):
            value = linear[k, channel] * exposure
            if value > 0.6:
                value = 0.6 + 0.4 * (1.0 - np.exp(-(value - 0.6) / 0.4))
            result[k, channel] = table[min(4095, max(0, int(value * 4095.0 + 0.5)))]
    return result
