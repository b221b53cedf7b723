"""Take one body out of a URDF tree as a URDF of its own, with absolute mesh paths."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from pathlib import Path

from scenewright.schemas.errors import BadInput
from scenewright.schemas.outside import file_content
from scenewright.stages.kit.formats.urdf_file import MAXIMUM_BYTES
from scenewright.stages.kit.formats.xml_files import parse_xml

PART_SEPARATOR = "__"


def read_urdf(path: Path) -> ElementTree.Element:
    """Parse a URDF file. Raises BadInput when it is missing or no URDF."""
    root = parse_xml(file_content(path, MAXIMUM_BYTES, hint="make the scene again"), str(path))
    if root.tag != "robot":
        raise BadInput(f"{path}: root element is <{root.tag}>, expected <robot>", hint="make the scene again")
    return root


def owner_of_link(link: str, names: set[str]) -> str | None:
    """Return the body that a link belongs to: links are `<name>` or `<name>__<part>`; None for the root link."""
    if link in names:
        return link
    head = link
    while PART_SEPARATOR in head:
        head = head.rsplit(PART_SEPARATOR, 1)[0]
        if head in names:
            return head
    return None


def split_body(root: ElementTree.Element, name: str, names: set[str], folder: Path) -> str:
    """Return the URDF text of the links of body `name` and the joints between them.

    `names` are all bodies of the tree, `folder` is what mesh paths are relative to. Raises BadInput when the tree
    has no link `name`.
    """
    own = [link for link in root.findall("link") if owner_of_link(link.get("name", ""), names) == name]
    link_names = {link.get("name") for link in own}
    if name not in link_names:
        raise BadInput(f"URDF has no link {name!r}", hint="links of a body are called <name> and <name>__<part>")
    robot = ElementTree.Element("robot", {"name": name})
    robot.extend(root.findall("material"))
    robot.extend(own)
    for joint in root.findall("joint"):
        parent, child = joint.find("parent"), joint.find("child")
        if parent is None or child is None:
            continue
        if parent.get("link") in link_names and child.get("link") in link_names:
            robot.append(joint)
    return with_absolute_meshes(robot, folder)


def with_absolute_meshes(robot: ElementTree.Element, folder: Path) -> str:
    """Return the URDF text with every mesh path made absolute from `folder` (also `package://` ones)."""
    copy = ElementTree.fromstring(ElementTree.tostring(robot))
    for mesh in copy.iter("mesh"):
        if not Path(_mesh_name(mesh)).is_absolute():
            mesh.set("filename", str(mesh_file(mesh, folder).resolve()))
    return ElementTree.tostring(copy, encoding="unicode")


def mesh_file(mesh: ElementTree.Element, folder: Path) -> Path:
    """Return the file that a <mesh> names, from `folder` where it names no whole path (also `package://` ones)."""
    return folder / _mesh_name(mesh)


def _mesh_name(mesh: ElementTree.Element) -> str:
    return mesh.get("filename", "").removeprefix("package://").removeprefix("file://")


def without_visuals(text: str) -> str:
    """Return URDF text without <visual> elements: physics needs none, and large meshes load slowly."""
    robot = ElementTree.fromstring(text)
    for link in robot.findall("link"):
        for visual in link.findall("visual"):
            link.remove(visual)
    return ElementTree.tostring(robot, encoding="unicode")


def links_with_friction(text: str) -> set[str]:
    """Return the names of the links of URDF text that say how rough they are."""
    links = ElementTree.fromstring(text).findall("link")
    return {link.get("name", "") for link in links if link.find("contact/lateral_friction") is not None}
