"""Meshes are cut where hulls of the halves are smallest; a mesh that was asked before gives the same pieces."""

from __future__ import annotations

import numpy as np
import trimesh
from scenewright.stages.kit.geometry import convex_pieces as module
from scenewright.stages.kit.geometry.convex_pieces import MESHES_KEPT, convex_pieces, hull_volume


def corner(size: float) -> trimesh.Trimesh:
    """An L of two boards."""
    boards = [trimesh.creation.box((size, size, 0.05)), trimesh.creation.box((0.05, size, size))]
    boards[0].apply_translation((size / 2, 0, 0))
    boards[1].apply_translation((0, 0, size / 2))
    return trimesh.util.concatenate([board.subdivide().subdivide() for board in boards])


def test_an_angle_is_two_boards() -> None:
    mesh = corner(1.0)
    pieces = convex_pieces(mesh.vertices, mesh.faces, most=2)
    assert len(pieces) == 2
    assert sum(map(hull_volume, pieces)) < 0.5 * hull_volume(mesh.vertices)
    assert {tuple(p) for piece in pieces for p in piece} == {tuple(p) for p in mesh.vertices}


def test_asked_again_the_same_and_few_are_kept() -> None:
    first, again = (convex_pieces(corner(1.0).vertices, corner(1.0).faces) for _ in range(2))
    assert all(np.array_equal(a, b) for a, b in zip(first, again, strict=True))
    first[0][:] = 0.0  # what is returned belongs to who asked
    assert all(
        np.array_equal(a, b) for a, b in zip(convex_pieces(corner(1.0).vertices, corner(1.0).faces), again, strict=True)
    )
    for k in range(MESHES_KEPT + 3):
        convex_pieces(corner(0.5 + 0.01 * k).vertices, corner(1.0).faces, most=1)
    assert len(module._kept) == MESHES_KEPT
