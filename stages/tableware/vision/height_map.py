"""From an overhead depth image to heights above the table, with what is wrong with the image said in one line."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from schemas.errors import BadInput
from stages.tableware.world.items import TABLE_SIDES
from stages.tableware.world.overhead import OverheadCamera

TALLEST = 0.20
"""Nothing on the table reaches higher [m]."""
LEAST_VALID = 0.2
PLANE_BAND, PLANE_OFF = 0.015, 0.03
"""Table pixels lie this near [m] to the table's plane; the plane may be this far [m] from where the camera says."""


@dataclass(frozen=True)
class HeightMap:
    """The part of the image that shows the workspace. Arrays (h, w)."""

    raw: np.ndarray
    """Height above the table [m], NaN-free; 0 where not valid."""
    valid: np.ndarray
    """bool, whether the sensor reports a depth."""
    smooth: np.ndarray
    """Height [m], gaps filled from around, median over 5 x 5."""
    color: np.ndarray
    """(h, w, 3) uint8."""
    focal: tuple[float, float]
    center: tuple[float, float]
    """Principal point in this part of the image [px]."""
    camera_height: float
    corner: tuple[int, int]
    """Column and row of the part's first pixel in the whole image."""

    def scale(self, z: float | np.ndarray) -> float | np.ndarray:
        """Return pixels per metre at height z [m]."""
        return self.focal[0] / (self.camera_height - z)

    def pixel(self, x: np.ndarray | float, y: np.ndarray | float, z: np.ndarray | float) -> tuple[Any, Any]:
        """Return (column, row) of world points [m]."""
        range_ = self.camera_height - z
        return self.center[0] + self.focal[0] * x / range_, self.center[1] - self.focal[1] * y / range_

    def world(self, u: np.ndarray | float, v: np.ndarray | float, z: np.ndarray | float) -> tuple[Any, Any]:
        """Return world (x, y) [m] of pixels at height z [m]."""
        range_ = self.camera_height - z
        return (u - self.center[0]) / self.focal[0] * range_, -(v - self.center[1]) / self.focal[1] * range_


def check_images(color: np.ndarray, depth: np.ndarray, view: OverheadCamera) -> None:
    """Raise BadInput in one line when the images cannot be what the camera saw of the table."""
    shape = (view.camera.height, view.camera.width)
    if color.dtype != np.uint8 or color.shape != (*shape, 3):
        raise BadInput(f"the colour image is {color.shape} {color.dtype}, not {(*shape, 3)} uint8",
                       hint="give the image and the camera that belong together")  # fmt: skip
    if depth.shape != shape:
        raise BadInput(f"the depth image is {depth.shape}, not {shape}", hint="align depth to colour first")
    down = view.world_from_camera[:3, 2]
    if down[2] > -0.9995:
        raise BadInput("the camera does not look straight down on the table",
                       hint="rectify the frame to the table plane first")  # fmt: skip
    if not np.isfinite(depth).all():
        raise BadInput("the depth image holds values that are no numbers", hint="use 0 where there is no depth")


def height_map(color: np.ndarray, depth: np.ndarray, view: OverheadCamera) -> HeightMap:
    """Return heights above the table plane, which is fitted to the depth.

    `color` (H, W, 3) uint8, `depth` (H, W) metres, 0 where unknown. Raises BadInput for no depth or a wrong scale.
    """
    check_images(color, depth, view)
    camera, above = view.camera, float(view.world_from_camera[2, 3])
    half = [0.5 * side * camera.fx / (above - 0.15) + 6 for side in TABLE_SIDES]
    left, top = max(0, int(camera.cx - half[0])), max(0, int(camera.cy - half[1]))
    right, bottom = min(camera.width, int(camera.cx + half[0]) + 2), min(camera.height, int(camera.cy + half[1]) + 2)
    part = np.ascontiguousarray(depth[top:bottom, left:right], dtype=np.float32)
    valid = part > 0.0
    share = float(valid.mean())
    if share < LEAST_VALID:
        raise BadInput(f"{share:.0%} of the pixels over the table have depth", hint="detection needs an RGB-D image")
    middle = float(np.median(part[::4, ::4][valid[::4, ::4]]))
    if not 0.5 * above < middle < 2.2 * above:
        raise BadInput(f"the depth image says {middle:.4g} where the table is {above:.3g} m away",
                       hint="depth must be in metres" if middle > 50 else "check the camera's height")  # fmt: skip
    plane = _table_plane(part, (camera.cx - left, camera.cy - top), (camera.fx, camera.fy), above)
    columns = np.arange(right - left, dtype=np.float32) * np.float32(plane[0])
    rows = np.arange(bottom - top, dtype=np.float32) * np.float32(plane[1])
    raw = np.float32(plane[2]) + columns[None] + rows[:, None] - part
    valid &= raw < TALLEST
    # What lies beyond the table's edge counts as low: unknown there, it would be filled with the dish that juts out.
    raw = np.where(valid, np.maximum(raw, np.float32(-0.02)), np.float32(0.0))
    weight = cv2.boxFilter(valid.astype(np.float32), -1, (7, 7))
    filled = np.where(valid, raw, cv2.boxFilter(raw, -1, (7, 7)) / np.maximum(weight, 1e-3))
    return HeightMap(
        raw, valid, cv2.medianBlur(filled, 5), color[top:bottom, left:right], (camera.fx, camera.fy),
        (camera.cx - left, camera.cy - top), above, (left, top),
    )  # fmt: skip


def _table_plane(part: np.ndarray, center: tuple[float, float], focal: tuple[float, float], above: float) -> np.ndarray:
    """Return (a, b, c) of the table's depth a u + b v + c [m] by trimmed least squares on every fourth pixel."""
    v, u = np.mgrid[0 : part.shape[0] : 4, 0 : part.shape[1] : 4]
    z = part[::4, ::4]
    inside = (np.abs(u - center[0]) < 0.49 * TABLE_SIDES[0] * focal[0] / above) & (
        np.abs(v - center[1]) < 0.49 * TABLE_SIDES[1] * focal[1] / above
    )
    u, v, z = u[inside & (z > 0)], v[inside & (z > 0)], z[inside & (z > 0)]
    near = z[np.abs(z - above) < PLANE_OFF]
    if len(near) < 0.05 * max(len(z), 400):
        raise BadInput(
            f"no table is seen {above:.3g} m below the camera", hint="check the depth's scale and the height"
        )
    plane = np.array([0.0, 0.0, float(np.median(near))])
    for band in (PLANE_BAND, 0.008, 0.006):
        kept = np.abs(z - plane[0] * u - plane[1] * v - plane[2]) < band
        if kept.sum() < 50:
            break
        columns = np.column_stack([u[kept], v[kept], np.ones(int(kept.sum()))])
        plane = np.linalg.lstsq(columns, z[kept], rcond=None)[0]
    return plane
