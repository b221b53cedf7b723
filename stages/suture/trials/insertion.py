"""Needle pose correction and insertion, executed (sections 3.2: needle insertion, needle pose correction)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stages.kit.geometry.transforms import apply, inverse, transform_from
from stages.suture.motion import primitives
from stages.suture.motion.constants import CORRECTION_TURN, NORMAL_SAMPLES
from stages.suture.motion.needle import TIP, UP_THE_WOUND, point_at, turned, upright
from stages.suture.rig import NEEDLE_RADIUS
from stages.suture.trials.bench import CORNER, Bench, Failed, travel_time
from stages.suture.trials.perception import Seen
from stages.suture.trials.wound import CHORD, HOLE_HEIGHT, SPANNED, entry, exit_, passage

START_ANGLE = SPANNED / 2
"""The tip lies this far past the needle's lowest point at the entry [rad], so that the arc spans entry and exit."""
NOMINAL = primitives.jaws(np.array([0.0, 0.0, -1.0]))
"""The right driver's orientation when a needle that it holds by the swage as planned is ready for insertion."""
STAND_OFF = np.array([-0.008, 0.0, 0.0])
BESIDE = np.array([0.030, 0.004, 0.020])
HOVER = np.array([-0.015, 0.0, 0.02])
SERVO_TURNS, SERVO_LOOKS, FEWEST_POSES, SERVOED = 4, 5, 2, np.radians(3.0)
TOO_MANY_LOOKS = 60


@dataclass(frozen=True)
class Believed:
    """What the robot believes of the needle in the right driver: the driver's orientation (3, 3) for insertion, the
    needle's tip, normal and circle centre in the driver's frame (3,)."""

    rotation: np.ndarray
    tip: np.ndarray
    normal: np.ndarray
    centre: np.ndarray


def believed(
    tool: np.ndarray, rotation: np.ndarray, normal: np.ndarray, ends: tuple[np.ndarray, np.ndarray]
) -> Believed:
    """Return beliefs from a unit normal (3,) and ends (3,) [m] seen at `tool` (4, 4).

    The end farther from the driver is the tip: the driver holds the needle by the swage.
    """
    tip, swage = sorted(ends, key=lambda end: -float(np.linalg.norm(end - tool[:3, 3])))
    inside = inverse(tool)
    return Believed(rotation, apply(inside, tip), inside[:3, :3] @ normal, apply(inside, (tip + swage) / 2.0))


def uncorrected(bench: Bench) -> Believed:
    """Return what is believed without pose correction: one look where the needle was handed over, nominal turns."""
    bench.overhead()
    seen = bench.look_until("elsewhere")
    if seen is None:
        raise Failed("I", "the needle could not be known before insertion")
    normal = seen.normal if seen.normal @ UP_THE_WOUND > 0 else -seen.normal
    return believed(bench.tools["right"], NOMINAL, normal, (seen.tip, seen.swage))


def corrected(bench: Bench) -> Believed:
    """Take the needle to the corner, align its normal with +y by ten looks, turn by 90 degrees about y (i, j, k)."""
    bench.overhead()
    if bench.policy.servoes_ends:
        # Turned on the way as a needle taken as planned needs it; what is amiss is seen there.
        bench.go("right", transform_from(NOMINAL, CORNER[:3, 3]))
        bench.record("i: to the corner")
        return servoed(bench)
    bench.go("right", CORNER)
    bench.record("i: to the corner")
    looks = samples(bench, NORMAL_SAMPLES)
    normal = mean_normal(looks)
    bench.go("right", primitives.normal_to_y(bench.tools["right"], normal))
    bench.record("j: normal along y")
    # The needle has moved since the normals were seen, so its ends are looked at anew, as often.
    looks = samples(bench, NORMAL_SAMPLES)
    tool = bench.tools["right"]
    rotation = primitives.final_turn(tool, CORRECTION_TURN)[-1][:3, :3]
    bench.move("right", primitives.final_turn(tool, CORRECTION_TURN))
    bench.record("k: 90 degrees about y")
    return believed(tool, rotation, UP_THE_WOUND, middle_ends(looks, tool[:3, 3]))


def servoed(bench: Bench) -> Believed:
    """Turn about y until the seen ends lie as insertion wants them, looking again after each turn (our own)."""
    wanted = upright(np.zeros(3), START_ANGLE)[:3, 0]
    kept: list[Held] = []
    for turn in range(SERVO_TURNS + 1):
        tool = bench.tools["right"]
        kept.append(in_driver(samples(bench, SERVO_LOOKS), tool))
        normal, tip, swage = fused(kept if bench.policy.fuses_looks else kept[-1:], tool)
        along = tip - swage
        angle = float(np.arctan2(np.cross(along, wanted) @ UP_THE_WOUND, along @ wanted))
        tilted = float(np.arccos(np.clip(normal @ UP_THE_WOUND, -1.0, 1.0)))
        if turn == SERVO_TURNS or (abs(angle) < SERVOED and tilted < SERVOED and len(kept) >= FEWEST_POSES):
            break
        bench.go("right", primitives.normal_to_y(bench.tools["right"], normal))
        if turn == 0:
            bench.record("j: normal along y")
        bench.move("right", primitives.final_turn(bench.tools["right"], angle))
    tool = bench.tools["right"]
    bench.record("k: turned by the seen ends")
    return believed(tool, tool[:3, :3], normal, (tip, swage))


