"""The handover test by how far a needle turned about the driver that holds it."""

from __future__ import annotations

import numpy as np
from scenewright.stages.suture.motion.constants import OpenConstants
from scenewright.stages.suture.trials.bench import Bench
from scenewright.stages.suture.trials.looking import trusted_look
from scenewright.stages.suture.trials.perception import Seen, farther_end
from scenewright.stages.suture.trials.policy import Trust

LOOKS, TURNED, TURNED_EACH = 3, np.radians(4.0), np.radians(1.5)
"""Looks of the handover test, the mean turn of the ends that passes it, and the least turn of each [rad]; by eye."""


class TurnedAboutHolder:
    """Handover test: normal and far end both turned the way that the right driver moved, over several looks."""

    def look(self, bench: Bench, trust: Trust) -> Seen | None:
        """Look so often that one mistake does not decide."""
        jaws = bench.jaws("left")
        tries = [trusted_look(bench, trust, "elsewhere", jaws) for _ in range(LOOKS)]
        looks = [attempt for attempt in tries if attempt is not None]
        return middle(looks) if looks else None

    def passed(self, before: Seen, after: Seen, holder: np.ndarray, constants: OpenConstants) -> bool:
        """Return whether both turned, and by enough between them."""
        angles = turned_about(before, after, holder)
        return min(angles) > TURNED_EACH and sum(angles) / 2.0 > TURNED


def middle(looks: list[Seen]) -> Seen:
    """Return the middle of looks at one needle: normals have no sign, ends are medians."""
    normals = np.array([look.normal if look.normal @ looks[0].normal > 0 else -look.normal for look in looks])
    normal = np.median(normals, axis=0)
    tip = np.median([look.tip for look in looks], axis=0)
    swage = np.median([look.swage for look in looks], axis=0)
    return Seen(normal / np.linalg.norm(normal), tip, swage, all(look.right for look in looks))


def turned_about(before: Seen, after: Seen, holder: np.ndarray) -> tuple[float, float]:
    """Return by what angles [rad] about the vertical a needle's normal and its far end turned, seen from the driver at
    (3,) that holds it. Jaws that hold the needle too turn it so as they move."""

    def angle(first: np.ndarray, second: np.ndarray) -> float:
        return float(np.arctan2(first[0] * second[1] - first[1] * second[0], first[:2] @ second[:2]))

    same = after.normal if after.normal @ before.normal > 0 else -after.normal
    ends = [farther_end(look, holder) - holder for look in (before, after)]
    return angle(before.normal, same), angle(ends[0], ends[1])
