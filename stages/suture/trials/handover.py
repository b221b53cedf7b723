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
from stages.suture.motion.constants import APPROACH_OFFSET, HANDOVER_OFFSET, RETRIES, THROWS
from stages.suture.motion.needle import UP_THE_WOUND, about, point_at, turned
from stages.suture.trials.bench import HOME, Bench, Failed, Hold
from stages.suture.trials.extraction import GRASPING, LAST_DRAWN, TAIL_TO_LEAVE, WANTED
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
LONGEST_PUSH, SHORT_BY = 0.05, 0.005
BEFORE_TAKING = np.array([-0.045, 0.0, 0.0])
"""Where the right driver waits, seen from the place of handover [m]."""
LOOKS, TURNED, TURNED_EACH, INWARDS = 3, np.radians(4.0), np.radians(1.5), np.radians(12.0)


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
    bench.wait_at("right", transform_from(TAKING, PLACE + BEFORE_TAKING))
    bench.go("left", transform_from(PRESENTING, PLACE))
    if bench.policy.cinches_before_handover:
        _cinch_before(bench)
    bench.record("f: presented")
    offset = np.zeros(3)
    for _ in range(1 + RETRIES):
        bench.overhead()
        before = _looks(bench)
        if before is not None:
            point = _taken_at(bench, before)
            path = primitives.approach(point + offset, TAKING, APPROACH_OFFSET)
            bench.go("right", path[0])
            bench.move("right", path)
            grip = _close(bench)
            after = _looks(bench)
            bench.record("g: both hold" if grip else "g: missed")
            if after is not None and _believes(bench, before, after):
                _release(bench, grip)
                return
            back = bench.tools["right"].copy()
            back[0, 3] -= 0.02
            bench.go("right", back)
        angle = bench.random.uniform(0, 2 * np.pi)
        offset = bench.random.uniform(0, HANDOVER_OFFSET) * np.array([np.cos(angle), np.sin(angle), 0.0])
    raise Failed("H", "no try to hand the needle over was believed to have succeeded")


def _looks(bench: Bench) -> Seen | None:
    """Look at the presented needle: once, or so often that one mistake does not decide."""
    if not bench.policy.checks_turn:
        return bench.look_until("elsewhere")
    jaws = bench.jaws("left")
    found = [seen for seen in (bench.look_until("elsewhere", where=jaws) for _ in range(LOOKS)) if seen is not None]
    return middle(found) if found else None


def middle(looks: list[Seen]) -> Seen:
    """Return the middle of looks at one needle: normals have no sign, ends are medians."""
    normals = np.array([seen.normal if seen.normal @ looks[0].normal > 0 else -seen.normal for seen in looks])
    normal = np.median(normals, axis=0)
    tip = np.median([seen.tip for seen in looks], axis=0)
    swage = np.median([seen.swage for seen in looks], axis=0)
    return Seen(normal / np.linalg.norm(normal), tip, swage, all(seen.right for seen in looks))


def _taken_at(bench: Bench, seen: Seen) -> np.ndarray:
    """Return the point (3,) [m] that the right driver's jaws close on: the far end, or a little inwards of it."""
    holder = bench.tools["left"][:3, 3]
    if not bench.policy.centres_jaws:
        return farther_end(seen, holder)
    at_tip = farther_end(seen, holder) is seen.tip
    return point_at(seen.pose, INWARDS if at_tip else np.pi - INWARDS)


def _believes(bench: Bench, before: Seen, after: Seen) -> bool:
    """Whether the robot takes the needle for held by the right driver too."""
    if not bench.policy.checks_turn:
        return handed_over(bench.policy, before, after)
    angles = turned_about(before, after, bench.tools["left"][:3, 3])
    return min(angles) > TURNED_EACH and sum(angles) / 2.0 > TURNED


def turned_about(before: Seen, after: Seen, holder: np.ndarray) -> tuple[float, float]:
    """Return by what angles [rad] about the vertical a needle's normal and its far end turned, seen from the driver at
    (3,) that holds it. Jaws that hold the needle too turn it so as they move."""

    def angle(first: np.ndarray, second: np.ndarray) -> float:
        return float(np.arctan2(first[0] * second[1] - first[1] * second[0], first[:2] @ second[:2]))

    same = after.normal if after.normal @ before.normal > 0 else -after.normal
    ends = [farther_end(seen, holder) - holder for seen in (before, after)]
    return angle(before.normal, same), angle(ends[0], ends[1])


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
    """Push the thread that hangs from the needle sideways with the right driver, where it is seen to be too short for
    what comes: it draws more through the stitches and clears the place of the grasp.

    A push by s at the middle of a straight thread of length h lengthens it to 2 sqrt((h / 2)^2 + s^2).
    """
    thread, world, model = bench.thread, bench.world, bench.eyes.model
    if bench.anchor is None or bench.hold is None or bench.suture >= THROWS:
        return
    bench.seconds += model.seconds_an_estimate
    seen = thread.working * (1.0 + model.thread_length_error * bench.random.standard_normal())
    spare = bench.tail_reckoned - TAIL_TO_LEAVE
    if seen > WANTED - SHORT_BY or bench.suture > LAST_DRAWN or spare < SHORT_BY:
        return
    bench.overhead()
    hanging = bench.tools["left"][:3, 3]
    half = float(np.linalg.norm(bench.anchor - hanging)) / 2.0
    wanted = min(2.0 * float(np.hypot(half, LONGEST_PUSH)), WANTED, seen + spare)
    push = float(np.sqrt(max(0.0, (wanted / 2.0) ** 2 - half**2)))
    bench.tail_reckoned -= max(0.0, wanted - seen)
    start = transform_from(TAKING, (bench.anchor + hanging) / 2.0 + np.array([-0.02, -0.01, 0.0]))
    bench.go("right", start)
    bench.yield_to(draw(thread, wanted, 0.5 * world.hold * bench.hold.quality, world))
    end = start.copy()
    end[1, 3] += 0.01 + push
    bench.go("right", end)
    bench.record("f: cinched before handover")
