"""Dense alignment of two frames: point-to-plane distance and brightness difference together, Gauss-Newton.

The hybrid objective of Park, Zhou and Koltun (Colored point cloud registration revisited, ICCV 2017) with projective
association (KinectFusion, Newcombe 2011), weights by the sensor's noise at each depth (Nguyen, Izadi and Lovell 2012),
and gain and bias of the exposure estimated along. One thread adds up in one order, so that the same frames give the
same bits; Open3D's parallel sums do not.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scenewright.stages.kit.compiled import compiled
from scenewright.stages.kit.registration.pyramid import Level, Pyramid
from scenewright.stages.kit.registration.rigid_motion import exponential, orthonormal

PARAMETERS = 8
"""Rotation, translation, gain and bias."""
ITERATIONS = (6, 8, 10)
"""Most iterations a level, the finest first."""
STRIDES = (2, 1, 1)
"""Every how many-th pixel of the source is compared, per level."""
GATES = (0.06, 0.12, 0.25)
"""Points farther apart than this are no pair, per level [m]."""
TOLERANCES = (2.0, 4.0, 8.0)
"""Residuals of so many standard deviations begin to lose weight, per level: from wide to narrow basins."""
BRIGHTNESS_NOISE = 0.03
"""Standard deviation of the brightness of one surface point in two frames, exposure apart."""
BRIGHTNESS_GATE = 0.3
"""Largest difference of brightness that counts (0 to 1); by eye."""
INDEPENDENT_SHARE = 0.01
"""Neighbouring residuals are alike: so many of them count as independent when uncertainty is stated."""
SYSTEMATIC_DEPTH = 0.005
"""Error of a depth camera that stays from frame to frame (lens, scale, bending of planes), as a share of the depth. It
keeps near surfaces, whose noise is a millimetre, from outweighing everything else. Chosen: docs/MAPPING.md."""
SMALLEST_STEP = 2e-5
"""Steps below this end a level [rad and m]."""
SUMS = 8
"""How many sums there are."""
SAMPLES, ON_SURFACE, FLOATING, HIDDEN, PLANES, PLANE_SQUARES, COLORS, COLOR_SQUARES = range(SUMS)
"""What is summed over the pixels of the source beside the equations: how many were compared, lie on the target's
surface, before it and behind it; how many gave an equation by distance and by brightness, and the squares of those."""
_FIRST, _SECOND = np.triu_indices(PARAMETERS)


@dataclass(frozen=True)
class Alignment:
    """Where a source frame is, seen from a target frame."""

    target_from_source: np.ndarray
    """(4, 4)."""
    information: np.ndarray
    """(6, 6) inverse covariance of a perturbation from the left (rotation [rad], translation [m])."""
    overlap: float
    """Share of the source's points that lie on the target's surface."""
    agreement: float
    """Of the points that should be seen in the target, the share that lies on its surface: 1 when nothing floats in
    front of what the target saw."""
    residual: float
    """Root mean square distance to the target's planes [m]."""
    brightness_residual: float
    """Root mean square difference of the brightness, exposure apart, 0 without colour. Planes slide on each other
    without any distance between them; their pictures do not."""

    @property
    def uncertainty(self) -> float:
        """Standard deviation in the worst direction, rotations counted at 1 m [m]; infinite when degenerate."""
        least = float(np.linalg.eigvalsh(self.information)[0])
        return float(least**-0.5) if least > 0 else float("inf")


class _Comparison(NamedTuple):
    """How two frames are compared on a level; see STRIDES, GATES and TOLERANCES."""

    stride: int
    gate: float
    tolerance: float
    use_color: bool


