"""Every estimate is believed."""

from __future__ import annotations

import numpy as np
from scenewright.stages.suture.motion.constants import MOVED
from scenewright.stages.suture.trials.bench import HOME, Bench
from scenewright.stages.suture.trials.looking import until_known
from scenewright.stages.suture.trials.perception import Seen, nearer_end


class EveryEstimate:
    """Trust: wherever the needle is seen, there it is."""

    def look(self, bench: Bench, place: str, where: np.ndarray) -> Seen | None:
        """Return one estimate, wherever it lies."""
        return bench.look(place)

    def seems_out(self, bench: Bench, before: Seen, out: bool) -> bool:
        """Return whether the end nearer to the driver moved by 2 cm, or the needle can't be seen any more."""
        after = until_known(lambda: bench.look("elsewhere" if out else "tissue"))
        driver = bench.tools["left"][:3, 3]
        return after is None or (
            float(np.linalg.norm(nearer_end(after, driver) - nearer_end(before, HOME["left"][:3, 3]))) >= MOVED
        )
