"""Distance from points to the surface of a posed, scaled CAD model, without rebuilding its mesh."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import trimesh
from scenewright.schemas.cad_library import CadModel
from scenewright.stages.cad.nearest_triangles import TriangleTree, forest_of, nearest_below, nearest_triangles, tree_of
from scenewright.stages.cad.shapes import Placement
from scenewright.stages.kit.compiled import compiled
from scenewright.stages.kit.formats.cad_models import load_collision_parts, load_visual_parts, part_transforms
from scenewright.stages.kit.formats.part_colors import vertex_colors
from scenewright.stages.kit.geometry.transforms import apply

SAMPLES = 300
"""Points that stand for the surface of a model where it is compared with free space."""
PLAIN = 153
"""Grey of a part without colours (sRGB, 0 to 255)."""
FACING = 0.5
"""Cosine within which a triangle belongs to a side."""
SIDES = 6
"""Sides of a part: -x, +x, -y, +y, -z, +z of its frame."""


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
    triangle: np.ndarray
    """(N,) index into the triangles of the part's visual mesh."""


@dataclass(frozen=True)
class Look:
    """What the triangles (K,) of a part's visual mesh look like."""

    colors: np.ndarray
    """(K, 3) sRGB, 0 to 255."""
    areas: np.ndarray
    """(K,) [m^2]."""

    @property
    def mean(self) -> np.ndarray:
        """(3,) mean colour over the surface."""
        return np.asarray(np.average(self.colors, axis=0, weights=self.areas if self.areas.sum() > 0 else None))


@dataclass(frozen=True)
class ModelSurface:
    """The parts of a model, each ready for distance queries in its own frame at scale 1.

    Poses, scales and joint values act on the query points instead of the mesh.
    """

    model: CadModel
    meshes: dict[str, tuple[np.ndarray, np.ndarray]]
    """Part -> vertices (V, 3) and faces (F, 3) of its visual mesh, part frame."""
    forest: TriangleTree
    """Trees over the triangles of the parts, part frames; triangles are told by their number in the part."""
    roots: np.ndarray
    """(P, 7): for each part the trees of the triangles that face -x, +x, -y, +y, -z, +z of the part frame (-1: none do)
    and that of all."""
    corners: dict[str, np.ndarray]
    """Part -> hull vertices (K, 3) of the visual mesh, part frame; they bound the part in every pose."""
    read_pieces: Callable[[], Mapping[str, Sequence[trimesh.Trimesh]]]
    """Returns `pieces`; most models are screened and never asked for them."""
    samples: dict[str, np.ndarray]
    """Part -> points (K, 3) spread over its visual mesh by area, part frame; `SAMPLES` over all parts."""
    looks: dict[str, Look]

    @cached_property
    def pieces(self) -> dict[str, tuple[trimesh.Trimesh, ...]]:
        """Part -> convex collision pieces, part frame. Raises BadInput when meshes are missing."""
        collision = self.read_pieces()
        return {part: tuple(collision.get(part, [])) for part in self.model.parts}

    def closest(self, points: np.ndarray, joints: dict[str, float], normals: np.ndarray | None = None) -> Nearest:
        """Return the nearest surface points of points (N, 3) in the model frame at scale 1.

        With `normals` (N, 3) of the points a point only meets triangles that face its way (within 60 degrees of the
        axis of the part frame that its normal is nearest to; any triangle where the part has none such). A cabinet's
        observed top is closer to the underside of a top board two centimetres too high than to the board's top.
        """
        transforms = part_transforms(self.model, joints)
        poses = np.array([transforms[part] for part in self.model.parts])
        facing = np.empty((0, 3)) if normals is None else np.ascontiguousarray(normals, dtype=float)
        return Nearest(*_closest(self.forest, self.roots, poses, np.ascontiguousarray(points, dtype=float), facing))

    def part_distance(self, points: np.ndarray, normal: np.ndarray, part: str) -> float:
        """Return the largest distance of points (N, 3), in the part's frame, to triangles of the part that face the
        way of `normal` (3,); inf when it has none."""
        root = self.roots[self.model.parts.index(part), facing_side(normal[None])[0]]
        return float(nearest_triangles(self.forest, points, root).distance.max()) if root >= 0 else float("inf")

    def hull_points(self, joints: dict[str, float]) -> np.ndarray:
        """Return points (K, 3) in the model frame at scale 1 whose bounds are those of the posed model."""
        transforms = part_transforms(self.model, joints)
        return np.concatenate([apply(transforms[part], self.corners[part]) for part in self.model.parts])

    def sample_points(self, joints: dict[str, float]) -> np.ndarray:
        """Return points (K, 3) spread over the surface of the posed model, model frame at scale 1."""
        transforms = part_transforms(self.model, joints)
        return np.concatenate([apply(transforms[part], self.samples[part]) for part in self.model.parts])

    def center_of_mass(self, joints: dict[str, float]) -> np.ndarray:
        """Return the centre (3,) of the volume of the posed model's collision pieces, model frame at scale 1."""
        transforms = part_transforms(self.model, joints)
        total, moment = 1e-12, np.zeros(3)
        for part, pieces in self.pieces.items():
            for piece in pieces:
                volume = abs(float(piece.volume))
                total, moment = total + volume, moment + volume * apply(transforms[part], piece.center_mass[None])[0]
        return moment / total

    def posed_pieces(self, joints: dict[str, float]) -> list[tuple[np.ndarray, np.ndarray]]:
        """Return (vertices (V, 3), faces (F, 3)) of every convex piece in the model frame at scale 1."""
        transforms = part_transforms(self.model, joints)
        return [
            (apply(transforms[part], np.asarray(piece.vertices)), np.asarray(piece.faces))
            for part in self.model.parts
            for piece in self.pieces.get(part, ())
        ]


