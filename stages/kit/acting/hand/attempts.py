"""Attempts at a motion, made one by one."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TypeVar

from scenewright.stages.kit.motion.failures import MotionFailed

Motion = TypeVar("Motion")


def first_motion(attempts: Iterable[Motion | MotionFailed | None], searches: int) -> Motion | None:
    """Return the first of the attempts that is a motion, made until `searches` for a path have failed. An attempt that
    a cheap test ended is None, one that a search ended its failure."""
    for attempt in attempts:
        if isinstance(attempt, MotionFailed):
            searches -= 1
            if searches == 0:
                break
        elif attempt is not None:
            return attempt
    return None
