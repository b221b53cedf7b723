"""The camera or stereo pair that a calibration file describes.

Understood are ROS camera_calibration YAML, OpenCV's stereo YAML (M1 D1 M2 D2 R T), Kalibr and EuRoC YAML, ORB-SLAM's
settings and camodocal's YAML (calibration_forms), KITTI `calib.txt` (P0: ...), Middlebury `calib.txt` (cam0=[...]
doffs= baseline=), JSON with a matrix or fx fy cx cy, and text with 4 to 9 numbers, a 3x3 or 4x4 matrix, or lines `fx:
525`.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from ruamel.yaml import YAML, YAMLError
from scenewright.schemas.errors import BadInput
from scenewright.stages.ingest.folders.calibration_forms import plain_camera, stated_depth_units
from scenewright.stages.ingest.folders.files import read_json
from scenewright.stages.ingest.messages.records import CalibrationRecord
from scenewright.stages.kit.formats.trajectories import read_text
from scenewright.stages.kit.geometry.transforms import inverse, is_rigid, transform_from

KINDS = "docs/FORMATS.md, Layouts of logs, lists the kinds"
EXTRINSICS = ("extrinsics.yml", "extrinsics.yaml", "extrinsic.yml", "extrinsic.yaml")
"""What OpenCV's stereo calibration writes beside intrinsics.yml: R and T."""
LARGEST_FILE = 256_000
"""Bytes of a calibration file: its parser is slow, and it holds some dozens of numbers."""
OPENCV_TAG = re.compile(r"!!opencv-matrix\b")
KITTI = re.compile(r"^P([0-3]):((?:\s+\S+){12})\s*$", re.MULTILINE)


@dataclass(frozen=True)
class FolderCalibration:
    """The camera of a folder of images, or its stereo pair. Sizes are 0 where the file does not state them."""

    left: CalibrationRecord
    right: CalibrationRecord | None = None
    left_from_right: np.ndarray | None = None
    """(4, 4) [m]; None when the projections P say how the eyes stand."""
    rectified: bool = False
    """Whether the images are already without distortion, in rows."""
    posed_from_left: np.ndarray | None = None
    """(4, 4) from the left camera to the one whose poses the data set states (KITTI: camera 0)."""
    disparity_offset: float | None = None
    """Middlebury's doffs [pixel]: Z = fx * baseline / (disparity + doffs)."""
    depth_units: float | None = None
    """Stored depth per metre, where the file states it."""
    notes: tuple[str, ...] = ()


def read_calibration(path: Path, camera_number: int = 0) -> FolderCalibration:
    """Read a calibration file of any known kind. Raises BadInput."""
    if path.stat().st_size > LARGEST_FILE:
        raise BadInput(f"{path}: more than {LARGEST_FILE} bytes is no calibration", hint=KINDS)
    note = f"intrinsics read from {path.name}"
    if path.suffix in (".yaml", ".yml"):
        calibration = _from_document(_read_yaml(path), path)
    elif path.suffix == ".json":
        calibration = _from_document(read_json(path), path)
    else:
        calibration = _from_text(read_text(path), path, camera_number)
    return replace(calibration, notes=(note, *calibration.notes))


def _read_yaml(path: Path) -> Any:
    text = OPENCV_TAG.sub("", read_text(path))
    if text.startswith("%YAML:"):  # OpenCV's own spelling of the directive
        text = text.split("\n", 1)[1] if "\n" in text else ""
    parser = YAML(typ="safe", pure=True)
    try:
        return parser.load(text)
    except (YAMLError, ValueError, RecursionError, TypeError, AttributeError, KeyError, IndexError) as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise BadInput(f"{path}: no YAML ({reason})"[:300], hint=KINDS) from None


def pair_of_files(left: Path, right: Path) -> FolderCalibration:
    """Read the calibrations of the two eyes. Raises BadInput."""
    first, second = read_calibration(left), read_calibration(right)
    documents = [_read_yaml(path) for path in (left, right)]
    left_from_right = None
    if not first.left.P:
        # EuRoC: T_BS is body_from_sensor.
        bodies = [_matrix(_first(document, "T_BS"), 4, 4) for document in documents]
        if any(body is None or not is_rigid(body) for body in bodies):
            raise BadInput(
                f"{right}: has neither a projection matrix nor T_BS, so no extrinsics of the two cameras",
                hint="add T_BS, body from sensor, to both files",
            )
        assert bodies[0] is not None and bodies[1] is not None
        left_from_right = inverse(bodies[0]) @ bodies[1]
    notes = (f"intrinsics read from {left.name} and {right.name}",) if left.name != right.name else first.notes
    return FolderCalibration(first.left, second.left, left_from_right, notes=notes)


