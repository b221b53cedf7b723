"""Drive to where something can be reached."""

from __future__ import annotations

from scenewright.stages.kit.tasks.strips import Schema
from scenewright.stages.plan.action import PlanAction


class Drive(PlanAction):
    """The way between two manipulations; the refinement plans it with the manipulation that follows."""

    name = "drive"
    order = 10
    has_motion = False
    schemas = (
        Schema(
            "drive",
            (("?from", "thing"), ("?to", "thing")),
            (("near", "?from"), ("reachable", "?to")),
            (("near", "?to"),),
            (("near", "?from"),),
        ),
    )


ACTION = Drive()
