"""Pictures for the page: depth in colours, depth jumps over colour, and one frame carried into another."""

from __future__ import annotations

import base64
from dataclasses import dataclass

import cv2
import numpy as np
from scenewright.stages.ingest.preflight.fits import relative_pose
from scenewright.stages.ingest.preflight.looking import Look
from scenewright.stages.ingest.preflight.registration import depth_jumps
from scenewright.stages.ingest.preflight.reprojection import projected
from scenewright.stages.kit.geometry.cameras import back_project

WIDTH = 400
"""Width of a picture on the page [px]."""
RESIDUAL_END = 0.1
"""Relative residual that is drawn in full colour."""


@dataclass(frozen=True)
class Picture:
    """A picture that is part of the page."""

    uri: str
    width: int
    height: int
    caption: str


def embedded(pixels: np.ndarray, caption: str) -> Picture:
    """Return a picture (H, W, 3) uint8 RGB as a data URI, at most WIDTH wide."""
    height, width = pixels.shape[:2]
    if width > WIDTH:
        size = (WIDTH, max(1, round(height * WIDTH / width)))
        pixels = cv2.resize(pixels, size, interpolation=cv2.INTER_AREA)
    _, data = cv2.imencode(".jpg", np.ascontiguousarray(pixels[..., ::-1]), [cv2.IMWRITE_JPEG_QUALITY, 82])
    text = base64.b64encode(data.tobytes()).decode("ascii")
    return Picture(f"data:image/jpeg;base64,{text}", pixels.shape[1], pixels.shape[0], caption)


def depth_in_colors(depth: np.ndarray, end: float) -> np.ndarray:
    """Return (H, W, 3) uint8 RGB of depth (H, W) uint16 [mm]: near red, far violet at `end` [m], invalid black."""
    share = np.clip(depth * 1e-3 / max(end, 1e-6), 0, 1)
    colors = cv2.applyColorMap(255 - (255 * share).astype(np.uint8), cv2.COLORMAP_TURBO)[..., ::-1]
    return np.where((depth > 0)[..., None], colors, 0).astype(np.uint8)


def in_color(look: Look, shape: tuple[int, int]) -> np.ndarray:
    """Return the frame's colour (or grey, or black) at `shape` (h, w) as (h, w, 3) uint8 RGB."""
    size = (shape[1], shape[0])
    if look.picture is not None:
        image = cv2.resize(look.picture, size, interpolation=cv2.INTER_AREA)
        return image if image.ndim == 3 else np.repeat(image[..., None], 3, axis=2)
    if look.gray is not None:
        return np.repeat(cv2.resize(look.gray, size, interpolation=cv2.INTER_AREA)[..., None], 3, axis=2)
    return np.zeros((*shape, 3), np.uint8)


def jumps_over_color(look: Look) -> np.ndarray:
    """Return the colour picture with depth jumps drawn in cyan."""
    assert look.depth is not None
    image = in_color(look, look.depth.shape).copy()
    thick = cv2.dilate(depth_jumps(look.depth).astype(np.uint8), np.ones((2, 2), np.uint8)).astype(bool)
    image[thick] = (0, 240, 255)
    return image


def residuals_over_color(
    source: Look, target: Look, world_from_source: np.ndarray, world_from_target: np.ndarray
) -> np.ndarray:
    """Return the target's picture with the source's depth carried into it: green agrees, red is too far (or hidden),
    blue too near; grey was not seen by the source."""
    assert source.depth is not None and target.depth is not None
    points = back_project(source.depth * np.float32(1e-3), source.depth_camera).reshape(-1, 3)
    points = points[points[:, 2] > 0].astype(np.float64)
    motion = relative_pose(world_from_target, world_from_source)
    u, v, z, inside = projected(points @ motion[:3, :3].T + motion[:3, 3], target.depth_camera)
    u, v, z = u[inside], v[inside], z[inside]
    order = np.argsort(-z, kind="stable")  # nearest last: it is what the target would see
    u, v, z = u[order], v[order], z[order]
    rendered = np.zeros(target.depth.shape, np.float64)
    rendered[v, u] = z
    dilated = cv2.dilate(
        rendered, np.ones((3, 3), np.uint8)
    )  # a grid of points leaves seams where the view comes closer
    rendered = np.where(rendered > 0, rendered, dilated)
    measured = target.depth * 1e-3
    in_both = (rendered > 0) & (measured > 0)
    residual = np.zeros(rendered.shape)
    residual[in_both] = np.clip((rendered[in_both] - measured[in_both]) / measured[in_both] / RESIDUAL_END, -1, 1)
    gray = in_color(target, target.depth.shape).mean(axis=2, keepdims=True) * 0.55 + 60
    tint = np.zeros((*rendered.shape, 3))
    size = np.abs(residual)
    tint[..., 1] = 200 * (1 - size)
    tint[..., 0] = np.where(residual > 0, 255 * size, 0)
    tint[..., 2] = np.where(residual < 0, 255 * size, 0)
    mixed = np.where(in_both[..., None], 0.45 * gray + 0.65 * tint, 0.5 * gray)
    return np.clip(mixed, 0, 255).astype(np.uint8)
