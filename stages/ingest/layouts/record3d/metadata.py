"""Record3D's metadata: K column by column and of the picture of w x h, poses, times and intrinsics of each frame.

A pose is `qx qy qz qw tx ty tz`, world_from_camera with OpenGL axes (marek-simonik/record3d, issues 27, 33 and 36).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.ingest.folders.frame_loading import Size
from scenewright.stages.ingest.folders.phone_frames import OPENGL_FROM_OPENCV, numbers_of
from scenewright.stages.kit.formats.stamps import exact_stamps
from scenewright.stages.kit.formats.trajectories import transform_from_numbers

UNMOVED = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
"""What stands for every pose of the selfie camera, which is not tracked (issue 63)."""
LARGEST_SIZE = 100_000
"""Largest width or height [px]; a bound against damaged files."""


@dataclass(frozen=True)
class Metadata:
    """What the document says of the frames; lists are as long as they are in it."""

    intrinsics: tuple[float, ...]
    """fx fy cx cy of the picture of the first frame."""
    own_intrinsics: tuple[tuple[float, ...], ...]
    """Of each frame, where the app's version writes them."""
    poses: tuple[tuple[float, ...], ...]
    stamps: tuple[int | None, ...]
    """[ns]"""
    rate: float | None
    """Frames a second."""
    picture_size: Size | None
    depth_size: Size | None

    @property
    def tracked(self) -> bool:
        """Whether any pose differs from none."""
        return any(pose != UNMOVED for pose in self.poses)

    def pose(self, frame: int) -> tuple[np.ndarray | None, str | None]:
        """Return world_from_camera (4, 4) with OpenCV axes of a frame, or why there is none."""
        if not self.tracked or frame >= len(self.poses):
            return None, None
        numbers = np.array(self.poses[frame])
        if not np.isfinite(numbers).all():
            return None, "non_finite_pose"
        try:
            return transform_from_numbers(np.roll(numbers, 3), "") @ OPENGL_FROM_OPENCV, None
        except BadInput:
            return None, "non_rigid_pose"

    def intrinsics_of(self, frame: int) -> tuple[float, ...]:
        """Return fx fy cx cy of a frame."""
        return self.own_intrinsics[frame] if frame < len(self.own_intrinsics) else self.intrinsics


def read_metadata(document: Any, where: str) -> Metadata:
    """Return what a document says. Raises BadInput, beginning with `where`, for one of another kind."""
    if not isinstance(document, dict):
        raise BadInput(f"{where}: is not an object with K and poses")
    matrix = _rows(document, "K", 9, where, whole=True)[0]
    columns = matrix if matrix[6] or matrix[7] else tuple(np.reshape(matrix, (3, 3)).T.reshape(9).tolist())
    rate = document.get("fps")
    known_rate = isinstance(rate, int | float) and not isinstance(rate, bool) and 0 < rate < 1e6
    times = document.get("frameTimestamps")
    texts = [repr(value) for value in times] if isinstance(times, list) else []
    stamps = exact_stamps(texts, [f"{where}: frameTimestamps, frame {k}" for k in range(len(texts))]).stamps
    return Metadata(
        intrinsics=(columns[0], columns[4], columns[6], columns[7]),
        own_intrinsics=_rows(document, "perFrameIntrinsicCoeffs", 4, where),
        poses=_rows(document, "poses", 7, where),
        stamps=stamps,
        rate=float(rate) if known_rate and rate is not None else None,
        picture_size=_size(document, "w", "h", where),
        depth_size=_size(document, "dw", "dh", where),
    )


def _rows(document: dict[str, Any], key: str, width: int, where: str, *, whole: bool = False) -> tuple[Any, ...]:
    """Return the rows of `width` numbers of a list, nothing where it is missing; `whole` lists are one row."""
    value = document.get(key)
    rows: Any = [value] if whole else [] if value is None else value
    try:
        numbers = [tuple(float(number) for number in row) for row in rows]
    except (TypeError, ValueError, OverflowError):
        raise BadInput(f"{where}: {key} holds a value that is not a number") from None
    wrong = next((k for k, row in enumerate(numbers) if len(row) != width), None)
    if wrong is not None:
        place = "" if whole else f", frame {wrong}"
        raise BadInput(f"{where}: {key}{place} has {len(numbers[wrong])} numbers, expected {width}")
    return tuple(numbers)


def _size(document: dict[str, Any], width: str, height: str, where: str) -> Size | None:
    if document.get(width) is None or document.get(height) is None:
        return None
    size = numbers_of([document[width], document[height]], 2)
    if size is None or not all(1 <= value <= LARGEST_SIZE for value in size):
        raise BadInput(f"{where}: {width}, {height} = {document[width]!r:.20}, {document[height]!r:.20} are no size")
    return round(size[0]), round(size[1])
