"""Which view tells most: votes by information, floor by what nobody looked at; things that fell and were found."""

from __future__ import annotations

import numpy as np
import pytest
from scenewright.stages.agent.arms.next_view import (
    ahead_of,
    best_floor_view,
    entropy,
    fallen_where,
    floor_seen,
    vote_information,
    worth,
)
from scenewright.stages.agent.arms.stations import around
from scenewright.stages.agent.obstacle_map import ObstacleMap
from scenewright.stages.agent.senses import Base, SeenFurniture, Sweep

CENTRE, SIZE = (3.0, 3.0), (1.4, 0.8)


@pytest.fixture
def obstacles() -> ObstacleMap:
    """A room of 6 m by 6 m with a table in its middle."""
    made = ObstacleMap(Base(3.0, 1.5, 1.57), 2.9)
    cells = np.argwhere(np.ones((61, 61)))
    table = (np.abs(cells - 30) <= (7, 4)).all(axis=1)
    rim = ((cells == 0) | (cells == 60)).any(axis=1)
    made.add(Sweep(cells[~table & ~rim], cells[table | rim], ()))
    return made


def test_a_vote_tells_most_where_votes_are_even_and_nothing_when_it_is_wrong_every_other_time() -> None:
    told = [vote_information(ahead) for ahead in range(4)]
    assert told == sorted(told, reverse=True)
    assert told[0] == pytest.approx(1 - entropy(0.1))
    assert vote_information(0, 0.5) == pytest.approx(0.0)
    # I(truth; vote) by its definition over the four cases, for a class that is ahead by one
    right, wrong = 0.9, 0.1
    joint = {(t, v): p * (0.9 if t == v else 0.1) for t, p in ((1, right), (0, wrong)) for v in (0, 1)}
    says = {v: joint[1, v] + joint[0, v] for v in (0, 1)}
    mutual = sum(p * np.log2(p / ({1: right, 0: wrong}[t] * says[v])) for (t, v), p in joint.items())
    assert told[1] == pytest.approx(mutual)


def test_a_side_is_worth_the_doubts_that_it_was_not_asked_about_over_the_time_it_takes() -> None:
    south, north = Base(3.0, 1.5, 1.57), Base(3.0, 4.5, -1.57)
    seen_from_south = {quarter: worth(south, 0.0, [((3.0, 3.0), frozenset({quarter}), 0)]) for quarter in range(4)}
    assert sorted(seen_from_south.values())[0] == 0.0  # its own quarter tells nothing more
    own = min(seen_from_south, key=lambda quarter: seen_from_south[quarter])
    doubt = ((3.0, 3.0), frozenset({own}), 0)
    assert worth(north, 3.0, [doubt]) > worth(south, 0.0, [doubt]) == 0.0
    assert worth(north, 3.0, [doubt]) > worth(north, 6.0, [doubt])
    assert worth(north, 3.0, [doubt, doubt]) == pytest.approx(2 * worth(north, 3.0, [doubt]))


def test_what_fell_lies_around_its_furniture_rather_where_it_was_lost(obstacles: ObstacleMap) -> None:
    cells, likely = fallen_where(obstacles, CENTRE, SIZE, (3.0, 3.35, 0.75))
    assert likely.sum() == pytest.approx(1.0)
    out = np.maximum(np.abs(cells - CENTRE) - np.array(SIZE) / 2, 0.0)
    assert np.hypot(*out.T).max() <= 0.8
    assert likely[cells[:, 1] > 3.4].sum() > 0.6 > 0.3 > likely[cells[:, 1] < 2.6].sum()


def test_a_table_hides_the_floor_behind_it_and_the_robot_its_own_foot(obstacles: ObstacleMap) -> None:
    cells = np.array([[3.0, 3.9], [3.0, 2.3], [3.0, 1.5], [4.5, 1.4], [1.5, 1.4]])
    south = Base(3.0, 1.3, np.pi / 2)
    assert floor_seen(obstacles, south, cells).tolist() == [False, True, False, False, False]
    assert floor_seen(obstacles, Base(3.0, 1.3, 0.0), cells).tolist() == [False, False, False, True, False]


def test_the_floor_is_looked_at_from_where_the_thing_may_lie_and_not_twice(obstacles: ObstacleMap) -> None:
    here = Base(3.0, 2.1, np.pi / 2)
    cells, likely = fallen_where(obstacles, CENTRE, SIZE, (3.0, 3.35, 0.75))
    first = best_floor_view(obstacles, here, cells, likely)
    assert first is not None
    assert first[0].y > 3.0  # behind the table, where it was lost
    rest = np.where(floor_seen(obstacles, first[0], cells), 0.0, likely)
    assert rest.sum() == pytest.approx(1 - first[1])
    second = best_floor_view(obstacles, here, cells, rest)
    assert second is not None and second[1] <= rest.sum() + 1e-9 and second[0] != first[0]
    assert best_floor_view(obstacles, here, cells, np.zeros(len(cells))) is None
    assert best_floor_view(obstacles, here, np.zeros((0, 2)), np.zeros(0)) is None


def test_what_is_small_is_stood_before_from_eight_sides() -> None:
    poses = around(SeenFurniture("floor", (1.0, 2.0), (0.1, 0.1), 0.0, False, False), 0.38)
    assert len(poses) == 8
    for pose in poses:
        assert np.hypot(pose.x - 1.0, pose.y - 2.0) == pytest.approx(0.43)
        assert ahead_of(pose, 0.43) == pytest.approx((1.0, 2.0))
