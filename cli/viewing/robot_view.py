"""The robot's links, and how they move with its joints."""

from __future__ import annotations

import numpy as np
from scenewright.schemas.artifact import Artifact
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.formats.link_poses import link_poses
from scenewright.stages.kit.formats.urdf_file import Urdf, parse_urdf
from scenewright.stages.kit.simulation.robot_option import USUAL_ROBOT
from scenewright.stages.kit.viewing.canvas import Canvas
from scenewright.stages.kit.viewing.meshes import merged, shape_mesh

ROBOT = "robot/"


def robot_of(artifact: Artifact) -> str:
    """Return which robot an artifact was made for."""
    return str(artifact.manifest.parameters.get("robot", USUAL_ROBOT)) if artifact.manifest else USUAL_ROBOT


def draw_robot(canvas: Canvas, name: str) -> Urdf | None:
    """Draw the links of a robot (`load_robot`), each in its own frame, and return its description; None (and a note)
    where that is not installed: then only the room moves."""
    from scenewright.stages.kit.simulation.robot_description import load_robot

    try:
        robot = load_robot(name)
        urdf = parse_urdf(robot.urdf)
    except Exception as error:  # noqa: BLE001 (a view without the robot is better than none)
        canvas.document("robot", f"not drawn: {error}")
        return None
    for link in urdf.links:
        meshes = []
        for shape in link.visuals:
            try:
                meshes.append(shape_mesh(shape, robot.urdf.parent))
            except BadInput:
                continue
        if meshes:
            mesh = merged(meshes)
            colors = np.tile(np.array([225, 225, 230], np.uint8), (len(mesh.vertices), 1))
            canvas.mesh(f"{ROBOT}{link.name}", mesh, colors)
    return urdf


def arm_joints(name: str) -> tuple[str, ...]:
    """Return the names of a robot's arm joints in their order."""
    from scenewright.stages.kit.simulation.robot_description import load_robot

    return load_robot(name).arm_joints


def animate_arm(canvas: Canvas, urdf: Urdf, names: tuple[str, ...], joints: np.ndarray, period: float) -> None:
    """Move the links of an arm that stands at the origin through rows of joint values (N, J) [rad], one each `period`
    [s], of the joints `names`."""
    for number, row in enumerate(joints):
        canvas.time(number * period)
        for link, pose in link_poses(urdf, dict(zip(names, map(float, row), strict=True))).items():
            canvas.transform(f"{ROBOT}{link}", pose)