# --- documents (YAML and JSON) ---------------------------------------------------------------------------------


def _from_document(document: Any, path: Path) -> FolderCalibration:
    if not isinstance(document, dict):
        raise BadInput(f"{path}: has no camera", hint=KINDS)
    if isinstance(document.get("cam0"), dict):
        return _kalibr(document, path)
    units = stated_depth_units(document, str(path))
    for first, second in (("M1", "M2"), ("K1", "K2"), ("cameraMatrix1", "cameraMatrix2")):
        if first in document and second in document:
            return _opencv_pair(document, first, second, path)
    nested = document.get("camera")
    camera = nested if isinstance(nested, dict) else plain_camera(document, str(path))
    return FolderCalibration(_camera_of(camera, path), depth_units=units)


def _camera_of(document: dict[Any, Any], path: Path) -> CalibrationRecord:
    """Return the one camera of a document."""
    matrix = _matrix(_first(document, "camera_matrix", "K", "k", "intrinsic_matrix"), 3, 3)
    if matrix is not None and matrix[2, 2] == 1 and not matrix[:2, 2].any():
        matrix = matrix.T  # column by column, as Open3D and Apple write it
    listed = _numbers(_first(document, "intrinsics", "intrinsic"))
    if matrix is None and listed is not None and len(listed) == 4:
        matrix = _pinhole_matrix(listed)
    if matrix is None and listed is not None and len(listed) == 9:
        matrix = np.array(listed).reshape(3, 3)
    if matrix is None:
        pairs = (("fx", "fl_x", "focal_x"), ("fy", "fl_y", "focal_y"), ("cx", "ppx"), ("cy", "ppy"))
        values = [_first(document, *names) for names in pairs]
        numbers = _numbers(values)
        if numbers is None:
            raise BadInput(f"{path}: has neither a camera matrix nor fx, fy, cx, cy", hint=KINDS)
        matrix = _pinhole_matrix(numbers)
    coefficients = _numbers(
        _first(document, "distortion_coefficients", "distortion_coeffs", "dist_coeffs", "distortion", "D", "dist")
    )
    if coefficients is None and "k1" in document:
        names = ("k1", "k2", "p1", "p2", "k3")
        coefficients = _numbers([document.get(name, 0.0) for name in names])
    model = _first(document, "distortion_model", "camera_type")
    size = _size(document, path)
    projection = _matrix(_first(document, "projection_matrix", "P"), 3, 4)
    rotation = _matrix(_first(document, "rectification_matrix", "R"), 3, 3)
    return _record(
        matrix,
        size,
        path,
        coefficients or (),
        model if isinstance(model, str) else "plumb_bob",
        () if rotation is None else rotation.reshape(-1),
        () if projection is None else projection.reshape(-1),
    )


def _opencv_pair(document: dict[Any, Any], first: str, second: str, path: Path) -> FolderCalibration:
    """Return the pair in OpenCV's stereo calibration: a point is x_right = R x_left + T."""
    size = _size(document, path)
    records = []
    for name, number in ((first, "1"), (second, "2")):
        matrix = _matrix(document[name], 3, 3)
        if matrix is None:
            raise BadInput(f"{path}: {name} is not a 3x3 matrix", hint="write nine numbers, row by row")
        coefficients = _numbers(_first(document, f"D{number}", f"distCoeffs{number}")) or ()
        records.append(_record(matrix, size, path, coefficients, "plumb_bob"))
    notes: tuple[str, ...] = ()
    if "R" not in document or "T" not in document:
        beside = next((path.parent / name for name in EXTRINSICS if (path.parent / name).is_file()), None)
        if beside is None:
            raise BadInput(
                f"{path}: has no R and T, the extrinsics of the two cameras",
                hint=f"put OpenCV's {EXTRINSICS[0]} of the same calibration beside it",
            )
        found = _read_yaml(beside)
        document = {**(found if isinstance(found, dict) else {}), **document}
        path, notes = beside, (f"R and T read from {beside.name}",)
    rotation, offset = _matrix(document.get("R"), 3, 3), _numbers(document.get("T"))
    if rotation is None or offset is None or len(offset) != 3 or not is_rigid(transform_from(rotation, np.zeros(3))):
        raise BadInput(
            f"{path}: R and T are not extrinsics of two cameras",
            hint="R is a 3x3 rotation and T three numbers, x_right = R x_left + T",
        )
    left_from_right = inverse(transform_from(rotation, np.array(offset)))
    return FolderCalibration(records[0], records[1], left_from_right, notes=notes)


