"""Support surfaces of a depth image: the large planes that objects stand on, found in inverse depth.

In a pinhole image the inverse depth of a plane is linear in the pixel coordinates, and the noise of structured light
is nearly constant there (Nguyen et al. 2012), so that one threshold serves the near and the far end of a table. What
the sensor bends (lens distortion) is a few parts in a thousand and smooth: a quadratic takes it up.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.kit.compiled import compiled

SAMPLE_STEP = 6
"""Every how many-th row and column takes part in the search and in the fit."""
HYPOTHESES = 256
"""Planes that are tried for one support surface (RANSAC); by eye."""
REFITS = 4
"""Times a plane is fitted to its inliers; by eye."""


@dataclass(frozen=True)
class SupportSettings:
    """How large a support surface is, and what counts as part of it."""

    area: float = 0.25
    """Smallest seen area of a support surface [m^2]; the largest plane is one from a quarter of this on."""
    surfaces: int = 4
    """At most so many are sought."""
    thickness: float = 0.004
    """Inverse depth closer to the surface than this belongs to it while the surface is fitted [1/m]."""
    clearance: float = 0.0045
    """What rises more than this over the surface stands on it [1/m] ..."""
    height: float = 0.003
    """... if it is at least this high [m]."""
    rise: float = 0.009
    """What stands on a surface rises more than this somewhere [m]: the sensor bends a table by half of it."""


@dataclass(frozen=True)
class SupportSurface:
    """One surface: coefficients of its inverse depth [1/m] over (1, x, y, x^2, xy, y^2), x and y the ray's slopes."""

    coefficients: np.ndarray
    normal: np.ndarray
    """(3,) unit vector that faces the camera."""
    offset: float
    """normal . p + offset = 0 for points p [m] of its plane; the camera's own height over it."""
    area: float
    """[m^2] seen."""


def ray_slopes(camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """Return x/z of every column (W,) and y/z of every row (H,), float32."""
    x = (np.arange(camera.width, dtype=np.float32) - np.float32(camera.cx)) / np.float32(camera.fx)
    y = (np.arange(camera.height, dtype=np.float32) - np.float32(camera.cy)) / np.float32(camera.fy)
    return x, y


def _best_plane(design: np.ndarray, inverse: np.ndarray, thickness: float, weights: np.ndarray) -> np.ndarray | None:
    """Coefficients (3,) of the plane with the most weight within `thickness`, from random triples of samples."""
    if len(inverse) < 30:
        return None
    # A fixed seed: the frame alone decides the result.
    random = np.random.default_rng(0)
    triples = random.integers(0, len(inverse), size=(HYPOTHESES, 3))
    matrices = design[triples][:, :, :3]
    sound = np.abs(np.linalg.det(matrices)) > 1e-4
    if not sound.any():
        return None
    planes = np.linalg.solve(matrices[sound], inverse[triples[sound]][..., None])[..., 0]
    screened = random.integers(0, len(inverse), size=min(1500, len(inverse)))
    screened_weight = _weight_within(design[screened], inverse[screened], weights[screened], planes, thickness)
    planes = planes[np.argsort(-screened_weight, kind="stable")[:8]]
    best: np.ndarray = planes[np.argmax(_weight_within(design, inverse, weights, planes, thickness))]
    return best


@compiled
def _weight_within(
    design: np.ndarray, inverse: np.ndarray, weights: np.ndarray, planes: np.ndarray, thickness: float
) -> np.ndarray:
    """Of every plane (K, 3) the weight of the samples that lie within `thickness` of it."""
    count = len(planes)
    a, b, c = planes[:, 0].copy(), planes[:, 1].copy(), planes[:, 2].copy()
    result = np.zeros(count)
    for i in range(len(inverse)):
        x, y, w, weight = design[i, 1], design[i, 2], inverse[i], weights[i]
        # No branch and a step of one: several planes at a time.
        for k in range(count):
            result[k] += weight if abs(a[k] + b[k] * x + c[k] * y - w) < thickness else 0.0
    return result


def _fit_coefficients(design: np.ndarray, inverse: np.ndarray) -> np.ndarray:
    """Least-squares coefficients by the normal equations: slopes are of order one, so that they are well enough
    conditioned, and a tenth of the time of an orthogonal decomposition. Pixels in a line have the smallest solution."""
    coefficients: np.ndarray = np.linalg.lstsq(design.T @ design, design.T @ inverse, rcond=None)[0]
    return coefficients


def find_supports(depth: np.ndarray, camera: Camera, settings: SupportSettings) -> list[SupportSurface]:
    """Return the support surfaces of a z-depth image (H, W) [m], 0 invalid, the one with the largest area first.

    Preemptive RANSAC over planes in inverse depth, samples weighted by the area that they stand for; the winner is
    refitted with quadratic terms. Walls and floors of a room are surfaces like a table: nothing here knows what is up.
    """
    x, y = ray_slopes(camera)
    sampled = depth[::SAMPLE_STEP, ::SAMPLE_STEP]
    rows, columns = np.nonzero(sampled > 0)
    inverse = 1.0 / sampled[rows, columns].astype(np.float64)
    xs, ys = x[::SAMPLE_STEP][columns].astype(np.float64), y[::SAMPLE_STEP][rows].astype(np.float64)
    design = np.stack([np.ones_like(xs), xs, ys, xs * xs, xs * ys, ys * ys], axis=1)
    pixel_area = SAMPLE_STEP**2 / (camera.fx * camera.fy)
    unexplained = np.ones(len(inverse), dtype=bool)
    surfaces: list[SupportSurface] = []
    for _ in range(settings.surfaces):
        plane = _best_plane(
            design[unexplained], inverse[unexplained], settings.thickness, 1 / inverse[unexplained] ** 2
        )
        if plane is None or np.linalg.norm(plane) < 1e-6:
            break
        coefficients = np.concatenate([plane, np.zeros(3)])
        inside = unexplained & (np.abs(design @ coefficients - inverse) < settings.thickness)
        for _ in range(REFITS):
            if np.count_nonzero(inside) < 30:
                break
            coefficients = _fit_coefficients(design[inside], inverse[inside])
            inside = unexplained & (np.abs(design @ coefficients - inverse) < settings.thickness)
        if np.count_nonzero(inside) < 30:
            break
        plane = _fit_coefficients(design[inside][:, :3], inverse[inside])
        # a + b x + c y = 1/z means (b, c, a) . p = 1; the camera is on the side where the form is below 1.
        length = float(np.linalg.norm(plane))
        normal = -np.array([plane[1], plane[2], plane[0]]) / length
        slant = np.abs(np.stack([xs, ys, np.ones_like(xs)], axis=1)[inside] @ normal)
        area = float((pixel_area / inverse[inside] ** 2 / np.maximum(slant, 0.05)).sum())
        if area < settings.area * (1.0 if surfaces else 0.25):
            break
        surfaces.append(SupportSurface(coefficients, normal, 1.0 / length, area))
        unexplained &= design @ coefficients - inverse > -settings.clearance
        unexplained &= ~inside
    return sorted(surfaces, key=lambda surface: -surface.area)


def surface_inverse(surface: SupportSurface, camera: Camera) -> np.ndarray:
    """Return the inverse depth (H, W) float32 [1/m] that the surface would have in every pixel."""
    x, y = ray_slopes(camera)
    a, b, c, d, e, f = surface.coefficients.astype(np.float32)
    return np.asarray((a + b * x + d * x * x)[None, :] + (c * y + f * y * y)[:, None] + e * y[:, None] * x[None, :])
