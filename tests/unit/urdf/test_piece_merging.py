"""Fewer pieces: what is merged holds what it was made of, fills little, and stays out of other things."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from scenewright.schemas.contact_graph import SCENE_NODE
from scenewright.schemas.scene_parts import Box
from scenewright.stages.kit.formats.scene_bundle import BundleBody, write_scene_bundle
from scenewright.stages.kit.geometry.boxes import box_from_bounds
from scenewright.stages.urdf.giving_way import Piece, written_pieces
from scenewright.stages.urdf.piece_merging import MOST_PIECES, merged, merged_bodies
from scipy.spatial import ConvexHull

from tests.unit.urdf.small_room import graph_of


def cuboid(low: tuple[float, ...], high: tuple[float, ...]) -> Piece:
    return Piece(np.array([np.where([k & 1, k & 2, k & 4], high, low) for k in range(8)], float))


def volume(pieces: list[Piece]) -> float:
    return sum(ConvexHull(piece.points).volume for piece in pieces)


STRIPS = [cuboid((0.1 * k, 0, 0), (0.1 * k + 0.1, 1, 0.05)) for k in range(10)]


def test_the_strips_of_a_board_become_the_board():
    (board,) = merged(STRIPS, [], 1)
    assert board.low == pytest.approx([0, 0, 0]) and board.high == pytest.approx([1, 1, 0.05])
    assert volume([board]) == pytest.approx(0.05)


def test_what_fills_least_goes_first():
    """Of two boards that stand apart by an angle, each becomes one piece, and not the room between them."""
    upright = [cuboid((0, 0.1 * k, 0.05), (0.05, 0.1 * k + 0.1, 1)) for k in range(10)]
    pieces = merged([*STRIPS, *upright], [], 2)
    assert len(pieces) == 2 and volume(pieces) == pytest.approx(0.05 + 0.05 * 0.95)


def test_another_thing_keeps_its_room():
    """Legs and top of a bench would be one hull; a box under it keeps them apart."""
    bench = [
        cuboid((0, 0, 0.4), (1, 0.4, 0.45)),
        cuboid((0, 0, 0), (0.05, 0.4, 0.4)),
        cuboid((0.95, 0, 0), (1, 0.4, 0.4)),
    ]
    assert len(merged(bench, [], 1)) == 1
    under = cuboid((0.3, 0.1, 0), (0.7, 0.3, 0.3))
    pieces = merged(bench, [under], 1)
    assert len(pieces) > 1 and max(piece.depth(under) for piece in pieces) < 1e-3
    corners = np.concatenate([piece.points for piece in bench])
    inside = [ConvexHull(piece.points).equations for piece in pieces]
    assert all(any((planes[:, :3] @ point + planes[:, 3] < 1e-9).all() for planes in inside) for point in corners)


def test_pieces_that_are_apart_stay_apart():
    assert len(merged([cuboid((0, 0, 0), (1, 1, 1)), cuboid((1.02, 0, 0), (2, 1, 1))], [], 1)) == 2


def test_a_ragged_body_gets_few_pieces_and_keeps_its_mass(tmp_path):
    ball = trimesh.creation.icosphere(subdivisions=4, radius=0.6)
    box: Box = box_from_bounds(*ball.bounds)
    lump = BundleBody("object_1", "object", SCENE_NODE, "supports", np.eye(4), False, box, mesh=ball)
    graph = graph_of([lump])
    before = write_scene_bundle(tmp_path, [lump], graph).bodies[0]
    assert len(written_pieces(tmp_path)["object_1"]) > 2 * MOST_PIECES
    (fewer,) = merged_bodies(tmp_path, [lump])
    after = write_scene_bundle(tmp_path, [fewer], graph).bodies[0]
    pieces = written_pieces(tmp_path)["object_1"]
    assert len(pieces) == MOST_PIECES and after.mass == pytest.approx(before.mass)
    radii = np.linalg.norm(np.concatenate([piece.points for piece in pieces]), axis=1)
    assert radii.min() > 0.45 and radii.max() < 0.75