def _kalibr(document: dict[Any, Any], path: Path) -> FolderCalibration:
    first = _camera_of(document["cam0"], path)
    second = document.get("cam1")
    if not isinstance(second, dict):
        return FolderCalibration(first)
    right_from_left = _matrix(second.get("T_cn_cnm1"), 4, 4)
    if right_from_left is None or not is_rigid(right_from_left):
        raise BadInput(f"{path}: cam1 has no rigid T_cn_cnm1", hint="write that 4x4 matrix, as Kalibr does")
    return FolderCalibration(first, _camera_of(second, path), inverse(right_from_left))


def _first(document: Any, *names: str) -> Any:
    if not isinstance(document, dict):
        return None
    return next((document[name] for name in names if document.get(name) is not None), None)


def _numbers(value: Any) -> list[float] | None:
    """Return the numbers of a list, of a list of rows, or of an OpenCV matrix; None when they are none.

    Rows hold numbers only: YAML can name one list many times over, so deeper nesting may be endless.
    """
    if isinstance(value, dict):
        value = value.get("data")
    if not isinstance(value, list | tuple) or len(value) > 100:
        return None
    rows = value if all(isinstance(item, list) for item in value) else [value]
    if any(len(row) > 100 for row in rows):
        return None
    flat = [item for row in rows for item in row]
    plain = all(isinstance(item, int | float) and not isinstance(item, bool) and abs(item) < 1e12 for item in flat)
    return [float(item) for item in flat] if plain else None


def _matrix(value: Any, rows: int, columns: int) -> np.ndarray | None:
    numbers = _numbers(value)
    return np.array(numbers).reshape(rows, columns) if numbers is not None and len(numbers) == rows * columns else None


def _size(document: dict[Any, Any], path: Path) -> tuple[int, int]:
    values = [_first(document, "image_width", "width", "w"), _first(document, "image_height", "height", "h")]
    numbers = _numbers(values)
    if numbers is None:
        numbers = _numbers(_first(document, "resolution", "image_size", "imageSize"))
    return _check_size(numbers or (0, 0), path)


def _check_size(numbers: Sequence[float], path: Path) -> tuple[int, int]:
    if len(numbers) != 2 or not all(0 <= value <= 100_000 for value in numbers):
        raise BadInput(f"{path}: image size {list(numbers)} is impossible", hint="write width and height in pixels")
    return round(numbers[0]), round(numbers[1])


# --- text ------------------------------------------------------------------------------------------------------


def _from_text(text: str, path: Path, camera_number: int) -> FolderCalibration:
    if KITTI.search(text):
        return _kitti(text, path, camera_number)
    keyed = split_lines(text)
    if "cam0" in keyed and "baseline" in keyed:
        return _middlebury(keyed, path)
    if "fx" in keyed:
        return FolderCalibration(_camera_of(_parse_values(keyed), path))
    try:
        numbers = [float(field) for field in re.sub(r"#.*", "", text).replace(",", " ").split()]
    except ValueError:
        raise BadInput(f"{path}: is no calibration that is understood", hint=KINDS) from None
    if len(numbers) in (4, 8, 9) and not (len(numbers) == 9 and numbers[6:] == [0, 0, 1]):
        return FolderCalibration(_record(_pinhole_matrix(numbers[:4]), (0, 0), path, numbers[4:], "plumb_bob"))
    if len(numbers) in (9, 16):
        edge = math.isqrt(len(numbers))
        return FolderCalibration(_record(np.array(numbers).reshape(edge, edge)[:3, :3], (0, 0), path))
    raise BadInput(
        f"{path}: {len(numbers)} numbers, expected fx fy cx cy [distortion], 3x3 or 4x4", hint="write one of these"
    )


def split_lines(text: str) -> dict[str, str]:
    """Return the values of lines `key: value` or `key = value`."""
    lines = (re.split(r"\s*[=:]\s*", line.strip(), maxsplit=1) for line in text.splitlines())
    return {words[0]: words[1] for words in lines if len(words) == 2}


def _parse_values(keyed: dict[str, str]) -> dict[str, Any]:
    typed: dict[str, Any] = {}
    for key, value in keyed.items():
        try:
            typed[key] = json.loads(value)
        except (ValueError, RecursionError):
            typed[key] = value
    return typed


