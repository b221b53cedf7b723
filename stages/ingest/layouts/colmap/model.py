"""Reader of COLMAP's sparse models, cameras and images, binary and text.

Written here and not left to pycolmap because a damaged file must end in a sentence: every count is held against the
bytes that are left before anything is allocated. Points and observations are skipped.
"""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.formats.trajectories import read_text
from scenewright.stages.kit.geometry.transforms import inverse, transform_from_quaternion

MODELS = {
    0: ("SIMPLE_PINHOLE", 3),
    1: ("PINHOLE", 4),
    2: ("SIMPLE_RADIAL", 4),
    3: ("RADIAL", 5),
    4: ("OPENCV", 8),
    5: ("OPENCV_FISHEYE", 8),
    6: ("FULL_OPENCV", 12),
    7: ("FOV", 5),
    8: ("SIMPLE_RADIAL_FISHEYE", 4),
    9: ("RADIAL_FISHEYE", 5),
    10: ("THIN_PRISM_FISHEYE", 12),
    11: ("RAD_TAN_THIN_PRISM_FISHEYE", 16),
    12: ("SIMPLE_DIVISION", 4),
    13: ("DIVISION", 5),
    14: ("SIMPLE_FISHEYE", 3),
    15: ("FISHEYE", 4),
    16: ("EUCM", 6),
    17: ("EQUIRECTANGULAR", 2),
}
"""Number in the file -> name, number of parameters."""
PARAMETERS = dict(MODELS.values())
LARGEST_FILE = 4_000_000_000
"""Bytes of images.bin that are walked over; most of them are observations, which are skipped."""
LONGEST_NAME = 4096
"""Longest name of an image that is looked for [bytes]; a bound against damaged files."""
LARGEST_SIZE = 100_000
"""Largest width or height of a camera [px]; a bound against damaged files."""
OBSERVATION = 24
"""Bytes of an observation in images.bin: x, y and the point's id."""


@dataclass(frozen=True)
class ModelCamera:
    """A camera of the model; pixel coordinates put the centre of the first pixel at (0.5, 0.5)."""

    model: str
    size: tuple[int, int]
    parameters: tuple[float, ...]


@dataclass(frozen=True)
class ModelImage:
    """A registered image."""

    name: str
    camera: int
    world_from_camera: np.ndarray | None
    """(4, 4), None when the file's quaternion is none."""


@dataclass(frozen=True)
class SparseModel:
    """What a sparse model says about images."""

    folder: Path
    cameras: dict[int, ModelCamera]
    images: tuple[ModelImage, ...]


def has_model(folder: Path) -> bool:
    """Whether a folder holds the files of a sparse model."""
    return any(
        all((folder / (name + suffix)).is_file() for name in ("cameras", "images")) for suffix in (".bin", ".txt")
    )


def read_model(folder: Path) -> SparseModel:
    """Read the model in a folder, binary before text. Raises BadInput naming the file and the place."""
    if all((folder / name).is_file() for name in ("cameras.bin", "images.bin")):
        cameras, images = _binary_cameras(folder / "cameras.bin"), _binary_images(folder / "images.bin")
    else:
        cameras, images = _text_cameras(folder / "cameras.txt"), _text_images(folder / "images.txt")
    for image in images:
        if image.camera not in cameras:
            raise BadInput(f"{folder}: image {image.name!r:.80} is of camera {image.camera}, which the model has not")
    return SparseModel(folder, cameras, tuple(images))


class _Reader:
    """A binary file read from the front; what would reach beyond its end raises BadInput."""

    def __init__(self, path: Path) -> None:
        size = path.stat().st_size
        if size > LARGEST_FILE:
            raise BadInput(f"{path}: {size} bytes, more than {LARGEST_FILE}")
        self.path = path
        self.data = np.memmap(path, np.uint8, "r") if size else np.zeros(0, np.uint8)
        self.place = 0

    def take(self, layout: str) -> tuple:
        count = struct.calcsize("<" + layout)
        return struct.unpack("<" + layout, self._bytes(count))

    def name(self) -> str:
        window = self.data[self.place : self.place + LONGEST_NAME].tobytes()
        end = window.find(b"\0")
        if end < 0:
            raise BadInput(f"{self.path}: byte {self.place}: a name does not end")
        self.place += end + 1
        try:
            return window[:end].decode("utf-8")
        except UnicodeDecodeError:
            raise BadInput(f"{self.path}: byte {self.place}: a name is not UTF-8") from None

    def skip(self, count: int) -> None:
        self._check(count)
        self.place += count

    def count(self, smallest: int, what: str) -> int:
        """Return a declared number of records of at least `smallest` bytes."""
        number = self.take("Q")[0]
        remaining = len(self.data) - self.place
        if number * smallest > remaining:
            raise BadInput(f"{self.path}: declares {number} {what}, but only {remaining} bytes follow")
        return number

    def _bytes(self, count: int) -> bytes:
        self._check(count)
        start, self.place = self.place, self.place + count
        return self.data[start : start + count].tobytes()

    def _check(self, count: int) -> None:
        if self.place + count > len(self.data):
            raise BadInput(f"{self.path}: ends at byte {len(self.data)}, within a record", hint="copy it again")


