"""Stereo pairs: which rotation and intrinsics put both eyes in rows, and how far apart they are."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.ingest.lenses import Lens, has_projection, lens_of, scaled_matrix, turned_lens
from scenewright.stages.ingest.messages.records import CalibrationRecord
from scenewright.stages.kit.geometry.transforms import transform_from

SMALLEST_BASELINE = 1e-3
"""Eyes nearer to each other than this [m] are one camera."""
LARGEST_BASELINE = 1.0
"""Largest distance of two eyes [m]; what is more is stated in another unit."""
UNCLEAR = (5.0, 20.0)
"""As millimetres rare, as centimetres usual. Less is millimetres of an endoscope, whose shaft holds both eyes; more is
too far apart in centimetres."""
PARALLEL = math.radians(20)
"""Eyes that look further apart than this are two cameras, not a pair."""


def projected_baseline(left: CalibrationRecord, right: CalibrationRecord) -> float | None:
    """Return how far along +x [m] the right eye stands by the projections P, None when they say nothing of it.

    P[3] is -fx times the distance from the left eye, so the left eye has 0 there, and so have cameras that are no pair.
    """
    if not has_projection(left) or not has_projection(right) or (left.P[3] == 0 and right.P[3] == 0):
        return None
    return left.P[3] / left.P[0] - right.P[3] / right.P[0]


def in_metres(baseline: float, where: str) -> tuple[float, str | None]:
    """Return a baseline of a calibration file in metres, and what was assumed: it has the unit of whoever calibrated.

    Raises BadInput for one that may as well be in centimetres.
    """
    length = abs(baseline)
    if length <= LARGEST_BASELINE:
        return baseline, None
    others = f"--baseline {length / 100:.4g} if it is in centimetres"
    low, high = UNCLEAR
    if low <= length < high:
        raise BadInput(
            f"{where}: the calibration's baseline is {length:.4g}, too long for metres: centimetres, or millimetres?",
            hint=f"{others}, --baseline {length / 1000:.4g} if in millimetres",
        )
    return baseline / 1000, f"WARNING: baseline of {length:.4g} taken as millimetres ({others})"


def is_pair(left: CalibrationRecord, right: CalibrationRecord, left_from_right: np.ndarray | None) -> bool:
    """Whether two calibrated cameras look like a stereo pair: by their projections, or because they stand apart and
    look the same way. The order of the two does not matter."""
    if projected_baseline(left, right) is not None:
        return True
    if left_from_right is None or np.linalg.norm(left_from_right[:3, 3]) < SMALLEST_BASELINE:
        return False
    offset = left_from_right[:3, 3] / np.linalg.norm(left_from_right[:3, 3])
    return bool(left_from_right[2, 2] > math.cos(PARALLEL) and abs(offset[0]) > math.cos(PARALLEL))


def stereo_lenses(
    calibrations: tuple[CalibrationRecord, CalibrationRecord],
    sizes: tuple[tuple[int, int], tuple[int, int]],
    rectified: tuple[bool, bool],
    left_from_right: np.ndarray | None,
    names: tuple[str, str],
    where: str,
    given: float | None = None,
) -> tuple[Lens, Lens, float]:
    """Return the lenses of the left and the right eye, whose images then differ along rows alone, and the baseline in
    the unit of the calibrations, negative where they say that left and right are exchanged; or the `given` one [m].

    Taken from the projections P and rotations R of the calibrations, else from `left_from_right` (4, 4). `names` are
    the topics. Raises BadInput for eyes at one place or one above the other, and when the log does not say how they
    stand to each other.
    """
    left, right = calibrations
    baseline = projected_baseline(left, right)
    if baseline is None and left_from_right is not None:
        return _from_transform(calibrations, sizes, rectified, left_from_right, names, where, given)
    if given is not None and has_projection(left) and has_projection(right):
        baseline = given  # two rectified cameras, and somebody who knows how far apart they stand
    if baseline is None:
        raise BadInput(
            f"{where}: nothing says how {names[0]} and {names[1]} stand to each other",
            hint="record their CameraInfo with P[3], or tf_static; of rectified cameras give --baseline METRES",
        )
    _check_baseline(baseline, names, where)
    if abs(right.P[7] - left.P[7]) > abs(right.P[3] - left.P[3]):
        raise _one_above_the_other(names, where)
    matrix, _ = scaled_matrix(left, tuple(left.P[i] for i in (0, 1, 2, 4, 5, 6, 8, 9, 10)), sizes[0], where, names[0])
    camera = _pinhole(matrix, sizes[0], left, where)
    lenses = []
    for calibration, size, flat, name in zip(calibrations, sizes, rectified, names, strict=True):
        turn = np.eye(3) if flat or len(calibration.R) != 9 else np.array(calibration.R, dtype=float).reshape(3, 3)
        if np.abs(turn @ turn.T - np.eye(3)).max() > 1e-3:
            raise BadInput(
                f"{where}: R of the calibration of {name} is not a rotation", hint="calibrate the pair again"
            )
        lenses.append(turned_lens(calibration, size, flat, camera, turn, where, name))
    return lenses[0], lenses[1], baseline


def _from_transform(
    calibrations: tuple[CalibrationRecord, CalibrationRecord],
    sizes: tuple[tuple[int, int], tuple[int, int]],
    rectified: tuple[bool, bool],
    left_from_right: np.ndarray,
    names: tuple[str, str],
    where: str,
    given: float | None,
) -> tuple[Lens, Lens, float]:
    """Rectify by turning both eyes so that their common x axis runs through both centres, the left picture's own x."""
    offset = left_from_right[:3, 3]
    baseline = math.copysign(float(np.linalg.norm(offset)), offset[0])
    if abs(offset[1]) > abs(offset[0]) and abs(baseline) >= SMALLEST_BASELINE:
        raise _one_above_the_other(names, where)
    _check_baseline(baseline, names, where)
    left_from_right = transform_from(left_from_right[:3, :3], offset * math.copysign(1.0, baseline))
    baseline = baseline if given is None else given
    turn = rectifying_rotation(left_from_right)
    plain = lens_of(calibrations[0], sizes[0], rectified[0], where, names[0])
    right_turn = turn @ left_from_right[:3, :3]
    lenses = [
        turned_lens(calibration, size, flat, plain.camera, rotation, where, name)
        for calibration, size, flat, rotation, name in zip(
            calibrations, sizes, rectified, (turn, right_turn), names, strict=True
        )
    ]
    rectified_left = replace(
        lenses[0], notes=(*lenses[0].notes, "stereo pair rectified by the transforms between its frames")
    )
    return rectified_left, lenses[1], baseline


