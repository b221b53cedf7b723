"""Needle pose correction and insertion, executed (sections 3.2: needle insertion, needle pose correction)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stages.kit.geometry.transforms import apply, inverse, transform_from
from stages.suture.motion import primitives
from stages.suture.motion.constants import CORRECTION_TURN, NORMAL_SAMPLES
from stages.suture.motion.needle import TIP, UP_THE_WOUND, about, point_at, turned, upright
from stages.suture.rig import NEEDLE_RADIUS
from stages.suture.trials.bench import CORNER, Bench, Failed
from stages.suture.trials.perception import Seen
from stages.suture.trials.wound import CHORD, HOLE_HEIGHT, SPANNED, entry, exit_, passage

START_ANGLE = SPANNED / 2
"""The tip lies this far past the needle's lowest point at the entry [rad], so that the arc spans entry and exit."""
NOMINAL = primitives.jaws(np.array([0.0, 0.0, -1.0]))
"""The right driver's orientation when a needle that it holds by the swage as planned is ready for insertion."""
STAND_OFF = np.array([-0.008, 0.0, 0.0])
HOVER = np.array([-0.015, 0.0, 0.02])
SERVO_TURNS, SERVO_LOOKS, SERVOED = 4, 5, np.radians(3.0)
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
    bench.go("right", CORNER)
    bench.record("i: to the corner")
    looks = samples(bench, NORMAL_SAMPLES)
    normal = mean_normal(looks)
    bench.go("right", primitives.normal_to_y(bench.tools["right"], normal))
    bench.record("j: normal along y")
    if bench.policy.servoes_ends:
        return servoed(bench)
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
    for _ in range(SERVO_TURNS):
        tool = bench.tools["right"]
        looks = samples(bench, SERVO_LOOKS)
        normal = mean_normal(looks)
        tip, swage = middle_ends(looks, tool[:3, 3])
        along = tip - swage
        angle = float(np.arctan2(np.cross(along, wanted) @ UP_THE_WOUND, along @ wanted))
        tilted = float(np.arccos(np.clip(normal @ UP_THE_WOUND, -1.0, 1.0)))
        if abs(angle) < SERVOED and tilted < SERVOED:
            break
        bench.move("right", primitives.final_turn(tool, angle))
        bench.go("right", primitives.normal_to_y(bench.tools["right"], about(UP_THE_WOUND, angle) @ normal))
    tool = bench.tools["right"]
    looks = samples(bench, SERVO_LOOKS)
    bench.record("k: turned by the seen ends")
    return believed(tool, tool[:3, :3], mean_normal(looks), middle_ends(looks, tool[:3, 3]))


def samples(bench: Bench, count: int) -> list[Seen]:
    """Return `count` estimates in the corner, looking on where some are abstained from; Failed (I) for too few."""
    found: list[Seen] = []
    for _ in range(TOO_MANY_LOOKS):
        seen = bench.look("corner_right")
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
    bench.move("right", tools)
    bench.needle = needles[-1]
    tips = needles[:, :3, :3] @ TIP + needles[:, :3, 3]
    found = passage(tips, -needles[:, :3, 1], bench.suture)
    bench.record("b: inserted")
    if found.fault is not None:
        raise Failed("I", found.fault)
    bench.holes = tuple(hole for hole in (found.entered, found.left) if hole is not None)
    bench.hold = None
    away = bench.tools["right"].copy()
    away[:3, 3] += np.array([-0.02, 0.0, 0.03])
    bench.withdraw("right", away)


def nominal_needle(suture: int) -> np.ndarray:
    """Return the pose (4, 4) of a needle that is ready for insertion as planned, its tip at the entry."""
    centre = (entry(suture) + exit_(suture)) / 2.0
    centre = np.array([centre[0] - CHORD, centre[1], HOLE_HEIGHT + NEEDLE_RADIUS * np.cos(START_ANGLE)])
    needle = upright(centre, START_ANGLE)
    assert np.allclose(point_at(needle, 0.0), entry(suture))
    return needle
