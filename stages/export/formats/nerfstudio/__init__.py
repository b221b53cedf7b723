"""nerfstudio: `transforms.json`, OpenGL cameras, camera-to-world. Format: docs.nerf.studio, data conventions."""

from __future__ import annotations

from scenewright.stages.export.registry import SequenceFormat

FORMAT = SequenceFormat(
    name="nerfstudio",
    order=20,
    layout="nerfstudio",
    summary="nerfstudio",
    streams=("color", "depth", "pose"),
    pose_note="written as OpenGL camera-to-world",
)
