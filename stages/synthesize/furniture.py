"""Library models as they can be placed: geometry at a set of joint values, doors' swept space, supporting surfaces."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np
import trimesh
from scenewright.schemas.base import as_vector
from scenewright.schemas.cad_library import CadLibrary, CadModel
from scenewright.schemas.scene_parts import Joint, SurfacePlane
from scenewright.stages.kit.formats.cad_models import (
    load_collision_parts,
    model_folder,
    part_transforms,
    posed_collision,
    posed_mesh,
)
from scenewright.stages.kit.geometry.ray_scenes import Triangles, triangles_of
from scenewright.stages.kit.geometry.transforms import apply
from scenewright.stages.synthesize.collision import ConvexShape, convex_shape

SWEEP_STEPS = 9
"""Values of a joint at which its parts are looked at for what they pass through; by eye."""
CONTACT_BAND = 1.5e-3
"""Vertices this close to the lowest one are what a thing stands on [m]."""


@dataclass(frozen=True)
class Furnishing:
    """A model at one set of joint values and one scale: everything about it but the pose."""

    model: CadModel
    folder: Path
    joints: dict[str, float] = field(default_factory=dict)
    scale: float = 1.0

    @cached_property
    def mesh(self) -> trimesh.Trimesh:
        """Visual mesh in the model frame [m], scaled."""
        return posed_mesh(self.folder, self.model, self.joints, self.scale)

    @cached_property
    def triangles(self) -> Triangles:
        """`mesh`, ready for rays."""
        return triangles_of(np.asarray(self.mesh.vertices), np.asarray(self.mesh.faces))

    @cached_property
    def contacts(self) -> np.ndarray:
        """Vertices (K, 3) of the model frame that it stands on [m]."""
        points = np.asarray(self.mesh.vertices)
        lowest = points[points[:, 2] < points[:, 2].min() + CONTACT_BAND]
        return np.unique(np.round(lowest, 6), axis=0)

    @cached_property
    def shape(self) -> ConvexShape:
        """Convex pieces in the model frame, scaled."""
        return convex_shape(posed_collision(self.folder, self.model, self.joints, self.scale))

    @cached_property
    def swing(self) -> ConvexShape | None:
        """What the moving parts pass through over their whole range (model frame, scaled), None without joints."""
        if not self.model.joints:
            return None
        pieces_of_part = load_collision_parts(self.folder)
        pieces = []
        for joint in self.model.joints:
            for value in np.linspace(joint.lower, joint.upper, SWEEP_STEPS):
                pose = part_transforms(self.model, {joint.name: float(value)})[joint.part]
                for piece in pieces_of_part.get(joint.part, []):
                    moved = piece.copy()
                    moved.apply_transform(pose)
                    moved.apply_scale(self.scale)
                    pieces.append(moved)
        return convex_shape(pieces)

    @property
    def closed_size(self) -> np.ndarray:
        """Edge lengths (3,) of the closed bounding box [m], scaled."""
        state = self.model.states[0]
        return self.scale * (np.asarray(state.box_maximum) - np.asarray(state.box_minimum))

    @cached_property
    def planes(self) -> tuple[SurfacePlane, ...]:
        """Surface planes in the model frame, scaled: all of them when closed, those of the body when not."""
        lasting = list(self.model.states[0].planes)
        if any(abs(value) > 1e-9 for value in self.joints.values()):
            for state in self.model.states[1:]:
                lasting = [
                    plane for plane in lasting if any(same_plane(plane, state_plane) for state_plane in state.planes)
                ]
        return tuple(_scaled_plane(plane, self.scale) for plane in lasting)

    @cached_property
    def drawer_floors(self) -> tuple[SurfacePlane, ...]:
        """Horizontal planes of the drawers that stand open, in the model frame, scaled."""
        floors = []
        for joint in self.model.joints:
            value = self.joints.get(joint.name, 0.0)
            if joint.type != "prismatic" or abs(value) < 1e-9:
                continue
            alone = [s for s in self.model.states if not any(v for name, v in s.joints.items() if name != joint.name)]
            state = max(alone, key=lambda s: abs(s.joints.get(joint.name, 0.0)))
            axis = np.asarray(joint.axis)
            travel = state.joints.get(joint.name, 0.0) * axis
            for plane in self.model.states[0].planes:
                moved = _shifted_plane(plane, travel)
                went_along = any(same_plane(moved, state_plane) for state_plane in state.planes)
                if (
                    plane.horizontal
                    and went_along
                    and not any(same_plane(plane, state_plane) for state_plane in state.planes)
                ):
                    floors.append(_scaled_plane(_shifted_plane(plane, value * axis), self.scale))
        return tuple(floors)

    @property
    def surfaces(self) -> tuple[SurfacePlane, ...]:
        """`planes`, and after them `drawer_floors`: what indices of planes count."""
        return (*self.planes, *self.drawer_floors)


def _shifted_plane(plane: SurfacePlane, shift: np.ndarray) -> SurfacePlane:
    return plane.model_copy(
        update={
            "offset": plane.offset - float(np.asarray(plane.normal) @ shift),
            "center": as_vector(np.asarray(plane.center) + shift),
            "corners": tuple(as_vector(np.asarray(corner) + shift) for corner in plane.corners),
        }
    )


def same_plane(a: SurfacePlane, b: SurfacePlane) -> bool:
    """Return whether two surfaces (one model frame) are the same rectangle."""
    return bool(
        np.allclose(a.normal, b.normal, atol=1e-3)
        and abs(a.offset - b.offset) < 1e-3
        and np.allclose(a.center, b.center, atol=0.02)
    )


def _scaled_plane(plane: SurfacePlane, scale: float) -> SurfacePlane:
    if scale == 1.0:
        return plane
    return plane.model_copy(
        update={
            "offset": plane.offset * scale,
            "area": plane.area * scale**2,
            "center": as_vector(np.asarray(plane.center) * scale),
            "corners": tuple(as_vector(np.asarray(corner) * scale) for corner in plane.corners),
        }
    )


def plane_in_world(plane: SurfacePlane, world_from_model: np.ndarray) -> SurfacePlane:
    """Return a plane of the model frame in the world frame; `world_from_model` (4, 4) is rigid."""
    normal = world_from_model[:3, :3] @ np.asarray(plane.normal)
    center = apply(world_from_model, np.asarray(plane.center))
    on_plane = apply(world_from_model, -plane.offset * np.asarray(plane.normal))
    corners = tuple(as_vector(apply(world_from_model, np.asarray(corner))) for corner in plane.corners)
    return plane.model_copy(
        update={
            "normal": as_vector(normal),
            "offset": float(-normal @ on_plane),
            "center": as_vector(center),
            "corners": corners,
        }
    )


def main_joint(model: CadModel) -> Joint:
    """Return the door that matters: the revolute joint whose part is called `door`, otherwise the first revolute
    joint, otherwise the first. Raises IndexError for a rigid model."""
    doors = [joint for joint in model.joints if joint.type == "revolute"] or list(model.joints)
    called_door = [joint for joint in doors if joint.part == "door"]
    return (called_door or doors)[0]


class Catalogue:
    """The models of a library by class, loaded once."""

    def __init__(self, library: CadLibrary) -> None:
        self.library = library
        self.by_class: dict[str, list[CadModel]] = {}
        for model in sorted(library.info.models, key=lambda m: m.id):
            self.by_class.setdefault(model.class_name, []).append(model)
        self._made: dict[tuple[str, tuple[tuple[str, float], ...], float], Furnishing] = {}

    def furnishing(self, model: CadModel, joints: dict[str, float], scale: float = 1.0) -> Furnishing:
        """Return the model at these joint values and scale; the same object for the same question."""
        key = (model.id, tuple(sorted(joints.items())), scale)
        if key not in self._made:
            self._made[key] = Furnishing(model, model_folder(self.library, model.id), dict(joints), scale)
        return self._made[key]
