"""URDF text of a rigid body in another size: shapes and where they are, not what it weighs."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree

LENGTHS = (("origin", "xyz"), ("box", "size"), ("cylinder", "radius"), ("cylinder", "length"), ("sphere", "radius"))


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


def _times(numbers: str, scale: float) -> str:
    return " ".join(f"{scale * float(number):.9g}" for number in numbers.split())
