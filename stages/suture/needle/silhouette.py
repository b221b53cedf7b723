"""Fit the needle's outline: a tapered half circle is drawn into both eyes and compared with the masks pixel by pixel.

The middle of a run of mask is the wire's middle only where the wire runs alone. Near edge-on both halves of the arc run
into one mask; the outline of what the whole needle covers still says where it is. So the needle is drawn as a chain of
cones; each pixel near it has a signed distance to the outline; the logistic function of that distance is compared with
the logistic function of its signed distance to the mask's outline, from wide to narrow. Levenberg-Marquardt steps move
the pose (6) and shift the right image (2). Pixels of thread, or where a driver may hide the needle, say nothing where
there is no mask; what the needle covers far from any mask says little, as masks lose stretches and tissue hides more.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np
from scenewright.stages.kit.compiled import compiled
from scenewright.stages.suture.needle.windows import EyeMask
from scenewright.stages.suture.rig import NEEDLE_RADIUS, NeedlePose, StereoRig

PIECES = 45
"""Pieces of the outline along the arc; by eye."""
ANGLES = np.linspace(0.0, np.pi, PIECES + 1)
"""Angles [rad] of the pieces' ends, from the tip (0) to the swage (pi)."""
WIRE_RADIUS, TIP_RADIUS, TAPER_ANGLE = 0.0005, 0.00004, 0.7
"""Half the wire's and the tip's thickness [m] of the needle's data sheet; the taper runs over 8.4 mm [rad]."""
ALONG = np.clip(ANGLES / TAPER_ANGLE, 0.0, 1.0)
"""Share of the taper at each of ANGLES, 1 from its end on."""
RADII = TIP_RADIUS + (WIRE_RADIUS - TIP_RADIUS) * (1.0 - (1.0 - ALONG) ** 1.6)
"""Half the wire's thickness [m] at each of ANGLES; the power of the taper is by eye."""
ON_CIRCLE = NEEDLE_RADIUS * np.stack([np.cos(ANGLES), np.sin(ANGLES)], axis=1)
"""Points (PIECES + 1, 2) of the arc in the needle's plane [m]."""
GROWTH = 0.03
"""Masks are wider than the wire by this on either side [px]."""
CALIBRATION_SIGMA = 0.3
"""Prior standard deviation [px] of the right image's shift."""
PIXEL_VARIANCE = 0.4
"""Variance of a pixel's misfit with neighbours that err alike counted in; the calibration's prior is set against it."""
LOST_WEIGHT, LOST_DISTANCE = 0.1, 2.0
"""Weight of a pixel that should be mask and is far from any; it falls to that over this distance [px]."""
HIDDEN_WEIGHT = 0.5
"""Weight of mask where a driver should be."""
LARGEST_STEP, LEAST_GAIN = 0.4, 0.05
"""A step turns by no more than this [rad]; steps that gain less [px] are the last."""
OFF_BY = 0.8
"""Distance [px] between drawn and found outline that a polishing step counts half: lumps are not the wire."""
UNDETERMINED = np.diag([1.0 / 0.06**2] * 3 + [1.0 / 3.0**2] * 3 + [0.0] * 2)
"""Holds what the masks do not determine, in units of 60 mm and 3 rad."""


class Sheet(NamedTuple):
    """One eye's window for the fit: `signed` (h, w) float32 distance [px] to the mask's outline, negative inside;
    `weight` (h, w) float32 of each pixel; `free` (h, w) bool: mask where no driver should be; `silent` (h, w) bool
    where missing mask says nothing; `corner` (2,): its first column and row; `total`: the misfit
    without a needle; `drawn`, `piece` (h, w): room for the drawing, `piece` -1 between uses. The compiled functions
    take it as it is."""

    signed: np.ndarray
    weight: np.ndarray
    free: np.ndarray
    silent: np.ndarray
    corner: np.ndarray
    total: float
    drawn: np.ndarray
    piece: np.ndarray


class Arc(NamedTuple):
    """A needle that is drawn: `pose` (4, 4) in the left camera's frame [m], `shift` (2,) of the right image [px],
    `camera` (4,) focal length, principal point, baseline, `on_circle` (K, 2) and `radii` (K,) of the wire [m], `growth`
    of the mask beyond it [px]."""

    pose: np.ndarray
    shift: np.ndarray
    camera: np.ndarray
    on_circle: np.ndarray
    radii: np.ndarray
    growth: float