@compiled
def _side_of(normal: np.ndarray) -> int:
    axis = int(np.argmax(np.abs(normal)))
    return 2 * axis + (1 if normal[axis] > 0.0 else 0)


@compiled
def _closest(
    forest: TriangleTree, roots: np.ndarray, model_from_part: np.ndarray, points: np.ndarray, normals: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return the fields of `Nearest` for parts with poses (P, 4, 4) in the model; normals (N, 3), or (0, 3) for any."""
    distance = np.full(len(points), np.inf)
    parts, triangles = np.zeros(len(points), np.int64), np.zeros(len(points), np.int64)
    nearest, facing = np.zeros((len(points), 3)), np.zeros((len(points), 3))
    local, normal, foot, candidate = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    for k in range(len(points)):
        for part in range(len(model_from_part)):
            pose = model_from_part[part]
            for axis in range(3):
                local[axis] = normal[axis] = 0.0
                for other in range(3):
                    local[axis] += pose[other, axis] * (points[k, other] - pose[other, 3])
                    if len(normals):
                        normal[axis] += pose[other, axis] * normals[k, other]
            root = roots[part, SIDES]
            if len(normals):
                root = roots[part, _side_of(normal)]
                if root < 0:
                    root = roots[part, SIDES]
            found, row = nearest_below(forest, root, local, distance[k], foot, candidate)
            if row < 0:
                continue
            distance[k], parts[k], triangles[k] = found, part, forest.numbers[row]
            for axis in range(3):
                nearest[k, axis], facing[k, axis] = pose[axis, 3], 0.0
                for other in range(3):
                    nearest[k, axis] += pose[axis, other] * foot[other]
                    facing[k, axis] += pose[axis, other] * forest.normals[row, other]
    return distance, nearest, facing, parts, triangles


@compiled
def facing_side(normals: np.ndarray) -> np.ndarray:
    """Return the side (N,) that normals (N, 3) face: 2 * axis, + 1 when they point along the axis."""
    sides = np.empty(len(normals), np.int64)
    for k in range(len(normals)):
        sides[k] = _side_of(normals[k])
    return sides


def load_surface(folder: Path, model: CadModel) -> ModelSurface:
    """Read a model folder of the library. Raises BadInput when meshes are missing."""
    return surface_of(model, load_visual_parts(folder), lambda: load_collision_parts(folder))


def surface_of(
    model: CadModel,
    visual: Mapping[str, trimesh.Trimesh],
    collision: Callable[[], Mapping[str, Sequence[trimesh.Trimesh]]],
) -> ModelSurface:
    """Return the surface of a model with these meshes of its parts, part frames; `collision` is called if its pieces
    are asked for."""
    meshes, corners = {}, {}
    trees: list[TriangleTree] = []
    places = np.full((len(model.parts), SIDES + 1), -1)
    for k, part in enumerate(model.parts):
        vertices, faces = np.asarray(visual[part].vertices, dtype=float), np.asarray(visual[part].faces)
        meshes[part] = vertices, faces
        triangles = vertices[faces]
        normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-18)
        for side in range(SIDES + 1):
            toward = normals[:, side // 2 % 3] * (1.0 if side % 2 else -1.0)
            chosen = np.flatnonzero(toward >= FACING) if side < SIDES else np.arange(len(faces))
            if len(chosen):
                places[k, side] = len(trees)
                trees.append(tree_of(vertices, faces[chosen], chosen))
        corners[part] = np.asarray(visual[part].convex_hull.vertices)
    forest, roots = forest_of(trees)
    areas = {part: float(visual[part].area) for part in model.parts}
    samples = {}
    for k, part in enumerate(model.parts):
        count = max(1, round(SAMPLES * areas[part] / max(sum(areas.values()), 1e-12)))
        samples[part] = np.asarray(trimesh.sample.sample_surface(visual[part], count, seed=k)[0])
    looks = {part: look_of(visual[part]) for part in model.parts}
    return ModelSurface(
        model, meshes, forest, np.where(places < 0, -1, roots[places]), corners, collision, samples, looks
    )


def look_of(mesh: trimesh.Trimesh) -> Look:
    """Return the look of a part's visual mesh."""
    painted, faces = vertex_colors(mesh), np.asarray(mesh.faces)
    colors = np.full((len(faces), 3), PLAIN, float) if painted is None else painted[faces].mean(axis=1)
    return Look(colors, np.asarray(mesh.area_faces))


def to_model(placement: Placement, points: np.ndarray) -> np.ndarray:
    """Return world points (N, 3) in the model frame at scale 1."""
    return (points - placement.translation) @ placement.rotation / placement.scale


def to_world(placement: Placement, points: np.ndarray) -> np.ndarray:
    """Return points (N, 3) of the model frame at scale 1 in the world."""
    return placement.scale * points @ placement.rotation.T + placement.translation


def alignment_error(
    surface: ModelSurface, placement: Placement, points: np.ndarray, normals: np.ndarray | None = None
) -> float:
    """Root mean square distance [m] from object vertices (N, 3) to the placed model (section 2.4.3, AE).

    With `normals` (N, 3, world) the distance is to surface that faces the same way (ModelSurface.closest).
    """
    turned = None if normals is None else normals @ placement.rotation
    nearest = surface.closest(to_model(placement, points), placement.shape.joints, turned)
    return placement.scale * float(np.sqrt(np.mean(nearest.distance**2)))


def robust_error(
    surface: ModelSurface, placement: Placement, points: np.ndarray, normals: np.ndarray | None, truncation: float
) -> float:
    """Return the alignment error [m] with distances cut off at `truncation` [m]; with `normals` (N, 3, world) to
    surface that faces the same way.

    Labels leak and rims of a fused mesh have arbitrary normals: a few vertices a decimetre away outweigh all others in
    a plain mean of squares.
    """
    turned = None if normals is None else normals @ placement.rotation
    nearest = surface.closest(to_model(placement, points), placement.shape.joints, turned)
    return float(np.sqrt(np.mean(np.minimum(placement.scale * nearest.distance, truncation) ** 2)))


def robust_errors(
    surfaces: Mapping[str, ModelSurface], placements: Sequence[Placement], points: np.ndarray, truncation: float
) -> list[float]:
    """Return `robust_error` [m] of each of many placements without normals; each shape is asked once for all of its
    placements."""
    together: dict[tuple[object, ...], list[int]] = defaultdict(list)
    for number, placement in enumerate(placements):
        together[placement.shape.model.id, *sorted(placement.shape.joints.items())].append(number)
    errors = [0.0] * len(placements)
    for numbers in together.values():
        shape = placements[numbers[0]].shape
        local = np.concatenate([to_model(placements[number], points) for number in numbers])
        distances = surfaces[shape.model.id].closest(local, shape.joints).distance.reshape(len(numbers), -1)
        for number, distance in zip(numbers, distances, strict=True):
            near = np.minimum(placements[number].scale * distance, truncation)
            errors[number] = float(np.sqrt(np.mean(near**2)))
    return errors
