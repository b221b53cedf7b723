"""Needle insertion, executed (section 3.2)."""

from __future__ import annotations

import numpy as np
from scenewright.stages.kit.geometry.transforms import transform_from
from scenewright.stages.suture.motion import primitives
from scenewright.stages.suture.motion.needle import TIP, turned
from scenewright.stages.suture.trials.belief import Belief, as_planned
from scenewright.stages.suture.trials.bench import Bench, Failed, travel_time
from scenewright.stages.suture.trials.places import beside_wound
from scenewright.stages.suture.trials.policy import Coordination
from scenewright.stages.suture.trials.wound import entry, exit_, passage

STAND_OFF = np.array([-0.008, 0.0, 0.0])
"""Way from the place of insertion to where the push begins [m]; by eye."""


def insert(bench: Bench, belief: Belief, coordination: Coordination) -> None:
    """Push the tip along the vector from entry to exit, then turn 45 degrees about the believed normal (a, b).

    Open loop, as in the thesis. Raises Failed (I) where the needle's path is one of its insertion errors.
    """
    bench.overhead()
    if bench.hold is None:
        raise Failed("H", "no needle in the right driver")
    rotation = belief.rotation
    insert_position = entry(bench.suture) - rotation @ belief.tip
    coordination.wait_at(bench, "left", beside_wound(bench.suture))
    coordination.near_entry(bench, rotation, insert_position)
    bench.go("right", transform_from(rotation, insert_position + STAND_OFF))
    bench.go("right", transform_from(rotation, insert_position))
    centre = insert_position + rotation @ belief.centre
    tools = primitives.insertion(
        transform_from(rotation, insert_position),
        exit_(bench.suture) - entry(bench.suture),
        rotation @ belief.normal,
        centre,
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
    path = passage(tips, -needles[:, :3, 1], bench.suture)
    pushed = len(tools) // 2 - 1
    moment = started + travel_time(tools[: pushed + 1], bench.world.speed)
    bench.record_past("a: pushed in", moment, "right", tools[pushed], needles[pushed], lain)
    bench.record("b: inserted")
    if path.fault is not None:
        raise Failed("I", path.fault)
    bench.expected = as_planned(belief, tools[-1])
    bench.holes = tuple(hole for hole in (path.entered, path.left) if hole is not None)
    bench.hold = None
    away = bench.tools["right"].copy()
    away[:3, 3] += np.array([-0.02, 0.0, 0.03])
    coordination.withdraw(bench, "right", away)
