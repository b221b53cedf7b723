"""TUM RGB-D: pictures by time stamp, index files, groundtruth.txt.

Format: https://cvg.cit.tum.de/data/datasets/rgbd-dataset/file_formats
"""

from __future__ import annotations

from scenewright.stages.export.registry import SequenceFormat

UNITS_PER_MILLIMETRE = 5
"""Depth units per millimetre: TUM has 5000 per metre."""
LARGEST_MILLIMETRES = 65534 // UNITS_PER_MILLIMETRE
"""13.106 m: 65535 units say invalid to many readers."""

FORMAT = SequenceFormat(
    name="tum",
    order=10,
    layout="tum",
    summary="TUM RGB-D",
    streams=("color", "depth", "pose"),
    one_camera=True,
    depth_limit=LARGEST_MILLIMETRES / 1000,
    depth_limit_reason="16 bits at 5000 units per metre reach no further",
)