def rectifying_rotation(left_from_right: np.ndarray) -> np.ndarray:
    """Return the (3, 3) rotation from the left eye's frame to the common one: x towards the right eye, z as near to
    the mean of both viewing directions as that allows."""
    x = left_from_right[:3, 3] / np.linalg.norm(left_from_right[:3, 3])
    forward = np.array([0.0, 0.0, 1.0]) + left_from_right[:3, 2]
    z = forward - (forward @ x) * x
    z = z / np.linalg.norm(z)
    return np.stack([x, np.cross(z, x), z])


def _pinhole(matrix: np.ndarray, size: tuple[int, int], record: CalibrationRecord, where: str) -> Camera:
    width, height = size if size != (0, 0) else (record.width, record.height)
    fx, fy, cx, cy = (float(matrix[i]) for i in ((0, 0), (1, 1), (0, 2), (1, 2)))
    return Camera.of_outside(where, width=width, height=height, fx=fx, fy=fy, cx=cx, cy=cy)


def _check_baseline(baseline: float, names: tuple[str, str], where: str) -> None:
    if abs(baseline) < SMALLEST_BASELINE or not math.isfinite(baseline):
        raise BadInput(
            f"{where}: {names[0]} and {names[1]} have no baseline ({baseline:g} m), so they are no stereo pair",
            hint="choose the right topic, or give --baseline METRES",
        )


def _one_above_the_other(names: tuple[str, str], where: str) -> BadInput:
    return BadInput(
        f"{where}: {names[0]} and {names[1]} stand one above the other", hint="only pairs in a row are read"
    )
