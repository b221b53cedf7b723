"""Where the links of a kinematic tree are."""

from __future__ import annotations

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.formats.urdf_file import Urdf, UrdfJoint
from scenewright.stages.kit.geometry.transforms import transform_from
from scipy.spatial.transform import Rotation


def link_poses(urdf: Urdf, values: dict[str, float]) -> dict[str, np.ndarray]:
    """Return link -> world_from_link (4, 4) at joint values [rad, m]; joints without a value are at 0, roots at the
    origin. Raises BadInput when the joints are no tree."""
    children: dict[str, list[UrdfJoint]] = {}
    for joint in urdf.joints:
        children.setdefault(joint.parent, []).append(joint)
    poses = {name: np.eye(4) for name in urdf.roots()}
    waiting = list(poses)
    while waiting:
        parent = waiting.pop()
        for joint in children.get(parent, []):
            if joint.child in poses:
                raise BadInput(
                    f"{urdf.name}: link {joint.child!r} has two parents",
                    hint="give each link but one a parent joint, and one alone",
                )
            poses[joint.child] = (
                poses[parent] @ joint.parent_from_child @ joint_motion(joint, values.get(joint.name, 0.0))
            )
            waiting.append(joint.child)
    missing = {link.name for link in urdf.links} - poses.keys()
    if missing:
        raise BadInput(
            f"{urdf.name}: link {sorted(missing)[0]!r} hangs on nothing",
            hint="give each link but one a parent joint, and one alone",
        )
    return poses


def joint_motion(joint: UrdfJoint, value: float) -> np.ndarray:
    """Return the (4, 4) motion of a joint at `value` [rad or m]; fixed and floating ones do not move."""
    axis = np.asarray(joint.axis, dtype=float)
    if joint.type in ("revolute", "continuous"):
        return transform_from(Rotation.from_rotvec(value * axis).as_matrix(), np.zeros(3))
    if joint.type == "prismatic":
        return transform_from(np.eye(3), value * axis)
    return np.eye(4)
