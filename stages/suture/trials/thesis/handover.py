"""The handover test of the thesis, in both of its readings.

The thesis contradicts itself: the handover section retries when the needle's orientation is unchanged, the recovery
section when its change is nonzero. Jaws that close on a needle that another driver holds, and then move, turn it; jaws
that miss do not. So an unchanged normal is the sign of a miss, and that is the test used. With the other reading most
trials end in handover (measured: docs/STITCH.md).
"""

from __future__ import annotations

import numpy as np
from scenewright.stages.suture.motion.constants import OpenConstants
from scenewright.stages.suture.trials.bench import Bench
from scenewright.stages.suture.trials.looking import until_known
from scenewright.stages.suture.trials.perception import Seen
from scenewright.stages.suture.trials.policy import Trust


class ThreadAsItHangs:
    """Thread at handover: as long as it is."""

    def lengthen(self, bench: Bench) -> None:
        """Leave the thread."""


class NormalChanged:
    """Handover test: held is a needle whose normal changed (the handover section)."""

    def look(self, bench: Bench, trust: Trust) -> Seen | None:
        """Look until one estimate is made."""
        return until_known(lambda: bench.look("elsewhere"))

    def passed(self, before: Seen, after: Seen, holder: np.ndarray, constants: OpenConstants) -> bool:
        """Return whether the normal, which has no sign, turned."""
        cosine = abs(float(before.normal @ after.normal))
        return float(np.arccos(min(1.0, cosine))) > constants.unchanged_normal


class NormalUnchanged(NormalChanged):
    """Handover test: held is a needle whose normal did not change (the recovery section)."""

    def passed(self, before: Seen, after: Seen, holder: np.ndarray, constants: OpenConstants) -> bool:
        """Return whether the normal stayed."""
        return not super().passed(before, after, holder, constants)
