"""An estimate that does not lie where the needle must be is not believed."""

from __future__ import annotations

import numpy as np
from scenewright.stages.suture.motion.needle import ARC_POINTS
from scenewright.stages.suture.trials.bench import Bench
from scenewright.stages.suture.trials.looking import until_known
from scenewright.stages.suture.trials.perception import Seen
from scenewright.stages.suture.trials.wound import exit_

PASSES = 0.010
"""A needle seen farther than this [m] from where it must be is not believed: jaws are 12 mm deep, and thread that pulls
turns a needle about their middle."""
LOOKS_AFTER = 20
"""Looks after an extraction until one is believed; by eye."""


class InPlace:
    """Trust: the needle lies in the jaws that hold it, or at the hole that it passes."""

    def look(self, bench: Bench, place: str, where: np.ndarray) -> Seen | None:
        """Return one estimate of a needle that passes one of the points `where` (K, 3) [m]; None for another."""
        looked = bench.look(place)
        return looked if looked is not None and passes(looked, where) else None

    def seems_out(self, bench: Bench, before: Seen, out: bool) -> bool:
        """Return whether the needle is seen in the left jaws and not in the wound, or not seen at all."""
        jaws, wound = bench.jaws("left"), exit_(bench.suture)[None]
        where, scene_place = np.concatenate([jaws, wound]), "elsewhere" if out else "tissue"
        after = until_known(lambda: self.look(bench, scene_place, where), LOOKS_AFTER)
        return after is None or (passes(after, jaws) and not passes(after, wound))


def passes(seen: Seen, where: np.ndarray) -> bool:
    """Whether a seen needle goes through one of the points (K, 3) [m]."""
    pose = seen.pose
    arc = ARC_POINTS @ pose[:3, :3].T + pose[:3, 3]
    return bool(np.linalg.norm(arc[:, None] - where[None], axis=2).min() < PASSES)