@compiled(fastmath=False)
def _accumulate(
    target: Level, source: Level, motion: np.ndarray, gain: float, bias: float, comparison: _Comparison
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the upper triangle of the normal matrix (36,), the right side (8,), and the sums (SUMS,)."""
    target_points, target_normals = target.points, target.normals
    target_brightness, target_gradient = target.brightness, target.gradient
    source_points, source_normals, source_brightness = source.points, source.normals, source.brightness
    stride, gate, tolerance, use_color = comparison
    fx, fy, cx, cy = target.intrinsics
    height, width = target_points.shape[:2]
    matrix = np.zeros(PARAMETERS * (PARAMETERS + 1) // 2)
    right = np.zeros(PARAMETERS)
    sums = np.zeros(SUMS)
    row = np.zeros(PARAMETERS)
    for v in range(0, source_points.shape[0], stride):
        for u in range(0, source_points.shape[1], stride):
            z_source = source_points[v, u, 2]
            if z_source <= 0:
                continue
            sums[SAMPLES] += 1
            x, y = source_points[v, u, 0], source_points[v, u, 1]
            q0 = motion[0, 0] * x + motion[0, 1] * y + motion[0, 2] * z_source + motion[0, 3]
            q1 = motion[1, 0] * x + motion[1, 1] * y + motion[1, 2] * z_source + motion[1, 3]
            q2 = motion[2, 0] * x + motion[2, 1] * y + motion[2, 2] * z_source + motion[2, 3]
            if q2 <= 0.05:
                continue
            column, line = fx * q0 / q2 + cx, fy * q1 / q2 + cy
            ut, vt = int(np.floor(column + 0.5)), int(np.floor(line + 0.5))
            if ut < 1 or vt < 1 or ut >= width - 1 or vt >= height - 1:
                continue
            z_target = target_points[vt, ut, 2]
            if z_target <= 0:
                continue
            noise = np.hypot(0.0012 + 0.0019 * (q2 - 0.4) ** 2, SYSTEMATIC_DEPTH * q2)
            reach = gate + 2 * noise
            if q2 - z_target > reach:
                sums[HIDDEN] += 1
                continue
            if z_target - q2 > reach:
                sums[FLOATING] += 1
                continue
            sums[ON_SURFACE] += 1
            n0, n1, n2 = target_normals[vt, ut, 0], target_normals[vt, ut, 1], target_normals[vt, ut, 2]
            if n0 != 0 or n1 != 0 or n2 != 0:
                s0, s1, s2 = source_normals[v, u, 0], source_normals[v, u, 1], source_normals[v, u, 2]
                m0 = motion[0, 0] * s0 + motion[0, 1] * s1 + motion[0, 2] * s2
                m1 = motion[1, 0] * s0 + motion[1, 1] * s1 + motion[1, 2] * s2
                m2 = motion[2, 0] * s0 + motion[2, 1] * s1 + motion[2, 2] * s2
                if m0 * n0 + m1 * n1 + m2 * n2 > 0.7:
                    d0 = q0 - target_points[vt, ut, 0]
                    d1 = q1 - target_points[vt, ut, 1]
                    d2 = q2 - z_target
                    distance = n0 * d0 + n1 * d1 + n2 * d2
                    # Noise is along the ray; what of it is along the normal is what the plane sees.
                    sigma = noise * max(abs(n2), 0.3)
                    scaled = distance / (tolerance * sigma)
                    weight = 1.0 / (sigma * sigma * (1.0 + scaled * scaled) ** 2)
                    row[0], row[1], row[2] = q1 * n2 - q2 * n1, q2 * n0 - q0 * n2, q0 * n1 - q1 * n0
                    row[3], row[4], row[5] = n0, n1, n2
                    k = 0
                    for i in range(6):
                        right[i] -= weight * row[i] * distance
                        for j in range(i, 6):
                            matrix[k] += weight * row[i] * row[j]
                            k += 1
                        k += 2
                    sums[PLANES] += 1
                    sums[PLANE_SQUARES] += distance * distance
            source_value = source_brightness[v, u]
            if not use_color or source_value < 0:
                continue
            left_column, top = int(np.floor(column)), int(np.floor(line))
            a, b = column - left_column, line - top
            value, along_u, along_v, measured = 0.0, 0.0, 0.0, True
            for k in range(4):
                i, j = top + k // 2, left_column + k % 2
                measured = measured and target_brightness[i, j] >= 0
                share = (b if k // 2 else 1.0 - b) * (a if k % 2 else 1.0 - a)
                value += share * target_brightness[i, j]
                along_u += share * target_gradient[i, j, 0]
                along_v += share * target_gradient[i, j, 1]
            if not measured:
                continue
            difference = value - gain * source_value - bias
            sums[COLORS] += 1
            sums[COLOR_SQUARES] += min(difference * difference, BRIGHTNESS_GATE * BRIGHTNESS_GATE)
            if abs(difference) > BRIGHTNESS_GATE:
                continue
            scaled = difference / (tolerance * BRIGHTNESS_NOISE)
            weight = 1.0 / (BRIGHTNESS_NOISE * BRIGHTNESS_NOISE * (1.0 + scaled * scaled) ** 2)
            g0, g1 = along_u * fx / q2, along_v * fy / q2
            g2 = -(g0 * q0 + g1 * q1) / q2
            row[0], row[1], row[2] = q1 * g2 - q2 * g1, q2 * g0 - q0 * g2, q0 * g1 - q1 * g0
            row[3], row[4], row[5], row[6], row[7] = g0, g1, g2, -source_value, -1.0
            k = 0
            for i in range(PARAMETERS):
                right[i] -= weight * row[i] * difference
                for j in range(i, PARAMETERS):
                    matrix[k] += weight * row[i] * row[j]
                    k += 1
    return matrix, right, sums


def align(
    target: Pyramid,
    source: Pyramid,
    guess: np.ndarray,
    *,
    use_color: bool = True,
    coarsest: int | None = None,
    iterations: tuple[int, ...] = ITERATIONS,
) -> Alignment:
    """Return where `source` is in `target` (target_from_source), beginning at `guess` (4, 4).

    `coarsest` is the level to begin at (default: the last); a good guess needs no coarse ones. With too little in
    common the result is the guess with zero information and overlap.
    """
    use_color = use_color and target.has_color and source.has_color
    motion, gain, bias = orthonormal(np.asarray(guess, dtype=float)), 1.0, 0.0
    last = min(len(target.levels), len(source.levels)) - 1
    first = last if coarsest is None else min(coarsest, last)
    matrix, sums = np.zeros((PARAMETERS, PARAMETERS)), np.zeros(SUMS)
    for number in range(first, -1, -1):
        for _ in range(iterations[number]):
            matrix, right, sums = _normal_equations(
                target.levels[number], source.levels[number], motion, gain, bias, number, use_color
            )
            if sums[PLANES] < 100:
                break
            step = np.linalg.solve(matrix + _damping(matrix), right)
            motion = orthonormal(exponential(step[:6]) @ motion)
            gain, bias = gain + step[6], bias + step[7]
            if np.abs(step[:6]).max() < SMALLEST_STEP:
                break
    matrix, _, sums = _normal_equations(target.levels[0], source.levels[0], motion, gain, bias, 0, use_color)
    return _summarise(motion, matrix, sums)


def judge(target: Pyramid, source: Pyramid, target_from_source: np.ndarray, level: int = 0) -> Alignment:
    """Return the figures of a pose as it is, by depth alone."""
    number = min(level, len(target.levels) - 1, len(source.levels) - 1)
    matrix, _, sums = _normal_equations(
        target.levels[number], source.levels[number], np.asarray(target_from_source, dtype=float), 1, 0, number, False
    )
    return _summarise(np.asarray(target_from_source, dtype=float), matrix, sums)


def _normal_equations(
    target: Level, source: Level, motion: np.ndarray, gain: float, bias: float, number: int, use_color: bool
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    comparison = _Comparison(STRIDES[number], GATES[number], TOLERANCES[number], use_color)
    packed, right, sums = _accumulate(target, source, motion, float(gain), float(bias), comparison)
    matrix = np.zeros((PARAMETERS, PARAMETERS))
    matrix[_FIRST, _SECOND] = packed
    matrix[_SECOND, _FIRST] = packed
    return matrix, right, sums


def _damping(matrix: np.ndarray) -> np.ndarray:
    """A little of the diagonal, so that directions that nothing fixes stay where they were guessed."""
    diagonal = np.diag(matrix).copy()
    floor = 1e-4 * max(float(diagonal[:6].max()), 1.0)
    diagonal[:6] = 1e-4 * diagonal[:6] + 0.1 * floor
    diagonal[6:] = 1e-3 * diagonal[6:] + 1.0
    return np.diag(diagonal)


def _summarise(motion: np.ndarray, matrix: np.ndarray, sums: np.ndarray) -> Alignment:
    samples, on_surface, floating, _, planes, plane_squares, colors, color_squares = sums
    motion_part, mixed, exposure = matrix[:6, :6], matrix[:6, 6:], matrix[6:, 6:]
    # What the unknown exposure takes from the motion's certainty (Schur complement).
    information = motion_part - mixed @ np.linalg.solve(exposure + np.eye(2), mixed.T)
    information = 0.5 * (information + information.T) * INDEPENDENT_SHARE
    return Alignment(
        target_from_source=motion,
        information=information,
        overlap=float(on_surface / samples) if samples else 0.0,
        agreement=float(on_surface / (on_surface + floating)) if on_surface else 0.0,
        residual=float(np.sqrt(plane_squares / planes)) if planes else 0.0,
        brightness_residual=float(np.sqrt(color_squares / colors)) if colors else 0.0,
    )
