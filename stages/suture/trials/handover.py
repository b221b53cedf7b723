"""Needle handover with its recovery, executed, and the cinch before it (section 3.2; future work of section 4.3).

The thesis contradicts itself: the handover section retries when the needle's orientation is unchanged, the recovery
section when its change is nonzero. Jaws that close on a needle that another driver holds, and then move, turn it; jaws
that miss do not. So an unchanged normal is the sign of a miss, and that is the test used. With the other reading most
trials end in handover (measured: docs/STITCH_TRIALS.md).
"""

from __future__ import annotations

import numpy as np

from stages.kit.geometry.transforms import inverse, transform_from
from stages.suture.motion import primitives
from stages.suture.motion.constants import APPROACH_OFFSET, HANDOVER_OFFSET, RETRIES
from stages.suture.motion.needle import UP_THE_WOUND, about, point_at, turned
from stages.suture.trials.bench import HOME, Bench, Failed, Hold
from stages.suture.trials.extraction import GRASPING
from stages.suture.trials.gripping import close
from stages.suture.trials.perception import Seen
from stages.suture.trials.settings import Policy
from stages.suture.trials.thread import draw

PRESENTING = about(UP_THE_WOUND, -np.pi / 4) @ GRASPING
"""The left driver's orientation in which a needle extracted as planned is taken by level jaws so that, these turned by
90 degrees about y, it is ready for insertion."""
PLACE = np.array([0.010, 0.0, 0.045])
TAKING = primitives.jaws(np.array([1.0, 0.0, 0.0]))
RELEASED = 0.012
WORKING_WANTED, LONGEST_PUSH = 0.080, 0.05


def farther_end(seen: Seen, driver: np.ndarray) -> np.ndarray:
    """Return the end (3,) of a seen needle that is farther from a driver at (3,): where handover grasps."""
    return max((seen.tip, seen.swage), key=lambda end: float(np.linalg.norm(end - driver)))


def hand_over(bench: Bench) -> None:
    """Pass the needle from the left to the right driver (f, g, h); up to five retries with random offsets.

    Raises Failed (H) when the needle is dropped or no try is believed to have succeeded.
    """
    bench.overhead()
    if bench.hold is None:
        raise Failed("H", "no needle in the left driver")
    bench.go("left", transform_from(PRESENTING, PLACE))
    if bench.policy.cinches_before_handover:
        _cinch_before(bench)
    bench.record("f: presented")
    offset = np.zeros(3)
    for _ in range(1 + RETRIES):
        bench.overhead()
        before = bench.look_until("elsewhere")
        if before is not None:
            point = farther_end(before, bench.tools["left"][:3, 3])
            path = primitives.approach(point + offset, TAKING, APPROACH_OFFSET)
            bench.go("right", path[0])
            bench.move("right", path)
            grip = _close(bench)
            after = bench.look_until("elsewhere")
            bench.record("g: both hold" if grip else "g: missed")
            if after is not None and handed_over(bench.policy, before, after):
                _release(bench, grip)
                return
            back = bench.tools["right"].copy()
            back[0, 3] -= 0.02
            bench.go("right", back)
        angle = bench.random.uniform(0, 2 * np.pi)
        offset = bench.random.uniform(0, HANDOVER_OFFSET) * np.array([np.cos(angle), np.sin(angle), 0.0])
    raise Failed("H", "no try to hand the needle over was believed to have succeeded")


def _close(bench: Bench) -> Hold | None:
    """Close the right jaws and move them a little; return how they hold the needle, None when they missed it."""
    world = bench.world
    closing = close(bench.tools["right"], bench.needle, world, bench.random)
    if bench.hold is None or closing.caught is None:
        if closing.touched:
            bench.turn_in_grip(world.knock_held, world.knock_held)
        return None
    turn = np.radians(world.handover_turn * (1.0 + 0.3 * bench.random.standard_normal()))
    vertical = np.array([0.0, 0.0, 1.0])
    bench.needle = turned(closing.caught, vertical, float(turn), bench.tools["left"][:3, 3])
    settled = turned(closing.caught, vertical, float(turn) * world.handover_turn_stays, bench.tools["right"][:3, 3])
    bench.hold.grip = inverse(bench.tools["left"]) @ bench.needle
    return Hold("right", inverse(bench.tools["right"]) @ settled, closing.quality)


def handed_over(policy: Policy, before: Seen, after: Seen) -> bool:
    """The handover test: whether the robot takes the needle for grasped by the looks before and after. Normals have no
    sign."""
    cosine = abs(float(before.normal @ after.normal))
    changed = float(np.arccos(min(1.0, cosine))) > policy.constants.unchanged_normal
    return changed if policy.retries_when_unchanged else not changed


def _release(bench: Bench, grip: Hold | None) -> None:
    """Open the left jaws and take the driver away."""
    if grip is None:
        bench.hold = None
        raise Failed("H", "the needle was taken for handed over and dropped")
    bench.hold = grip
    bench.needle = bench.tools["right"] @ grip.grip
    away = bench.tools["left"].copy()
    away[:3, 3] += np.array([RELEASED, 0.0, RELEASED])
    bench.withdraw("left", away)
    bench.withdraw("left", HOME["left"])
    bench.record("h: released")


def _cinch_before(bench: Bench) -> None:
    """Push the thread that hangs from the needle sideways with the right driver: it draws more through the stitches and
    clears the place of the grasp.

    A push by s at the middle of a straight thread of length h lengthens it to 2 sqrt((h / 2)^2 + s^2).
    """
    if bench.anchor is None or bench.hold is None:
        return
    bench.overhead()
    thread, world = bench.thread, bench.world
    middle = (bench.anchor + point_at(bench.needle, np.pi)) / 2.0
    start = transform_from(TAKING, middle + np.array([-0.02, -0.02, 0.0]))
    bench.go("right", start)
    span = float(np.linalg.norm(bench.anchor - point_at(bench.needle, np.pi)))
    reach = 2.0 * float(np.hypot(span / 2.0, LONGEST_PUSH))
    wanted = min(reach, WORKING_WANTED, thread.working + max(0.0, thread.tail - 0.02))
    # Stops where the needle would begin to slip: the thread is felt through the left driver's grip.
    if thread.resistance(world) < 0.5 * world.hold * bench.hold.quality:
        draw(thread, wanted, 0.5 * world.hold * bench.hold.quality, world)
    push = start.copy()
    push[1, 3] += 0.02 + LONGEST_PUSH
    bench.go("right", push)
    bench.record("f: cinched before handover")
    bench.withdraw("right", HOME["right"])
