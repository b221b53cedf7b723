"""Needle extraction with its recovery and suture cinching, executed (section 3.2)."""

from __future__ import annotations

import numpy as np
from scenewright.stages.kit.geometry.transforms import inverse
from scenewright.stages.suture.motion import primitives
from scenewright.stages.suture.motion.constants import RETRIES
from scenewright.stages.suture.motion.needle import ARC_POINTS, UP_THE_WOUND, turned
from scenewright.stages.suture.rig import NEEDLE_RADIUS
from scenewright.stages.suture.trials.bench import Bench, Failed, Hold
from scenewright.stages.suture.trials.gripping import close, thread_between
from scenewright.stages.suture.trials.looking import trusted_look
from scenewright.stages.suture.trials.perception import Seen
from scenewright.stages.suture.trials.policy import Policy
from scenewright.stages.suture.trials.pulling import pull_to
from scenewright.stages.suture.trials.thread import pull_through
from scenewright.stages.suture.trials.wound import SPANNED, exit_


def extract(bench: Bench, policy: Policy) -> None:
    """Grasp the needle in the wound, turn it out by 80 degrees, pull; up to five retries (d, e).

    Believes what it sees: a needle that seems to be in the wound still means another try. Raises Failed (E) when the
    needle is still in the wound once the robot goes on or gives up, (T) when thread comes along in the jaws or about
    them.
    """
    wound = exit_(bench.suture)[None]
    for attempt in range(1 + RETRIES):
        bench.overhead()
        policy.coordination.stand_back(bench, attempt)
        before = trusted_look(bench, policy.trust, "tissue", wound) or policy.expectation.expected(bench, attempt)
        if before is None:
            continue
        out, pinched = _attempt(bench, policy, before)
        moved = policy.trust.seems_out(bench, before, out)
        if out and pinched:
            raise Failed("T", "thread was grasped with the needle")
        if out and bench.tangled("left"):
            raise Failed("T", "thread is wound about the left driver")
        if moved and out:
            return
        if moved:
            raise Failed("E", "the needle was taken for extracted and is still in the wound")
        if out:
            raise Failed("E", "an extracted needle was taken for one in the wound and dropped")
    raise Failed("E", "no try to extract the needle succeeded")


def _attempt(bench: Bench, policy: Policy, seen: Seen) -> tuple[bool, bool]:
    """Return whether the needle came out, and whether thread was caught with it."""
    world = bench.world
    path = policy.grasp.to_extract(bench, seen)
    bench.go("left", path[0])
    bench.move("left", path)
    bench.record("d: at the needle")
    closing = close(bench.tools["left"], bench.needle, world, bench.random)
    if closing.caught is None:
        if closing.touched:
            knock = np.radians(world.knock) * bench.random.standard_normal(2)
            hole = exit_(bench.suture)
            bench.needle = turned(bench.needle, np.array([0.0, 0.0, 1.0]), float(knock[0]), hole)
            bench.needle = turned(bench.needle, bench.needle[:3, 2], 0.5 * float(knock[1]), bench.needle[:3, 3])
        return False, False
    pinched = thread_between(bench.tools["left"], bench.rope, world)
    share = closing.quality * (world.pinched_share if pinched else 1.0)
    grip = inverse(bench.tools["left"]) @ closing.caught
    centre, normal = seen.pose[:3, 3], seen.normal
    if normal @ UP_THE_WOUND < 0:
        normal = -normal
    turn = primitives.rotating_out(bench.tools["left"], normal, centre, policy.grasp.turn_out(seen))
    needles = turn @ grip
    loads = _loads(bench, needles, closing.shift)
    over = np.flatnonzero(loads > world.hold * share)
    if len(over):
        # The jaws slip off where the force exceeds the hold; the needle stays as far as it came.
        step = int(over[0])
        bench.move("left", turn[: step + 1])
        bench.needle = needles[max(0, step - 1)] if step > 1 else bench.needle
        return False, pinched
    bench.hold = Hold("left", grip, share)
    bench.anchor = None
    bench.move("left", turn)
    bench.anchor = exit_(bench.suture)
    bench.record("e: turned out")
    pull_to(bench, policy.constants.linear_pull)
    return True, pinched


def _loads(bench: Bench, needles: np.ndarray, shift: float) -> np.ndarray:
    """Return the force [N] on the grasp along a turn of the needle (K, 4, 4): friction in tissue, and how far needle
    and holes are apart."""
    world = bench.world
    in_tissue = SPANNED * NEEDLE_RADIUS * 1000.0
    loads = np.empty(len(needles))
    for step, needle in enumerate(needles):
        points = ARC_POINTS @ needle[:3, :3].T + needle[:3, 3]
        apart = [float(np.linalg.norm(points - hole, axis=1).min()) for hole in bench.holes]
        loads[step] = world.tissue_friction * in_tissue + world.tissue_stiffness * 1000.0 * max(*apart, shift)
    return loads


def cinch(bench: Bench, policy: Policy) -> None:
    """Pull the thread through the stitch, as far as the arm cinches (e).

    Raises Failed (T) where thread runs out or the needle is pulled out of the jaws, or the stitch stays loose.
    """
    world, thread = bench.world, bench.thread
    noise = world.stitch_noise * bench.random.standard_normal()
    distance = policy.cinch.pull(bench, policy.constants)
    force = world.hold * (bench.hold.quality if bench.hold else 0.0)
    drawn = pull_through(thread, bench.suture, distance, force, noise, world)
    bench.lay_thread()
    bench.yield_to(drawn)
    policy.slack_watch.tighten(bench)
    bench.record(policy.cinch.panel)
    if bench.hold is None:
        raise Failed("T", "taut thread pulled the needle out of the jaws")
    if thread.slack > world.loose:
        raise Failed("T", f"{thread.slack * 1000:.0f} mm of slack stay in the stitch")
    if bench.tangled("left"):
        raise Failed("T", "thread is wound about the left driver")
