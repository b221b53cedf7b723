"""Which body of the true room a body of the planned scene is: the nearest of the same class, one to one."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree

import numpy as np
from scenewright.schemas.interactive_scene import SceneBody
from scenewright.schemas.plan import BodyMatch
from scenewright.schemas.scene_parts import Joint
from scenewright.stages.kit.simulation.urdf_split import PART_SEPARATOR

ALIKE = ({"table", "desk"}, {"cabinet", "wall_cabinet"})
"""Classes that segmentation and CAD matching confuse, and that serve the same purpose."""


def alike(first: str, second: str) -> bool:
    """Whether two classes may be of one thing."""
    return first == second or any({first, second} <= group for group in ALIKE)


def match_bodies(planned: dict[str, SceneBody], true: dict[str, SceneBody], radius: float) -> dict[str, BodyMatch]:
    """Return a match per planned body: greedily by the distance of box centres, within `radius` [m], one to one."""
    pairs = []
    for name, record in planned.items():
        for true_name, candidate in true.items():
            if alike(record.class_name, candidate.class_name):
                away = float(np.linalg.norm(np.subtract(record.box.center, candidate.box.center)))
                if away <= radius or (name == true_name and record.box == candidate.box):
                    pairs.append((away, name, true_name))
    matches = {name: BodyMatch(body=name, matched=None) for name in planned}
    used: set[str] = set()
    for away, name, true_name in sorted(pairs):
        if matches[name].matched is None and true_name not in used:
            matches[name] = BodyMatch(body=name, matched=true_name, distance=round(away, 6))
            used.add(true_name)
    return matches


def match_joint(planned: SceneBody, joint: str, true: SceneBody) -> str | None:
    """Return the joint of the true body that a planned joint is: the nearest moving part of the same type, by handle
    (or origin) in the world at value 0. None when the true body has none of that type."""
    planned_joint = next(entry for entry in planned.joints if entry.name == joint)
    best: tuple[float, str] | None = None
    for entry in true.joints:
        if entry.type != planned_joint.type:
            continue
        away = float(np.linalg.norm(_anchor(planned, planned_joint) - _anchor(true, entry)))
        if best is None or away < best[0]:
            best = (away, entry.name)
    return None if best is None else best[1]


def _anchor(body: SceneBody, joint: Joint) -> np.ndarray:
    pose = np.array(body.world_from_body)
    return pose[:3, :3] @ np.array(joint.handle or joint.origin) + pose[:3, 3]


def renamed(record: SceneBody, text: str, name: str, joints: dict[str, str] | None = None) -> tuple[SceneBody, str]:
    """Return a body's record and URDF text with its name (and prefix of links and joints) changed to `name`.

    `joints` (true name -> planned name) renames joints further, so that a plan's arguments keep their meaning.
    """
    old = record.name
    joints = joints or {}

    def new_name(value: str) -> str:
        if value in joints:
            return joints[value]
        if value == old:
            return name
        return re.sub(rf"^{re.escape(old + PART_SEPARATOR)}", name + PART_SEPARATOR, value)

    root = ElementTree.fromstring(text)
    for element in root.iter():
        if element.tag in ("link", "joint") and element.get("name"):
            element.set("name", new_name(element.get("name", "")))
        if element.tag in ("parent", "child") and element.get("link"):
            element.set("link", new_name(element.get("link", "")))
    changed = record.model_copy(
        update={
            "name": name,
            "joints": tuple(
                joint.model_copy(update={"name": new_name(joint.name), "part": new_name(joint.part)})
                for joint in record.joints
            ),
            "joint_values": {new_name(key): value for key, value in record.joint_values.items()},
        }
    )
    return changed, ElementTree.tostring(root, encoding="unicode")
