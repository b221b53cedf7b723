"""Fit a circle of known radius to the needle's masks in both eyes, where the edges are; compiled where it counts.

The circle is projected into both eyes. Across its curve, at each of CIRCLE_ANGLES, the mask is scanned for the run of
mask that is nearest to the curve and as wide as the wire should be there: the run's middle, in pixels from the curve,
is the residual. Robust Gauss-Newton steps move the centre (3), turn the plane (2), and shift the right image (2): the
calibration's error is estimated along with the pose, held by a prior.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from stages.suture.rig import NEEDLE_RADIUS, StereoRig

CIRCLE_ANGLES = np.linspace(0.0, 2.0 * np.pi, 180, endpoint=False)
WIRE_WIDTH = 0.0010
CALIBRATION_SIGMA = 0.3
"""Prior standard deviation [px] of the right image's shift."""
RESIDUAL_SIGMA = 0.35
"""What a cross-section's middle is off by [px] when the fit is right."""
HIDDEN_WEIGHT = 0.3
"""What is seen where a driver should be is needle before the driver, or the driver's own bright edge."""
CORRELATED = 5.0
"""Neighbouring cross-sections share their errors (the masks' outlines wander): so many count as one."""


@dataclass(frozen=True)
class EyeMask:
    """A window of one eye's mask: `soft` (h, w) float32 smoothed mask, `hidden` (h, w) bool or None, first pixel."""

    soft: np.ndarray
    hidden: np.ndarray
    column: int
    row: int


@dataclass(frozen=True)
class CircleFit:
    """A circle: `frame` (3, 3) with columns u, v (in the plane) and the normal; `centre` (3,) [m]; the right image's
    `shift` (2,) [px]; `offsets`, `widths` (2, A) [px] of the mask's runs in both eyes (NaN: no run there); `hidden`
    (2, A) where something may hide the needle; `expected` (2, A) the width the wire should have [px]."""

    frame: np.ndarray
    centre: np.ndarray
    shift: np.ndarray
    offsets: np.ndarray
    widths: np.ndarray
    hidden: np.ndarray
    expected: np.ndarray
    information: np.ndarray


@numba.njit(cache=True, fastmath=True)
def _scan(
    soft: np.ndarray,
    hidden: np.ndarray,
    columns: np.ndarray,
    rows: np.ndarray,
    across: np.ndarray,
    band: float,
    expected: np.ndarray,
    offsets: np.ndarray,
    widths: np.ndarray,
    is_hidden: np.ndarray,
) -> None:
    """Write each curve point's nearest plausible run of mask across the curve: offset of its middle and width [px]."""
    height, width = soft.shape
    step = 0.5
    for index in range(len(columns)):
        offsets[index], widths[index] = np.nan, np.nan
        is_hidden[index] = False
        x0, y0 = columns[index], rows[index]
        column, row = int(np.floor(x0 + 0.5)), int(np.floor(y0 + 0.5))
        if 0 <= column < width and 0 <= row < height:
            is_hidden[index] = hidden[row, column]
        else:
            continue
        reach = band + expected[index]
        count = int(2 * reach / step) + 1
        previous, entered, best = 0.0, 0.0, 1e9
        inside = False
        for k in range(count + 1):
            position = -reach + k * step
            x, y = x0 + position * across[index, 0], y0 + position * across[index, 1]
            value = 0.0
            column, row = int(np.floor(x)), int(np.floor(y))
            if k < count and 0 <= column < width - 1 and 0 <= row < height - 1:
                a, b = x - column, y - row
                value = (1 - b) * ((1 - a) * soft[row, column] + a * soft[row, column + 1])
                value += b * ((1 - a) * soft[row + 1, column] + a * soft[row + 1, column + 1])
            if not inside and value >= 0.45:
                entered = position - step * (value - 0.45) / (value - previous + 1e-9) if k > 0 else position
                inside = True
            elif inside and value < 0.45:
                left = position - step * (0.45 - value) / (previous - value + 1e-9)
                run, middle = left - entered, 0.5 * (left + entered)
                plausible = 0.3 * expected[index] - 0.5 < run < 1.5 * expected[index] + 1.5
                if plausible and abs(middle) < abs(best) and abs(middle) <= band:
                    best = middle
                    offsets[index], widths[index] = middle, run
                inside = False
            previous = value