def _kitti(text: str, path: Path, camera_number: int) -> FolderCalibration:
    """Return cameras `camera_number` and the one after it of a KITTI odometry calibration: rectified, P[3] = -fx x."""
    projections: dict[int, list[float]] = {}
    for match in KITTI.finditer(text):
        try:
            projections[int(match[1])] = [float(field) for field in match[2].split()]
        except ValueError:
            raise BadInput(
                f"{path}: P{match[1]} holds a value that is not a number", hint="write twelve numbers"
            ) from None
    if camera_number not in projections:
        raise BadInput(
            f"{path}: has no P{camera_number}",
            hint=f"it has {', '.join(f'P{number}' for number in sorted(projections))}",
        )
    records = {}
    for number, values in projections.items():
        matrix = np.array(values).reshape(3, 4)
        records[number] = _record(matrix[:, :3], (0, 0), path, projection=values)
    left = records[camera_number]
    try:
        offset = np.linalg.solve(np.array(left.K).reshape(3, 3), np.array(left.P).reshape(3, 4)[:, 3])
    except np.linalg.LinAlgError:
        raise BadInput(
            f"{path}: the camera matrix of P{camera_number} cannot be inverted",
            hint="write it row by row: fx 0 cx, 0 fy cy, 0 0 1",
        ) from None
    posed_from_left = transform_from(np.eye(3), -offset)
    return FolderCalibration(left, records.get(camera_number + 1), None, True, posed_from_left)


def _middlebury(keyed: dict[str, str], path: Path) -> FolderCalibration:
    """Return the pair of a Middlebury calibration: rectified, baseline in millimetres, cx of the right eye is that of
    the left plus doffs."""

    def numbers(key: str, count: int) -> list[float]:
        try:
            values = [float(field) for field in re.sub(r"[\[\];,]", " ", keyed.get(key, "")).split()]
        except ValueError:
            values = []
        if len(values) != count or not np.isfinite(values).all():
            raise BadInput(f"{path}: {key} is missing or has not {count} numbers", hint=KINDS)
        return values

    first, second = (np.array(numbers(name, 9)).reshape(3, 3) for name in ("cam0", "cam1"))
    baseline = numbers("baseline", 1)[0] / 1000
    offset = numbers("doffs", 1)[0] if "doffs" in keyed else float(second[0, 2] - first[0, 2])
    if abs(second[0, 2] - first[0, 2] - offset) > 0.5:
        raise BadInput(
            f"{path}: doffs {offset:g} is not the difference of the principal points in cam0 and cam1",
            hint="correct doffs: cx of cam1 minus cx of cam0",
        )
    size = _check_size([numbers(key, 1)[0] for key in ("width", "height")], path) if "width" in keyed else (0, 0)
    # The difference of the principal points is doffs to the digits printed; disparities are stated against doffs.
    second[0, 2] = first[0, 2] + offset
    records = [
        _record(matrix, size, path, projection=[*matrix[0], -matrix[0, 0] * shift, *matrix[1], 0, *matrix[2], 0])
        for matrix, shift in ((first, 0.0), (second, baseline))
    ]
    return FolderCalibration(records[0], records[1], None, True, disparity_offset=offset)


def _pinhole_matrix(numbers: Sequence[float]) -> np.ndarray:
    return np.array([[numbers[0], 0, numbers[2]], [0, numbers[1], numbers[3]], [0, 0, 1]], dtype=float)


def _record(
    matrix: np.ndarray,
    size: tuple[int, int],
    path: Path,
    coefficients: Iterable[float] = (),
    model: str = "plumb_bob",
    rotation: Iterable[float] = (),
    projection: Iterable[float] = (),
) -> CalibrationRecord:
    """Return the record, with coefficients as many as OpenCV has. Raises BadInput for what is no camera."""
    values = [float(value) for value in coefficients]
    count = next((count for count in (0, 4, 5, 8, 12, 14) if len(values) <= count), len(values))
    values += [0.0] * (count - len(values))
    numbers = [float(value) for value in matrix.reshape(-1)]
    every = [*values, *numbers, *rotation, *projection]
    if not np.isfinite(every).all() or numbers[0] <= 0 or numbers[4] <= 0:
        raise BadInput(
            f"{path}: focal lengths {numbers[0]:g}, {numbers[4]:g} are no camera, or numbers are not finite",
            hint="write fx and fy in pixels, over 0",
        )
    if abs(numbers[1]) > 1e-3 * numbers[0]:
        raise BadInput(
            f"{path}: the camera matrix is skewed by {numbers[1]:g} pixels", hint="row by row: fx 0 cx, 0 fy cy"
        )
    return CalibrationRecord(
        stamp=0,
        frame_id="",
        width=size[0],
        height=size[1],
        distortion_model=model,
        D=tuple(values),
        K=tuple(numbers),
        R=tuple(map(float, rotation)),
        P=tuple(map(float, projection)),
    )
