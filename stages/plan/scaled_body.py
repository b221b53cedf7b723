"""URDF text of a rigid body in another size, and with more to it: shapes and where they are, not what it weighs."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable

import numpy as np

LENGTHS = (("origin", "xyz"), ("box", "size"), ("cylinder", "radius"), ("cylinder", "length"), ("sphere", "radius"))
"""Tags and attributes of a URDF that are lengths."""


def scaled_text(text: str, scale: float) -> str:
    """Return URDF text of one link with every length `scale` times as long, about the origin of its frame."""
    root = ElementTree.fromstring(text)
    for tag, attribute in LENGTHS:
        for element in root.iter(tag):
            if element.get(attribute) is not None:
                element.set(attribute, _times(element.get(attribute, ""), scale))
    for element in root.iter("mesh"):
        element.set("scale", _times(element.get("scale", "1 1 1"), scale))
    ElementTree.indent(root)  # pybullet breaks lines of more than a kilobyte, within a word if need be
    return ElementTree.tostring(root, encoding="unicode")


def with_boxes(text: str, boxes: Iterable[tuple[np.ndarray, np.ndarray]]) -> str:
    """Return URDF text of one link with boxes more in its shape: centre and edge lengths (3,), its frame [m]."""
    root = ElementTree.fromstring(text)
    for center, size in boxes:
        add_box(root.findall("link")[0], center, size)
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode")


def shifted_text(text: str, shift: np.ndarray) -> str:
    """Return URDF text of one link with its shapes and its mass moved by a shift (3,) of its frame [m]."""
    root = ElementTree.fromstring(text)
    for tag in ("collision", "visual", "inertial"):
        for element in root.iter(tag):
            origin = element.find("origin")
            if origin is None:
                origin = ElementTree.SubElement(element, "origin", {"xyz": "0 0 0", "rpy": "0 0 0"})
            origin.set("xyz", _words(np.array(origin.get("xyz", "0 0 0").split(), float) + shift))
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode")


def add_box(link: ElementTree.Element, center: np.ndarray, size: np.ndarray) -> None:
    """Add a box, centre and edge lengths (3,) [m], to the collision shape of a link."""
    shape = ElementTree.SubElement(link, "collision")
    ElementTree.SubElement(shape, "origin", {"xyz": _words(center), "rpy": "0 0 0"})
    ElementTree.SubElement(ElementTree.SubElement(shape, "geometry"), "box", {"size": _words(size)})


def _words(values: np.ndarray) -> str:
    return " ".join(f"{float(value):.6g}" for value in values)


def _times(numbers: str, scale: float) -> str:
    return " ".join(f"{scale * float(number):.9g}" for number in numbers.split())
