"""Exit codes and signals: explained outcomes apart from crashes."""

from __future__ import annotations

import pytest
from scenewright.stages.engine.batch.outcomes import MEANINGS, classify, is_explained, worst_exit_code


@pytest.mark.parametrize(
    ("status", "outcome", "code"),
    [
        (0, "done", 0),
        (1, "crash", 1),
        (2, "usage", 2),
        (3, "bad input", 3),
        (4, "not ok", 4),
        (5, "missing dependency", 5),
        (6, "machine failure", 6),
        (130, "interrupted", 130),
        (-9, "crash", 137),
        (-11, "crash", 139),
        (137, "crash", 137),
        (256 - 9, "crash", 137),
        (256 - 11, "crash", 139),
        (7, "crash", 7),
        (127, "crash", 127),
    ],
)
def test_every_status_has_an_outcome(status: int, outcome: str, code: int) -> None:
    assert classify(status) == (outcome, code)


def test_only_success_and_crashes_are_unexplained() -> None:
    assert [name for name in MEANINGS if not is_explained(name)] == ["done", "crash"]


def test_the_gravest_code_wins() -> None:
    assert worst_exit_code([0, 4, 3, 0]) == 3
    assert worst_exit_code([0, 6, 137]) == 1 == worst_exit_code([127, 4])
    assert worst_exit_code([]) == 0
