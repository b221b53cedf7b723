"""Thread sweeping, needle extraction with its recovery, suture cinching, executed (section 3.2)."""

from __future__ import annotations

import numpy as np

from stages.kit.geometry.transforms import inverse, transform_from
from stages.suture.motion import primitives
from stages.suture.motion.constants import (
    APPROACH_OFFSET,
    EXTRACTION_ADVANCE,
    EXTRACTION_TURN,
    INSERTION_TURN,
    MOVED,
    RETRIES,
    cinch_length,
)
from stages.suture.motion.needle import ARC_POINTS, UP_THE_WOUND, point_at, turned
from stages.suture.rig import NEEDLE_RADIUS
from stages.suture.trials.bench import HOME, Bench, Failed, Hold, passes
from stages.suture.trials.gripping import close, thread_between
from stages.suture.trials.insertion import BESIDE
from stages.suture.trials.perception import Seen
from stages.suture.trials.thread import pull_on, pull_through
from stages.suture.trials.wound import SPANNED, exit_

GRASPING = primitives.jaws(np.array([-1.0, 0.0, 0.0]))
OUTWARDS = np.array([0.249, 0.548, 0.798]) / np.linalg.norm([0.249, 0.548, 0.798])
LONGEST_PULL = 0.115
"""How far [m] from the wound the left driver still reaches while it pulls."""
TAIL_TO_LEAVE = 0.030
"""What bookkeeping leaves behind the first hole [m]."""
BOOK_MARGIN = 0.002
WANTED = 0.080
"""Thread [m] between stitch and needle that handover and pose correction take."""
LAST_DRAWN = 3
"""From this suture (0 to 5) on, friction in the stitches made holds the tail: what is wanted later is drawn here."""
BACK = np.array([0.015, 0.0, 0.005])
INWARDS, LEAST_TURN = np.radians(12.0), np.radians(10.0)
LOOKS_AFTER = 20
PULLS_ON, LOOSE_SEEN, LOOSE_ERROR = 2, 0.003, 0.001
"""How often thread seen loose is pulled on, from what length [m] on, and what it is off by [m] beside its share."""


def sweep(bench: Bench) -> None:
    """Pass the wide open left driver over the wound towards the cameras, pushing thread ahead (c)."""
    bench.overhead()
    noise = bench.world.sweep_height_noise * bench.random.standard_normal()
    path = primitives.sweep(exit_(bench.suture), bench.world.sweep_height + noise)
    bench.go("left", path[0])
    bench.move("left", path, bar=True)
    bench.record("c: swept")
    if bench.policy.moves_both:
        bench.go("left", transform_from(GRASPING, exit_(bench.suture) + BESIDE))
    else:
        bench.withdraw("left", HOME["left"])


def nearer_end(seen: Seen, driver: np.ndarray) -> np.ndarray:
    """Return the end (3,) of a seen needle that is nearer to a driver at (3,): where extraction grasps."""
    return min((seen.tip, seen.swage), key=lambda end: float(np.linalg.norm(end - driver)))


def extract(bench: Bench) -> None:
    """Grasp the end nearer to the left driver, turn it out by 80 degrees, pull; up to five retries (d, e).

    Believes what it sees: an end that moved less than 2 cm means another try. Raises Failed (E) when the needle is
    still in the wound once the robot goes on or gives up, (T) when thread comes along in the jaws or about them.
    """
    wound = exit_(bench.suture)[None]
    for attempt in range(1 + RETRIES):
        bench.overhead()
        _stand_back(bench, attempt)
        before = bench.look_until("tissue", where=wound)
        if before is None and bench.policy.expects and attempt == 0:
            before = bench.expected
        if before is None:
            continue
        out, pinched = _attempt(bench, before)
        moved = _seems_out(bench, before, out)
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


def _stand_back(bench: Bench, attempt: int) -> None:
    """Take the left driver to where it does not hide the needle."""
    if not bench.policy.moves_both:
        bench.go("left", HOME["left"])
    elif attempt > 0:
        back = bench.tools["left"].copy()
        back[:3, 3] += BACK
        bench.go("left", back)


def _seems_out(bench: Bench, before: Seen, out: bool) -> bool:
    """Whether the robot takes the needle for extracted: the seen end moved by 2 cm; or, for a policy that checks, the
    needle is seen in the jaws and not where it was."""
    place = "elsewhere" if out else "tissue"
    if bench.policy.checks_place:
        jaws = bench.jaws("left")
        after = bench.look_until(place, LOOKS_AFTER, np.concatenate([jaws, exit_(bench.suture)[None]]))
        return after is None or (passes(after, jaws) and not passes(after, exit_(bench.suture)[None]))
    after = bench.look_until(place)
    driver = bench.tools["left"][:3, 3]
    return after is None or (
        float(np.linalg.norm(nearer_end(after, driver) - nearer_end(before, HOME["left"][:3, 3]))) >= MOVED
    )


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


