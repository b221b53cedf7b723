"""What keeps its mesh gives way: no two things share space, so where their shapes in physics do one of them is wrong.

The shape of a CAD model is known; that of a reconstructed mesh is a guess at what was not seen: a hull that spans the
room under a desk, a box that took along the board below it. So where it lies in another thing it is cut, and of two
guesses the larger one is, which spans more that nobody saw. What it looks like stays.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from scenewright.schemas.interactive_scene import InteractiveSceneFile
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.kit.formats.scene_bundle import BundleBody
from scenewright.stages.kit.formats.written_scene import WrittenScene
from scenewright.stages.kit.geometry.boxes import box_volume, minimum_rectangle
from scenewright.stages.kit.geometry.convex_solids import Solid, convex_solid, penetration
from scenewright.stages.kit.geometry.transforms import apply, inverse, transform_from_yaw
from scenewright.stages.kit.simulation.shapes import link_shapes
from scenewright.stages.kit.simulation.urdf_split import owner_of_link, read_urdf, with_absolute_meshes
from scenewright.stages.urdf.convex_cutting import outside_box
from scipy.spatial import ConvexHull, QhullError

DEPTH = 0.003
"""Things that lie no deeper in each other are left alone [m]: the settle test lets 5 mm pass, and Bullet pads every
mesh by one."""
TOUCHING = 0.001
"""Depth [m] by which pieces that touch may lie in each other."""
CLEARANCE = 0.003
"""Room that is left around what was cut out [m]: the padding of both, and a millimetre in which neither rubs."""


@dataclass(frozen=True, eq=False)
class Piece:
    """A convex collision shape, world frame."""

    points: np.ndarray
    """(N, 3) [m] whose hull it is."""

    @cached_property
    def solid(self) -> Solid:
        """Ready for collision queries; without pieces where it is flat."""
        try:
            hull = ConvexHull(self.points)
        except (QhullError, ValueError):
            return convex_solid([])
        used, faces = np.unique(hull.simplices, return_inverse=True)
        return convex_solid([(self.points[used], faces.reshape(-1, 3))])

    @cached_property
    def world_from_box(self) -> np.ndarray:
        """(4, 4) of the least upright box around it."""
        return transform_from_yaw(minimum_rectangle(self.points[:, :2])[2], np.zeros(3))

    @cached_property
    def low(self) -> np.ndarray:
        """(3,) least coordinates [m]."""
        return np.asarray(self.points.min(axis=0))

    @cached_property
    def high(self) -> np.ndarray:
        """(3,) greatest coordinates [m]."""
        return np.asarray(self.points.max(axis=0))

    def without(self, other: Piece) -> list[Piece]:
        """Return what of it is outside of the least upright box around another, 3 mm wider, as pieces."""
        box_from_world = inverse(other.world_from_box)
        around = apply(box_from_world, other.points)
        low, high = around.min(axis=0) - CLEARANCE, around.max(axis=0) + CLEARANCE
        cut_points = outside_box(apply(box_from_world, self.points), low, high)
        return [Piece(apply(other.world_from_box, part)) for part in cut_points]

    def depth(self, other: Piece) -> float:
        """Return how deep [m] it lies in another."""
        if (self.low >= other.high).any() or (other.low >= self.high).any():
            return 0.0
        return penetration(self.solid, other.solid).depth


def given_way(root: Path, bodies: Sequence[BundleBody]) -> list[BundleBody]:
    """Return the bodies of the scene written to `root`, those cut that keep their mesh and lie in another: in a model,
    in the building, or in a smaller thing that keeps its own. Raises BadInput."""
    pieces = written_pieces(root)
    keeping = [body for body in bodies if body.model is None and body.mesh is not None and not _is_layout(body)]
    final = {name: own_pieces for name, own_pieces in pieces.items() if name not in {body.name for body in keeping}}
    cut: dict[str, dict[int, list[Piece]]] = {}
    for body in sorted(keeping, key=lambda body: (box_volume(body.box), body.name)):
        own_pieces = {number: [piece] for number, piece in enumerate(pieces[body.name])}
        for others in final.values():
            _cut(own_pieces, others)
        final[body.name] = [piece for cut_pieces in own_pieces.values() for piece in cut_pieces]
        changed = {
            number: cut_pieces for number, cut_pieces in own_pieces.items() if cut_pieces != [pieces[body.name][number]]
        }
        if not final[body.name]:
            final[body.name] = pieces[body.name]
        elif changed:
            cut[body.name] = own_pieces if body.movable else changed
    return [_with(body, cut[body.name]) if body.name in cut else body for body in bodies]


def written_pieces(root: Path) -> dict[str, list[Piece]]:
    """Return body of the scene written to `root` -> its collision shapes, where it was reconstructed."""
    scene = WrittenScene(root, InteractiveSceneFile.read(root / "scene.json"))
    names = {body.name for body in scene.info.bodies}
    text = with_absolute_meshes(read_urdf(root / scene.info.combined_file), root)
    pieces: dict[str, list[Piece]] = {name: [] for name in names}
    for link, shapes in link_shapes(text).items():
        owner = owner_of_link(link, names)
        if owner is not None:
            pose = scene.link_poses[link]
            pieces[owner] += [Piece(apply(pose, np.asarray(shape.vertices, dtype=float))) for shape in shapes]
    return pieces


def _cut(pieces_of_shape: dict[int, list[Piece]], others: Sequence[Piece]) -> None:
    """Cut what of a thing's pieces, by the number of their shape, lies in those of another, if any lies deep in it."""
    pieces = [piece for cut_pieces in pieces_of_shape.values() for piece in cut_pieces]
    if not pieces:
        return
    low, high = np.min([piece.low for piece in pieces], axis=0), np.max([piece.high for piece in pieces], axis=0)
    others = [obstacle for obstacle in others if (obstacle.low < high).all() and (low < obstacle.high).all()]
    depths = [max(piece.depth(obstacle) for piece in pieces) for obstacle in others]
    if max(depths, default=0.0) <= DEPTH:
        return
    for obstacle in (obstacle for obstacle, depth in zip(others, depths, strict=True) if depth > TOUCHING):
        for number, cut_pieces in pieces_of_shape.items():
            pieces_of_shape[number] = [
                remainder
                for piece in cut_pieces
                for remainder in (piece.without(obstacle) if piece.depth(obstacle) > TOUCHING else [piece])
            ]


def _is_layout(body: BundleBody) -> bool:
    return load_vocabulary().by_name(body.class_name).is_layout


def _with(body: BundleBody, cut: Mapping[int, Sequence[Piece]]) -> BundleBody:
    body_from_world = inverse(body.world_from_body)
    in_body = {
        number: tuple(apply(body_from_world, piece.points) for piece in pieces)
        for number, pieces in sorted(cut.items())
    }
    return replace(body, cut=in_body)
