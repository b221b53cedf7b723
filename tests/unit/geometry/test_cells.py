"""Numbers that stand for rows."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scenewright.stages.kit.geometry.cells import row_keys

NUMBERS = st.one_of(st.integers(-3, 3), st.integers(-(2**50), 2**50))


@given(arrays(np.int64, st.tuples(st.integers(1, 12), st.integers(1, 4)), elements=NUMBERS))
def test_they_sort_and_meet_as_the_rows_do(rows: np.ndarray) -> None:
    unique, first, inverse = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    _, first_of_keys, inverse_of_keys = np.unique(row_keys(rows), return_index=True, return_inverse=True)
    assert (first == first_of_keys).all() and (inverse.reshape(-1) == inverse_of_keys).all()
    assert (rows[first_of_keys] == unique).all()


def test_no_rows_have_no_numbers() -> None:
    assert len(row_keys(np.zeros((0, 3), np.int64))) == 0