def _project(
    rig: StereoRig, points: np.ndarray, directions: np.ndarray, eye: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return pixels (A, 2), the unit normals (A, 2) of the curve there and the projection's Jacobian (A, 2, 3)."""
    x = points[:, 0] - (rig.baseline if eye else 0.0)
    y, z = points[:, 1], np.maximum(points[:, 2], 1e-3)
    jacobian = np.zeros((len(points), 2, 3))
    jacobian[:, 0, 0] = jacobian[:, 1, 1] = rig.focal / z
    jacobian[:, 0, 2], jacobian[:, 1, 2] = -rig.focal * x / z**2, -rig.focal * y / z**2
    pixels = np.stack([rig.focal * x / z + rig.centre[0], rig.focal * y / z + rig.centre[1]], axis=1)
    along = np.einsum("aij,aj->ai", jacobian, directions)
    along /= np.linalg.norm(along, axis=1, keepdims=True) + 1e-9
    return pixels, np.stack([-along[:, 1], along[:, 0]], axis=1), jacobian


def measure(
    rig: StereoRig, eyes: tuple[EyeMask, EyeMask], frame: np.ndarray, centre: np.ndarray, shift: np.ndarray, band: float
) -> tuple[CircleFit, np.ndarray]:
    """Return the circle with the masks' runs across it, and the Jacobian (2, A, 7) of the offsets.

    The parameters are the centre's shift (3) [m], turns about u and v (2) [rad] and the right image's shift (2) [px].
    """
    cosine, sine = np.cos(CIRCLE_ANGLES)[:, None], np.sin(CIRCLE_ANGLES)[:, None]
    u, v, normal = frame[:, 0], frame[:, 1], frame[:, 2]
    arms = NEEDLE_RADIUS * (cosine * u + sine * v)
    tangents = cosine * v - sine * u
    # a turn about u moves a point by u x arm, which is along the normal; likewise about v
    about_u, about_v = NEEDLE_RADIUS * sine * normal, -NEEDLE_RADIUS * cosine * normal
    points = centre + arms
    count = len(points)
    offsets, widths = np.empty((2, count)), np.empty((2, count))
    hidden, expected = np.zeros((2, count), dtype=np.bool_), np.empty((2, count))
    jacobian = np.zeros((2, count, 7))
    for eye in (0, 1):
        pixels, across, projection = _project(rig, points, tangents, eye)
        if eye:
            pixels = pixels + shift
        expected[eye] = WIRE_WIDTH * rig.focal / np.maximum(points[:, 2], 1e-3)
        window = eyes[eye]
        _scan(
            window.soft,
            window.hidden,
            pixels[:, 0] - window.column,
            pixels[:, 1] - window.row,
            across,
            band,
            expected[eye],
            offsets[eye],
            widths[eye],
            hidden[eye],
        )
        row = np.einsum("ai,aij->aj", across, projection)
        jacobian[eye, :, :3] = row
        jacobian[eye, :, 3] = (row * about_u).sum(axis=1)
        jacobian[eye, :, 4] = (row * about_v).sum(axis=1)
        if eye:
            jacobian[eye, :, 5:] = across
    return CircleFit(frame, centre, shift, offsets, widths, hidden, expected, np.zeros((7, 7))), jacobian


def turned(frame: np.ndarray, about_u: float, about_v: float) -> np.ndarray:
    """Return the frame (3, 3) turned by small angles [rad] about its own u and v."""
    u, v = frame[:, 0], frame[:, 1]
    turn = about_u * u + about_v * v
    angle = float(np.linalg.norm(turn))
    if angle < 1e-12:
        return frame
    k = turn / angle
    cross = np.array([[0.0, -k[2], k[1]], [k[2], 0.0, -k[0]], [-k[1], k[0], 0.0]])
    rotation = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    return rotation @ frame


def refine(
    rig: StereoRig,
    eyes: tuple[EyeMask, EyeMask],
    frame: np.ndarray,
    centre: np.ndarray,
    bands: tuple[float, ...],
    shift: np.ndarray | None = None,
    arc: tuple[float, float] | None = None,
) -> CircleFit:
    """Return the circle moved onto the masks by one Gauss-Newton step for each of `bands` [px].

    A step looks for mask within its band of the curve; its loss is Cauchy's, at a quarter of the band or more. With
    `arc` (middle angle, half width) [rad] only cross-sections of that part of the circle count.
    """
    shift = np.zeros(2) if shift is None else shift
    prior = np.zeros((7, 7))
    prior[5, 5] = prior[6, 6] = 1.0 / CALIBRATION_SIGMA**2
    noise = RESIDUAL_SIGMA**2 * CORRELATED
    counts = np.ones(len(CIRCLE_ANGLES), dtype=bool)
    if arc is not None:
        counts = np.abs((CIRCLE_ANGLES - arc[0] + np.pi) % (2 * np.pi) - np.pi) <= arc[1]
    for band in bands:
        fit, jacobian = measure(rig, eyes, frame, centre, shift, band)
        use = np.isfinite(fit.offsets) & counts
        if use.sum() < 8:
            return fit
        residual, rows = fit.offsets[use], jacobian[use]
        scale = max(band / 4.0, 2.0 * RESIDUAL_SIGMA)
        weight = 1.0 / (1.0 + (residual / scale) ** 2) / noise
        weight[fit.hidden[use]] *= HIDDEN_WEIGHT
        normal_matrix = (rows * weight[:, None]).T @ rows + prior
        right_side = rows.T @ (weight * residual)
        right_side[5:] -= prior[5, 5] * shift
        # a little damping in units of 20 mm and 1 rad keeps a step that the data do not determine small
        damping = np.array([1 / 0.02**2] * 3 + [1.0] * 2 + [0.0] * 2)
        step = np.linalg.solve(normal_matrix + np.diag(damping), right_side)
        turn_size = float(np.hypot(step[3], step[4]))
        step[3:5] *= min(1.0, 0.5 / max(turn_size, 1e-9))
        centre = centre + step[:3]
        frame = turned(frame, float(step[3]), float(step[4]))
        shift = np.clip(shift + step[5:], -2.0, 2.0)
    fit, jacobian = measure(rig, eyes, frame, centre, shift, bands[-1])
    use = np.isfinite(fit.offsets) & counts
    residual, rows = fit.offsets[use], jacobian[use]
    weight = 1.0 / (1.0 + (residual / (2.0 * RESIDUAL_SIGMA)) ** 2) / noise
    weight[fit.hidden[use]] *= HIDDEN_WEIGHT
    information = (rows * weight[:, None]).T @ rows + prior
    return CircleFit(fit.frame, fit.centre, fit.shift, fit.offsets, fit.widths, fit.hidden, fit.expected, information)