def _binary_cameras(path: Path) -> dict[int, ModelCamera]:
    reader = _Reader(path)
    cameras: dict[int, ModelCamera] = {}
    for _ in range(reader.count(24, "cameras")):
        number, model, width, height = reader.take("iiQQ")
        if model not in MODELS:
            raise BadInput(f"{path}: camera {number} is of model {model}, which is not known here")
        name, count = MODELS[model]
        cameras[number] = _camera(name, width, height, reader.take(f"{count}d"), f"{path}: camera {number}")
    return cameras


def _binary_images(path: Path) -> list[ModelImage]:
    reader = _Reader(path)
    images = []
    for _ in range(reader.count(73, "images")):
        reader.take("i")
        pose = reader.take("7d")
        camera = reader.take("i")[0]
        name = reader.name()
        reader.skip(reader.count(OBSERVATION, "observations") * OBSERVATION)
        images.append(ModelImage(name, camera, _world_from_camera(pose)))
    return images


def _text_cameras(path: Path) -> dict[int, ModelCamera]:
    cameras = {}
    for line, text in enumerate(read_text(path).splitlines(), start=1):
        fields = text.split("#", 1)[0].split()
        if not fields:
            continue
        where = f"{path}: line {line}"
        try:
            number, model, width, height = int(fields[0]), fields[1], int(fields[2]), int(fields[3])
            values = tuple(float(field) for field in fields[4:])
        except (IndexError, ValueError):
            raise BadInput(f"{where}: expected an id, a model, width, height and parameters") from None
        if len(values) != PARAMETERS.get(model, len(values)):
            raise BadInput(f"{where}: {model} has {PARAMETERS[model]} parameters, not {len(values)}")
        cameras[number] = _camera(model, width, height, values, where)
    return cameras


def _text_images(path: Path) -> list[ModelImage]:
    """Return the images: each has two lines, of which the second, with its observations, may be empty."""
    images, observations_follow = [], False
    for line, text in enumerate(read_text(path).splitlines(), start=1):
        if text.startswith("#"):
            continue
        if observations_follow:
            observations_follow = False
            continue
        fields = text.split(None, 9)
        if not fields:
            continue
        try:
            int(fields[0])
            pose, camera, name = [float(field) for field in fields[1:8]], int(fields[8]), fields[9].strip()
        except (IndexError, ValueError):
            raise BadInput(f"{path}: line {line}: expected id, qw qx qy qz, tx ty tz, camera, name") from None
        images.append(ModelImage(name, camera, _world_from_camera(tuple(pose))))
        observations_follow = True
    return images


def _camera(model: str, width: int, height: int, parameters: tuple[float, ...], where: str) -> ModelCamera:
    if not (1 <= width <= LARGEST_SIZE and 1 <= height <= LARGEST_SIZE):
        raise BadInput(f"{where}: images of {width}x{height} pixels")
    if not all(map(math.isfinite, parameters)):
        raise BadInput(f"{where}: parameters {list(parameters)} are not finite")
    return ModelCamera(model, (width, height), parameters)


def _world_from_camera(numbers: tuple[float, ...]) -> np.ndarray | None:
    """Return world_from_camera of `qw qx qy qz tx ty tz`, which are camera_from_world; NaN stays to be counted."""
    values = np.array(numbers)
    if not np.isfinite(values).all():
        return np.full((4, 4), np.nan)
    with np.errstate(over="ignore"):
        norm = float(np.linalg.norm(values[:4]))
    if not 0.9 < norm < 1.1:
        return None
    return inverse(transform_from_quaternion(values[[1, 2, 3, 0]] / norm, values[4:]))
