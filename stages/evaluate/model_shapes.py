"""CAD models as evaluation compares them: parts with surface, colour, convex pieces, joints; and where they stand."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scenewright.schemas.cad_library import CadModel
from scenewright.schemas.scene_parts import Joint
from scenewright.stages.kit.formats.cad_models import part_transforms
from scenewright.stages.kit.geometry.transforms import apply
from scenewright.stages.kit.measurement.convex_overlap import ConvexPiece
from scenewright.stages.kit.measurement.shape_symmetry import NO_SYMMETRY, Symmetry, shape_symmetry

SAMPLES = 2000
"""Points on the closed surface that stand for the shape."""


@dataclass(frozen=True)
class PartShape:
    """One rigid part of a model, in its part frame: origin at the joint, axes of the model frame at joint value 0."""

    triangles: np.ndarray
    """(T, 3, 3) corners of the visible surface [m]."""
    color: tuple[float, float, float]
    """Mean colour over the surface, sRGB 0 to 255."""
    pieces: tuple[ConvexPiece, ...] = ()

    @cached_property
    def area(self) -> float:
        """Area of the surface [m^2]."""
        return float(_areas(self.triangles).sum())


@dataclass(frozen=True)
class ModelShape:
    """A model at scale 1. Model frame: metres, z up, front along -y."""

    model_id: str
    class_name: str
    parts: Mapping[str, PartShape]
    joints: tuple[Joint, ...] = ()
    movable: bool = False
    contains: bool = False

    @cached_property
    def _kinematics(self) -> CadModel:
        """The part of a model's record that says how its parts hang together."""
        return CadModel.model_construct(id=self.model_id, parts=tuple(self.parts), joints=self.joints)

    def part_poses(self, values: Mapping[str, float]) -> dict[str, np.ndarray]:
        """Part -> (4, 4) model_from_part at joint values [rad, m]; joints that are not named are closed."""
        return part_transforms(self._kinematics, dict(values))

    @cached_property
    def closed_triangles(self) -> np.ndarray:
        """(T, 3, 3) corners of the whole surface with all joints at 0, model frame."""
        poses = self.part_poses({})
        return np.concatenate([apply(poses[name], part.triangles) for name, part in self.parts.items()])

    @cached_property
    def closed_bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Least and greatest coordinates (3,) of the closed model."""
        corners = self.closed_triangles.reshape(-1, 3)
        return corners.min(axis=0), corners.max(axis=0)

    @cached_property
    def closed_points(self) -> np.ndarray:
        """(SAMPLES, 3) points on the closed surface, drawn by area with a fixed seed."""
        return sample_triangles(self.closed_triangles, SAMPLES, np.random.default_rng(0))

    @cached_property
    def symmetry(self) -> Symmetry:
        """What the closed shape looks the same after. Models with joints have none: their front is where they open."""
        return NO_SYMMETRY if self.joints else shape_symmetry(self.closed_points)


@dataclass(frozen=True)
class PlacedShape:
    """A model as it stands in the world."""

    shape: ModelShape
    world_from_model: np.ndarray
    """(4, 4) rigid; p_world = world_from_model * (scale * p_model)."""
    scale: float = 1.0
    values: Mapping[str, float] = field(default_factory=dict)
    """Joint -> value [rad, m at scale 1]."""
    held: frozenset[str] = frozenset()
    """Joints that do not move here although the model's do."""

    @property
    def joints(self) -> tuple[Joint, ...]:
        """The joints that move."""
        return tuple(joint for joint in self.shape.joints if joint.name not in self.held)

    @property
    def rotation(self) -> np.ndarray:
        """(3, 3) world_from_model."""
        return self.world_from_model[:3, :3]

    @property
    def extents(self) -> np.ndarray:
        """(3,) edge lengths of the closed model's box along the model's own axes, scaled [m]."""
        low, high = self.shape.closed_bounds
        return self.scale * (high - low)

    @property
    def center(self) -> np.ndarray:
        """(3,) middle of the closed model's box, in the world [m]."""
        low, high = self.shape.closed_bounds
        return apply(self.world_from_model, self.scale * 0.5 * (low + high))

    def pieces(self) -> list[ConvexPiece]:
        """Convex pieces of all parts in the world, joints at their values."""
        poses = self.shape.part_poses(self.values)
        placed = []
        for name, part in self.shape.parts.items():
            pose = poses[name].copy()
            pose[:3, 3] *= self.scale
            placed += [piece.placed(self.world_from_model @ pose, self.scale) for piece in part.pieces]
        return placed


def _areas(triangles: np.ndarray) -> np.ndarray:
    """(T,) areas [m^2] of triangles (T, 3, 3)."""
    return 0.5 * np.linalg.norm(np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=1)


def sample_triangles(triangles: np.ndarray, count: int, random: np.random.Generator) -> np.ndarray:
    """Return (count, 3) points drawn uniformly by area from triangles (T, 3, 3). Raises ValueError without area."""
    areas = _areas(triangles)
    if not areas.sum() > 0:
        raise ValueError("the surface has no area")
    chosen = triangles[random.choice(len(triangles), size=count, p=areas / areas.sum())]
    u, v = random.random((2, count, 1))
    flip = u + v > 1
    u, v = np.where(flip, 1 - u, u), np.where(flip, 1 - v, v)
    return chosen[:, 0] + u * (chosen[:, 1] - chosen[:, 0]) + v * (chosen[:, 2] - chosen[:, 0])


def supporting_area(shape: ModelShape, scale: float = 1.0, level: float = 0.97) -> float:
    """Return the area [m^2] of the largest level upward surface of the closed model: what it can carry things on.

    Upward: the normal's z is more than `level`. Triangles within 1 cm of height make one surface.
    """
    triangles = shape.closed_triangles * scale
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    length = np.linalg.norm(normals, axis=1)
    upward = normals[:, 2] > level * np.maximum(length, 1e-12)
    heights = triangles[upward, :, 2].mean(axis=1)
    order = np.argsort(heights, kind="stable")
    heights, total = heights[order], np.concatenate([[0.0], np.cumsum(0.5 * length[upward][order])])
    until = np.searchsorted(heights, heights + 0.01, side="right")
    return float((total[until] - total[: len(heights)]).max(initial=0.0))
