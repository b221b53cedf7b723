"""Thread by what is seen of it: how far to pull, what is loose, what is too short."""

from __future__ import annotations

import numpy as np
from scenewright.stages.kit.geometry.transforms import transform_from
from scenewright.stages.suture.motion.constants import THROWS, OpenConstants
from scenewright.stages.suture.trials.bench import Bench
from scenewright.stages.suture.trials.places import TAKING
from scenewright.stages.suture.trials.pulling import LONGEST_PULL, OUTWARDS, pull_by, pull_to
from scenewright.stages.suture.trials.thread import draw, pull_on

TAIL_TO_LEAVE = 0.030
"""What bookkeeping leaves behind the first hole [m]."""
BOOK_MARGIN = 0.002
"""Thread that bookkeeping leaves over [m]; by eye."""
WANTED = 0.080
"""Thread [m] between stitch and needle that handover and pose correction take."""
LAST_DRAWN = 3
"""Suture (0 to 5) from which on friction in the stitches made holds the tail: what is wanted later is drawn here."""
PULLS_ON, LOOSE_SEEN, LOOSE_ERROR = 2, 0.003, 0.001
"""How often thread seen loose is pulled on, from what length [m] on, and what it is off by [m] beside its share."""
LONGEST_PUSH, SHORT_BY = 0.05, 0.005
"""Longest push sideways, and by how little too short a thread may be [m]; by eye."""


class ByTheBooks:
    """Cinch: pulls by the seen length of thread, not by constants: all that the stitch leaves, and from the tail what
    the next throws will want, while few stitches hold it."""

    panel = "e: cinched"

    def pull(self, bench: Bench, constants: OpenConstants) -> float:
        """Pull as far as the books say, and return how far [m] from the exit that is."""
        bench.overhead()
        distance = min(LONGEST_PULL, booked(bench))
        pull_to(bench, distance)
        return distance


def booked(bench: Bench) -> float:
    """Return how far [m] from the exit to pull.

    The thread is seen with an error, once a stitch; what is left of the tail is reckoned from the first look.
    """
    suture = bench.suture
    working = seen_length(bench)
    remaining = working - bench.thread.used_by(suture, 0.0)
    if suture == 0:
        pull = min(WANTED, remaining - TAIL_TO_LEAVE)
        bench.tail_reckoned = remaining - pull
        return pull
    wanted_working = (
        WANTED + bench.thread.used_by(suture + 1, 0.0) * (suture == LAST_DRAWN) if suture <= LAST_DRAWN else 0.0
    )
    spare = max(0.0, bench.tail_reckoned - TAIL_TO_LEAVE)
    drawn = min(spare, max(0.0, wanted_working - remaining))
    bench.tail_reckoned -= drawn
    return remaining + max(drawn, BOOK_MARGIN)


def seen_length(bench: Bench) -> float:
    """Return the length of working thread [m] as it is seen, with the error of a look at it."""
    model = bench.eyes.model
    bench.seconds += model.seconds_an_estimate
    return bench.thread.working * (1.0 + model.thread_length_error * bench.random.standard_normal())


class PullsOn:
    """Slack: looks at the stitch, and pulls on by what is seen to be loose, until nothing is."""

    def tighten(self, bench: Bench) -> None:
        """Pull on, at most twice."""
        thread, model, world = bench.thread, bench.eyes.model, bench.world
        for _ in range(PULLS_ON):
            bench.seconds += model.seconds_an_estimate
            error = np.hypot(LOOSE_ERROR, model.thread_length_error * thread.slack) * bench.random.standard_normal()
            loose = thread.slack + error
            if loose < LOOSE_SEEN or bench.hold is None:
                return
            bench.overhead()
            pull_by(bench, loose * OUTWARDS)
            bench.yield_to(pull_on(thread, loose, world.hold * bench.hold.quality, world))


class PushedSideways:
    """Thread at handover: the right driver pushes the thread that hangs from the needle sideways, where it is seen to
    be too short for what comes: it draws more through the stitches and clears the place of the grasp.

    A push by s at the middle of a straight thread of length h lengthens it to 2 sqrt((h / 2)^2 + s^2).
    """

    def lengthen(self, bench: Bench) -> None:
        """Push by as much as is wanted and the tail has to spare."""
        thread, world = bench.thread, bench.world
        if bench.anchor is None or bench.hold is None or bench.suture >= THROWS:
            return
        working = seen_length(bench)
        spare = bench.tail_reckoned - TAIL_TO_LEAVE
        if working > WANTED - SHORT_BY or bench.suture > LAST_DRAWN or spare < SHORT_BY:
            return
        bench.overhead()
        hanging = bench.tools["left"][:3, 3]
        half = float(np.linalg.norm(bench.anchor - hanging)) / 2.0
        target_length = min(2.0 * float(np.hypot(half, LONGEST_PUSH)), WANTED, working + spare)
        push = float(np.sqrt(max(0.0, (target_length / 2.0) ** 2 - half**2)))
        bench.tail_reckoned -= max(0.0, target_length - working)
        start = transform_from(TAKING, (bench.anchor + hanging) / 2.0 + np.array([-0.02, -0.01, 0.0]))
        bench.go("right", start)
        bench.yield_to(draw(thread, target_length, 0.5 * world.hold * bench.hold.quality, world))
        end = start.copy()
        end[1, 3] += 0.01 + push
        bench.go("right", end)
        bench.record("f: cinched before handover")
