"""The topics of a sequence's MCAP file, and reading what its calibrations and metadata say."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.RawImage_pb2 import RawImage
from scenewright.schemas.errors import BadInput
from scenewright.schemas.scene_parts import Camera
from scenewright.schemas.sequence import LabelEntry

TRANSFORMS = "/tf"
WORLD_FRAME, CAMERA_FRAME = "world", "camera"
WORLD_METADATA, LABELS_METADATA = "scenewright", "labels"
MESSAGE_TYPES: dict[str, Any] = {
    "color": CompressedImage,
    "right": CompressedImage,
    "depth": RawImage,
    "labels": RawImage,
    "deviation": RawImage,
    "picture": CompressedImage,
    "calibration": CameraCalibration,
    "right_calibration": CameraCalibration,
    "picture_calibration": CameraCalibration,
}
"""Last part of the topic -> message type; the first part is the camera."""
CAMERA_NAME = re.compile(r"[A-Za-z0-9_]+")
TOPIC = re.compile(rf"/({CAMERA_NAME.pattern})/({'|'.join(MESSAGE_TYPES)})")
PIXEL_STREAMS = ("color", "depth", "labels", "right", "deviation", "picture")


def camera_of(message: Any, path: Path) -> Camera:
    """Return the pinhole camera of a CameraCalibration. Raises BadInput, naming `path`, without focal lengths."""
    if len(message.K) != 9 or message.K[0] <= 0 or message.K[4] <= 0:
        raise BadInput(f"{path}: calibration has no focal lengths (K = {list(message.K)})")
    fx, _, cx, _, fy, cy, *_ = message.K
    return Camera.of_outside(path, width=message.width, height=message.height, fx=fx, fy=fy, cx=cx, cy=cy)


def label_table(table: dict[str, str], path: Path) -> tuple[LabelEntry, ...]:
    """Return the label table of a metadata record. Raises BadInput, naming `path`, for a key that is no number."""
    try:
        return tuple(LabelEntry(instance=int(key), class_name=table[key]) for key in sorted(table, key=int))
    except ValueError:
        raise BadInput(
            f"{path}: metadata record {LABELS_METADATA!r} has a key that is not an instance number"
        ) from None
