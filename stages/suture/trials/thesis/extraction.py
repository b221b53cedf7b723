"""Sweeping, extraction and cinching as in the thesis, and its arms without them."""

from __future__ import annotations

import numpy as np
from scenewright.stages.suture.motion import primitives
from scenewright.stages.suture.motion.constants import EXTRACTION_ADVANCE, EXTRACTION_TURN, OpenConstants, cinch_length
from scenewright.stages.suture.trials.bench import Bench
from scenewright.stages.suture.trials.perception import Seen, farther_end, nearer_end
from scenewright.stages.suture.trials.places import GRASPING
from scenewright.stages.suture.trials.policy import Coordination
from scenewright.stages.suture.trials.pulling import LONGEST_PULL, pull_to
from scenewright.stages.suture.trials.wound import exit_


class NoSweep:
    """Sweep: the thread stays where it lies."""

    def sweep(self, bench: Bench, coordination: Coordination) -> None:
        """Leave the thread."""


class OverTheWound:
    """Sweep: the wide open left driver passes over the wound towards the cameras, pushing thread ahead (c)."""

    def sweep(self, bench: Bench, coordination: Coordination) -> None:
        """Pass over the wound, then clear of the needle."""
        bench.overhead()
        noise = bench.world.sweep_height_noise * bench.random.standard_normal()
        path = primitives.sweep(exit_(bench.suture), bench.world.sweep_height + noise)
        bench.go("left", path[0])
        bench.move("left", path, bar=True)
        bench.record("c: swept")
        coordination.after_sweep(bench)


class NothingExpected:
    """Expectation: a needle that can't be known is nowhere."""

    def expected(self, bench: Bench, attempt: int) -> Seen | None:
        """Return None."""
        return None


class ByTheEnds:
    """Grasp: jaws close 5 mm beyond the nearer end at extraction, on the farther end at handover."""

    def to_extract(self, bench: Bench, seen: Seen) -> np.ndarray:
        """Return the left driver's poses (K, 4, 4): 1 cm beside the end nearer to it, then 1.5 cm along."""
        return primitives.approach(nearer_end(seen, bench.tools["left"][:3, 3]), GRASPING, EXTRACTION_ADVANCE)

    def turn_out(self, seen: Seen) -> float:
        """Return 80 degrees [rad]."""
        return EXTRACTION_TURN

    def to_take(self, seen: Seen, holder: np.ndarray) -> np.ndarray:
        """Return the end (3,) [m] farther from the driver at (3,)."""
        return farther_end(seen, holder)


class LinearPull:
    """Cinch: none; thread stays as the linear pull of extraction left it (e)."""

    panel = "e: pulled"

    def pull(self, bench: Bench, constants: OpenConstants) -> float:
        """Return how far [m] from the exit that pull led."""
        return constants.linear_pull


class ToCinchLength:
    """Cinch: to beta, which falls by a constant from suture to suture (e)."""

    panel = "e: cinched"

    def pull(self, bench: Bench, constants: OpenConstants) -> float:
        """Pull to beta, and return it [m]."""
        bench.overhead()
        distance = min(LONGEST_PULL, max(constants.linear_pull, cinch_length(bench.suture, constants)))
        pull_to(bench, distance)
        return distance


class NotWatched:
    """Slack: stays unseen."""

    def tighten(self, bench: Bench) -> None:
        """Leave the stitch."""
