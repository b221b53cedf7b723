"""Writing an MCAP file of ROS 2 messages (CDR, embedded ros2msg schemas) as a ROS 2 recorder would.

Topics of a camera called `camera`: `/camera/color/image_raw/compressed`, `/camera/depth/image_raw` (16UC1, mm),
`/camera/labels/image_raw` (mono16), `/camera/right/image_raw/compressed`, and a `camera_info` beside each; `/tf`
world -> camera. Log time and header stamp are the frame's time.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.export.formats.ros2 import FORMAT
from scenewright.stages.export.frames import ExportFrame, ExportJob
from scenewright.stages.export.pictures import picture_suffix
from scenewright.stages.kit.formats.frame_streams import LABELS_METADATA, WORLD_FRAME, WORLD_METADATA
from scenewright.stages.kit.geometry.transforms import quaternion_of
from scenewright.stages.kit.ros2_bag import BagWriter, ros2_header, ros2_types

IMAGE, COMPRESSED_IMAGE = "sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage"
CAMERA_INFO, TF_MESSAGE = "sensor_msgs/msg/CameraInfo", "tf2_msgs/msg/TFMessage"


def compressed_image(stamp: int, encoded: bytes, frame_id: str) -> Any:
    """Return a sensor_msgs/CompressedImage of JPEG or PNG bytes, stamped `stamp` [ns]."""
    kind = "png" if picture_suffix(encoded) == ".png" else "jpeg"
    data = np.frombuffer(encoded, np.uint8)
    return ros2_types().types[COMPRESSED_IMAGE](header=ros2_header(stamp, frame_id), format=kind, data=data)


def image(stamp: int, pixels: np.ndarray, encoding: str, frame_id: str) -> Any:
    """Return a sensor_msgs/Image of an (H, W) uint16 array, little-endian, rows without padding."""
    height, width = pixels.shape
    return ros2_types().types[IMAGE](
        header=ros2_header(stamp, frame_id),
        height=height,
        width=width,
        encoding=encoding,
        is_bigendian=0,
        step=2 * width,
        data=np.ascontiguousarray(pixels, dtype="<u2").view(np.uint8).reshape(-1),
    )


def camera_info(stamp: int, camera: Camera, frame_id: str, baseline: float = 0.0) -> Any:
    """Return the sensor_msgs/CameraInfo of a camera without distortion.

    With a `baseline` [m] it is that of the right eye of a rectified pair: P[3] = -fx baseline.
    """
    types = ros2_types().types
    matrix = [camera.fx, 0.0, camera.cx, 0.0, camera.fy, camera.cy, 0.0, 0.0, 1.0]
    projection = [camera.fx, 0.0, camera.cx, -camera.fx * baseline, 0.0, camera.fy, camera.cy, 0.0, 0.0, 0.0, 1.0, 0.0]
    return types[CAMERA_INFO](
        header=ros2_header(stamp, frame_id),
        height=camera.height,
        width=camera.width,
        distortion_model="plumb_bob",
        d=np.zeros(5),
        k=np.array(matrix),
        r=np.eye(3).reshape(-1),
        p=np.array(projection),
        binning_x=0,
        binning_y=0,
        roi=types["sensor_msgs/msg/RegionOfInterest"](x_offset=0, y_offset=0, height=0, width=0, do_rectify=False),
    )


def transforms(stamp: int, parent: str, child: str, parent_from_child: np.ndarray) -> Any:
    """Return a tf2_msgs/TFMessage with the one transform parent -> child, (4, 4)."""
    types = ros2_types().types
    x, y, z = (float(value) for value in parent_from_child[:3, 3])
    qx, qy, qz, qw = (float(value) for value in quaternion_of(parent_from_child))
    transform = types["geometry_msgs/msg/Transform"](
        translation=types["geometry_msgs/msg/Vector3"](x=x, y=y, z=z),
        rotation=types["geometry_msgs/msg/Quaternion"](x=qx, y=qy, z=qz, w=qw),
    )
    stamped = types["geometry_msgs/msg/TransformStamped"](
        header=ros2_header(stamp, parent), child_frame_id=child, transform=transform
    )
    return types[TF_MESSAGE](transforms=[stamped])


def write(job: ExportJob) -> None:
    """Write the frames."""
    info, cameras, tally = job.info, job.cameras, job.tally
    baselines = {camera.name: camera.baseline for camera in info.cameras}
    registered = "yes" if info.color_depth_registered else "no"
    metadata = {WORLD_METADATA: {"world_frame": WORLD_FRAME, "world_up": job.world_up, "registered": registered}}
    if info.label_table:
        metadata[LABELS_METADATA] = {str(entry.instance): entry.class_name for entry in info.label_table}
    with BagWriter(job.root / FORMAT.log, metadata) as bag:
        for frame in job.frames:
            for topic, stream, message in _messages(frame, cameras[frame.camera_name], baselines[frame.camera_name]):
                bag.add(topic, message, frame.stamp, tally.frames)
                tally.streams.add(stream)
            tally.frames += 1


def _messages(frame: ExportFrame, camera: Camera, baseline: float | None) -> Iterable[tuple[str, str, Any]]:
    """Yield (topic, stream, message) of a frame; a camera_info precedes each image."""
    name, stamp = frame.camera_name, frame.stamp
    if frame.world_from_camera is not None:
        yield "/tf", "pose", transforms(stamp, WORLD_FRAME, name, frame.world_from_camera)
    if frame.color is not None:
        yield f"/{name}/color/camera_info", "color", camera_info(stamp, camera, name)
        yield f"/{name}/color/image_raw/compressed", "color", compressed_image(stamp, frame.color, name)
    if frame.depth is not None:
        yield f"/{name}/depth/camera_info", "depth", camera_info(stamp, camera, name)
        yield f"/{name}/depth/image_raw", "depth", image(stamp, frame.depth, "16UC1", name)
    if frame.labels is not None:
        yield f"/{name}/labels/image_raw", "labels", image(stamp, frame.labels, "mono16", name)
    if frame.right is not None:
        yield f"/{name}/right/camera_info", "right", camera_info(stamp, camera, name, baseline or 0.0)
        yield f"/{name}/right/image_raw/compressed", "right", compressed_image(stamp, frame.right, name)
