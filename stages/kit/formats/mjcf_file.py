"""The same scene for MuJoCo: nested bodies, free joints for what can be carried, a key frame with the joint values."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from scenewright.stages.kit.formats.urdf_file import Link, Shape, Urdf, UrdfJoint, number, numbers
from scenewright.stages.kit.geometry.substances import ROLLING_FRICTION, SPINNING_FRICTION
from scenewright.stages.kit.geometry.transforms import quaternion_of

KEY_FRAME, SPAWN = "reconstructed", "spawn"
LAMP_CUTOFF = "85"
"""Half the cone of the lamp [degrees]: all of the room below it."""


def write_mjcf(
    path: Path,
    urdf: Urdf,
    joint_values: dict[str, float],
    spawn: np.ndarray | None = None,
    lamp: tuple[float, ...] = (0.0, 0.0, 3.0),
) -> None:
    """Write a kinematic tree (root link `world`) as MJCF; mesh paths are relative to `path`. `spawn`: world_from_base
    (4, 4) of the site `spawn`, to which a robot can be attached; `lamp`: (3,) where the light hangs [m].

    MuJoCo allows free joints only right under the world: children of floating joints go there with their world poses.
    The key frame `reconstructed` holds the given joint values and the poses of the free bodies.
    """
    root = ElementTree.Element("mujoco", model=urdf.name)
    ElementTree.SubElement(root, "compiler", angle="radian", inertiafromgeom="false", autolimits="true", meshdir=".")
    ElementTree.SubElement(root, "option", gravity="0 0 -9.81", integrator="implicitfast")
    defaults = ElementTree.SubElement(root, "default")
    for name, attributes in (
        ("visual", {"group": "2", "contype": "0", "conaffinity": "0", "density": "0"}),
        (
            "collision",
            {"group": "3", "rgba": "0.5 0.5 0.5 0.3", "friction": f"0.45 {SPINNING_FRICTION} {ROLLING_FRICTION}"},
        ),
    ):
        ElementTree.SubElement(ElementTree.SubElement(defaults, "default", {"class": name}), "geom", attributes)
    assets = ElementTree.SubElement(root, "asset")
    world = ElementTree.SubElement(root, "worldbody")
    shines = {"dir": "0 0 -1", "cutoff": LAMP_CUTOFF, "exponent": "1", "castshadow": "true"}
    ElementTree.SubElement(world, "light", {"name": "lamp", "pos": numbers(lamp), **shines})
    if spawn is not None:
        ElementTree.SubElement(world, "site", name=SPAWN, pos=numbers(spawn[:3, 3]), quat=_quaternion(spawn))
    contact = ElementTree.SubElement(root, "contact")
    children: dict[str, list[UrdfJoint]] = {}
    for joint in urdf.joints:
        children.setdefault(joint.parent, []).append(joint)
    meshes: dict[tuple[str, float, bool], str] = {}
    free: list[tuple[UrdfJoint, np.ndarray]] = []
    positions: list[float] = []

    def add_mesh(shape: Shape, visual: bool) -> str:
        key = (shape.mesh or "", shape.scale, visual)
        if key not in meshes:
            meshes[key] = f"mesh_{len(meshes)}"
            attributes = {"name": meshes[key], "file": key[0], "inertia": "shell" if visual else "convex"}
            if shape.scale != 1.0:
                attributes["scale"] = numbers((shape.scale,) * 3)
            ElementTree.SubElement(assets, "mesh", attributes)
        return meshes[key]

    def add_body(
        parent: ElementTree.Element, joint: UrdfJoint, pose: np.ndarray, world_from_parent: np.ndarray
    ) -> None:
        body = ElementTree.SubElement(
            parent, "body", name=joint.child, pos=numbers(pose[:3, 3]), quat=_quaternion(pose)
        )
        world_from_body = world_from_parent @ pose
        if joint.type == "floating":
            ElementTree.SubElement(body, "freejoint", name=joint.name)
            positions.extend([*world_from_body[:3, 3], *quaternion_of(world_from_body)[[3, 0, 1, 2]]])
        elif joint.type in ("revolute", "prismatic", "continuous"):
            _add_joint(body, joint)
            ElementTree.SubElement(contact, "exclude", body1=joint.parent, body2=joint.child)
            positions.append(joint_values.get(joint.name, 0.0))
        _fill(body, urdf.link(joint.child), add_mesh)
        for below in children.get(joint.child, []):
            if below.type == "floating":
                free.append((below, world_from_body @ below.parent_from_child))
            else:
                add_body(body, below, below.parent_from_child, world_from_body)

    for joint in children.get("world", []):
        if joint.type == "floating":
            free.append((joint, joint.parent_from_child))
        else:
            add_body(world, joint, joint.parent_from_child, np.eye(4))
    while free:
        joint, pose = free.pop(0)
        add_body(world, joint, pose, np.eye(4))
    if positions:
        keys = ElementTree.SubElement(root, "keyframe")
        ElementTree.SubElement(keys, "key", name=KEY_FRAME, qpos=numbers(tuple(positions)))
    ElementTree.indent(root, " ")
    Path(path).write_bytes(ElementTree.tostring(root, encoding="utf-8", xml_declaration=True) + b"\n")


def _quaternion(pose: np.ndarray) -> str:
    """MuJoCo's order: w, x, y, z."""
    return numbers(quaternion_of(pose)[[3, 0, 1, 2]])


def _add_joint(body: ElementTree.Element, joint: UrdfJoint) -> None:
    attributes = {
        "name": joint.name,
        "type": "slide" if joint.type == "prismatic" else "hinge",
        "axis": numbers(joint.axis),
        "damping": number(joint.damping),
        "frictionloss": number(joint.friction),
    }
    if joint.type != "continuous":
        attributes["range"] = numbers((joint.lower, joint.upper))
    ElementTree.SubElement(body, "joint", attributes)


def _fill(body: ElementTree.Element, link: Link, add_mesh: Callable[[Shape, bool], str]) -> None:
    if link.inertial is not None:
        tensor = link.inertial.inertia
        full = [tensor[0, 0], tensor[1, 1], tensor[2, 2], tensor[0, 1], tensor[0, 2], tensor[1, 2]]
        ElementTree.SubElement(
            body,
            "inertial",
            pos=numbers(link.inertial.center),
            mass=number(link.inertial.mass),
            fullinertia=" ".join(f"{value:.9g}" for value in full),
        )
    for shapes, kind in ((link.visuals, "visual"), (link.collisions, "collision")):
        for shape in shapes:
            attributes = {
                "class": kind,
                "pos": numbers(shape.link_from_shape[:3, 3]),
                "quat": _quaternion(shape.link_from_shape),
            }
            if shape.mesh is not None:
                attributes |= {"type": "mesh", "mesh": add_mesh(shape, kind == "visual")}
            elif shape.round is not None:  # a radius, then half of the length
                sizes = np.asarray(shape.round.sizes) * (1.0, 0.5)[: len(shape.round.sizes)]
                attributes |= {"type": shape.round.kind, "size": numbers(sizes)}
            else:
                attributes |= {"type": "box", "size": numbers(0.5 * np.asarray(shape.box_size))}
            if kind == "collision" and link.friction is not None:
                # MuJoCo takes the larger of the two values of a contact
                attributes["friction"] = numbers((link.friction, SPINNING_FRICTION, ROLLING_FRICTION))
            if kind == "visual" and shape.color is not None:
                attributes["rgba"] = numbers(shape.color)
            ElementTree.SubElement(body, "geom", attributes)
