"""From an overhead depth image to heights above the table, with what is wrong with the image said in one line."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.compiled import compiled
from scenewright.stages.tableware.world.items import TABLE_SIDES
from scenewright.stages.tableware.world.overhead import OverheadCamera

TALLEST = 0.20
"""Height above which nothing on the table reaches [m]."""
LOWEST = np.float32(-0.02)
"""Height to which lower ones are cut [m]; by eye."""
LEAST_VALID = 0.2
"""Share of pixels with depth that an image needs; by eye."""
PLANE_WIDTH = 0.0025
"""Width of the last fit's weights [m]: the noise of a dim image."""
PLANE_BAND, PLANE_OFF = 0.015, 0.03
"""Table pixels lie this near [m] to the table's plane; the plane may be this far [m] from where the camera says."""


@dataclass(frozen=True)
class HeightMap:
    """The part of the image that shows the workspace. Arrays (h, w)."""

    raw: np.ndarray
    """Height above the table [m], NaN-free; 0 where not valid."""
    valid: np.ndarray
    """bool, whether the sensor reports a depth."""
    tall: np.ndarray
    """bool, whether what is there is higher than TALLEST: not valid."""
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
    sides: tuple[float, float] = TABLE_SIDES
    """Of the workspace along x and y [m]; its middle is below the camera."""
    roughness: float = 0.0
    """Standard deviation of the table's smoothed heights [m] where it was measured: real depth has waves."""

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

    def workspace(self) -> np.ndarray:
        """Return (h, w) bool: the table top in the image, less two pixels."""
        mask = np.zeros(self.smooth.shape, dtype=bool)
        half = 0.5 * np.array(self.sides)
        (left, right), (bottom, top) = self.pixel(half[0] * np.array([-1, 1]), half[1] * np.array([-1, 1]), 0.0)
        mask[max(0, int(top) + 3) : max(0, int(bottom) - 1), max(0, int(left) + 3) : max(0, int(right) - 1)] = True
        return mask

    def measured_roughness(self) -> float:
        """Return the standard deviation (from the median deviation) of `smooth` on the bare table [m]."""
        values = self.smooth[self.workspace() & self.valid & (np.abs(self.smooth) < PLANE_BAND)]
        return 1.4826 * float(np.median(np.abs(values - np.median(values)))) if len(values) > 100 else 0.0


def check_color(color: np.ndarray, shape: tuple[int, int]) -> None:
    """Raise BadInput for what is no (H, W, 3) uint8 image of this (H, W)."""
    if color.dtype != np.uint8 or color.shape != (*shape, 3):
        raise BadInput(
            f"the colour image is {color.shape} {color.dtype}, not {(*shape, 3)} uint8",
            hint="give the image and the camera that belong together",
        )


def check_depth(depth: np.ndarray, shape: tuple[int, int]) -> None:
    """Raise BadInput for a depth image of another (H, W)."""
    if depth.shape != shape:
        raise BadInput(f"the depth image is {depth.shape}, not {shape}", hint="align depth to colour first")


def check_images(color: np.ndarray, depth: np.ndarray, view: OverheadCamera) -> None:
    """Raise BadInput in one line when the images cannot be what the camera saw of the table."""
    shape = (view.camera.height, view.camera.width)
    check_color(color, shape)
    check_depth(depth, shape)
    down = view.world_from_camera[:3, 2]
    if down[2] > -0.9995:
        raise BadInput(
            "the camera does not look straight down on the table", hint="rectify the frame to the table plane first"
        )
    if not np.isfinite(depth).all():
        raise BadInput("the depth image holds values that are not numbers", hint="use 0 where there is no depth")