@dataclass(frozen=True)
class Outline:
    """A fitted outline: pose, the right image's shift (2) [px], the misfit, and the information (8, 8) about centre
    [m], rotation vector [rad; camera frame] and shift, to be divided by a pixel's variance."""

    pose: NeedlePose
    shift: np.ndarray
    misfit: float
    information: np.ndarray


def sheet_of(eye: EyeMask) -> Sheet:
    """Return an eye's window made ready."""
    mask = eye.mask.astype(np.uint8)
    outside, inside = (cv2.distanceTransform(part, cv2.DIST_L2, 3) for part in (1 - mask, mask))
    signed = np.where(eye.mask, 0.5 - inside, outside - 0.5).astype(np.float32)
    weight = np.where(eye.mask, 1.0, LOST_WEIGHT + (1.0 - LOST_WEIGHT) / (1.0 + (signed / LOST_DISTANCE) ** 2))
    silent = eye.hidden | _dilate(eye.thread, 3)
    weight[silent & ~eye.mask] = 0.0
    weight[eye.hidden & eye.mask] = HIDDEN_WEIGHT
    free = eye.mask & ~eye.hidden
    drawn, piece = np.zeros(mask.shape, dtype=np.float32), np.full(mask.shape, -1, dtype=np.int16)
    total = float(weight[eye.mask].sum())
    return Sheet(signed, weight.astype(np.float32), free, silent, eye.corner, total, drawn, piece)


def _dilate(mask: np.ndarray, side: int) -> np.ndarray:
    """Return the mask grown by a square of `side` [px]."""
    return np.asarray(cv2.dilate(mask.astype(np.uint8), np.ones((side, side), np.uint8)) > 0)


