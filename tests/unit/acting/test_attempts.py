"""Attempts at a motion, made one by one."""

from __future__ import annotations

from collections.abc import Iterator

from scenewright.stages.kit.acting.hand.attempts import first_motion
from scenewright.stages.kit.motion.failures import MotionFailed


def test_the_first_motion_is_taken_and_so_many_failed_searches_are_enough() -> None:
    made: list[object] = []

    def attempts(*outcomes: object) -> Iterator[object]:
        made.clear()
        for outcome in outcomes:
            made.append(outcome)
            yield outcome

    blocked = MotionFailed("no_path", "something is in the way")
    assert first_motion(attempts(None, blocked, "motion", "another"), 2) == "motion" and len(made) == 3
    assert first_motion(attempts(blocked, None, blocked, "motion"), 2) is None and len(made) == 3
    assert first_motion(attempts(None, None), 1) is None, "cheap tests cost no search"
