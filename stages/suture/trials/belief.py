"""What the robot believes of the needle that its right driver holds, and what looks at it amount to."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scenewright.stages.kit.geometry.transforms import apply, inverse
from scenewright.stages.suture.motion.needle import UP_THE_WOUND
from scenewright.stages.suture.trials.perception import Seen
from scenewright.stages.suture.trials.wound import SPANNED

START_ANGLE = SPANNED / 2
"""The tip lies this far past the needle's lowest point at the entry [rad], so that the arc spans entry and exit."""


@dataclass(frozen=True)
class Belief:
    """What the robot believes of the needle in the right driver: the driver's orientation (3, 3) for insertion, the
    needle's tip, normal and circle centre in the driver's frame (3,)."""

    rotation: np.ndarray
    tip: np.ndarray
    normal: np.ndarray
    centre: np.ndarray


def believed(tool: np.ndarray, rotation: np.ndarray, normal: np.ndarray, ends: tuple[np.ndarray, np.ndarray]) -> Belief:
    """Return beliefs from a unit normal (3,) and ends (3,) [m] seen at `tool` (4, 4).

    The end farther from the driver is the tip: the driver holds the needle by the swage.
    """
    tip, swage = sorted(ends, key=lambda end: -float(np.linalg.norm(end - tool[:3, 3])))
    inside = inverse(tool)
    return Belief(rotation, apply(inside, tip), inside[:3, :3] @ normal, apply(inside, (tip + swage) / 2.0))


def as_planned(belief: Belief, tool: np.ndarray) -> Seen:
    """Return where the believed needle lies once its driver is at `tool` (4, 4)."""
    tip, centre = apply(tool, belief.tip), apply(tool, belief.centre)
    return Seen(tool[:3, :3] @ belief.normal, tip, 2.0 * centre - tip, False)


def mean_normal(looks: list[Seen]) -> np.ndarray:
    """Return the mean of estimated normals (3,), each turned to the side of +y first."""
    total = np.sum([look.normal if look.normal @ UP_THE_WOUND > 0 else -look.normal for look in looks], axis=0)
    return total / np.linalg.norm(total)


def middle_ends(looks: list[Seen], driver: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the medians (3,) of the far and of the near end, seen from the driver at (3,) [m]."""
    far, near = [], []
    for look in looks:
        first, second = sorted((look.tip, look.swage), key=lambda end: -float(np.linalg.norm(end - driver)))
        far.append(first)
        near.append(second)
    return np.median(far, axis=0), np.median(near, axis=0)