@dataclass(frozen=True)
class Held:
    """A needle in a driver's frame: unit normal, far and near end (3,) [m]."""

    normal: np.ndarray
    far: np.ndarray
    near: np.ndarray


def in_driver(looks: list[Seen], tool: np.ndarray) -> Held:
    """Return the middle of looks at a needle that a driver at `tool` (4, 4) holds, in its frame."""
    inside = inverse(tool)
    far, near = middle_ends(looks, tool[:3, 3])
    return Held(inside[:3, :3] @ mean_normal(looks), apply(inside, far), apply(inside, near))


def fused(kept: list[Held], tool: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return normal, far and near end (3,) in the world of a needle seen at several poses of the driver."""
    normal = np.mean([held.normal for held in kept], axis=0)
    far, near = (np.mean([getattr(held, name) for held in kept], axis=0) for name in ("far", "near"))
    return tool[:3, :3] @ normal / np.linalg.norm(normal), apply(tool, far), apply(tool, near)


def samples(bench: Bench, count: int) -> list[Seen]:
    """Return `count` estimates in the corner, looking on where some are abstained from; Failed (I) for too few."""
    found: list[Seen] = []
    for _ in range(TOO_MANY_LOOKS):
        seen = bench.look("corner_right", bench.jaws("right"))
        if seen is not None:
            found.append(seen)
        if len(found) == count:
            return found
    raise Failed("I", "the needle could not be known in the corner")


def mean_normal(looks: list[Seen]) -> np.ndarray:
    """Return the mean of estimated normals (3,), each turned to the side of +y first."""
    total = np.sum([seen.normal if seen.normal @ UP_THE_WOUND > 0 else -seen.normal for seen in looks], axis=0)
    return total / np.linalg.norm(total)


def middle_ends(looks: list[Seen], driver: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the medians (3,) of the far and of the near end, seen from the driver at (3,) [m]."""
    far, near = [], []
    for seen in looks:
        first, second = sorted((seen.tip, seen.swage), key=lambda end: -float(np.linalg.norm(end - driver)))
        far.append(first)
        near.append(second)
    return np.median(far, axis=0), np.median(near, axis=0)


def insert(bench: Bench, belief: Believed) -> None:
    """Push the tip along the vector from entry to exit, then turn 45 degrees about the believed normal (a, b).

    Open loop, as in the thesis. Raises Failed (I) where the needle's path is one of its insertion errors.
    """
    bench.overhead()
    if bench.hold is None:
        raise Failed("H", "no needle in the right driver")
    rotation = belief.rotation
    place = entry(bench.suture) - rotation @ belief.tip
    bench.wait_at("left", beside_wound(bench.suture))
    if not bench.policy.moves_both:
        bench.go("right", transform_from(rotation, place + HOVER))
    bench.go("right", transform_from(rotation, place + STAND_OFF))
    bench.go("right", transform_from(rotation, place))
    centre = place + rotation @ belief.centre
    tools = primitives.insertion(
        transform_from(rotation, place), exit_(bench.suture) - entry(bench.suture), rotation @ belief.normal, centre
    )
    slip = np.radians(bench.world.insertion_slip) * bench.random.standard_normal()
    shares = np.concatenate([np.zeros(len(tools) // 2), np.linspace(0.0, 1.0, len(tools) - len(tools) // 2)])
    needles = np.array(
        [
            turned(tool @ bench.hold.grip, (tool @ bench.hold.grip)[:3, 2], share * slip, tool[:3, 3])
            for tool, share in zip(tools, shares, strict=True)
        ]
    )
    started, lain = bench.seconds, bench.rope.copy()
    bench.move("right", tools)
    bench.needle = needles[-1]
    tips = needles[:, :3, :3] @ TIP + needles[:, :3, 3]
    found = passage(tips, -needles[:, :3, 1], bench.suture)
    pushed = len(tools) // 2 - 1
    bench.record_past("a: pushed in", started + travel_time(tools[: pushed + 1], bench.world.speed), "right",
                      tools[pushed], needles[pushed], lain)  # fmt: skip
    bench.record("b: inserted")
    if found.fault is not None:
        raise Failed("I", found.fault)
    bench.expected = as_planned(belief, tools[-1])
    bench.holes = tuple(hole for hole in (found.entered, found.left) if hole is not None)
    bench.hold = None
    away = bench.tools["right"].copy()
    away[:3, 3] += np.array([-0.02, 0.0, 0.03])
    bench.withdraw("right", away)


def as_planned(belief: Believed, tool: np.ndarray) -> Seen:
    """Return where the believed needle lies once its driver is at `tool` (4, 4)."""
    tip, centre = apply(tool, belief.tip), apply(tool, belief.centre)
    return Seen(tool[:3, :3] @ belief.normal, tip, 2.0 * centre - tip, False)


def beside_wound(suture: int) -> np.ndarray:
    """Return where the left driver (4, 4) waits for its turn, clear of the needle that comes out."""
    return transform_from(primitives.sweep(exit_(suture), 0.0)[0, :3, :3], exit_(suture) + BESIDE)


def nominal_needle(suture: int) -> np.ndarray:
    """Return the pose (4, 4) of a needle that is ready for insertion as planned, its tip at the entry."""
    centre = (entry(suture) + exit_(suture)) / 2.0
    centre = np.array([centre[0] - CHORD, centre[1], HOLE_HEIGHT + NEEDLE_RADIUS * np.cos(START_ANGLE)])
    needle = upright(centre, START_ANGLE)
    assert np.allclose(point_at(needle, 0.0), entry(suture))
    return needle
