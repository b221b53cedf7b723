"""A whole kinematic tree as bodies: what is free, what stands fast, and what moves on joints in either.

A link that hangs on another by a floating joint is the first of a free body. A link that hangs on the world by a
fixed joint is the first of a body that stands fast; in URDF and MJCF, where a table hangs on its floor, so is one that
is fixed to what stands fast. What hangs on these by other joints belongs to them; what is fixed to a part that moves is
one with it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.formats.link_poses import link_poses
from scenewright.stages.kit.formats.urdf_file import Link, Shape, Urdf, UrdfJoint
from scenewright.stages.kit.geometry.solids import MassProperties
from scenewright.stages.kit.geometry.transforms import apply


@dataclass(frozen=True)
class OthersBody:
    """One body: its links, the body's own first, and the joints between them."""

    name: str
    free: bool
    world_from_body: np.ndarray
    """(4, 4) of the first link."""
    links: tuple[Link, ...]
    joints: tuple[UrdfJoint, ...]


def bodies_of(urdf: Urdf, values: Mapping[str, float], where: str, *, models: bool = False) -> list[OthersBody]:
    """Return the bodies of a tree with joints at `values` [rad, m], in the order of its links.

    `models`: only what hangs on the root itself is a body of its own, as in SDF.

    Bodies without a shape to touch are left out. Raises BadInput, beginning with `where`, for what is no tree, and for
    what can move and has no mass.
    """
    joint_of = {joint.child: joint for joint in urdf.joints}
    if len(joint_of) < len(urdf.joints):
        raise BadInput(f"{where}: a link is the child of two joints: bodies in a ring are not read")
    poses = link_poses(replace(urdf, name=where), dict(values))
    fast: set[str] = set()
    owner: dict[str, str] = {}
    free: set[str] = set()
    for name in _parents_first(urdf):
        joint = joint_of.get(name)
        if joint is None or (joint.type == "fixed" and joint.parent in fast):
            fast.add(name)
            part = models and joint is not None and joint.parent in joint_of
            owner[name] = owner[joint.parent] if joint is not None and part else name
        elif joint.type == "floating":
            free.add(name)
            owner[name] = name
        else:
            owner[name] = owner[joint.parent]
    members: dict[str, list[Link]] = {}
    for link in urdf.links:
        members.setdefault(owner[link.name], []).append(link)
    inner = {name: [j for j in urdf.joints if owner[j.child] == name and j.child != name] for name in members}
    bodies = []
    for name, links in members.items():
        first = next(link for link in links if link.name == name)
        ordered = (first, *(link for link in links if link is not first))
        whole = welded(ordered, inner[name])
        if any(link.collisions for link in whole[0]):
            bodies.append(OthersBody(name, name in free, poses[name], *whole))
    for body in bodies:
        moving = {joint.child for joint in body.joints} | ({body.name} if body.free else set())
        for link in body.links:
            if link.name in moving and link.inertial is None:
                raise BadInput(f"{where}: link {link.name!r} can move and has no mass", hint="give it mass and inertia")
    return bodies


def _parents_first(urdf: Urdf) -> list[str]:
    children: dict[str, list[str]] = {}
    for joint in urdf.joints:
        children.setdefault(joint.parent, []).append(joint.child)
    order = urdf.roots()
    for name in order:
        order.extend(children.get(name, []))
    return order


def welded(links: tuple[Link, ...], joints: list[UrdfJoint]) -> tuple[tuple[Link, ...], tuple[UrdfJoint, ...]]:
    """Return links and joints of a body with every link that is fixed to another one made part of it: engines give a
    link without mass a kilogram. Masses add up, shapes keep their places."""
    kept = {link.name: link for link in links}
    moved = list(joints)
    while (fixed := next((joint for joint in moved if joint.type == "fixed"), None)) is not None:
        parent, child = kept[fixed.parent], kept.pop(fixed.child)
        kept[parent.name] = _one(parent, child, fixed.parent_from_child)
        moved = [_hung_on(joint, fixed) for joint in moved if joint is not fixed]
    return tuple(kept.values()), tuple(moved)


def _hung_on(joint: UrdfJoint, fixed: UrdfJoint) -> UrdfJoint:
    if joint.parent != fixed.child:
        return joint
    return replace(joint, parent=fixed.parent, parent_from_child=fixed.parent_from_child @ joint.parent_from_child)


def _one(parent: Link, child: Link, parent_from_child: np.ndarray) -> Link:
    shapes = tuple(_moved(shape, parent_from_child) for shape in child.collisions)
    inertials = [entry for entry in (parent.inertial, turned(child.inertial, parent_from_child)) if entry is not None]
    return replace(
        parent,
        inertial=together(inertials) if inertials else None,
        collisions=parent.collisions + shapes,
        friction=parent.friction if parent.collisions or child.friction is None else child.friction,
    )


def _moved(shape: Shape, parent_from_child: np.ndarray) -> Shape:
    return replace(shape, link_from_shape=parent_from_child @ shape.link_from_shape)


def turned(inertial: MassProperties | None, target_from_own: np.ndarray) -> MassProperties | None:
    """Return mass properties in another frame; `target_from_own` is (4, 4) and rigid."""
    if inertial is None:
        return None
    rotation = target_from_own[:3, :3]
    center = apply(target_from_own, np.asarray(inertial.center)[None])[0]
    return MassProperties(inertial.mass, center, rotation @ inertial.inertia @ rotation.T)


def together(parts: list[MassProperties]) -> MassProperties:
    """Return the mass properties of parts of one frame that are one rigid thing (parallel axes)."""
    mass = sum(part.mass for part in parts)
    if not mass > 0:
        return parts[0]
    center = sum(part.mass * np.asarray(part.center) for part in parts) / mass
    inertia = np.zeros((3, 3))
    for part in parts:
        offset = np.asarray(part.center) - center
        inertia += part.inertia + part.mass * (offset @ offset * np.eye(3) - np.outer(offset, offset))
    return MassProperties(mass, np.asarray(center), inertia)
