"""Semantic robot description (SRDF) of a scene: which pairs of links a planner need not check, and why."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from xml.etree import ElementTree

from scenewright.stages.kit.formats.urdf_file import Urdf, number
from scenewright.stages.kit.formats.written_scene import WrittenScene
from scenewright.stages.urdf.exports import SceneExporter
from scenewright.stages.urdf.resting_contacts import resting_contacts

GROUP, STATE = "doors_and_drawers", "reconstructed"


def write_srdf(path: Path, urdf: Urdf, contacts: Sequence[tuple[str, str]], values: Mapping[str, float]) -> None:
    """Write the disabled collision pairs of a tree, and the joint values it was reconstructed in as a group state.

    Reasons: `Adjacent` for links that a joint connects, `Contact` for the pairs of `contacts`, which touch while
    nothing moves. A pair stands once, the first reason counts; order and names within a pair are sorted.
    """
    robot = ElementTree.Element("robot", name=urdf.name)
    moving = [joint.name for joint in urdf.joints if joint.type in ("revolute", "prismatic", "continuous")]
    if moving:
        group = ElementTree.SubElement(robot, "group", name=GROUP)
        for name in moving:
            ElementTree.SubElement(group, "joint", name=name)
        state = ElementTree.SubElement(robot, "group_state", name=STATE, group=GROUP)
        for name in moving:
            ElementTree.SubElement(state, "joint", name=name, value=number(values.get(name, 0.0)))
    shapes = {link.name for link in urdf.links if link.collisions}
    reasons: dict[tuple[str, str], str] = {}
    for joint in urdf.joints:
        if joint.parent in shapes and joint.child in shapes:
            reasons[_pair(joint.parent, joint.child)] = "Adjacent"
    for first, second in contacts:
        reasons.setdefault(_pair(first, second), "Contact")
    for first, second in sorted(reasons):
        ElementTree.SubElement(robot, "disable_collisions", link1=first, link2=second, reason=reasons[(first, second)])
    ElementTree.indent(robot, " ")
    Path(path).write_bytes(ElementTree.tostring(robot, encoding="utf-8", xml_declaration=True) + b"\n")


def _pair(first: str, second: str) -> tuple[str, str]:
    return (first, second) if first <= second else (second, first)


def _write(path: Path, scene: WrittenScene) -> None:
    write_srdf(path, scene.urdf, resting_contacts(scene.root), scene.joint_values)


EXPORTER = SceneExporter("srdf", order=10, file="scene.srdf", write=_write)
