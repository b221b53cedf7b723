"""Distance from points to the surface of a posed, scaled CAD model, without rebuilding its mesh."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import open3d as o3d
import trimesh

from schemas.cad_library import CadModel
from stages.cad.shapes import Placement
from stages.kit.formats.cad_models import load_collision_parts, load_visual_parts, part_transforms
from stages.kit.geometry.transforms import apply, inverse


@dataclass(frozen=True)
class Nearest:
    """Where points come closest to a model: model frame, scale 1."""

    distance: np.ndarray
    """(N,)."""
    points: np.ndarray
    """(N, 3)."""
    normals: np.ndarray
    """(N, 3) of the triangles."""
    part: np.ndarray
    """(N,) index into the model's parts."""


@dataclass(frozen=True)
class ModelSurface:
    """The parts of a model, each ready for distance queries in its own frame at scale 1.

    Poses, scales and joint values act on the query points instead of the mesh.
    """

    model: CadModel
    scenes: dict[str, o3d.t.geometry.RaycastingScene]
    corners: dict[str, np.ndarray]
    """Part -> hull vertices (K, 3) of the visual mesh, part frame; they bound the part in every pose."""
    pieces: dict[str, tuple[trimesh.Trimesh, ...]]
    """Part -> convex collision pieces, part frame."""

    def closest(self, points: np.ndarray, joints: dict[str, float]) -> Nearest:
        """Return the nearest surface points of points (N, 3) in the model frame at scale 1."""
        distance = np.full(len(points), np.inf)
        nearest, normal = np.zeros((len(points), 3)), np.zeros((len(points), 3))
        part_index = np.zeros(len(points), dtype=int)
        for k, (part, model_from_part) in enumerate(part_transforms(self.model, joints).items()):
            local = apply(inverse(model_from_part), points).astype(np.float32)
            answer = self.scenes[part].compute_closest_points(o3d.core.Tensor.from_numpy(local))
            found = answer["points"].numpy().astype(float)
            gap = np.linalg.norm(local - found, axis=1)
            closer = gap < distance
            distance[closer], part_index[closer] = gap[closer], k
            nearest[closer] = apply(model_from_part, found[closer])
            normal[closer] = answer["primitive_normals"].numpy()[closer].astype(float) @ model_from_part[:3, :3].T
        return Nearest(distance, nearest, normal, part_index)

    def part_distances(self, points: np.ndarray, part: str) -> np.ndarray:
        """Return distances (N,) of points (N, 3) in the part's frame to that part."""
        return (
            self.scenes[part]
            .compute_distance(o3d.core.Tensor.from_numpy(points.astype(np.float32)))
            .numpy()
            .astype(float)
        )

    def hull_points(self, joints: dict[str, float]) -> np.ndarray:
        """Return points (K, 3) in the model frame at scale 1 whose bounds are those of the posed model."""
        transforms = part_transforms(self.model, joints)
        return np.concatenate([apply(transforms[part], self.corners[part]) for part in self.model.parts])

    def posed_pieces(self, joints: dict[str, float]) -> list[tuple[np.ndarray, np.ndarray]]:
        """Return (vertices (V, 3), faces (F, 3)) of every convex piece in the model frame at scale 1."""
        transforms = part_transforms(self.model, joints)
        return [
            (apply(transforms[part], np.asarray(piece.vertices)), np.asarray(piece.faces))
            for part in self.model.parts
            for piece in self.pieces.get(part, ())
        ]


def load_surface(folder: Path, model: CadModel) -> ModelSurface:
    """Read a model folder of the library. Raises BadInput when meshes are missing."""
    visual, collision = load_visual_parts(folder), load_collision_parts(folder)
    scenes, corners = {}, {}
    for part in model.parts:
        scene = o3d.t.geometry.RaycastingScene(nthreads=1)
        scene.add_triangles(
            o3d.core.Tensor.from_numpy(np.asarray(visual[part].vertices, dtype=np.float32)),
            o3d.core.Tensor.from_numpy(np.asarray(visual[part].faces, dtype=np.uint32)),
        )
        scenes[part] = scene
        corners[part] = np.asarray(visual[part].convex_hull.vertices)
    pieces = {part: tuple(collision.get(part, [])) for part in model.parts}
    return ModelSurface(model, scenes, corners, pieces)


def to_model(placement: Placement, points: np.ndarray) -> np.ndarray:
    """Return world points (N, 3) in the model frame at scale 1."""
    return (points - placement.translation) @ placement.rotation / placement.scale


def to_world(placement: Placement, points: np.ndarray) -> np.ndarray:
    """Return points (N, 3) of the model frame at scale 1 in the world."""
    return placement.scale * points @ placement.rotation.T + placement.translation


def vertex_distances(surface: ModelSurface, placement: Placement, points: np.ndarray) -> np.ndarray:
    """Return distances (N,) [m] from world points (N, 3) to the placed model."""
    return placement.scale * surface.closest(to_model(placement, points), placement.shape.joints).distance


def alignment_error(surface: ModelSurface, placement: Placement, points: np.ndarray) -> float:
    """Root mean square distance [m] from object vertices (N, 3) to the placed model (section 2.4.3, AE)."""
    return float(np.sqrt(np.mean(vertex_distances(surface, placement, points) ** 2)))
