"""The thread by lengths: what lies before the last hole, in stitches, behind; and when it slides, holds or runs out."""

from __future__ import annotations

from dataclasses import dataclass
from math import exp, pi

import numpy as np
from scenewright.stages.suture.trials.settings import World
from scenewright.stages.suture.trials.wound import CHORD, entry, exit_

LEFT_IN_FIRST_HOLE = 0.010
"""A tail shorter than this [m] slips out of the first hole."""


@dataclass
class Thread:
    """Lengths [m]. `working`: from the last hole to the needle; `tail`: what may still be drawn through the stitches;
    `slack`: what is loose in the stitch just made; `through`: stitches that hold the thread."""

    working: float
    tail: float = 0.0
    slack: float = 0.0
    through: int = 0

    def resistance(self, world: World) -> float:
        """Force [N] that draws more thread through every stitch made so far (capstan equation)."""
        return world.thread_friction * exp(pi * world.capstan * self.through)

    def used_by(self, suture: int, noise: float) -> float:
        """Thread [m] that suture 0 to 5 takes: from the last exit to its entry, and through the wound."""
        through = 1.05 * CHORD
        if suture == 0:
            return through
        return float(np.linalg.norm(entry(suture) - exit_(suture - 1))) + through + noise


@dataclass(frozen=True)
class Drawn:
    """What drawing thread came to: `short` [m] by which taut thread did not give, `lost` when its end came out."""

    short: float = 0.0
    lost: bool = False


def draw(thread: Thread, length: float, force: float, world: World) -> Drawn:
    """Make `working` at least `length` [m], from the tail as far as `force` [N] overcomes the stitches' friction."""
    missing = length - thread.working
    if missing <= 0.0:
        return Drawn()
    if thread.resistance(world) > force:
        return Drawn(short=missing)
    if thread.tail - missing < LEFT_IN_FIRST_HOLE:
        return Drawn(lost=True)
    thread.tail -= missing
    thread.working = length
    return Drawn()


def pull_through(thread: Thread, suture: int, distance: float, force: float, noise: float, world: World) -> Drawn:
    """Draw the thread through a new stitch until the needle is `distance` [m] from its exit (extraction, cinching).

    The first time the whole thread follows and what stays behind is the tail; later the stitch takes its share,
    what remains beyond `distance` is slack in it, and what is short comes from the tail or not at all.
    """
    available = thread.working - thread.used_by(suture, noise)
    if suture == 0:
        thread.tail = available - distance
        thread.working, thread.slack, thread.through = distance, 0.0, 1
        return Drawn(lost=thread.tail < LEFT_IN_FIRST_HOLE)
    thread.slack = max(0.0, available - distance)
    thread.working = min(available, distance)
    drawn = draw(thread, distance, force, world)
    thread.through += 1
    return drawn


def pull_on(thread: Thread, more: float, force: float, world: World) -> Drawn:
    """Draw a stitch that was made tighter by `more` [m]: its slack comes first, then the tail as far as it gives."""
    eased = min(max(0.0, more), thread.slack)
    thread.slack -= eased
    thread.working += eased
    # `through` counts this stitch already, whose friction the slack has overcome.
    return draw(thread, thread.working + max(0.0, more) - eased, force, world)
