"""A scene as separate bodies, each free, still, or still with doors: what formats without one big tree need."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scenewright.schemas.contact_graph import ContactGraphFile
from scenewright.schemas.errors import BadInput
from scenewright.schemas.interactive_scene import SceneBody
from scenewright.stages.kit.formats.urdf_file import Link, UrdfJoint
from scenewright.stages.kit.formats.written_scene import WrittenScene

MOVING = ("revolute", "prismatic", "continuous")


@dataclass(frozen=True)
class BodyToExport:
    """One body of the scene with its links, the body's own first, and the joints between them."""

    record: SceneBody
    links: tuple[Link, ...]
    joints: tuple[UrdfJoint, ...]

    @property
    def name(self) -> str:
        """Name of the body and of its first link."""
        return self.record.name

    @property
    def articulated(self) -> bool:
        """Whether a part of it moves against another."""
        return any(joint.type in MOVING for joint in self.joints)

    @property
    def dynamic(self) -> bool:
        """Whether anything of it moves. What is neither movable nor has doors stays in the world, whatever carries
        it, as in static.urdf."""
        return self.record.movable or self.articulated


@dataclass(frozen=True)
class SceneToExport:
    """A written scene, its contact graph, and its bodies."""

    written: WrittenScene
    graph: ContactGraphFile

    @cached_property
    def bodies(self) -> tuple[BodyToExport, ...]:
        """Every body in the order of scene.json. Raises BadInput for a body that the tree does not have."""
        links = {link.name: link for link in self.written.urdf.links}
        names = {record.name for record in self.written.info.bodies}
        inner: dict[str, list[UrdfJoint]] = {}
        for joint in self.written.urdf.joints:
            if joint.child not in names:
                inner.setdefault(joint.parent, []).append(joint)
        bodies = []
        for record in self.written.info.bodies:
            if record.name not in links:
                raise BadInput(f"{self.written.root}: no link {record.name!r} in scene.urdf", hint="run `urdf` again")
            joints = tuple(_below(record.name, inner))
            links_of_body = (links[record.name], *(links[joint.child] for joint in joints))
            bodies.append(BodyToExport(record, links_of_body, joints))
        return tuple(bodies)

    def pose(self, link: Link) -> np.ndarray:
        """Return world_from_link (4, 4), joints as reconstructed."""
        return self.written.link_poses[link.name]


def _below(link: str, inner: dict[str, list[UrdfJoint]]) -> Iterator[UrdfJoint]:
    """Yield the joints below a link that stay within its body, parents first. The tree was checked: no circles."""
    waiting = list(inner.get(link, []))
    while waiting:
        joint = waiting.pop(0)
        yield joint
        waiting.extend(inner.get(joint.child, []))
