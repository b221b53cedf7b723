"""MoveIt's planning scene as text, as `moveit_ros` loads it from a file."""

from scenewright.stages.export.scene_registry import SceneFormat

FORMAT = SceneFormat(
    "moveit",
    order=30,
    file="scene.scene",
    summary="collision objects of MoveIt's planning scene, with SRDF",
    notes=(
        "metres, z up; objects stand as reconstructed and have no joints: scene.srdf and scene.urdf of the scene do",
        "an object's subframes are called like its links",
    ),
)
