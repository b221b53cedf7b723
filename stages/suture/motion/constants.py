"""The constants of the thesis's motions (Srinivas 2024, section 3.2), and those that it leaves open."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, radians

INSERTION_TURN = pi / 4
"""Turn about the circle's normal after the push from entry to exit [rad]."""
APPROACH_OFFSET = 0.010
"""A driver starts this far [m] horizontally from the point at which it grasps."""
EXTRACTION_ADVANCE = 0.015
"""Travel [m] towards that point before the jaws close at extraction; at handover it is the offset."""
EXTRACTION_TURN = radians(80.0)
"""Turn about the circle's normal by which the needle is drawn out [rad]."""
MOVED = 0.020
"""An end that moved less than this [m] was not extracted."""
RETRIES = 5
"""Most retries of an extraction and of a handover."""
HANDOVER_OFFSET = 0.005
"""Random horizontal offsets of handover retries stay below this [m]."""
NORMAL_SAMPLES = 10
"""Looks whose mean normal is the needle's."""
CORRECTION_TURN = pi / 2
"""Turn between the two looks of the pose correction [rad]."""
THROWS = 6
"""Sutures of a trial, after which it ends."""
INTERVENTIONS = 2
"""Interventions that a trial may need before it ends."""


@dataclass(frozen=True)
class OpenConstants:
    """What the thesis uses and does not state; values chosen on tuning seeds 0 to 29 (docs/STITCH.md)."""

    desired_length: float = 0.110
    """l_des of the cinch length beta = l_des - (i - 1) l_each [m]."""
    length_each: float = 0.020
    """l_each [m]: stitch width and spacing of the phantom."""
    linear_pull: float = 0.050
    """The linear motion [m] that ends an extraction."""
    unchanged_normal: float = radians(10.0)
    """A normal that turned less than this [rad] counts as unchanged in the handover test."""


def cinch_length(suture: int, constants: OpenConstants) -> float:
    """Return beta [m] of suture 0 to 5: l_des - (i - 1) l_each with i from 1; never less than nothing."""
    return max(0.0, constants.desired_length - suture * constants.length_each)
