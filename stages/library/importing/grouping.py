"""The parts of a source that move: links that are fast to one another make one group, joints lie between groups.

Parts hang on the body: what moves on a moving part is held fast on it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.geometry.transforms import apply
from scenewright.stages.library.importing.source_model import SourceJoint, SourceLink, SourceModel, Surface
from scenewright.stages.library.modelling import BODY

SMALLEST_RANGE = {"revolute": 1e-3, "prismatic": 1e-4}
"""A joint that moves less is held fast [rad, m]."""


@dataclass(frozen=True)
class Group:
    """A part of the result: links that are fast to one another, in the frame of the source's root link."""

    name: str
    links: tuple[tuple[SourceLink, np.ndarray], ...]
    """Each with root_from_link (4, 4)."""
    joint: SourceJoint | None = None
    root_from_child: np.ndarray | None = None


def grouped(source: SourceModel) -> tuple[list[Group], list[str]]:
    """Return the body and the moving parts of a source. Raises BadInput for joints that make no tree."""
    links = {link.name: link for link in source.links}
    where = source.source
    if len(links) < len(source.links):
        raise BadInput(f"{where}: two links have one name")
    joint_of: dict[str, SourceJoint] = {}
    for joint in source.joints:
        if joint.parent not in links or joint.child not in links:
            raise BadInput(f"{where}: joint {joint.name!r:.60} names a link that does not exist")
        if joint.child in joint_of:
            raise BadInput(f"{where}: link {joint.child!r:.60} has two parents")
        joint_of[joint.child] = joint
    roots = [name for name in links if name not in joint_of]
    if len(roots) != 1:
        raise BadInput(f"{where}: {len(roots)} root links, expected 1")
    children: dict[str, list[SourceJoint]] = {}
    for joint in source.joints:
        children.setdefault(joint.parent, []).append(joint)
    findings: list[str] = []
    members: dict[str, list[tuple[SourceLink, np.ndarray]]] = {roots[0]: [(links[roots[0]], np.eye(4))]}
    heads: dict[str, tuple[SourceJoint, np.ndarray]] = {}
    waiting = [(roots[0], roots[0], np.eye(4))]
    reached = {roots[0]}
    while waiting:
        name, head, root_from_link = waiting.pop(0)
        for joint in children.get(name, []):
            pose = root_from_link @ joint.parent_from_child
            if joint.kind == "floating" and not _is_whole(links[name], children[name]):
                findings.append(f"joint {joint.name!r:.40} floats: held fast")
            own_joint = _moving_joint(joint, findings)
            if own_joint is not None and head != roots[0]:
                findings.append(f"joint {joint.name!r:.40} moves on a part that moves: held fast")
                own_joint = None
            group = head if own_joint is None else joint.child
            if own_joint is not None:
                heads[group] = (own_joint, pose)
            members.setdefault(group, []).append((links[joint.child], pose))
            reached.add(joint.child)
            waiting.append((joint.child, group, pose))
    if len(reached) < len(links):
        raise BadInput(f"{where}: joints lead in a circle")
    groups = [Group(BODY, tuple(members[roots[0]]))]
    for head, (joint, pose) in heads.items():
        groups.append(Group(head, tuple(members[head]), joint, pose))
    return groups, findings


def _is_whole(parent: SourceLink, joints: Sequence[SourceJoint]) -> bool:
    """Whether all of a model hangs on a parent without shape (`world`): it may then be put anywhere anyway."""
    return len(joints) == 1 and not parent.visual and not parent.collision


def _moving_joint(joint: SourceJoint, findings: list[str]) -> SourceJoint | None:
    """Return the joint as one that moves, or None for one that does not."""
    if joint.kind in ("fixed", "floating"):
        return None
    if np.linalg.norm(joint.axis) < 1e-9:
        findings.append(f"joint {joint.name!r:.40} has an axis of length 0: held fast")
        return None
    if joint.kind == "continuous":
        return replace(joint, kind="revolute", lower=-np.pi, upper=np.pi)
    if joint.lower > joint.upper:
        findings.append(f"joint {joint.name!r:.40}: lower and upper limit changed places")
        joint = replace(joint, lower=joint.upper, upper=joint.lower)
    if joint.kind == "revolute" and max(-joint.lower, joint.upper) > 4 * np.pi:
        findings.append(f"joint {joint.name!r:.40} turns by {max(-joint.lower, joint.upper):.0f} rad: degrees?")
    if joint.upper - joint.lower < SMALLEST_RANGE[joint.kind]:
        findings.append(f"joint {joint.name!r:.40} has no range: held fast")
        return None
    return joint


def source_points(groups: Sequence[Group]) -> np.ndarray:
    """Return the vertices (N, 3) of all parts as the file poses them, root frame and file's unit. Raises BadInput."""
    points = [apply(pose, surface.vertices) for surface, pose in _drawn(groups)]
    if not points:
        raise BadInput("holds no shapes")
    return np.concatenate(points)


def source_corners(groups: Sequence[Group]) -> np.ndarray:
    """Return the triangles (F, 3, 3) of all parts as the file poses them."""
    return np.concatenate([apply(pose, surface.vertices)[surface.faces] for surface, pose in _drawn(groups)])


def _drawn(groups: Sequence[Group]) -> Iterator[tuple[Surface, np.ndarray]]:
    for group in groups:
        for link, pose in group.links:
            for surface in link.visual or link.collision:
                yield surface, pose
