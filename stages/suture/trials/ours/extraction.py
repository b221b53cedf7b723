"""Where our jaws close, how far we turn, and what we expect of a needle that can't be seen."""

from __future__ import annotations

import numpy as np
from scenewright.stages.suture.motion import primitives
from scenewright.stages.suture.motion.constants import APPROACH_OFFSET, EXTRACTION_TURN, INSERTION_TURN
from scenewright.stages.suture.motion.needle import point_at
from scenewright.stages.suture.trials.bench import HOME, Bench
from scenewright.stages.suture.trials.perception import Seen, farther_end
from scenewright.stages.suture.trials.places import GRASPING
from scenewright.stages.suture.trials.wound import SPANNED

INWARDS, LEAST_TURN = np.radians(12.0), np.radians(10.0)
"""How far from its end the needle is gripped, and the least turn that draws it out [rad]; by eye."""


class AsInserted:
    """Expectation: a needle in tissue that can't be known is taken to lie as its insertion was planned, at the first
    try."""

    def expected(self, bench: Bench, attempt: int) -> Seen | None:
        """Return where insertion should have left it; None from the second try on."""
        return bench.expected if attempt == 0 else None


class OnTheWire:
    """Grasp: jaws close in their middle on the wire beside the seen end, not beyond the end; a turn that was cut short
    is finished, not made again."""

    def to_extract(self, bench: Bench, seen: Seen) -> np.ndarray:
        """Return the left driver's poses (K, 4, 4) on the way to its grasp point."""
        return primitives.approach(grasp_point(seen, INWARDS), GRASPING, APPROACH_OFFSET)

    def turn_out(self, seen: Seen) -> float:
        """Return what is left [rad] of 80 degrees."""
        return left_to_turn(seen)

    def to_take(self, seen: Seen, holder: np.ndarray) -> np.ndarray:
        """Return the point (3,) [m] of the wire a little inwards of the end farther from the driver at (3,)."""
        at_tip = farther_end(seen, holder) is seen.tip
        return point_at(seen.pose, INWARDS if at_tip else np.pi - INWARDS)


def grasp_point(seen: Seen, inwards: float) -> np.ndarray:
    """Return the point (3,) [m] of a seen needle that lies `inwards` [rad of the arc] from its end nearer to the left
    driver's place."""
    home = HOME["left"][:3, 3]
    at_tip = np.linalg.norm(seen.tip - home) < np.linalg.norm(seen.swage - home)
    return point_at(seen.pose, inwards if at_tip else np.pi - inwards)


def left_to_turn(seen: Seen) -> float:
    """Return how far a needle that was inserted as planned is still to be turned out [rad]; some of it always."""
    along = seen.pose[:3, 0]
    turned_out = float(np.arctan2(along[0], -along[2])) - (SPANNED / 2 + INSERTION_TURN)
    return float(np.clip(EXTRACTION_TURN - turned_out, LEAST_TURN, EXTRACTION_TURN))
