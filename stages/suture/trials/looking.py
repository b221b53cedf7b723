"""Looking at the needle again and again."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scenewright.stages.suture.trials.bench import Bench, Failed
from scenewright.stages.suture.trials.perception import Seen
from scenewright.stages.suture.trials.policy import Trust

LOOKS = 10
"""Looks at one place before the needle is said to be unseen; by eye."""
TOO_MANY_LOOKS = 60
"""Most looks in the corner until enough are believed; by eye."""


def until_known(look: Callable[[], Seen | None], most: int = LOOKS) -> Seen | None:
    """Look again while the needle can't be known, at most `most` times; None then."""
    for _ in range(most):
        accepted = look()
        if accepted is not None:
            return accepted
    return None


def trusted_look(bench: Bench, trust: Trust, place: str, where: np.ndarray) -> Seen | None:
    """Look until an estimate of a needle that must pass one of the points (K, 3) [m] is believed; None for none."""
    return until_known(lambda: trust.look(bench, place, where))


def corner_looks(bench: Bench, trust: Trust, count: int) -> list[Seen]:
    """Return `count` estimates in the corner, looking on where some are abstained from; Failed (I) for too few."""
    looks: list[Seen] = []
    for _ in range(TOO_MANY_LOOKS):
        accepted = trust.look(bench, "corner_right", bench.jaws("right"))
        if accepted is not None:
            looks.append(accepted)
        if len(looks) == count:
            return looks
    raise Failed("I", "the needle could not be known in the corner")