def _attempt(bench: Bench, seen: Seen) -> tuple[bool, bool]:
    """Return whether the needle came out, and whether thread was caught with it."""
    world = bench.world
    if bench.policy.centres_jaws:
        path = primitives.approach(grasp_point(seen, INWARDS), GRASPING, APPROACH_OFFSET)
    else:
        path = primitives.approach(nearer_end(seen, bench.tools["left"][:3, 3]), GRASPING, EXTRACTION_ADVANCE)
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
    angle = left_to_turn(seen) if bench.policy.centres_jaws else EXTRACTION_TURN
    turn = primitives.rotating_out(bench.tools["left"], normal, centre, angle)
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
    _pull_to(bench, bench.policy.constants.linear_pull)
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


def _pull_to(bench: Bench, distance: float) -> None:
    """Pull the needle straight out to `distance` [m] from the exit, the thread following through the stitch."""
    if bench.hold is None:
        return
    hole = exit_(bench.suture)
    swage = point_at(bench.needle, np.pi)
    target = bench.tools["left"].copy()
    target[:3, 3] += hole + distance * OUTWARDS - swage
    anchor, bench.anchor = bench.anchor, None
    bench.go("left", target)
    bench.anchor = anchor


def cinch(bench: Bench) -> None:
    """Pull the thread through the stitch: to beta where the arm cinches, else as the linear pull left it (e).

    Raises Failed (T) where thread runs out or the needle is pulled out of the jaws, or the stitch stays loose.
    """
    world, policy, thread = bench.world, bench.policy, bench.thread
    distance = policy.constants.linear_pull
    noise = world.stitch_noise * bench.random.standard_normal()
    if policy.cinches:
        bench.overhead()
        distance = max(distance, cinch_length(bench.suture, policy.constants))
        if policy.keeps_books:
            distance = _booked(bench)
        distance = min(LONGEST_PULL, distance)
        _pull_to(bench, distance)
    force = world.hold * (bench.hold.quality if bench.hold else 0.0)
    drawn = pull_through(thread, bench.suture, distance, force, noise, world)
    bench.lay_thread()
    bench.yield_to(drawn)
    if policy.watches_slack:
        _pull_on(bench)
    bench.record("e: cinched" if policy.cinches else "e: pulled")
    if bench.hold is None:
        raise Failed("T", "taut thread pulled the needle out of the jaws")
    if thread.slack > world.loose:
        raise Failed("T", f"{thread.slack * 1000:.0f} mm of slack stay in the stitch")
    if bench.tangled("left"):
        raise Failed("T", "thread is wound about the left driver")


def _booked(bench: Bench) -> float:
    """Return how far [m] from the exit to pull, by the seen length of thread: all that the stitch leaves, and from the
    tail what the next throws will want, while few stitches hold it.

    The thread is seen with an error, once a stitch; what is left of the tail is reckoned from the first look.
    """
    suture, model = bench.suture, bench.eyes.model
    bench.seconds += model.seconds_an_estimate
    seen = bench.thread.working * (1.0 + model.thread_length_error * bench.random.standard_normal())
    left = seen - bench.thread.used_by(suture, 0.0)
    if suture == 0:
        pull = min(WANTED, left - TAIL_TO_LEAVE)
        bench.tail_reckoned = left - pull
        return pull
    wanted = WANTED + bench.thread.used_by(suture + 1, 0.0) * (suture == LAST_DRAWN) if suture <= LAST_DRAWN else 0.0
    spare = max(0.0, bench.tail_reckoned - TAIL_TO_LEAVE)
    drawn = min(spare, max(0.0, wanted - left))
    bench.tail_reckoned -= drawn
    return left + max(drawn, BOOK_MARGIN)


def _pull_on(bench: Bench) -> None:
    """Look at the stitch, and pull on by what is seen to be loose, until nothing is (our own)."""
    thread, model, world = bench.thread, bench.eyes.model, bench.world
    for _ in range(PULLS_ON):
        bench.seconds += model.seconds_an_estimate
        error = np.hypot(LOOSE_ERROR, model.thread_length_error * thread.slack) * bench.random.standard_normal()
        loose = thread.slack + error
        if loose < LOOSE_SEEN or bench.hold is None:
            return
        bench.overhead()
        away = bench.tools["left"].copy()
        away[:3, 3] += loose * OUTWARDS
        anchor, bench.anchor = bench.anchor, None
        bench.go("left", away)
        bench.anchor = anchor
        bench.yield_to(pull_on(thread, loose, world.hold * bench.hold.quality, world))
