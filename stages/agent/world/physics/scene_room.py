"""A true scene to live in: library models as they are, with their meshes, joints and handles.

What a front's handle is made of is told by its joint: the connected piece of the moving part that `handle` lies in.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import trimesh
from scenewright.schemas.apartment import Apartment
from scenewright.schemas.interactive_scene import SceneBody
from scenewright.schemas.scene_parts import Joint
from scenewright.stages.agent.world.physics.eyes import color_name
from scenewright.stages.agent.world.physics.room import Room
from scenewright.stages.agent.world.reconstructed import SHELL
from scenewright.stages.kit.motion.doors import is_closed
from scenewright.stages.kit.rendering.ray_casting import SceneRenderer
from scenewright.stages.kit.rendering.surfaces import TriangleSoup, build_soup, joined_soups, linear_to_srgb, moved_soup
from scenewright.stages.kit.simulation.carriers import carrier
from scenewright.stages.kit.simulation.shapes import has_colors, link_shapes, paint
from scenewright.stages.kit.simulation.world import read_scene_bodies

BARE = (150, 150, 150, 255)
"""Colour of models without one."""
UPRIGHT = 0.9
"""Least share of a hinge's axis along the vertical, of a slide's across it: lids and flaps are no fronts."""
AT_HANDLE = 0.01
"""The point at which a part is gripped is this near to the box of its bar [m]; by eye."""
MOST_OF_PART = 0.3
"""Largest share of a part's surface that is a handle; by eye."""


class SceneRoom(Room):
    """The room of a scene folder (`room/` of a ground truth), which `apartment` describes. Raises BadInput as
    `read_scene_bodies` does."""

    def __init__(self, root: Path, apartment: Apartment) -> None:
        bodies = read_scene_bodies(root)
        super().__init__(apartment)
        for record, text in bodies.values():
            self.world.add_body(record, text)
        records = {name: record for name, (record, _) in bodies.items()}
        self._fronts = {
            joint.part: (name, joint)
            for name, record in records.items()
            if name in self.furniture
            for joint in record.joints
            if is_front(record, joint)
        }
        self.parts = {
            part: "door" if joint.type == "revolute" else "drawer" for part, (_, joint) in self._fronts.items()
        }
        self.parts |= {f"{part}__handle": "handle" for part in self._fronts}
        self.fixtures = tuple(
            name
            for name, record in records.items()
            if record.class_name not in SHELL and name not in self.furniture and name not in self.things
        )
        named = [*self.furniture, *self.things, *self.fixtures, *self.parts]
        self._number = {name: number for number, name in enumerate(named, 1)}
        self.named = {number: name for name, number in self._number.items()}
        self._still: list[TriangleSoup] = []
        self._moving: list[tuple[str, str, TriangleSoup]] = []
        """Body, link, and its triangles in the link's frame."""
        for record, text in bodies.values():
            if record.class_name != "ceiling":  # light comes from there
                self._add_meshes(record, link_shapes(text, "visual"))
        self.world.settle(0.5)

    def _add_meshes(self, record: SceneBody, shapes: dict[str, list[trimesh.Trimesh]]) -> None:
        name = record.name
        for link, meshes in shapes.items():
            for mesh in meshes:
                if not has_colors(mesh):
                    paint(mesh, np.array(BARE, np.uint8))
            named = [(self._number.get(name, 0), mesh) for mesh in meshes if len(mesh.faces)]
            if link in self._fronts:
                joint = self._fronts[link][1]
                at = np.array(joint.handle or joint.origin) - np.array(joint.origin)
                front, handle = split_handle([mesh for _, mesh in named], at)
                numbered = ((self._number[link], front), (self._number[f"{link}__handle"], handle))
                named = [(number, mesh) for number, pieces in numbered for mesh in pieces]
            if not named:
                continue
            soup = build_soup(named)
            if record.movable or link != name:
                self._moving.append((name, link, soup))
            else:
                self._still.append(moved_soup(soup, self.world.pose(name)))
            if link == name and name in self.things:
                told = color_name(linear_to_srgb(soup.corner_colors).reshape(-1, 3))
                self.things[name] = self.things[name].model_copy(update={"color": told})

    def renderer(self, eye: np.ndarray) -> SceneRenderer:
        """Return what the cameras see, as everything lies now; the robot aside."""
        moving = [moved_soup(soup, self.world.link_pose(name, link)) for name, link, soup in self._moving]
        return SceneRenderer(joined_soups([*self._still, *moving]), shadows=False, antialias=False)

    def _is_shut(self, part: str) -> bool:
        name, joint = self._fronts[part]
        return is_closed(joint, self.world.joint_value(name, joint.name))

    def opened(self) -> set[str]:
        """Return the furniture of which a door or a drawer is not shut."""
        return {name for part, (name, _) in self._fronts.items() if not self._is_shut(part)}

    def owner(self, name: str) -> str:
        """Return the furniture that the eyes take a named body or part for: what stands open is seen as itself."""
        part = name.removesuffix("__handle")
        return "" if part in self._fronts and not self._is_shut(part) else super().owner(name)

    def lies(self, name: str) -> tuple[float, float, float]:
        """Return the middle of a thing's foot [m], world frame."""
        low, high = self.world.bounds(name)
        x, y = (low + high)[:2] / 2
        return float(x), float(y), float(low[2])

    def carrier(self, name: str) -> str:
        """Return the body that a thing is on or in, by contact; where nothing carries it the furniture that its foot is
        within, or `floor`."""
        body = carrier(self.world, name)
        if body is not None:
            return "floor" if self.world.bodies[body].record.class_name in SHELL else body
        at = np.array(self.lies(name))
        for piece in self.furniture:
            low, high = self.world.bounds(piece)
            if np.all((at > low) & (at < high)):
                return piece
        return "floor"


def is_front(record: SceneBody, joint: Joint) -> bool:
    """Whether a part is a door or a drawer: it turns about the vertical, or slides level."""
    axis = np.array(record.world_from_body)[:3, :3] @ np.array(joint.axis)
    along = abs(float(axis[2])) / float(np.linalg.norm(axis))
    return along >= UPRIGHT if joint.type == "revolute" else along <= 1 - UPRIGHT


def split_handle(meshes: list[trimesh.Trimesh], at: np.ndarray) -> tuple[list[trimesh.Trimesh], list[trimesh.Trimesh]]:
    """Return the meshes of a part without, and of, the connected piece that is gripped at a point (3,) of its frame:
    no handle where that piece is most of the part."""
    area = sum(float(mesh.area) for mesh in meshes)
    front: list[trimesh.Trimesh] = []
    handle: list[trimesh.Trimesh] = []
    for mesh in meshes:
        groups = trimesh.graph.connected_components(mesh.face_adjacency, nodes=np.arange(len(mesh.faces)), min_len=1)
        gripped = [
            faces
            for faces in groups
            for corners in [mesh.triangles[faces].reshape(-1, 3)]
            if np.all((at > corners.min(axis=0) - AT_HANDLE) & (at < corners.max(axis=0) + AT_HANDLE))
            and float(mesh.area_faces[faces].sum()) < MOST_OF_PART * area
        ]
        of_handle = np.zeros(len(mesh.faces), bool)
        for faces in gripped:
            of_handle[faces] = True
        for pieces, chosen in ((front, ~of_handle), (handle, of_handle)):
            if chosen.any():
                piece = mesh.submesh([np.flatnonzero(chosen)], append=True, repair=False)
                assert isinstance(piece, trimesh.Trimesh)
                pieces.append(piece)
    return front, handle
