"""Names of the usual ways in which poses are meant that we do not mean. Cheap to import; the maths is beside it."""

from __future__ import annotations

from typing import Literal, get_args

PoseConvention = Literal[
    "as-is",
    "inverse",
    "opengl",
    "inverse-opengl",
    "ros-body",
    "inverse-ros-body",
    "left-handed",
    "quaternion-wxyz",
    "quaternion-xyzw",
    "inverse-quaternion-wxyz",
]
POSE_CONVENTIONS: tuple[PoseConvention, ...] = get_args(PoseConvention)
CONVENTION_WORDS: dict[PoseConvention, str] = {
    "as-is": "poses as they are",
    "inverse": "inverted poses (the log has camera_from_world)",
    "opengl": "OpenGL camera axes (y up, z backward)",
    "inverse-opengl": "inverted poses with OpenGL camera axes (the log has view matrices)",
    "ros-body": "ROS body axes (x forward, y left, z up) instead of the camera's",
    "inverse-ros-body": "inverted poses with ROS body axes",
    "left-handed": "left-handed axes (y mirrored in camera and world)",
    "quaternion-wxyz": "quaternions with w first that were read with w last",
    "quaternion-xyzw": "quaternions with w last that were read with w first",
    "inverse-quaternion-wxyz": "inverted poses with w-first quaternions (COLMAP's) that were read with w last",
}
"""What the log has where the convention fits, for people."""
