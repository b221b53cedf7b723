"""What a small thing looks like is explained by the larger one that it stands on, where that fits nearly as well."""

from __future__ import annotations

import numpy as np
from scenewright.stages.kit.open_words.answering import RegionIndex, explained

NOTHING = np.zeros(0, int)


def index_of(boxes: list[tuple[tuple[float, float, float], tuple[float, float, float]]]) -> RegionIndex:
    """Entities with these centres and sizes [m]."""
    centers, sizes = (np.array(part, float) for part in zip(*boxes, strict=True))
    starts = np.zeros(len(boxes) + 1, int)
    return RegionIndex(NOTHING, starts, NOTHING, sizes.max(axis=1), centers - sizes / 2, centers + sizes / 2)


TABLE = ((0.0, 0.0, 0.35), (1.4, 0.8, 0.7))
BOTTLE = ((0.3, 0.1, 0.83), (0.08, 0.08, 0.26))
FAR_BOTTLE = ((3.0, 0.1, 0.83), (0.08, 0.08, 0.26))


def test_a_bottle_that_looks_like_its_table_is_no_table() -> None:
    found = explained(np.array([0.68, 0.81]), index_of([TABLE, BOTTLE]))
    np.testing.assert_allclose(found, [0.68, 0.81 * (1 - 0.68)])


def test_what_fits_much_better_than_its_table_stays() -> None:
    given = np.array([0.3, 0.81])
    np.testing.assert_array_equal(explained(given, index_of([TABLE, BOTTLE])), given)


def test_a_table_elsewhere_explains_nothing() -> None:
    given = np.array([0.68, 0.81])
    np.testing.assert_array_equal(explained(given, index_of([TABLE, FAR_BOTTLE])), given)


def test_nothing_is_explained_where_there_is_nothing() -> None:
    empty = RegionIndex(NOTHING, np.zeros(1, int), NOTHING, np.zeros(0), np.zeros((0, 3)), np.zeros((0, 3)))
    assert explained(np.zeros(0), empty).shape == (0,)
