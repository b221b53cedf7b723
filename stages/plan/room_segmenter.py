"""The segmenter of a room in which a plan is executed: a simulated one that errs."""

from __future__ import annotations

import numpy as np
from scenewright.stages.kit.acting.errors import SegmenterErrors
from scenewright.stages.kit.acting.eyes.simulated import Shown, SimulatedSegmenter
from scenewright.stages.kit.simulation.world import PhysicsWorld
from scenewright.stages.plan.affordances import LAYOUT
from scenewright.stages.plan.eyes import Room

CELL = 0.05
"""A thing that was moved by more is seen anew [m]."""


def room_segmenter(room: Room, world: PhysicsWorld, errors: SegmenterErrors) -> SimulatedSegmenter:
    """Return the segmenter of pictures in which the bodies of a room are numbered from 1 on, in their order."""
    classes = {number: (name, record.class_name) for number, (name, record) in enumerate(room.records.items(), start=1)}
    bare = [0, *(number for number, (_, class_name) in classes.items() if class_name in LAYOUT)]

    def shown() -> dict[int, Shown]:
        return {
            number: Shown(name, class_name, tuple(np.rint(world.pose(name)[:2, 3] / CELL).astype(int).tolist()))
            for number, (name, class_name) in classes.items()
            if class_name not in LAYOUT
        }

    return SimulatedSegmenter(errors, shown, bare)
