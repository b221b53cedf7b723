"""SDF, for Gazebo and Drake."""

from scenewright.stages.export.scene_registry import SceneFormat

FORMAT = SceneFormat(
    "sdf",
    order=20,
    file="scene.sdf",
    summary="SDF 1.9 world with its meshes, for Gazebo",
    notes=(
        "metres, kilograms, z up; in SDF the pose that a file shows is every joint's zero: limits count from the "
        "reconstructed value (joint_zero)",
    ),
)
