"""The benchmark of growth: the corridor repeats, the walk goes on, and the verdict is that of the curve."""

from __future__ import annotations

import os

import numpy as np
import pytest

from benchmarks.corridor import FURNITURE, LENGTH, PER_CELL, ROOM, class_of, instance_of, moved, walk
from benchmarks.experiments.growth import EXPERIMENT, REPEATS, WALKS, WHOLE, edges_of, frame_at, growth, row_at
from benchmarks.timing import Clock, alone, memory


def test_entities_of_all_cells_have_numbers_of_their_own() -> None:
    numbers = [instance_of(number, cell) for cell in (-1, 0, 1, 2) for number in range(len(ROOM + FURNITURE))]
    assert len(set(numbers)) == len(numbers) and min(numbers) == 1 and len(ROOM + FURNITURE) < PER_CELL
    assert {class_of(instance_of(len(ROOM), cell)) for cell in (-1, 0, 2)} == {FURNITURE[0][0]}


def test_the_walk_goes_on_where_the_cell_ends() -> None:
    poses = walk(50)
    step = np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1)
    assert np.allclose(step, LENGTH / 50)
    following = moved(poses[0], 1)
    assert np.linalg.norm(following[:3, 3] - poses[-1, :3, 3]) == pytest.approx(LENGTH / 50)
    np.testing.assert_allclose(following[:3, :3], poses[0, :3, :3])


def test_a_walk_begins_again_behind_the_last_cell() -> None:
    class Stub:
        def __init__(self, pose: np.ndarray) -> None:
            self.pose = pose

    frames = [Stub(pose) for pose in walk(5)]
    late = 2 * REPEATS * len(frames) + REPEATS
    for cells, cell in ((1, 0), (2, 0), (None, 2)):
        frame, pose = frame_at(frames, late, cells)  # type: ignore[arg-type]
        assert frame is frames[1] and pose[0, 3] == pytest.approx(frames[1].pose[0, 3] + cell * LENGTH)


def test_growth_is_the_end_beside_the_beginning() -> None:
    def rows(costs: list[float]) -> list[dict[str, float]]:
        return [{"time a frame": cost} for cost in costs]

    assert growth(rows([50, 10, 10, 10, 10, 10])) == 1.0, "the first window does not count"
    assert growth(rows([5, 10, 20, 30, 60, 90])) == 5.0


def test_every_window_of_every_walk_is_a_case() -> None:
    for _, length, _ in WALKS.values():
        assert {str(edge) for edge in edges_of(round(WHOLE * length))[1:]} <= set(EXPERIMENT.subcases)
    rows = [{"frames": 250.0, "floor": 17.0}, {"time a frame": 5.0}]
    assert row_at(250)(rows) == rows[0] and row_at(None)(rows) == rows[1] and row_at(500)(rows) is None


def test_a_clock_counts_what_it_wraps() -> None:
    class Owner:
        @staticmethod
        def work(number: int) -> int:
            return sum(range(number))

    clock = Clock()
    clock.wrap(Owner, "work")
    assert Owner.work(300_000) == 300_000 * 299_999 // 2
    assert clock.wall[0] > 0 and clock.taken() > 0 and clock.taken() == 0


def test_a_process_of_its_own_has_its_own_variables_and_memory() -> None:
    before = dict(os.environ)
    assert alone(os.getenv, "FROM_OUTSIDE", FROM_OUTSIDE="3") == "3"
    assert dict(os.environ) == before
    assert 0 < memory("VmRSS") <= memory("VmHWM") and alone(memory, "VmRSS") > 0