@compiled(fastmath=True)
def trace(arc: Arc, corner: np.ndarray, eye: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the arc's points (K, 3) [m] and their columns, rows and radii (K, 3) [px] in the window."""
    pose, shift, camera, on_circle, radii = arc.pose, arc.shift, arc.camera, arc.on_circle, arc.radii
    count = len(radii)
    points, pixels = np.empty((count, 3)), np.empty((count, 3))
    for k in range(count):
        for i in range(3):
            points[k, i] = pose[i, 3] + on_circle[k, 0] * pose[i, 0] + on_circle[k, 1] * pose[i, 1]
        z = max(points[k, 2], 0.01)
        pixels[k, 0] = camera[0] * (points[k, 0] - eye * camera[3]) / z + camera[1] + eye * shift[0] - corner[0]
        pixels[k, 1] = camera[0] * points[k, 1] / z + camera[2] + eye * shift[1] - corner[1]
        pixels[k, 2] = radii[k] * camera[0] / z
    return points, pixels


@compiled(fastmath=True)
def box_of(pixels: np.ndarray, k: int, reach: float, stride: int, height: int, width: int) -> tuple[int, int, int, int]:
    """Return first and last column and row of the window's part within `reach` [px] of piece k, the first ones
    multiples of `stride`."""
    r = max(pixels[k, 2], pixels[k + 1, 2]) + reach
    left, right = min(pixels[k, 0], pixels[k + 1, 0]) - r, max(pixels[k, 0], pixels[k + 1, 0]) + r
    top, bottom = min(pixels[k, 1], pixels[k + 1, 1]) - r, max(pixels[k, 1], pixels[k + 1, 1]) + r
    limit = 1e6
    return (
        max(int(np.floor(max(left, -limit))), 0) // stride * stride,
        min(int(np.ceil(min(right, limit))), width - 1),
        max(int(np.floor(max(top, -limit))), 0) // stride * stride,
        min(int(np.ceil(min(bottom, limit))), height - 1),
    )


@compiled(fastmath=True)
def _foot(pixels: np.ndarray, k: int, column: int, row: int) -> tuple[float, float, float]:
    """Return the share (0 to 1) of piece k at which it is nearest to a pixel, and the way (x, y) [px] from there."""
    dx, dy = pixels[k + 1, 0] - pixels[k, 0], pixels[k + 1, 1] - pixels[k, 1]
    share = ((column - pixels[k, 0]) * dx + (row - pixels[k, 1]) * dy) / (dx * dx + dy * dy + 1e-12)
    share = min(max(share, 0.0), 1.0)
    return share, column - pixels[k, 0] - share * dx, row - pixels[k, 1] - share * dy


@compiled(fastmath=True)
def draw(pixels: np.ndarray, growth: float, reach: float, stride: int, drawn: np.ndarray, piece: np.ndarray) -> None:
    """Write each pixel's signed distance [px] to the outline, and the piece it is of, within `reach` of the pieces, for
    every `stride`th row and column."""
    height, width = drawn.shape
    for k in range(len(pixels) - 1):
        first, last, top, bottom = box_of(pixels, k, growth + reach, stride, height, width)
        for row in range(top, bottom + 1, stride):
            for column in range(first, last + 1, stride):
                share, x, y = _foot(pixels, k, column, row)
                distance = np.sqrt(x * x + y * y) - growth
                distance -= pixels[k, 2] + share * (pixels[k + 1, 2] - pixels[k, 2])
                if piece[row, column] < 0 or distance < drawn[row, column]:
                    drawn[row, column] = distance
                    piece[row, column] = k


@compiled(fastmath=True)
def _compare(
    arc: Arc, sheet: Sheet, eye: int, tau: float, scale: float, matrix: np.ndarray, gradient: np.ndarray
) -> float:
    """Return the misfit less what it is without a needle; add to the normal equations (8, 8), (8,)."""
    pose, camera, growth = arc.pose, arc.camera, arc.growth
    signed, weight, drawn, piece = sheet.signed, sheet.weight, sheet.drawn, sheet.piece
    height, width = signed.shape
    reach, stride = 3.0 * tau + 0.7, 2 if tau > 1.0 else 1
    area = float(stride * stride)
    points, pixels = trace(arc, sheet.corner, eye)
    draw(pixels, growth, reach, stride, drawn, piece)
    cost = 0.0
    jacobian = np.empty(8)
    for k in range(len(pixels) - 1):
        first, last, top, bottom = box_of(pixels, k, growth + reach, stride, height, width)
        if first > last or top > bottom:
            # out of the window there is no mask
            length = np.hypot(pixels[k + 1, 0] - pixels[k, 0], pixels[k + 1, 1] - pixels[k, 1])
            cost += min(length, 100.0) * (pixels[k, 2] + pixels[k + 1, 2])
            continue
        for row in range(top, bottom + 1, stride):
            for column in range(first, last + 1, stride):
                if piece[row, column] != k:
                    continue
                piece[row, column] = -1
                distance, w = drawn[row, column], area * weight[row, column]
                if w == 0.0 or distance > reach:
                    continue
                masked = 1.0 / (1.0 + np.exp(min(signed[row, column] / tau, 30.0)))
                model = 1.0 / (1.0 + np.exp(distance / tau))
                if distance < 0.0 and signed[row, column] > 0.0:
                    # masks end before the tip does: a wire thinner than a pixel or so need not be seen
                    w *= min(max(2.0 * pixels[k, 2] - 0.3, 0.05), 1.0)
                error = masked - model
                cost += w * (error * error - masked * masked)
                slope = model * (1.0 - model) / tau
                share, x, y = _foot(pixels, k, column, row)
                norm = np.sqrt(x * x + y * y)
                if slope < 1e-3 or norm < 1e-6:
                    continue
                px = points[k, 0] + share * (points[k + 1, 0] - points[k, 0])
                py = points[k, 1] + share * (points[k + 1, 1] - points[k, 1])
                pz = points[k, 2] + share * (points[k + 1, 2] - points[k, 2])
                # the model grows where the outline moves along its own normal
                gx, gy = slope * camera[0] / pz * x / norm, slope * camera[0] / pz * y / norm
                gz = -(gx * (px - eye * camera[3]) + gy * py) / pz
                ax, ay, az = px - pose[0, 3], py - pose[1, 3], pz - pose[2, 3]
                jacobian[0], jacobian[1], jacobian[2] = gx, gy, gz
                jacobian[3], jacobian[4], jacobian[5] = ay * gz - az * gy, az * gx - ax * gz, ax * gy - ay * gx
                jacobian[6], jacobian[7] = eye * slope * x / norm, eye * slope * y / norm
                if scale > 0.0:
                    # an outline that is off by much here is a lump's, not the wire's
                    w /= 1.0 + ((distance - signed[row, column]) / scale) ** 2
                for i in range(8):
                    weighted = w * jacobian[i]
                    gradient[i] += weighted * error
                    for j in range(i, 8):
                        matrix[i, j] += weighted * jacobian[j]
    return cost


@compiled(fastmath=True)
def _misfit(
    arc: Arc, sheets: tuple[Sheet, Sheet], tau: float, scale: float, matrix: np.ndarray, gradient: np.ndarray
) -> float:
    """Return the misfit with the calibration's prior; write the normal matrix (8, 8) and the downhill gradient (8,)."""
    matrix[:], gradient[:] = 0.0, 0.0
    precision = PIXEL_VARIANCE / CALIBRATION_SIGMA**2
    cost = precision * (arc.shift[0] ** 2 + arc.shift[1] ** 2)
    for eye, sheet in enumerate(sheets):
        cost += sheet.total + _compare(arc, sheet, eye, tau, scale, matrix, gradient)
    for i in range(8):
        for j in range(i):
            matrix[i, j] = matrix[j, i]
    for i in range(2):
        matrix[6 + i, 6 + i] += precision
        gradient[6 + i] -= precision * arc.shift[i]
    return cost


@compiled
def _take_step(arc: Arc, matrix: np.ndarray, gradient: np.ndarray, damping: float) -> Arc:
    """Return the needle after a damped Gauss-Newton step of pose and shift."""
    step = np.linalg.solve(matrix + damping * np.diag(np.diag(matrix)) + UNDETERMINED, gradient)
    angle = np.sqrt(step[3] ** 2 + step[4] ** 2 + step[5] ** 2)
    step *= min(1.0, LARGEST_STEP / max(angle, 1e-9))
    angle = min(angle, LARGEST_STEP)
    # Rodrigues' formula; the limits of its two factors where there is no turn
    sine = np.sin(angle) / angle if angle > 1e-8 else 1.0
    versine = (1.0 - np.cos(angle)) / angle**2 if angle > 1e-8 else 0.5
    cross = np.array([[0.0, -step[5], step[4]], [step[5], 0.0, -step[3]], [-step[4], step[3], 0.0]])
    turn = np.eye(3) + sine * cross + versine * (cross @ cross)
    pose = arc.pose.copy()
    pose[:3, :3] = turn @ np.ascontiguousarray(arc.pose[:3, :3])
    pose[:3, 3] += step[:3]
    return Arc(pose, arc.shift + step[6:], arc.camera, arc.on_circle, arc.radii, arc.growth)


@compiled
def _fit_to_masks(
    arc: Arc, sheets: tuple[Sheet, Sheet], levels: tuple[tuple[float, int], ...], polish: int
) -> tuple[Arc, float, np.ndarray]:
    """Return the needle moved onto the masks, its misfit and the information (8, 8)."""
    tau, cost = 1.0, 0.0
    matrix, gradient = np.eye(8), np.zeros(8)
    for tau, steps in levels:
        damping = 1e-3
        cost = _misfit(arc, sheets, tau, 0.0, matrix, gradient)
        for _ in range(steps):
            trial = _take_step(arc, matrix, gradient, damping)
            trial_matrix, trial_gradient = np.empty((8, 8)), np.empty(8)
            gain = cost - _misfit(trial, sheets, tau, 0.0, trial_matrix, trial_gradient)
            if gain > 0.0:
                arc, cost, matrix, gradient = trial, cost - gain, trial_matrix, trial_gradient
                damping = max(damping / 5.0, 1e-4)
                if gain < LEAST_GAIN:
                    break
            else:
                damping *= 8.0
                if damping > 1e3:
                    break
    for _ in range(polish):
        _misfit(arc, sheets, tau, OFF_BY, matrix, gradient)
        arc = _take_step(arc, matrix, gradient, 0.0)
    if polish:
        cost = _misfit(arc, sheets, tau, 0.0, np.empty((8, 8)), np.empty(8))
    return arc, cost, matrix


def camera_of(rig: StereoRig) -> np.ndarray:
    """Return the rig as the compiled functions take it: focal length, principal point, baseline."""
    return np.array([rig.focal, rig.centre[0], rig.centre[1], rig.baseline])


def arc_at(rig: StereoRig, pose: np.ndarray, shift: np.ndarray, growth: float = GROWTH) -> Arc:
    """Return the needle at a pose (4, 4) for the compiled functions; masks are wider by `growth` [px]."""
    return Arc(np.ascontiguousarray(pose, dtype=np.float64), shift, camera_of(rig), ON_CIRCLE, RADII, growth)


def fit_outline(
    rig: StereoRig,
    sheets: tuple[Sheet, Sheet],
    pose: NeedlePose,
    shift: np.ndarray,
    levels: tuple[tuple[float, int], ...],
    polish: int = 0,
    growth: float = GROWTH,
) -> Outline:
    """Return the outline moved onto the masks from `pose`, whose tip it takes for the tip; masks are taken to be wider
    than the wire by `growth` [px] on either side.

    `levels` are widths of the logistic function [px] and the most steps with each; `polish` steps at the last of them
    count less what is off by much. The information is the polished one's, the misfit the plain one's.
    """
    arc, cost, information = _fit_to_masks(arc_at(rig, pose.camera_from_needle, shift, growth), sheets, levels, polish)
    return Outline(NeedlePose(arc.pose), arc.shift, cost, information)
