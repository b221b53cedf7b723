"""Votes: what masks said of segments, as shares of the looks."""

from __future__ import annotations

import numpy as np
from scenewright.stages.fuse.votes import Votes

from tests.unit.fuse.scenes import class_id

CHAIR, TABLE = class_id("chair"), class_id("table")


def test_a_share_is_that_of_the_looks_and_no_more_than_all() -> None:
    votes = Votes({1: {CHAIR: 3.0, TABLE: 1.0}, 2: {CHAIR: 9.0}}, {1: 4, 2: 5})
    segments = np.array([1, 2, 7])
    assert votes.share(segments, [CHAIR]).tolist() == [0.75, 1.0, 0.0]
    assert votes.share(segments, [CHAIR, TABLE]).tolist() == [1.0, 1.0, 0.0]
    assert votes.own_share(segments, np.array([TABLE, CHAIR, 0])).tolist() == [0.25, 1.0, 0.0]
    assert votes.share(np.zeros(0, int), [CHAIR]).shape == (0,)
