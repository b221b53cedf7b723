"""Needle handover with its recovery, executed (section 3.2)."""

from __future__ import annotations

import numpy as np
from scenewright.stages.kit.geometry.transforms import inverse, transform_from
from scenewright.stages.suture.motion import primitives
from scenewright.stages.suture.motion.constants import APPROACH_OFFSET, HANDOVER_OFFSET, RETRIES
from scenewright.stages.suture.motion.needle import turned
from scenewright.stages.suture.trials.bench import HOME, Bench, Failed, Hold
from scenewright.stages.suture.trials.gripping import close
from scenewright.stages.suture.trials.places import PRESENTING, TAKING
from scenewright.stages.suture.trials.policy import Coordination, Policy

PLACE = np.array([0.010, 0.0, 0.045])
"""Point at which the left driver presents the needle [m]; by eye."""
RELEASED = 0.012
"""Way back and up of the driver that let go [m]; by eye."""
BEFORE_TAKING = np.array([-0.045, 0.0, 0.0])
"""Point at which the right driver waits, seen from the place of handover [m]; by eye."""


def hand_over(bench: Bench, policy: Policy) -> None:
    """Pass the needle from the left to the right driver (f, g, h); up to five retries with random offsets.

    Raises Failed (H) when the needle is dropped or no try is believed to have succeeded.
    """
    bench.overhead()
    if bench.hold is None:
        raise Failed("H", "no needle in the left driver")
    policy.coordination.wait_at(bench, "right", transform_from(TAKING, PLACE + BEFORE_TAKING))
    bench.go("left", transform_from(PRESENTING, PLACE))
    policy.handover_thread.lengthen(bench)
    bench.record("f: presented")
    offset = np.zeros(3)
    for _ in range(1 + RETRIES):
        bench.overhead()
        before = policy.handover_test.look(bench, policy.trust)
        if before is not None:
            point = policy.grasp.to_take(before, bench.tools["left"][:3, 3])
            path = primitives.approach(point + offset, TAKING, APPROACH_OFFSET)
            bench.go("right", path[0])
            bench.move("right", path)
            grip = _close(bench)
            after = policy.handover_test.look(bench, policy.trust)
            bench.record("g: both hold" if grip else "g: missed")
            holder = bench.tools["left"][:3, 3]
            if after is not None and policy.handover_test.passed(before, after, holder, policy.constants):
                _release(bench, policy.coordination, grip)
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


def _release(bench: Bench, coordination: Coordination, grip: Hold | None) -> None:
    """Open the left jaws and take the driver away."""
    if grip is None:
        bench.hold = None
        raise Failed("H", "the needle was taken for handed over and dropped")
    bench.hold = grip
    bench.needle = bench.tools["right"] @ grip.grip
    away = bench.tools["left"].copy()
    away[:3, 3] += np.array([RELEASED, 0.0, RELEASED])
    coordination.withdraw(bench, "left", away)
    coordination.withdraw(bench, "left", HOME["left"])
    bench.record("h: released")
