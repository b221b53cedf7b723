"""One URDF of several rigid bodies: a carrier with what stands on it, for as long as it is lifted."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree

import numpy as np
from scenewright.stages.kit.geometry.transforms import quaternion_of


def joined_text(carrier: str, load: dict[str, tuple[str, np.ndarray]]) -> str:
    """Return URDF text of a body with the links of others fixed to its first link.

    `carrier` is URDF text; `load`: body -> (URDF text, carrier_from_body (4, 4)). Joints of the load are dropped with
    their moving parts: what is carried is taken to be rigid.
    """
    robot = ElementTree.fromstring(carrier)
    links = robot.findall("link")
    for name, (text, pose) in sorted(load.items()):
        link = ElementTree.fromstring(text).find("link")
        if link is None:
            continue
        link.set("name", name)
        robot.append(link)
        joint = ElementTree.SubElement(robot, "joint", {"name": f"{name}__aboard", "type": "fixed"})
        ElementTree.SubElement(joint, "parent", {"link": links[0].get("name", "")})
        ElementTree.SubElement(joint, "child", {"link": name})
        where = {"xyz": _words(pose[:3, 3]), "rpy": _words(_roll_pitch_yaw(pose))}
        ElementTree.SubElement(joint, "origin", where)
    return ElementTree.tostring(robot, encoding="unicode")


def _words(values: np.ndarray) -> str:
    return " ".join(f"{float(value):.9g}" for value in values)


def _roll_pitch_yaw(pose: np.ndarray) -> np.ndarray:
    """Return URDF's fixed-axis angles (3,) [rad] of a pose (4, 4)."""
    x, y, z, w = quaternion_of(pose)
    roll = np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    pitch = np.arcsin(np.clip(2 * (w * y - z * x), -1.0, 1.0))
    yaw = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return np.array([roll, pitch, yaw])
