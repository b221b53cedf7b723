"""execution.mcap: where every body and link was and what a camera saw, in Foxglove's schemas; always the same bytes."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np
from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from google.protobuf.message import Message
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.kit.formats import foxglove
from scenewright.stages.kit.formats.foxglove_log import foxglove_log
from scenewright.stages.kit.motion.recording import Snapshot

COLOR, CALIBRATION, TRANSFORMS = "/camera/color", "/camera/calibration", "/tf"
_KINDS: dict[str, type[Message]] = {COLOR: CompressedImage, CALIBRATION: CameraCalibration, TRANSFORMS: FrameTransforms}


def write_execution(
    path: Path,
    snapshots: Iterable[Snapshot],
    images: dict[int, np.ndarray],
    camera: Camera,
    world_from_camera: np.ndarray,
) -> None:
    """Write the snapshots as FrameTransforms (world -> every link and body), and images (H, W, 3) by snapshot index.

    A frame that did not move since it was last said (0.1 mm, 0.1 mrad) is not said again.
    """
    with foxglove_log(path, _KINDS) as add:
        last = -1
        logged: dict[str, np.ndarray] = {}
        for index, snapshot in enumerate(snapshots):
            stamp = foxglove.nanoseconds(snapshot.time)
            if stamp <= last:
                continue
            last = stamp
            poses = {**snapshot.links, "camera": world_from_camera}
            changed = [name for name in sorted(poses) if name not in logged or _differs(logged[name], poses[name])]
            logged.update({name: poses[name] for name in changed})
            message = FrameTransforms()
            for name in changed:
                message.transforms.extend(foxglove.transforms_message(stamp, "world", name, poses[name]).transforms)
            add(TRANSFORMS, stamp, message)
            if index in images:
                add(CALIBRATION, stamp, foxglove.calibration_message(stamp, camera, "camera"))
                jpeg = foxglove.encode_jpeg(images[index])
                add(COLOR, stamp, foxglove.color_message(stamp, jpeg, "camera"))


def _differs(first: np.ndarray, second: np.ndarray) -> bool:
    return bool(np.abs(first - second).max() > 1e-4)
