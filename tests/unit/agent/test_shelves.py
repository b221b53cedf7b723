"""Open shelves: their boards as the head sees them, free places on them, and putting something there."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scenewright.stages.agent.arms.stations import spots
from scenewright.stages.agent.scene_map import Item, SceneMap
from scenewright.stages.agent.senses import Base, SeenFurniture
from scenewright.stages.agent.world.physics.body import PhysicsBody
from scenewright.stages.agent.world.physics.front_seeing import levels_seen, open_shelf
from scenewright.stages.agent.world.physics.head import GRAIN, SeenPiece

from tests.unit.agent.made_scene import BOARDS, SHELF_AT, TABLE_AT, write_room
from tests.unit.agent.test_doors import NO_ERRORS
from tests.unit.agent.test_physics import PhysicsBodyStub
from tests.unit.agent.test_scene_room import scene_room

LOW, HIGH = np.array([0.0, 0.0, 0.0]), np.array([0.8, 0.32, 1.32])


def cubes(*heights: float) -> np.ndarray:
    """Return the middles of cubes of boards and of a back (N, 3) [m]."""
    x, y = (np.arange(0.0, size + GRAIN / 2, GRAIN) for size in (0.8, 0.32))
    boards = [np.stack(np.meshgrid(x, y, [height]), -1).reshape(-1, 3) for height in heights]
    back = np.stack(np.meshgrid(x, [0.32], np.arange(0.0, 1.32, GRAIN)), -1).reshape(-1, 3)
    return np.concatenate([*boards, back])


def test_boards_are_where_cubes_lie_away_from_the_sides_and_two_layers_are_one_board() -> None:
    assert levels_seen((LOW, HIGH), cubes(0.04, 0.4, 0.76)) == pytest.approx((0.04, 0.4, 0.76))
    assert levels_seen((LOW, HIGH), cubes(0.36, 0.4, 0.76)) == pytest.approx((0.38, 0.76)), "between two layers"
    base = np.array([0.4, -1.0, np.pi / 2])
    rack = cubes(0.4, 0.76)[: -len(cubes())]  # no back, and the boards' edges hide nothing behind them
    shelf = open_shelf("furniture_0", "shelf", (LOW, HIGH), rack, base)
    assert shelf is not None and shelf.levels == pytest.approx((0.4, 0.76)) and shelf.before(base)
    assert shelf.inward == pytest.approx(np.pi / 2)


def test_a_spot_in_a_shelf_is_on_a_board_near_its_front_and_not_where_something_stands() -> None:
    scene = SceneMap(PhysicsBodyStub())  # type: ignore[arg-type]
    levels = (0.4, 0.76, 1.12)
    scene.furniture["shelf_0"] = SeenFurniture(
        "shelf", (0.4, 0.16), (0.8, 0.32), 1.3, False, True, open_to=-np.pi / 2, levels=levels
    )
    free = spots(scene, "shelf_0", Base(0.4, -1.0, np.pi / 2))
    assert [round(z - 0.02, 2) for *_, z in free[:3]] == [0.76] * 3, "first where the arm likes it"
    assert all(y == pytest.approx(0.13) for _, y, _ in free) and {round(z - 0.02, 2) for *_, z in free} == set(levels)
    scene.items["cup_0"] = Item("cup_0", (0.4, 0.13, 0.78), "", 0.04, "shelf_0")
    left = [tuple(np.round(spot, 3)) for spot in spots(scene, "shelf_0", Base(0.4, -1.0, np.pi / 2))]
    assert (0.4, 0.13, 0.78) not in left and (0.4, 0.13, 0.42) in left


def test_a_top_is_bare_where_it_was_seen() -> None:
    piece = SeenPiece("cabinet")
    x, y = np.meshgrid(np.arange(0.0, 0.5, 0.02), np.arange(0.0, 0.9, 0.02))
    top = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, 0.8)])
    piece.add(top[(top[:, 1] < 0.3) | (top[:, 1] > 0.6)])
    assert piece.bare_at(0.25, 0.15) and piece.bare_at(0.25, 0.75) and not piece.bare_at(0.25, 0.45)


@pytest.mark.slow
def test_a_can_is_taken_from_the_side_and_put_onto_a_board(tmp_path: Path) -> None:
    body = PhysicsBody(scene_room(write_room(tmp_path / "room", shelf=True)), ("can",), NO_ERRORS, 2)
    body.sweep()
    shelf = next(piece for piece in body.sweep().furniture if piece.label == "shelf")
    assert shelf.open_to == pytest.approx(np.pi / 2, abs=1e-6)
    near = [min(abs(level - board) for board in BOARDS) for level in shelf.levels]
    assert len(near) >= 2 and max(near) < 0.03
    assert body.drive(Base(TABLE_AT[0] - 0.75, 0.1, 0.0), "table_0").ok
    seen = body.look((TABLE_AT[0], 0.0, 0.74), close=False).detections
    at = next(d.position for d in seen if d.label == "can")
    assert body.reaches(body.base, at, take="level") and body.grasp(at, "can", 0, level=True).ok and body.held_level
    before = Base(SHELF_AT[0], SHELF_AT[1] + 0.15 + 0.45, -np.pi / 2)
    assert body.drive(before, "shelf_0").ok
    spot = (SHELF_AT[0], SHELF_AT[1] + 0.02, min(shelf.levels, key=lambda level: abs(level - 0.8)) + 0.02)
    assert body.release(spot, "shelf", gently=True).ok
    assert body.bodies["can_4"].on == "shelf_6" and body.bodies["can_4"].at == pytest.approx(spot[:2], abs=0.05)
    body.close()
