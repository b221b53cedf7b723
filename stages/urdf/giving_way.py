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
from scipy.spatial import ConvexHull, QhullError

from schemas.interactive_scene import InteractiveSceneFile
from stages.kit.formats.scene_bundle import BundleBody
from stages.kit.formats.written_scene import WrittenScene
from stages.kit.geometry.boxes import box_volume, minimum_rectangle
from stages.kit.geometry.convex_solids import Solid, convex_solid, penetration
from stages.kit.geometry.transforms import apply, inverse, transform_from_yaw
from stages.kit.simulation.shapes import link_shapes
from stages.kit.simulation.urdf_split import owner_of_link, read_urdf, with_absolute_meshes
from stages.urdf.convex_cutting import outside_box

DEPTH = 0.003
"""Things that lie no deeper in each other are left alone [m]: the settle test lets 5 mm pass, and Bullet pads every
mesh by one."""
TOUCHING = 0.001
"""Of those that do, pieces may lie this deep in each other [m]."""
CLEARANCE = 0.002
"""Room that is left around what was cut out [m]: the padding of both."""


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

    def without(self, other: Piece) -> list[Piece]:
        """Return what of it is outside of the least upright box around another, 2 mm wider, as pieces."""
        there = inverse(other.world_from_box)
        around = apply(there, other.points)
        low, high = around.min(axis=0) - CLEARANCE, around.max(axis=0) + CLEARANCE
        parts = outside_box(apply(there, self.points), low, high)
        return [Piece(apply(other.world_from_box, part)) for part in parts]

    def depth(self, other: Piece) -> float:
        """Return how deep [m] it lies in another."""
        return penetration(self.solid, other.solid).depth


def given_way(root: Path, bodies: Sequence[BundleBody]) -> list[BundleBody]:
    """Return the bodies of the scene written to `root`, those cut that keep their mesh and lie in another: in a model,
    in the building, or in a smaller thing that keeps its own. Raises BadInput."""
    pieces = written_pieces(root)
    keeps = {body.name for body in bodies if body.model is None and body.mesh is not None} - WrittenScene(
        root, InteractiveSceneFile.read(root / "scene.json")
    ).layout
    settled = {name: own for name, own in pieces.items() if name not in keeps}
    cut: dict[str, dict[int, list[Piece]]] = {}
    for body in sorted(bodies, key=lambda body: (box_volume(body.box), body.name)):
        if body.name not in keeps:
            continue
        own = {number: [piece] for number, piece in enumerate(pieces[body.name])}
        for others in settled.values():
            _cut(own, others)
        settled[body.name] = [piece for parts in own.values() for piece in parts]
        changed = {number: parts for number, parts in own.items() if parts != [pieces[body.name][number]]}
        if not settled[body.name]:
            settled[body.name] = pieces[body.name]
        elif changed:
            cut[body.name] = own if body.movable else changed
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


def _cut(own: dict[int, list[Piece]], others: Sequence[Piece]) -> None:
    """Cut what of a thing's pieces, by the number of their shape, lies in those of another, if any lies deep in it."""
    depths = [max((piece.depth(other) for parts in own.values() for piece in parts), default=0.0) for other in others]
    if max(depths, default=0.0) <= DEPTH:
        return
    for other in (other for other, depth in zip(others, depths, strict=True) if depth > TOUCHING):
        for number, parts in own.items():
            own[number] = [
                rest for piece in parts for rest in (piece.without(other) if piece.depth(other) > TOUCHING else [piece])
            ]


def _with(body: BundleBody, cut: Mapping[int, Sequence[Piece]]) -> BundleBody:
    body_from_world = inverse(body.world_from_body)
    in_body = {
        number: tuple(apply(body_from_world, piece.points) for piece in parts) for number, parts in sorted(cut.items())
    }
    return replace(body, cut=in_body)