def height_map(
    color: np.ndarray, depth: np.ndarray, view: OverheadCamera, sides: tuple[float, float] = TABLE_SIDES
) -> HeightMap:
    """Return heights above the table plane, which is fitted to the depth.

    `color` (H, W, 3) uint8, `depth` (H, W) metres, 0 where unknown. Raises BadInput for no depth or a wrong scale.
    """
    check_images(color, depth, view)
    camera, above = view.camera, float(view.world_from_camera[2, 3])
    half = [0.5 * side * camera.fx / (above - 0.15) + 6 for side in sides]
    left, top = max(0, int(camera.cx - half[0])), max(0, int(camera.cy - half[1]))
    right, bottom = min(camera.width, int(camera.cx + half[0]) + 2), min(camera.height, int(camera.cy + half[1]) + 2)
    part = np.ascontiguousarray(depth[top:bottom, left:right], dtype=np.float32)
    valid = part > 0.0
    share = float(valid.mean())
    if share < LEAST_VALID:
        raise BadInput(f"{share:.0%} of the pixels over the table have depth", hint="detection needs an RGB-D image")
    middle = float(np.median(part[::4, ::4][valid[::4, ::4]]))
    if not 0.5 * above < middle < 2.2 * above:
        raise BadInput(
            f"the depth image says {middle:.4g} where the table is {above:.3g} m away",
            hint="depth must be in metres" if middle > 50 else "check the camera's height",
        )
    plane = _table_plane(part, (camera.cx - left, camera.cy - top), (camera.fx, camera.fy), above, sides)
    raw, valid, tall = _heights(part, float(plane[0]), float(plane[1]), float(plane[2]))
    weight = cv2.boxFilter(valid.astype(np.float32), -1, (7, 7))
    filled = _fill_gaps(raw, valid, cv2.boxFilter(raw, -1, (7, 7)), weight)
    return HeightMap(
        raw=raw,
        valid=valid,
        tall=tall,
        smooth=cv2.medianBlur(filled, 5),
        color=color[top:bottom, left:right],
        focal=(camera.fx, camera.fy),
        center=(camera.cx - left, camera.cy - top),
        camera_height=above,
        corner=(left, top),
        sides=sides,
    )


def _table_plane(
    part: np.ndarray, center: tuple[float, float], focal: tuple[float, float], above: float, sides: tuple[float, float]
) -> np.ndarray:
    """Return (a, b, c) of the table's depth a u + b v + c [m] on every sixth pixel, by least squares that leave out
    more and more."""
    v, u = np.mgrid[0 : part.shape[0] : 6, 0 : part.shape[1] : 6]
    z = part[::6, ::6]
    inside = (np.abs(u - center[0]) < 0.49 * sides[0] * focal[0] / above) & (
        np.abs(v - center[1]) < 0.49 * sides[1] * focal[1] / above
    )
    u, v, z = u[inside & (z > 0)], v[inside & (z > 0)], z[inside & (z > 0)]
    near_table = z[np.abs(z - above) < PLANE_OFF]
    if len(near_table) < 0.05 * max(len(z), 200):
        raise BadInput(
            f"no table is seen {above:.3g} m below the camera", hint="check the depth's scale and the height"
        )
    plane = np.array([0.0, 0.0, float(np.median(near_table))])
    columns = np.column_stack([u, v, np.ones(len(u))]).astype(np.float64)
    for turn, width in enumerate((PLANE_BAND, 0.008, 0.004, PLANE_WIDTH, PLANE_WIDTH, PLANE_WIDTH)):
        residual = z - columns @ plane
        # Welsch's weights: floors of dishes and utensils lie above the table alone and would lift a trimmed mean.
        weight = (np.abs(residual) < width).astype(float) if turn < 2 else np.exp(-0.5 * (residual / width) ** 2)
        weight[np.abs(residual) > 4.0 * width] = 0.0
        if weight.sum() < 50.0:
            break
        weighted = columns * weight[:, None]
        plane = np.linalg.solve(columns.T @ weighted + 1e-9 * np.eye(3), weighted.T @ z)
    return plane


@compiled
def _heights(part: np.ndarray, a: float, b: float, c: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return heights (h, w) [m] over the plane of depth a u + b v + c, 0 where not valid, (h, w) bool valid, and (h, w)
    bool taller than TALLEST.

    What lies beyond the table's edge counts as low: unknown there, it would be filled with the dish that juts out."""
    raw, valid = np.zeros(part.shape, np.float32), np.zeros(part.shape, np.bool_)
    tall = np.zeros(part.shape, np.bool_)
    for v in range(part.shape[0]):
        for u in range(part.shape[1]):
            height = np.float32(a * u + b * v + c - part[v, u])
            if part[v, u] > 0.0:
                if height < TALLEST:
                    valid[v, u] = True
                    raw[v, u] = max(height, LOWEST)
                else:
                    tall[v, u] = True
    return raw, valid, tall


@compiled
def _fill_gaps(raw: np.ndarray, valid: np.ndarray, sums: np.ndarray, weight: np.ndarray) -> np.ndarray:
    filled = raw.copy()
    for v in range(raw.shape[0]):
        for u in range(raw.shape[1]):
            if not valid[v, u]:
                filled[v, u] = sums[v, u] / max(weight[v, u], np.float32(1e-3))
    return filled
