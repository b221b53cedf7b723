"""Ways of the hand along with a door or a drawer, tried until one can be gone."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np
from scenewright.schemas.scene_parts import Joint
from scenewright.stages.kit.motion.arcs import Arc, JointedModel, along_arc
from scenewright.stages.kit.motion.arm_motion import ArmPlanner, Tally
from scenewright.stages.kit.motion.doors import ContactPoint
from scenewright.stages.kit.motion.segments import Manipulation

OVERSHOOT = 0.02
"""A front is pushed this much beyond shut [rad] or [m]; its limit stops it."""
PRESS = 0.006
"""The commanded finger tips are this far inside what is pushed, so that they stay in touch [m]."""


def pushes(
    body: str,
    joint: Joint,
    contacts: Iterable[ContactPoint],
    values: np.ndarray,
    turns: Sequence[np.ndarray],
    tip_overhang: float,
) -> Iterator[Arc]:
    """Yield the ways in which closed fingers push a part at its contacts through joint values (K,), the hand turned by
    each of the `turns` (K,) about the vertical [rad]. `tip_overhang` [m]: of the tips over the tool point."""
    for contact in contacts:
        for turn in turns:
            for roll in (0.0, np.pi / 2):
                yield Arc(body, joint, contact, values, turn, roll, tip_overhang - PRESS, 0.0, 0.0)


def first_along(
    model: JointedModel,
    arm: np.ndarray,
    arcs: Iterable[Arc],
    bases: Iterable[np.ndarray],
    planner: ArmPlanner,
    tally: Tally,
) -> Manipulation | None:
    """Return the motion along the first arc that can be gone from one of the bases (3,); None (tallied) without one."""
    motions = (along_arc(model, arm, arc, base, planner, tally) for arc in arcs for base in bases)
    return next((motion for motion in motions if motion is not None), None)
