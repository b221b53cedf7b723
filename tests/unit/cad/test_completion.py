"""What nobody saw is added where it has room: legs below a top, a bottom to a box, depth behind a front."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from scenewright.stages.cad.completion import LEG, Completion, completion_of, inside_points
from scenewright.stages.cad.free_space import NOTHING_KNOWN, NOWHERE, FreeSpace, blocks_of
from scenewright.stages.cad.surroundings import Convex, convex_of
from scenewright.stages.kit.formats.scene_supports import furniture_pieces

TURN = 0.3
"""Everything is turned by this [rad]."""


def turned(points: np.ndarray, angle: float = TURN) -> np.ndarray:
    cosine, sine = np.cos(angle), np.sin(angle)
    return points @ np.array([[cosine, sine, 0], [-sine, cosine, 0], [0, 0, 1.0]])


def surface(*rectangles: tuple[tuple[float, float], tuple[float, float], tuple[float, float], int]) -> trimesh.Trimesh:
    """Rectangles across an axis: bounds in x, y and z, of which one has no length, and which way they look (+1, -1);
    with vertices every 2 cm, as a map has them."""
    meshes = []
    for *bounds, side in rectangles:
        low, high = np.array(bounds, dtype=float).T
        axis = int(np.argmin(high - low))
        first, second = [a for a in range(3) if a != axis]
        counts = [int(round((high[a] - low[a]) / 0.02)) + 1 for a in (first, second)]
        grid = np.zeros((counts[0], counts[1], 3)) + low
        grid[..., first] = np.linspace(low[first], high[first], counts[0])[:, None]
        grid[..., second] = np.linspace(low[second], high[second], counts[1])[None]
        number = np.arange(counts[0] * counts[1]).reshape(counts)
        a, b, c, d = number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]
        faces = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])
        looks_up = side * (1 if axis != 1 else -1) > 0
        meshes.append(trimesh.Trimesh(grid.reshape(-1, 3), faces if looks_up else faces[:, ::-1], process=False))
    return trimesh.Trimesh(*_joined(meshes), process=False)


def _joined(meshes: list[trimesh.Trimesh]) -> tuple[np.ndarray, np.ndarray]:
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    faces = [np.asarray(mesh.faces) + start for mesh, start in zip(meshes, starts, strict=False)]
    return np.concatenate([mesh.vertices for mesh in meshes]), np.concatenate(faces)


TABLETOP = surface(((-0.6, 0.6), (-0.4, 0.4), (0.72, 0.72), 1), ((-0.6, 0.6), (-0.4, -0.4), (0.70, 0.72), -1))
FRONT = surface(((-0.3, 0.3), (0.0, 0.0), (0.0, 1.0), -1))
SHELL = surface(
    ((-0.2, 0.2), (-0.15, -0.15), (0.06, 0.3), -1),
    ((-0.2, 0.2), (0.15, 0.15), (0.06, 0.3), 1),
    ((-0.2, -0.2), (-0.15, 0.15), (0.06, 0.3), -1),
    ((0.2, 0.2), (-0.15, 0.15), (0.06, 0.3), 1),
)


def completed(
    mesh: trimesh.Trimesh, free: FreeSpace = NOTHING_KNOWN, others: tuple[Convex, ...] = ()
) -> tuple[Completion | None, list[np.ndarray]]:
    """What a mesh that stands at 0 m is completed by, in its own frame."""
    points, faces = turned(np.asarray(mesh.vertices)), np.asarray(mesh.faces)
    found = completion_of(points, faces, furniture_pieces(points, faces, 0.0), 0.0, TURN, free, others)
    return found, [] if found is None else [turned(piece, -TURN) for piece in found.pieces]


def seen_through(low: tuple[float, float, float], high: tuple[float, float, float]) -> FreeSpace:
    """Space of which the cells between two corners, in the frame of the thing, were seen through."""
    edge, blocks = 0.08, np.array([[i, j, k] for i in range(-2, 2) for j in range(-2, 2) for k in range(-1, 3)])
    inner = np.stack(np.meshgrid(*[np.arange(8)] * 3, indexing="ij"), -1)[..., ::-1].reshape(-1, 3)  # x fastest
    middles = turned(((blocks[:, None] * 8 + inner + 0.5) * edge).reshape(-1, 3), -TURN)
    free = np.all((middles > low) & (middles < high), axis=1).reshape(len(blocks), 512)
    return FreeSpace(NOWHERE, blocks_of(blocks, free, edge))


def test_a_top_gets_four_legs_down_to_the_floor() -> None:
    found, legs = completed(TABLETOP)
    assert found is not None and found.what == "4 legs of up to 720 mm"
    assert len(legs) == 4
    for leg in legs:
        assert leg[:, 2].min() == pytest.approx(0.0)
        assert 0.70 - 1e-9 <= leg[:, 2].max() <= 0.72 + 1e-9
        assert np.allclose(np.ptp(leg[:, :2], axis=0), LEG, atol=1e-9)
    middles = np.array([leg[:, :2].mean(axis=0) for leg in legs])
    assert {tuple(np.sign(middle)) for middle in middles} == {(-1, -1), (1, -1), (1, 1), (-1, 1)}
    assert np.allclose(np.abs(middles), [0.58, 0.38], atol=0.03), "below the corners, in thin posts: no skirt"


def test_a_box_gets_a_bottom() -> None:
    found, pieces = completed(SHELL)
    assert found is not None and found.what == "a bottom" and len(pieces) == 1
    [bottom] = pieces
    assert np.allclose([bottom.min(axis=0), bottom.max(axis=0)], [[-0.2, -0.15, 0], [0.2, 0.15, 0.01]], atol=1e-6)


def test_a_chair_of_which_the_ends_of_the_legs_were_missed_gets_no_plate() -> None:
    """A seat at 0.45 m on four legs of 4 cm that were seen down to 5 cm."""
    legs = [
        side
        for x in (-0.2, 0.16)
        for y in (-0.2, 0.16)
        for side in (
            ((x, x + 0.04), (y, y), (0.05, 0.45), -1),
            ((x, x), (y, y + 0.04), (0.05, 0.45), -1),
            ((x, x + 0.04), (y + 0.04, y + 0.04), (0.05, 0.45), 1),
            ((x + 0.04, x + 0.04), (y, y + 0.04), (0.05, 0.45), 1),
        )
    ]
    found, pieces = completed(surface(((-0.2, 0.2), (-0.2, 0.2), (0.45, 0.45), 1), *legs))
    assert found is not None and len(pieces) == 4
    for piece in pieces:
        assert piece[:, 2].max() == pytest.approx(0.05, abs=0.001)
        assert np.all(np.abs(piece[:, :2].mean(axis=0)) > 0.13), "at the ends of what was seen of the legs"


def test_what_stands_is_left_alone() -> None:
    box = trimesh.creation.box((0.4, 0.3, 0.5)).apply_translation([0, 0, 0.25])
    found, pieces = completed(box)
    assert found is not None and found.what == "" and pieces == []


def test_a_front_gets_as_much_depth_as_it_needs() -> None:
    """1 m high, its middle at 0.5 m: 5 degrees need 2 x 0.5 tan 5 degrees = 87 mm, in steps of 40 mm 120."""
    found, pieces = completed(FRONT)
    assert found is not None and found.what == "120 mm of depth behind what was seen"
    points = np.concatenate(pieces)
    assert points[:, 1].max() == pytest.approx(0.12, abs=1e-6) and points[:, 1].min() == pytest.approx(0.0, abs=1e-6)


def test_a_front_before_a_wall_reaches_the_wall() -> None:
    corners = np.array([[x, y, z] for x in (-2, 2) for y in (0.60, 0.70) for z in (0, 2.5)], dtype=float)
    found, pieces = completed(FRONT, others=(convex_of(turned(corners)),))
    assert found is not None and len(pieces) >= 1
    assert 0.58 <= np.concatenate(pieces)[:, 1].max() <= 0.60


def test_the_back_of_a_chair_does_not_become_a_block_up_to_the_wall() -> None:
    """Seen from the front, 0.5 to 0.8 m high, a wall 0.4 m behind: some depth and legs, no more than it needs."""
    corners = np.array([[x, y, z] for x in (-2, 2) for y in (0.40, 0.50) for z in (0, 2.5)], dtype=float)
    back = surface(((-0.25, 0.25), (0.01, 0.01), (0.5, 0.8), -1))
    found, pieces = completed(back, others=(convex_of(turned(corners)),))
    assert found is not None and " of depth behind what was seen and 4 legs of up to 500 mm" in found.what
    assert np.concatenate(pieces)[:, 1].max() <= 0.20
    below = [piece for piece in pieces if piece[:, 2].min() < 0.4]
    assert len(below) == 4 and all(np.ptp(leg[:, :2], axis=0).max() <= LEG + 1e-9 for leg in below)


def test_legs_keep_out_of_what_was_seen_empty() -> None:
    """Cameras saw through all that lies under the right half: the legs stand under the left, as the top still would."""
    free = seen_through((0.15, -1.0, -0.1), (1.0, 1.0, 0.64))
    found, legs = completed(TABLETOP, free)
    assert found is not None and legs
    for leg in legs:
        assert not free.is_empty(turned(inside_points(leg, 0.005))).any(), "none of it in seen free space"
        assert leg[:, 0].max() < 0.2


def test_what_was_seen_empty_all_over_vetoes() -> None:
    found, _ = completed(TABLETOP, seen_through((-1.0, -1.0, -0.1), (1.0, 1.0, 0.64)))
    assert found is None


def test_legs_keep_out_of_what_stands_there() -> None:
    """A chair under the near left corner of the table."""
    corners = np.array([[x, y, z] for x in (-0.7, -0.3) for y in (-0.5, -0.2) for z in (0, 0.5)], dtype=float)
    found, legs = completed(TABLETOP, others=(convex_of(turned(corners)),))
    assert found is not None and len(legs) == 4
    for leg in legs:
        inside = inside_points(leg)
        assert not np.any((inside[:, 0] > -0.7) & (inside[:, 0] < -0.3) & (inside[:, 1] > -0.5) & (inside[:, 1] < -0.2))


def test_a_bottom_is_asked_of_what_was_seen_alone() -> None:
    """What stands in the sides of the box stands in it already. Seen empty inside, it gets feet below its corners: by
    its own sides cells say nothing. What was seen empty goes along with what moved."""
    inside = np.array([[x, y, z] for x in (-0.1, 0.0) for y in (-0.1, 0.1) for z in (0, 0.2)], dtype=float)
    found, _ = completed(SHELL, others=(convex_of(turned(inside)),))
    assert found is not None and found.what == "a bottom"
    free = seen_through((-1.0, -1.0, -0.2), (1.0, 1.0, 0.2))
    hollow, feet = completed(SHELL, free)
    assert hollow is not None and hollow.what == "4 legs of up to 60 mm" and len(feet) == 4
    points, faces = turned(np.asarray(SHELL.vertices)), np.asarray(SHELL.faces)
    lower = SHELL.copy().apply_translation([0, 0, -0.03])
    near, _ = completed(lower, free)
    assert near is not None and near.what == "a bottom", "3 cm: heights are exact to no more"
    far = np.array([0.0, 0.0, 5.0])
    moved = completion_of(points, faces, furniture_pieces(points, faces, 0.0), 0.0, TURN, free, (), went=far)
    assert moved is not None and moved.what == "a bottom"
