"""Who can be said to lean: not what was not seen down to its feet."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scenewright.stages.graph.balance import footing_seen, is_unbalanced, leaning_relation
from scenewright.stages.kit.geometry.boxes import box_from_bounds

from tests.unit.graph.test_support import entity, solid


def seen_from_the_front(low: float):
    """A box of which the front edge, the front and the top were seen: its middle lies behind its only footing."""
    across, up = np.meshgrid(np.linspace(0, 0.2, 11), np.linspace(low, low + 0.2, 11))
    front = np.column_stack([across.ravel(), np.zeros(121), up.ravel()])
    across, back = np.meshgrid(np.linspace(0, 0.2, 11), np.linspace(0, 0.4, 31))
    top = np.column_stack([across.ravel(), back.ravel(), np.full(341, low + 0.2)])
    return replace(
        entity("box_3", box_from_bounds((0, 0, low), (0.2, 0.4, low + 0.2))), points=np.concatenate([front, top])
    )


def test_what_shows_no_feet_leans_on_nothing():
    table = solid("table_1", (-1, -1, 0), (1, 1, 0.7), class_name="table", movable=False)
    wall = entity("box_2", box_from_bounds((0, 0.4, 0.7), (0.2, 0.5, 1.0)))
    grid = np.stack(np.meshgrid(np.linspace(0, 0.2, 21), np.linspace(0.7, 1.0, 31)), axis=-1).reshape(-1, 2)
    wall = replace(wall, points=np.column_stack([grid[:, 0], np.full(len(grid), 0.41), grid[:, 1]]))
    box = seen_from_the_front(0.7)
    assert is_unbalanced(box)
    leaning = leaning_relation(box, "table_1", [table, wall, box])
    assert leaning is not None and leaning.source == "box_2"
    floating = seen_from_the_front(0.85)
    assert footing_seen(box, table) and not footing_seen(floating, table)
    assert leaning_relation(floating, "table_1", [table, wall, floating]) is None
