"""Needle pose correction that goes by the seen ends."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scenewright.stages.kit.geometry.transforms import apply, inverse, transform_from
from scenewright.stages.suture.motion import primitives
from scenewright.stages.suture.motion.needle import UP_THE_WOUND, upright
from scenewright.stages.suture.trials.belief import START_ANGLE, Belief, believed, mean_normal, middle_ends
from scenewright.stages.suture.trials.bench import CORNER, Bench
from scenewright.stages.suture.trials.looking import corner_looks
from scenewright.stages.suture.trials.perception import Seen
from scenewright.stages.suture.trials.places import NOMINAL
from scenewright.stages.suture.trials.policy import Trust

SERVO_TURNS, SERVO_LOOKS, FEWEST_POSES, SERVOED = 4, 5, 2, np.radians(3.0)
"""Most turns of the correction, looks of each, poses that are needed, and the error at which it ends [rad]; by eye."""


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


def latest(kept: list[Held], tool: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return normal, far and near end (3,) in the world of a needle as it was seen at the last pose of the driver."""
    return fused(kept[-1:], tool)


@dataclass(frozen=True)
class BySeenEnds:
    """Pose correction: turned on the way to the corner as a needle taken as planned needs it, then about y until the
    seen ends lie as insertion wants them, looking again after each turn."""

    combined: Callable[[list[Held], np.ndarray], tuple[np.ndarray, np.ndarray, np.ndarray]] = fused
    """What looks from several poses of the driver come to."""

    def believed(self, bench: Bench, trust: Trust) -> Belief:
        """Return what is believed after the last turn. Raises Failed (I) where the needle can't be known."""
        bench.overhead()
        bench.go("right", transform_from(NOMINAL, CORNER[:3, 3]))
        bench.record("i: to the corner")
        wanted_direction = upright(np.zeros(3), START_ANGLE)[:3, 0]
        poses_in_driver: list[Held] = []
        for turn in range(SERVO_TURNS + 1):
            tool = bench.tools["right"]
            poses_in_driver.append(in_driver(corner_looks(bench, trust, SERVO_LOOKS), tool))
            normal, tip, swage = self.combined(poses_in_driver, tool)
            along = tip - swage
            angle = float(np.arctan2(np.cross(along, wanted_direction) @ UP_THE_WOUND, along @ wanted_direction))
            tilted = float(np.arccos(np.clip(normal @ UP_THE_WOUND, -1.0, 1.0)))
            if turn == SERVO_TURNS or (
                abs(angle) < SERVOED and tilted < SERVOED and len(poses_in_driver) >= FEWEST_POSES
            ):
                break
            bench.go("right", primitives.normal_to_y(bench.tools["right"], normal))
            if turn == 0:
                bench.record("j: normal along y")
            bench.move("right", primitives.final_turn(bench.tools["right"], angle))
        tool = bench.tools["right"]
        bench.record("k: turned by the seen ends")
        return believed(tool, tool[:3, :3], normal, (tip, swage))
