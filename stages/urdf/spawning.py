"""Where a robot is put into the scene: on the floor that was seen, where there is most room."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import trimesh
from scenewright.schemas.base import as_transform
from scenewright.schemas.interactive_scene import Spawn
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.kit.formats.scene_bundle import BundleBody
from scenewright.stages.kit.geometry.transforms import apply, transform_from_yaw
from scenewright.stages.urdf.standing_place import CELL, roomiest_place


def spawn_of(bodies: Sequence[BundleBody], floors: Sequence[trimesh.Trimesh]) -> Spawn | None:
    """Return the place for a robot's base among the bodies of a scene; None without a floor, or where it is full.

    `floors`: what was seen of them, world frame.
    """
    floor = np.concatenate([np.zeros((0, 3)), *(_filled(mesh) for mesh in floors)])
    others = [body for body in bodies if not load_vocabulary().by_name(body.class_name).is_layout]
    surface = np.concatenate([_surface(body) for body in others] or [np.zeros((0, 3))])
    place = roomiest_place(floor, [body.box for body in others if body.mesh is None], surface)
    if place is None:
        return None
    middle, radius = place
    things = [np.array(body.box.center[:2]) for body in others]
    ahead = np.mean(things, axis=0) - middle if things else np.array([1.0, 0.0])
    position = np.array([*middle, np.median(floor[:, 2])])
    world_from_base = transform_from_yaw(float(np.arctan2(ahead[1], ahead[0])), position)
    return Spawn(world_from_base=as_transform(np.round(world_from_base, 6)), radius=round(radius, 3))


def _surface(body: BundleBody) -> np.ndarray:
    """Return points (N, 3) [m] on a body's own mesh, world frame, in all cells that it covers."""
    if body.mesh is None or not len(body.mesh.faces):
        return np.zeros((0, 3))
    return apply(body.world_from_body, _filled(body.mesh))


def _filled(mesh: trimesh.Trimesh) -> np.ndarray:
    dense, _ = trimesh.remesh.subdivide_to_size(mesh.vertices, mesh.faces, max_edge=CELL, max_iter=20)
    return np.asarray(dense, float)
